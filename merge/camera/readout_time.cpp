#include "merge/camera/readout_time.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "adjust/calibration/rig_observations.h"
#include "adjust/tile/rolling_start.h"
#include "merge/tree/tile_solver.h"

namespace megablock {

namespace {

constexpr double kStepS = 0.01;  // d: a readout takes some hundredths of a second
// Observations of tie points. Where there are more, only every second, third ... track counts.
constexpr std::int64_t kMostObservations = 15000;

TrackSet thinned(const TrackSet& tracks) {
  const std::int64_t every = (tracks.observation_count() + kMostObservations - 1) / kMostObservations;
  return every > 1 ? select_tracks(tracks, every, true) : tracks;
}

class Sample {
 public:
  Sample(const Block& block, const BlockState& state, const TrackSet& tracks, CameraIndex camera,
         const IndexedVector<CameraIndex, double>& readout_s, const AdjustOptions& options)
      : options_(options),
        paths_(block),
        whole_(whole_block(block, state, thinned(tracks), options.observations)),
        shutters_{paths_, {}, state},
        kept_(whole_.problem.kept),
        x_(whole_.problem.x),
        y_(whole_.problem.y) {
    row_ = whole_.problem.cameras.size();
    for (const CameraIndex c : whole_.problem.cameras) {
      if (c == camera) row_ = shutters_.readouts.size();
      shutters_.readouts.push_back({readout_s[c], static_cast<double>(block.cameras[c].height)});
    }
  }

  // Whether a frame of the camera is in the sample and moves; at rest, its rows show the same.
  bool moves() const {
    if (row_ == shutters_.readouts.size()) return false;
    const TileProblem& problem = whole_.problem;
    const std::vector<Motion> motions = tile_motions(paths_, problem, whole_.state, shutters_.others);
    return std::any_of(problem.images.begin(), problem.images.end(), [&](const TileImage& image) {
      return static_cast<std::size_t>(image.camera.value) == row_ &&
             motions[static_cast<std::size_t>(image.frame.value)].velocity.norm() > 0;
    });
  }

  double readout() const { return shutters_.readouts[row_].time_s; }
  void set_readout(double time_s) { shutters_.readouts[row_].time_s = time_s; }

  // Adjusts and screens the sample with the present readout time.
  void adjust() {
    whole_.problem.kept = kept_;
    restore();
    adjust_moving_tile(shutters_, whole_.problem, whole_.state, options_, solve_by_condensation);
    motions_ = tile_motions(paths_, whole_.problem, whole_.state, shutters_.others);
  }

  // Adjusts what is kept with another readout time. The distances and motions are those of the last adjust().
  AdjustSummary with_readout(double time_s) {
    restore();
    std::vector<Readout> readouts = shutters_.readouts;
    readouts[row_].time_s = time_s;
    correct_rolling_shutter(readouts, motions_, whole_.state, whole_.problem);
    TileState state = whole_.state;
    SolveOptions solve;
    solve.max_iterations = options_.max_iterations;
    solve.function_tolerance = 1e-10;
    return solve_by_condensation(whole_.problem, state, solve);
  }

 private:
  void restore() {
    whole_.problem.x = x_;
    whole_.problem.y = y_;
  }

  const AdjustOptions& options_;
  FramePaths paths_;
  WholeBlock whole_;
  RollingShutters shutters_;
  std::vector<std::uint8_t> kept_;  // before screening
  std::vector<double> x_, y_;       // as measured
  std::vector<Motion> motions_;
  std::size_t row_;  // of the camera; the number of cameras where the sample does not have it
};

}  // namespace

ReadoutEstimate estimate_readout(const Block& block, const BlockState& state, const TrackSet& tracks,
                                 IndexedVector<CameraIndex, double> readout_s, CameraIndex camera,
                                 const AdjustOptions& options) {
  constexpr int kMostRounds = 5;
  constexpr double kEnoughSigmas = 0.1;
  Sample sample(block, state, tracks, camera, readout_s, options);
  if (!sample.moves()) return {0, 0, "no path is known: its images have no times, do not move, or are not oriented"};
  ReadoutEstimate estimate;
  for (int round = 0; round < kMostRounds; ++round) {
    sample.adjust();
    const double t = sample.readout();
    const AdjustSummary middle = sample.with_readout(t);
    const double before = sample.with_readout(t - kStepS).final_cost,
                 after = sample.with_readout(t + kStepS).final_cost;
    const double slope = (after - before) / (2 * kStepS);
    const double curvature = (after - 2 * middle.final_cost + before) / (kStepS * kStepS);
    if (!(curvature > 0)) return {0, 0, "the images do not show it"};
    estimate.sigma_s = middle.sigma0 / std::sqrt(curvature);
    estimate.time_s = std::clamp(t - slope / curvature, -kLongestReadoutS, kLongestReadoutS);
    sample.set_readout(estimate.time_s);
    if (std::abs(estimate.time_s - t) < kEnoughSigmas * estimate.sigma_s) break;
  }
  return estimate;
}

ReadoutChoice choose_readout(const ReadoutEstimate& found, double expected_s) {
  constexpr double kSignificant = 3, kConfirmed = 0.5;
  const std::string expected =
      expected_s == 0 ? "" : fmt::format(", where a table of cameras says {:.0f} ms", 1000 * expected_s);
  if (!found.failure.empty()) return {0, fmt::format("no rolling shutter{}: {}", expected, found.failure)};
  const std::string figure = fmt::format("{:.1f} ± {:.1f} ms", 1000 * found.time_s, 1000 * found.sigma_s);
  const bool significant = std::abs(found.time_s) > kSignificant * found.sigma_s,
             confirmed = expected_s == 0 || std::abs(found.time_s - expected_s) < kConfirmed * std::abs(expected_s);
  if (!significant || !confirmed)
    return {0, fmt::format("no rolling shutter: the images give a readout time of {}{}", figure, expected)};
  return {std::round(1e6 * found.time_s) / 1e6, fmt::format("readout time {} from the images{}", figure, expected)};
}

}  // namespace megablock
