// Compares the verification of pairs (match/verification/two_view.h) with OpenCV's robust estimators
// (opencv_two_view.h): processor time, right models, and errors of rotation and base (medians, root mean squares, and
// number of pairs for which ours is nearer to the truth).
//
//   compare_two_view [PAIRS = 40 [SCENE]]    simulated: general, plane, rotation (all); 10 to 70 % wrong matches
//   compare_two_view selection [PAIRS]       the same, verification alone: wrong matches that are accepted, right ones
//                                            that are lost; limit of 3 px, and the last selection by sigma
//   compare_two_view spacing [PAIRS]         the same with points of a sample at any distance, 50, 100, 200 px apart
//   compare_two_view FOLDER FOCAL_PX [STEP]  photographs: each with its next STEP (4) by name; matches, inliers
//
// Simulated: 2000 x 1500 px, focal length 1400 px, 800 matches with 0.5 px of noise, base 0.15 (plane: 0.3) of the
// depth; "3 pt": with verticals good to 0.1 degrees.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <limits>
#include <string>

#include "geometry/camera/camera.h"
#include "geometry/numbers/angles.h"
#include "geometry/numbers/median.h"
#include "io/block/tracks.h"
#include "match/features/features.h"
#include "match/pairs/pair_matching.h"
#include "opencv_two_view.h"

namespace {

using namespace megablock;

constexpr double kFocal = 1400;

double processor_seconds() {
  timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

double root_mean_square(const std::vector<double>& values) {
  double squares = 0;
  for (const double v : values) squares += v * v;
  return std::sqrt(squares / static_cast<double>(values.size()));
}

enum class Scene { kGeneral, kPlane, kRotation };

struct Pair {
  PointPairs points;
  RelativeOrientation truth;
  AxisDirection vertical_a, vertical_b;
  std::vector<std::uint8_t> right;
};

Pair simulated(Scene scene, double wrong, std::uint64_t seed, double noise_px = 0.5) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::normal_distribution<double> normal(0, 1);
  const auto anywhere = [&] {
    const double x = uniform(random), y = uniform(random);
    return Eigen::Vector2d(1000 / kFocal * x, 750 / kFocal * y);
  };
  const auto small = [&](double size) {
    const double x = normal(random), y = normal(random), z = normal(random);
    return Eigen::Vector3d(size * x, size * y, size * z);
  };
  Pair pair;
  pair.truth.rotation = rotation_exp<double>({0.05 * uniform(random), 0.08 * uniform(random), 0.5 * uniform(random)});
  const double base = scene == Scene::kRotation ? 0 : scene == Scene::kPlane ? 0.3 : 0.15;
  const Eigen::Vector3d t =
      -(pair.truth.rotation * (base * Eigen::Vector3d(1, 0.5 * uniform(random), 0.1 * uniform(random))));
  if (base > 0) pair.truth.base = t.normalized();
  const Eigen::Vector3d down = (Eigen::Vector3d::UnitZ() + small(0.1)).normalized();
  const auto seen = [&](const Eigen::Vector3d& v) {
    const double sigma = 0.1 * kDegree;
    return AxisDirection{(v + small(sigma)).normalized(),
                         sigma * sigma * (Eigen::Matrix3d::Identity() - v * v.transpose())};
  };
  pair.vertical_a = seen(down);
  pair.vertical_b = seen(pair.truth.rotation * down);
  while (pair.points.size() < 800) {
    const Eigen::Vector2d a = anywhere();
    const double depth = scene == Scene::kPlane ? 1 : 1 + 0.3 * uniform(random);
    Eigen::Vector2d b = (pair.truth.rotation * (depth * a.homogeneous()) + t).hnormalized();
    if (std::abs(b.x()) > 1000 / kFocal || std::abs(b.y()) > 750 / kFocal) continue;
    pair.right.push_back(!(0.5 * (uniform(random) + 1) < wrong));
    if (!pair.right.back()) b = anywhere();
    pair.points.a.push_back(a + small(noise_px / kFocal).head<2>());
    pair.points.b.push_back(b + small(noise_px / kFocal).head<2>());
  }
  return pair;
}

struct Measured {
  double seconds = 0;
  int right_models = 0, pairs = 0;
  std::vector<double> rotation_deg, base_deg;

