// Measures the rate of matching: verified pairs per second for images of 4 000 and 8 000 features.
//
// Sample runs:
//   bench_matching            both sizes, all cores
//   bench_matching 8000 40    8 000 features, 40 pairs
//
// The images of a pair have a third of their features in common (noisy copies), as seen over relief from two places.
// The other features are unrelated.
#include <omp.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <vector>

#include "geometry/transform/rotation.h"
#include "io/block/tracks.h"
#include "match/nearest/nearest.h"
#include "match/pairs/pair_matching.h"

namespace {

using namespace megablock;

Camera make_camera() {
  Camera camera;
  camera.width = 4000;
  camera.height = 3000;
  camera.intrinsics = {2800, 2000, 1500, -0.02, 0.01, 0, 0.0005, 0};
  return camera;
}

using Components = std::array<double, 128>;

// To the norm the features stage gives its descriptors.
SiftDescriptor quantise(const Components& components) {
  double square = 0;
  for (const double c : components) square += c * c;
  SiftDescriptor d;
  for (std::size_t i = 0; i < d.size(); ++i) {
    d[i] = static_cast<std::uint8_t>(std::clamp(176 * components[i] / std::sqrt(square), 0.0, 127.0));
  }
  return d;
}

// Squared normals: sparse and skewed as SIFT's components are.
Components random_components(std::mt19937_64& generator) {
  std::normal_distribution<double> normal(0, 1);
  Components components;
  for (auto& c : components) {
    c = normal(generator);
    c *= c;
  }
  return components;
}

void add(ImageFeatures& features, const Eigen::Vector2d& pixel, const SiftDescriptor& descriptor) {
  features.keypoints.push_back({to_fixed_pixel(pixel.x()), to_fixed_pixel(pixel.y()), 4, 0});
  features.descriptors.push_back(descriptor);
}

std::pair<ImageFeatures, ImageFeatures> make_images(int count, const Camera& camera) {
  std::mt19937_64 generator(1);
  std::uniform_real_distribution<double> unit(0, 1);
  std::normal_distribution<double> noise(0, 0.5), change(0, 0.4);
  std::pair<ImageFeatures, ImageFeatures> images;
  images.first.image = ImageIndex(0);
  images.second.image = ImageIndex(1);
  const Eigen::Quaterniond rotation = rotation_exp<double>(Eigen::Vector3d(0.02, -0.03, 0.1));
  const Eigen::Vector3d centre(0.2, 0.02, 0);
  const auto jitter = [&] { return Eigen::Vector2d(noise(generator), noise(generator)); };
  for (int i = 0; i < count; ++i) {
    Components components = random_components(generator);
    const Eigen::Vector3d point =
        (0.9 + 0.2 * unit(generator)) * Eigen::Vector3d(1.4 * unit(generator) - 0.7, unit(generator) - 0.5, 1);
    add(images.first, project(camera.intrinsics, point) + jitter(), quantise(components));
    if (i % 3 == 0) {
      for (auto& c : components) c = std::max(0.0, c + change(generator));
      add(images.second, project(camera.intrinsics, Eigen::Vector3d(rotation * (point - centre))) + jitter(),
          quantise(components));
    } else {
      add(images.second, {4000 * unit(generator), 3000 * unit(generator)}, quantise(random_components(generator)));
    }
  }
  return images;
}

template <typename Work>
double seconds(int pairs, Work work) {
  const auto start = std::chrono::steady_clock::now();
#pragma omp parallel for schedule(dynamic)
  for (int i = 0; i < pairs; ++i) work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void run(int features, int pairs) {
  const Camera camera = make_camera();
  const auto [a, b] = make_images(features, camera);
  const MatchOptions options;
  const double nearest = seconds(pairs, [&] { nearest_neighbours(a.descriptors, b.descriptors, 2); });
  const double all = seconds(pairs, [&] { match_pair(a, b, camera, camera, options); });
  const VerifiedPair pair = match_pair(a, b, camera, camera, options);
  const double products = 128e-9 * features * features * pairs;
  std::printf(
      "%5d features: nearest neighbours %6.1f pairs/s (%.0f G products/s), verified %6.1f pairs/s; %d matches, %zu "
      "inliers\n",
      features, pairs / nearest, products / nearest, pairs / all, pair.putative, pair.feature_a.size());
}

}  // namespace

int main(int argc, char** argv) {
  std::printf("%d threads\n", omp_get_max_threads());
  const int pairs = argc > 2 ? std::atoi(argv[2]) : 40;
  if (argc > 1) {
    run(std::atoi(argv[1]), pairs);
  } else {
    for (const int features : {4000, 8000}) run(features, pairs);
  }
}
