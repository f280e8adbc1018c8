// Makes one tile of a simulated block, and measures the errors of its adjustment.
#pragma once

#include <limits>

#include "adjust/terms/build_problem.h"
#include "adjust/terms/linearise.h"
#include "adjust/tile/tile_adjustment.h"
#include "io/base/error.h"
#include "io/simulate/blocks/simulate.h"

namespace megablock {

inline std::vector<Eigen::Vector3d> no_points(const TileProblem& problem) {
  return std::vector<Eigen::Vector3d>(problem.points.size(),
                                      Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
}

struct SingleTile {
  SimulatedBlock simulated;
  AdjustOptions options;
  TileProblem problem;
  TileState state;

  explicit SingleTile(const SimulationOptions& simulation, const AdjustOptions& adjust = {})
      : SingleTile(simulate_block(simulation), adjust) {}
  explicit SingleTile(SimulatedBlock block, const AdjustOptions& adjust = {})
      : simulated(std::move(block)), options(adjust) {
    const BlockState start = initial_state(simulated.block);
    problem = make_tile_problem(simulated.block, start, single_tile(simulated.block), TileIndex(0), simulated.tracks,
                                options.observations);
    state = make_tile_state(problem, start, no_points(problem));
  }

  // The truth in the problem's tables; points of tracks and control points.
  TileState truth() const {
    std::vector<Eigen::Vector3d> points = simulated.points;
    points.insert(points.end(), simulated.control_truth.begin(), simulated.control_truth.end());
    return make_tile_state(problem, simulated.truth, points);
  }

  double position_rms() const {
    double sum = 0;
    for (std::size_t f = 0; f < problem.frames.size(); ++f)
      sum += (state.frames[f].centre - simulated.truth.frames[problem.frames[f]].centre).squaredNorm();
    return std::sqrt(sum / static_cast<double>(problem.frames.size()));
  }
  double rotation_rms() const {
    double sum = 0;
    for (std::size_t f = 0; f < problem.frames.size(); ++f)
      sum += std::pow(rotation_angle(state.frames[f].rotation, simulated.truth.frames[problem.frames[f]].rotation), 2);
    return std::sqrt(sum / static_cast<double>(problem.frames.size()));
  }
};

// Exact observations of a small aerial block at its true poses.
struct ExactTile : SingleTile {
  ExactTile() : SingleTile(exact()) { state = truth(); }
  static SimulationOptions exact() {
    SimulationOptions options;
    options.frames = 20;
    options.points_per_frame = 80;
    options.image_noise_px = 0;
    return options;
  }
  // The first tie point with at least `count` observations.
  std::int64_t long_track(std::int64_t count) const {
    for (std::int64_t p = 0; p < problem.point_count(); ++p)
      if (problem.begin[p + 1] - problem.begin[p] >= count) return p;
    throw ComputeError("no such track");
  }
  // Moves an observation to where another ground point would be seen.
  void redirect(std::int64_t row, const Eigen::Vector3d& point) {
    const TileImage& image = problem.images[problem.image[row].value];
    const Eigen::Vector2d pixel = project(state.cameras[image.camera.value],
                                          to_camera(state.frames[image.frame.value], state.mounts[image.mount], point));
    problem.x[row] = pixel.x();
    problem.y[row] = pixel.y();
  }
};

}  // namespace megablock
