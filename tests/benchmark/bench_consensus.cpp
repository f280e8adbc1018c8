// Measures the robust estimation of poses and similarities from observations with many outliers: milliseconds of a
// hundred calls on one core, median error in the units of the scene, and the share of calls whose error is not larger
// than with exact data ("success").
//
//     bench_consensus
#include <benchmark/benchmark.h>

#include "adjust/independent_models/model_link.h"
#include "adjust/orientation/steps/resection.h"
#include "adjust/resection/rig_resection.h"
#include "cluster/job/work_queue.h"
#include "geometry/numbers/median.h"
#include "tests/support/adjust/street_rig.h"

namespace megablock {
namespace {

constexpr int kScenes = 100;

struct Errors {
  std::vector<double> error;
  int failed = 0;
  void report(benchmark::State& state, double limit) const {
    double good = 0;
    for (const double e : error) good += e < limit;
    state.counters["success"] = good / kScenes;
    state.counters["median_error"] = error.empty() ? 0 : median(error);
  }
};

template <typename Scene, typename Solve>
void run(benchmark::State& state, double limit, const Solve& solve) {
  std::vector<Scene> scenes;
  for (std::uint64_t seed = 0; seed < kScenes; ++seed)
    scenes.emplace_back(0.01 * static_cast<double>(state.range(0)), seed);
  Errors errors;
  for (auto _ : state) {
    errors = {};
    for (const Scene& scene : scenes)
      if (const auto error = solve(scene)) errors.error.push_back(*error);
  }
  state.SetItemsProcessed(state.iterations() * kScenes);
  errors.report(state, limit);
}

// One camera, 200 points 10 to 60 m in front of it, half a pixel of 1 200.
struct FrameScene {
  OrientationGraph graph;
  OrientationValues values;
  std::vector<Eigen::Vector3d> rays;
  Pose truth;
  FrameScene(double wrong, std::uint64_t seed) {
    Noise noise(seed);
    truth = {rotation_exp<double>(noise.triple()), 10 * noise.triple()};
    graph.frames.resize(1);
    graph.images.push_back({ImageIndex(0), 0, 0, {}, nullptr});
    graph.begin = {0};
    for (int i = 0; i < 200; ++i) {
      const double z = noise.uniform(10, 60);
      const Eigen::Vector3d inside(z * noise.uniform(-0.6, 0.6), z * noise.uniform(-0.4, 0.4), z);
      Eigen::Vector3d seen = inside / z;
      seen.head<2>() += 0.5 / 1200 * noise.pair();
      if (noise.uniform(0, 1) < wrong) seen = {noise.uniform(-0.6, 0.6), noise.uniform(-0.4, 0.4), 1};
      rays.push_back(seen.normalized());
      graph.observations.push_back({0, Eigen::Vector2d::Zero()});
      graph.begin.push_back(i + 1);
      values.points.push_back(truth.centre + truth.rotation.conjugate() * inside);
    }
    values.frames.resize(1);
  }
};
void frame_by_p3p(benchmark::State& state) {
  run<FrameScene>(state, 0.05, [](const FrameScene& scene) -> std::optional<double> {
    const auto pose = resect_frame(scene.graph, scene.rays, 0, 4.0 / 1200, 15, scene.values);
    if (!pose) return std::nullopt;
    return (pose->centre - scene.truth.centre).norm();
  });
}
BENCHMARK(frame_by_p3p)->ArgName("wrong_%")->Arg(0)->Arg(30)->Arg(60)->Unit(benchmark::kMillisecond);

// Ten cameras, some 25 points of 2 cm, 4 to 12 m away.
struct RigScene {
  std::vector<ObservedPoint> observations;
  Pose truth;
  RigScene(double wrong, std::uint64_t seed) {
    Noise noise(seed);
    truth = level_rig({500, 300, 32.5}, noise.uniform(-3, 3));
    for (int i = 0; i < 32; ++i) {
      const double angle = noise.uniform(0, 2 * std::numbers::pi), distance = noise.uniform(4, 12);
      Eigen::Vector3d point(500 + distance * std::cos(angle), 300 + distance * std::sin(angle),
                            noise.uniform(30.5, 36));
      const auto seen = street_rig().see(to_inside(truth, point));
      if (!seen) continue;
      point +=
          noise.uniform(0, 1) < wrong ? Eigen::Vector3d(3 * noise.triple()) : Eigen::Vector3d(0.02 * noise.triple());
      observations.push_back(
          {street_rig().ray(*seen, 0.5 * noise.pair()), point, 4e-4 * Eigen::Matrix3d::Identity(), 0.5, i});
    }
  }
};
void rig_by_gp3p(benchmark::State& state) {
  run<RigScene>(state, 0.05, [](const RigScene& scene) -> std::optional<double> {
    try {
      RigResectionOptions options;
      options.min_share = 0.3;
      return (resect_rig(scene.observations, options, 1).pose.centre - scene.truth.centre).norm();
    } catch (const std::exception&) {
      return std::nullopt;
    }
  });
}
BENCHMARK(rig_by_gp3p)->ArgName("wrong_%")->Arg(0)->Arg(30)->Arg(60)->Unit(benchmark::kMillisecond);

// 200 points and 5 images that two models share, 1 000 units wide, sigma 0.1.
struct LinkScene {
  std::vector<Model> models{{1, {}, {}}, {2, {}, {}}};
  SharedRows shared;
  Similarity truth;
  LinkScene(double wrong, std::uint64_t seed) {
    Noise noise(seed);
    truth = {std::exp(noise()), rotation_exp<double>(noise.triple()), 1000 * noise.triple()};  // second -> first
    const auto place = [&] {
      return Eigen::Vector3d(noise.uniform(0, 1000), noise.uniform(0, 200), noise.uniform(0, 50));
    };
    for (int i = 0; i < 200; ++i) {
      const Eigen::Vector3d x = place();
      Eigen::Vector3d y = truth(x) + 0.1 * truth.scale * noise.triple();
      if (noise.uniform(0, 1) < wrong) y += 300 * truth.scale * noise.triple();
      models[0].points.push_back({i, y, 0.1 * truth.scale});
      models[1].points.push_back({i, x + 0.1 * noise.triple(), 0.1});
      shared.points.emplace_back(i, i);
    }
    for (int i = 0; i < 5; ++i) {
      const Pose pose{rotation_exp<double>(noise.triple()), place()};
      Pose moved = truth(pose);
      moved.rotation = rotation_update(moved.rotation, 1e-3 * noise.triple());
      models[0].images.push_back({i, moved, 0.1 * truth.scale, 1e-3});
      models[1].images.push_back({i, pose, 0.1, 1e-3});
      shared.images.emplace_back(i, i);
    }
  }
};
void link_of_models(benchmark::State& state) {
  run<LinkScene>(state, 0.1, [&](const LinkScene& scene) -> std::optional<double> {
    LinkOptions options;
    options.scale_sigmas = state.range(1) != 0;
    const auto link = fit_model_link(scene.models, 0, 1, scene.shared, options);
    if (!link) return std::nullopt;
    const Eigen::Vector3d middle(500, 100, 25);
    return (link->similarity(middle) - scene.truth(middle)).norm() / scene.truth.scale;
  });
}
BENCHMARK(link_of_models)
    ->ArgNames({"wrong_%", "sigmas_open"})
    ->Args({0, 0})
    ->Args({30, 0})
    ->Args({60, 0})
    ->Args({0, 1})
    ->Args({30, 1})
    ->Args({60, 1})
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace megablock

BENCHMARK_MAIN();