  template <typename Estimate>
  void run(const Pair& pair, PairModel right, const Estimate& estimate) {
    const double start = processor_seconds();
    const TwoView found = estimate();
    seconds += processor_seconds() - start;
    ++pairs;
    right_models += found.model == right;
    rotation_deg.push_back(rotation_angle(found.rotation, pair.truth.rotation) / kDegree);
    const double cosine = std::clamp(found.translation.dot(pair.truth.base), -1.0, 1.0);
    base_deg.push_back(std::acos(cosine) / kDegree);
  }
  void print(const char* name, bool with_base) const {
    const auto off = std::count_if(rotation_deg.begin(), rotation_deg.end(), [](double e) { return e > 1; });
    std::printf("  %-7s %7.2f ms  models %3d/%d  rotation %.4f (%.4f)", name, 1e3 * seconds / pairs, right_models,
                pairs, median(rotation_deg), root_mean_square(rotation_deg));
    if (with_base) std::printf("  base %.3f (%.3f) deg", median(base_deg), root_mean_square(base_deg));
    std::printf("  off by > 1 deg: %td\n", off);
  }
};

void print_nearer(const char* what, const std::vector<double>& cv, const std::vector<double>& ours) {
  constexpr double kSame = 1e-6;  // degrees
  int nearer = 0, further = 0;
  for (std::size_t i = 0; i < cv.size(); ++i) {
    nearer += ours[i] < cv[i] - kSame;
    further += ours[i] > cv[i] + kSame;
  }
  std::printf("  %s: ours nearer in %d of %zu, further in %d\n", what, nearer, cv.size(), further);
}

void compare_simulated(int pairs, const std::string& only) {
  for (const auto& [name, scene, right] : {std::tuple{"general", Scene::kGeneral, PairModel::kEssential},
                                           std::tuple{"plane", Scene::kPlane, PairModel::kHomography},
                                           std::tuple{"rotation", Scene::kRotation, PairModel::kRotationOnly}}) {
    if (!only.empty() && only != name) continue;
    for (const double wrong : {0.1, 0.3, 0.5, 0.6, 0.7}) {
      Measured cv, ours, verticals;
      for (int i = 0; i < pairs; ++i) {
        const auto seed = static_cast<std::uint64_t>(i);
        const Pair pair = simulated(scene, wrong, seed);
        TwoViewOptions options;
        options.max_residual = 3 / kFocal;
        options.seed = seed;
        cv.run(pair, right, [&] { return OpencvTwoView(pair.points, options).estimate(); });
        ours.run(pair, right, [&] { return estimate_two_view(pair.points, options); });
        options.vertical_a = pair.vertical_a;
        options.vertical_b = pair.vertical_b;
        verticals.run(pair, right, [&] { return estimate_two_view(pair.points, options); });
      }
      std::printf("%s, %.0f %% wrong\n", name, 100 * wrong);
      cv.print("OpenCV", scene != Scene::kRotation);
      ours.print("ours", scene != Scene::kRotation);
      verticals.print("3 pt", scene != Scene::kRotation);
      print_nearer("rotation", cv.rotation_deg, ours.rotation_deg);
      if (scene != Scene::kRotation) print_nearer("base", cv.base_deg, ours.base_deg);
    }
  }
}

// What the last selection does to a pair.
struct Selected {
  int models = 0;
  double seconds = 0, wrong = 0, right = 0, accepted = 0, lost = 0;
  std::vector<double> rotation_deg, base_deg;

