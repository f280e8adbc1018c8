// Compares matching along trusted epipolar lines (match/pairs/guided_matching.h) with matching of whole images, on
// rendered images of the Stereopolis vehicle between houses with repeated facades: number of matches, right ones, time.
//
//   compare_guidance [frames = 8] [share of repeated facades = 0.7] [seed = 1]
//
// A match is right when the surface that the first image shows at its keypoint appears within 3 px of the other one.
#include <omp.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>

#include "io/block/tracks.h"
#include "io/images/image_codec.h"
#include "io/simulate/blocks/simulate.h"
#include "io/simulate/images/render.h"
#include "match/features/features.h"
#include "match/filter/match_filter.h"
#include "match/pairs/pair_matching.h"
#include "partition/candidates/candidates.h"
#include "tests/support/io/scratch_directory.h"

namespace {

using namespace megablock;

struct Town {
  SimulationOptions options;
  Layout layout;
  Block block;  // with the trajectory
  std::vector<ImageFeatures> features;
};

Pose true_pose(const Town& town, ImageIndex image) {
  const Image& entry = town.block.images[image];
  return camera_pose(town.layout.truth.frames[entry.frame],
                     town.layout.truth.mounts.front()[static_cast<std::size_t>(entry.mount)]);
}

Town make_town(std::int64_t frames, double repeated, std::uint64_t seed) {
  Town town;
  town.options = SimulationOptions::of(SimulationOptions::Scene::kStereopolis);
  SimulationOptions& o = town.options;
  o.frames = frames;
  o.seed = seed;
  o.bridge = false;
  o.repeated_facades = repeated;
  o.street_spacing_m = 60;
  o.drives = 1;
  o.days = 1;
  o.image_width = 640;
  o.image_height = 360;
  o.focal_px = 467;
  o.mount_rotation_error_deg = 0.05;  // a calibrated rig
  o.mount_position_error_m = 0.002;
  o.drift_m = 0.05;
  town.layout = make_layout(o);
  town.layout.scene = std::make_unique<City>(o, town.layout);
  SimulatedBlock simulated;
  simulated.block = town.layout.block;
  simulated.truth = town.layout.truth;
  simulate_given(o, simulated);
  town.block = simulated.block;
  town.block.relative_poses.clear();  // a rendered block has poses only
  const auto& city = dynamic_cast<const City&>(*town.layout.scene);
  const ScratchDirectory scratch;
  const std::string file = scratch.path("image.jpg");
  town.features.resize(town.block.images.size());
  for (CameraIndex camera(0); town.block.cameras.contains(camera); ++camera.value) {
    const RayTable rays(town.block.cameras[camera], town.layout.truth.cameras[camera]);
    for (ImageIndex i(0); town.block.images.contains(i); ++i.value) {
      if (town.block.camera_of(i) != camera) continue;
      write_image_file(file,
                       render_image(city, rays, true_pose(town, i), o.focal_px, static_cast<std::uint64_t>(i.value)));
      town.features[static_cast<std::size_t>(i.value)] = detect_features(file, "", i, {});
    }
  }
  return town;
}

Eigen::Vector2d pixel(const ImageFeatures& f, std::int32_t row) {
  const Keypoint& k = f.keypoints[static_cast<std::size_t>(row)];
  return {from_fixed_pixel(k.x), from_fixed_pixel(k.y)};
}

std::size_t count_right(const Town& town, const VerifiedPair& pair) {
  const auto& city = dynamic_cast<const City&>(*town.layout.scene);
  const Pose a = true_pose(town, pair.a), b = true_pose(town, pair.b);
  const Intrinsics &ka = town.layout.truth.cameras[town.block.camera_of(pair.a)],
                   &kb = town.layout.truth.cameras[town.block.camera_of(pair.b)];
  std::size_t right = 0;
  for (std::size_t m = 0; m < pair.feature_a.size(); ++m) {
    const auto ray = viewing_ray(ka, pixel(town.features[static_cast<std::size_t>(pair.a.value)], pair.feature_a[m]));
    if (!ray) continue;
    const City::Hit hit = city.cast(a.centre, a.rotation.conjugate() * *ray);
    if (hit.object == City::kSky) continue;
    const Eigen::Vector2d seen = project(kb, to_inside(b, hit.point));
    const Eigen::Vector2d found = pixel(town.features[static_cast<std::size_t>(pair.b.value)], pair.feature_b[m]);
    right += (seen - found).norm() < 3;
  }
  return right;
}

void compare(const Town& town, const char* name, const MatchOptions& options) {
  const CandidateGraph graph = candidate_pairs(town.block, {}, {});
  const TrustedPairs trajectory(town.block, options.trust);
  const MatchFilter filter = MatchFilter::shipped();
  std::size_t verified = 0, matches = 0, right = 0;
  double seconds = 0;
  for (const ImagePair& p : graph.pairs) {
    const ImageFeatures &a = town.features[static_cast<std::size_t>(p.a.value)],
                        &b = town.features[static_cast<std::size_t>(p.b.value)];
    const auto start = std::chrono::steady_clock::now();
    const VerifiedPair pair =
        match_pair(a, b, town.block.cameras[town.block.camera_of(p.a)], town.block.cameras[town.block.camera_of(p.b)],
                   options, {trajectory.relate(p.a, p.b), options.filter ? &filter : nullptr});
    seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    verified += pair.model != PairModel::kNone;
    matches += pair.feature_a.size();
    right += count_right(town, pair);
  }
  std::printf("%-30s %5zu of %5zu pairs, %7zu matches, %7zu right (%.1f %%), %.1f s\n", name, verified,
              graph.pairs.size(), matches, right, 100.0 * static_cast<double>(right) / static_cast<double>(matches),
              seconds);
}

}  // namespace

int main(int argc, char** argv) {
  const std::int64_t frames = argc > 1 ? std::atoll(argv[1]) : 8;
  const double repeated = argc > 2 ? std::atof(argv[2]) : 0.7;
  const std::uint64_t seed = argc > 3 ? static_cast<std::uint64_t>(std::atoll(argv[3])) : 1;
  const Town town = make_town(frames, repeated, seed);
  for (const int k : {1, 3}) {
    MatchOptions options;
    options.k_best = k;
    std::printf("k = %d\n", k);
    options.guided = options.filter = false;
    compare(town, "whole images", options);
    options.filter = true;
    compare(town, "whole images, filter", options);
    options.guided = true;
    options.filter = false;
    compare(town, "epipolar lines", options);
    options.filter = true;
    compare(town, "epipolar lines, filter", options);
  }
}
