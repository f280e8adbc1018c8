// Measures the minimal solvers of geometry/: microseconds per call on one core, mean number of solutions, and the share
// of samples with the truth among the solutions ("success"), as in the benchmark of PoseLib.
//
// Scenes of relative orientation (pair_scene.h): 0 general, 1 plane, 2 forward, 3 plane seen along its normal, 4 short
// base (0.01), 5 no base (the rotation alone counts); second argument: noise in tenths of a pixel. Without noise the
// truth is within 1e-3 deg (scene 3: 0.1 deg) of rotation and base together; with noise within a degree of the
// rotation.
//
//     bench_solvers --benchmark_repetitions=5
#include <benchmark/benchmark.h>

#include <algorithm>

#include "geometry/resection/gp3p.h"
#include "geometry/resection/p3p.h"
#include "geometry/similarity/minimal_similarity.h"
#include "geometry/two_view/five_point.h"
#include "geometry/two_view/fundamental.h"
#include "geometry/two_view/homography.h"
#include "geometry/two_view/rotation_pair.h"
#include "geometry/two_view/vertical_pair.h"
#include "tests/support/geometry/pair_scene.h"

namespace megablock {
namespace {

constexpr std::size_t kCases = 1000;
enum SceneKind { kGeneral, kPlane, kForward, kPlaneForward, kShortBase, kNoBase };

PairScene scene_of(const benchmark::State& state, std::size_t count, bool heading_only, std::mt19937_64& random) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  PairSceneOptions options;
  const SceneKind kind = static_cast<SceneKind>(state.range(0));
  options.plane = kind == kPlane || kind == kPlaneForward;
  options.base =
      kind == kForward || kind == kPlaneForward ? Eigen::Vector3d(0, 0, 0.3) : 0.3 * random_direction(random);
  if (kind == kShortBase) options.base *= 1.0 / 30;
  if (kind == kNoBase) options.base.setZero();
  options.noise_px = 0.1 * static_cast<double>(state.range(1));
  if (kind != kForward && kind != kPlaneForward)
    options.rotation = heading_only ? rotation_exp<double>({0, 0.5 * uniform(random), 0})
                                    : rotation_exp<double>(0.3 * uniform(random) * random_direction(random));
  return PairScene(options, count, random);
}

template <typename List>
bool found_truth(const benchmark::State& state, const List& found, const RelativeOrientation& truth) {
  const bool rotation_only = state.range(1) > 0 || state.range(0) == kNoBase;
  const double limit = state.range(1) > 0 ? 1 : state.range(0) == kPlaneForward ? 0.1 : 1e-3;
  for (const RelativeOrientation& o : found)
    if (rotation_error_deg(o, truth) + (rotation_only ? 0 : base_error_deg(o, truth)) < limit) return true;
  return false;
}

void report(benchmark::State& state, std::size_t successes, std::size_t solutions) {
  state.counters["success"] = static_cast<double>(successes) / kCases;
  state.counters["solutions"] = static_cast<double>(solutions) / kCases;
}

// `solve` takes the rays of both images.
template <std::size_t N, typename Solve>
void run_pairs(benchmark::State& state, bool heading_only, const Solve& solve) {
  std::mt19937_64 random(1);
  std::vector<std::array<Eigen::Vector3d, N>> a, b;
  std::vector<RelativeOrientation> truth;
  for (std::size_t i = 0; i < kCases; ++i) {
    const PairScene scene = scene_of(state, N, heading_only, random);
    a.push_back(scene.first<N>(scene.a));
    b.push_back(scene.first<N>(scene.b));
    truth.push_back(scene.truth);
  }
  std::size_t successes = 0, solutions = 0, i = 0;
  for (; i < kCases; ++i) {
    const auto found = solve(a[i], b[i]);
    successes += found_truth(state, found, truth[i]);
    solutions += found.size();
  }
  for (auto _ : state) {
    i = (i + 1) % kCases;
    benchmark::DoNotOptimize(solve(a[i], b[i]));
  }
  report(state, successes, solutions);
}

void vertical_pair(benchmark::State& state) {
  const Eigen::Vector3d down = Eigen::Vector3d::UnitY();
  run_pairs<3>(state, true, [&](const auto& a, const auto& b) { return solve_vertical_pair(a, b, down, down); });
}
void five_point(benchmark::State& state) {
  run_pairs<5>(state, false, [](const FiveRays& a, const FiveRays& b) { return solve_five_point(a, b); });
}
void five_point_in_front(benchmark::State& state) {
  run_pairs<5>(state, false, [](const FiveRays& a, const FiveRays& b) { return solve_five_point_in_front(a, b); });
}
void eight_point(benchmark::State& state) {
  run_pairs<8>(state, false, [](const auto& a, const auto& b) {
    const auto essential = fit_essential(a, b);
    return essential ? orientations_of_essential(*essential) : Solutions<RelativeOrientation, 4>();
  });
}
void homography(benchmark::State& state) {
  run_pairs<4>(state, false, [](const auto& a, const auto& b) {
    Solutions<RelativeOrientation, 2> found;
    if (const auto h = fit_homography(a, b))
      for (const PlanarOrientation& o : visible_orientations(*h, a)) found.push_back(o.orientation);
    return found;
  });
}
void rotation_pair(benchmark::State& state) {
  run_pairs<2>(state, false, [](const auto& a, const auto& b) {
    Solutions<RelativeOrientation, 1> found;
    if (const auto q = solve_rotation_pair(a[0], a[1], b[0], b[1])) found.push_back({*q, Eigen::Vector3d::UnitX()});
    return found;
  });
}

void all_scenes(benchmark::internal::Benchmark* b) {
  for (int scene = kGeneral; scene <= kNoBase; ++scene)
    for (const int tenths_px : {0, 5}) b->Args({scene, tenths_px});
}
BENCHMARK(vertical_pair)->Apply(all_scenes)->Unit(benchmark::kMicrosecond);
BENCHMARK(five_point)->Apply(all_scenes)->Unit(benchmark::kMicrosecond);
BENCHMARK(five_point_in_front)->Args({kGeneral, 0})->Args({kGeneral, 5})->Unit(benchmark::kMicrosecond);
BENCHMARK(eight_point)->Args({kGeneral, 0})->Args({kForward, 0})->Unit(benchmark::kMicrosecond);
BENCHMARK(homography)->Args({kPlane, 0})->Args({kPlaneForward, 0})->Unit(benchmark::kMicrosecond);
BENCHMARK(rotation_pair)->Args({kNoBase, 0})->Args({kNoBase, 5})->Unit(benchmark::kMicrosecond);

// Scenes of poses and similarities: 0 general, 1 plane across the viewing direction, 2 points near one line (a fiftieth
// of their extent beside it), 3 three hundred metres further away, at a hundred times their extent; 1 and 3 of poses
// only. Second argument: noise in tenths of a pixel, of a metre at similarities (sides of a kilometre). Without noise
// the truth is within 1e-3 of rotation (deg) and centre (m) together; with noise within a degree of the rotation.
enum PointKind { kSpread, kFacing, kNearLine, kFarAway };

struct PoseCase {
  Pose truth;
  std::array<Eigen::Vector3d, 3> origins, rays, points;
};

// Points in camera axes.
std::array<Eigen::Vector3d, 3> points_seen(PointKind kind, std::mt19937_64& random) {
  std::normal_distribution<double> normal(0, 1);
  std::array<Eigen::Vector3d, 3> points;
  for (Eigen::Vector3d& p : points) {
    const double x = normal(random), y = normal(random), z = normal(random);
    p = {3 * x, 2 * y, 10 + (kind == kFacing ? 0 : 2 * std::abs(z))};
    if (kind == kFarAway) p.z() += 300;
  }
  if (kind == kNearLine)
    points[2] = points[0] + normal(random) * (points[1] - points[0]) +
                0.02 * (points[1] - points[0]).norm() * random_direction(random);
  return points;
}

std::vector<PoseCase> pose_cases(const benchmark::State& state, double spread) {
  std::mt19937_64 random(2);
  std::normal_distribution<double> noise(0, 0.1 / kSceneFocalPx);
  std::vector<PoseCase> cases(kCases);
  for (PoseCase& c : cases) {
    c.truth = {rotation_exp<double>(2 * random_direction(random)), 10 * random_direction(random)};
    const auto inside = points_seen(static_cast<PointKind>(state.range(0)), random);
    for (std::size_t k = 0; k < 3; ++k) {
      c.origins[k] = spread * random_direction(random);
      c.rays[k] = (inside[k] - c.origins[k]).normalized();
      c.rays[k] += static_cast<double>(state.range(1)) * noise(random) * c.rays[k].cross(random_direction(random));
      c.rays[k].normalize();
      c.points[k] = c.truth.centre + c.truth.rotation.conjugate() * inside[k];
    }
  }
  return cases;
}

template <typename Solve>
void run_poses(benchmark::State& state, double spread, const Solve& solve) {
  const std::vector<PoseCase> cases = pose_cases(state, spread);
  const bool exact = state.range(1) == 0;
  std::size_t successes = 0, solutions = 0, i = 0;
  for (const PoseCase& c : cases) {
    const auto found = solve(c);
    successes += std::any_of(found.begin(), found.end(), [&](const Pose& pose) {
      const double turned = degrees(rotation_angle(pose.rotation, c.truth.rotation));
      return exact ? turned + (pose.centre - c.truth.centre).norm() < 1e-3 : turned < 1;
    });
    solutions += found.size();
  }
  for (auto _ : state) {
    i = (i + 1) % kCases;
    benchmark::DoNotOptimize(solve(cases[i]));
  }
  report(state, successes, solutions);
}

void p3p(benchmark::State& state) {
  run_poses(state, 0, [](const PoseCase& c) { return solve_p3p(c.rays, c.points); });
}
void gp3p(benchmark::State& state) {
  run_poses(state, 1, [](const PoseCase& c) { return solve_gp3p(c.origins, c.rays, c.points); });
}

void similarity(benchmark::State& state) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> uniform(0, 1);
  const double noise_m = 0.1 * static_cast<double>(state.range(1));
  std::vector<std::array<Eigen::Vector3d, 3>> from(kCases), to(kCases);
  std::size_t successes = 0, i = 0;
  for (; i < kCases; ++i) {
    const Similarity truth{0.5 + uniform(random),
                           rotation_exp<double>(3.1 * uniform(random) * random_direction(random)),
                           1000 * random_direction(random)};
    for (Eigen::Vector3d& p : from[i]) p = 1000 * random_direction(random);
    if (state.range(0) == kNearLine)
      from[i][2] = from[i][0] + uniform(random) * (from[i][1] - from[i][0]) + 20 * random_direction(random);
    for (std::size_t k = 0; k < 3; ++k) to[i][k] = truth(from[i][k]) + noise_m * random_direction(random);
    const auto found = solve_similarity(from[i], to[i]);
    successes += found && degrees(rotation_angle(found->rotation, truth.rotation)) < (noise_m > 0 ? 1 : 1e-3);
  }
  for (auto _ : state) {
    i = (i + 1) % kCases;
    benchmark::DoNotOptimize(solve_similarity(from[i], to[i]));
  }
  report(state, successes, successes);
}

void all_points(benchmark::internal::Benchmark* b) {
  for (const int kind : {kSpread, kFacing, kNearLine, kFarAway})
    for (const int tenths_px : {0, 5}) b->Args({kind, tenths_px});
}
BENCHMARK(p3p)->Apply(all_points)->Unit(benchmark::kMicrosecond);
BENCHMARK(gp3p)->Apply(all_points)->Unit(benchmark::kMicrosecond);
BENCHMARK(similarity)->ArgsProduct({{kSpread, kNearLine}, {0, 5}})->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace megablock

BENCHMARK_MAIN();