  void run(const Pair& pair, PairModel model, const TwoViewOptions& options) {
    const double start = processor_seconds();
    const TwoView found = estimate_two_view(pair.points, options);
    seconds += processor_seconds() - start;
    models += found.model == model;
    for (std::size_t i = 0; i < pair.right.size(); ++i) {
      (pair.right[i] ? right : wrong) += 1;
      if (pair.right[i] != found.inlier[i]) (pair.right[i] ? lost : accepted) += 1;
    }
    rotation_deg.push_back(rotation_angle(found.rotation, pair.truth.rotation) / kDegree);
    base_deg.push_back(std::acos(std::clamp(found.translation.dot(pair.truth.base), -1.0, 1.0)) / kDegree);
  }
  void print() const {
    std::printf(" | %d, %.2f %%, %.2f %%, %.4f, %.3f (%.3f)", models, 100 * accepted / wrong, 100 * lost / right,
                median(rotation_deg), median(base_deg), root_mean_square(base_deg));
  }
};

void compare_selection(int pairs) {
  std::printf(
      "models right, wrong matches accepted, right ones lost, rotation, base (rms), degrees\n"
      "| scene | noise | wrong | 3 px | by sigma |\n");
  for (const auto& [name, scene, model] : {std::tuple{"general", Scene::kGeneral, PairModel::kEssential},
                                           std::tuple{"plane", Scene::kPlane, PairModel::kHomography},
                                           std::tuple{"rotation", Scene::kRotation, PairModel::kRotationOnly}})
    for (const double noise_px : {0.2, 0.3, 0.5, 1.0, 2.0})
      for (const double wrong : {0.1, 0.3, 0.5}) {
        Selected constant, by_sigma;
        for (int i = 0; i < pairs; ++i) {
          const Pair pair = simulated(scene, wrong, static_cast<std::uint64_t>(i), noise_px);
          TwoViewOptions options;
          options.max_residual = 3 / kFocal;
          options.seed = static_cast<std::uint64_t>(i);
          by_sigma.run(pair, model, options);
          options.max_sigmas = std::numeric_limits<double>::infinity();
          constant.run(pair, model, options);
        }
        std::printf("| %s | %.1f px | %.0f %%", name, noise_px, 100 * wrong);
        constant.print();
        by_sigma.print();
        std::printf(" |\n");
        std::fflush(stdout);
      }
}

void compare_spacing(int pairs) {
  for (const auto& [name, scene, model] : {std::tuple{"general", Scene::kGeneral, PairModel::kEssential},
                                           std::tuple{"plane", Scene::kPlane, PairModel::kHomography}})
    for (const double wrong : {0.1, 0.3, 0.5, 0.7})
      for (const bool verticals : {false, true}) {
        std::printf("%s, %.0f %% wrong%s\n", name, 100 * wrong, verticals ? ", verticals" : "");
        for (const double spacing_px : {0, 50, 100, 200}) {
          Measured measured;
          for (int i = 0; i < pairs; ++i) {
            const Pair pair = simulated(scene, wrong, static_cast<std::uint64_t>(i));
            TwoViewOptions options;
            options.max_residual = 3 / kFocal;
            options.seed = static_cast<std::uint64_t>(i);
            options.sample_spacing = spacing_px / kFocal;
            if (verticals) {
              options.vertical_a = pair.vertical_a;
              options.vertical_b = pair.vertical_b;
            }
            measured.run(pair, model, [&] { return estimate_two_view(pair.points, options); });
          }
          measured.print((std::to_string(static_cast<int>(spacing_px)) + " px").c_str(), true);
        }
      }
}

// The matches of two photographs as normalised points.
PointPairs matched(const ImageFeatures& a, const ImageFeatures& b, const Intrinsics& camera) {
  PointPairs points;
  const auto at = [&](const ImageFeatures& f, std::int32_t row) {
    const Keypoint& k = f.keypoints[static_cast<std::size_t>(row)];
    return unproject(camera, {from_fixed_pixel(k.x), from_fixed_pixel(k.y)});
  };
  for (const auto& [row_a, row_b] : match_descriptors(a.descriptors, b.descriptors, {})) {
    const auto pa = at(a, row_a), pb = at(b, row_b);
    if (!pa || !pb) continue;
    points.a.push_back(*pa);
    points.b.push_back(*pb);
  }
  return points;
}

void compare_photographs(const std::string& folder, double focal_px, std::size_t step) {
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    std::string extension = entry.path().extension().string();
    std::ranges::transform(extension, extension.begin(), [](unsigned char c) { return std::tolower(c); });
    if (extension == ".jpg") files.push_back(entry.path().string());
  }
  std::sort(files.begin(), files.end());
  std::vector<ImageFeatures> features;
  FeatureOptions detection;
  detection.max_features = 4000;
  for (std::size_t i = 0; i < files.size(); ++i)
    features.push_back(detect_features(files[i], "", ImageIndex(static_cast<std::int32_t>(i)), detection));
  double seconds_cv = 0, seconds_ours = 0;
  int verified_cv = 0, verified_ours = 0, inliers_cv = 0, inliers_ours = 0, pairs = 0;
  std::vector<double> apart;
  for (std::size_t i = 0; i < files.size(); ++i)
    for (std::size_t j = i + 1; j < std::min(files.size(), i + 1 + step); ++j) {
      const Intrinsics camera = {focal_px, 0.5 * features[i].width, 0.5 * features[i].height, 0, 0, 0, 0, 0};
      const PointPairs points = matched(features[i], features[j], camera);
      TwoViewOptions options;
      options.max_residual = 3 / focal_px;
      options.seed = i * files.size() + j;
      if (points.size() < static_cast<std::size_t>(options.min_inliers)) continue;
      ++pairs;
      const double start = processor_seconds();
      const TwoView cv = OpencvTwoView(points, options).estimate();
      const double middle = processor_seconds();
      const TwoView ours = estimate_two_view(points, options);
      seconds_ours += processor_seconds() - middle;
      seconds_cv += middle - start;
      verified_cv += cv.model != PairModel::kNone;
      verified_ours += ours.model != PairModel::kNone;
      if (cv.model == PairModel::kNone || ours.model == PairModel::kNone) continue;
      inliers_cv += cv.inlier_count;
      inliers_ours += ours.inlier_count;
      apart.push_back(rotation_angle(cv.rotation, ours.rotation) / kDegree);
    }
  std::printf("%s: %d pairs\n", folder.c_str(), pairs);
  std::printf("  OpenCV %7.2f ms a pair, %d verified, %d inliers of pairs that both verify\n", 1e3 * seconds_cv / pairs,
              verified_cv, inliers_cv);
  std::printf("  ours   %7.2f ms a pair, %d verified, %d inliers; rotations apart by %.3f deg (median)\n",
              1e3 * seconds_ours / pairs, verified_ours, inliers_ours, median(apart));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc > 2 && std::filesystem::is_directory(argv[1]))
    compare_photographs(argv[1], std::atof(argv[2]), argc > 3 ? static_cast<std::size_t>(std::atoi(argv[3])) : 4);
  else if (argc > 1 && std::string(argv[1]) == "selection")
    compare_selection(argc > 2 ? std::atoi(argv[2]) : 200);
  else if (argc > 1 && std::string(argv[1]) == "spacing")
    compare_spacing(argc > 2 ? std::atoi(argv[2]) : 200);
  else
    compare_simulated(argc > 1 ? std::atoi(argv[1]) : 40, argc > 2 ? argv[2] : "");
}
