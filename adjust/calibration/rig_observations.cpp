// Chooses the observations that a calibration takes:
//
//     off-line   control points, no tie points: a surveyed target field
//     on-line    tie points alone: a free network. The scale of the rig has no observation; the loose sigmas of the
//                mounts are constant damping along it (Cannelle 2013, eq. 9 to 11)
//     all        what the project gives
//
// A result is judged by what it did not use: tracks that were held out, and known points intersected with the new rig.
#include "adjust/calibration/rig_observations.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "adjust/terms/build_problem.h"
#include "adjust/terms/linearise.h"
#include "geometry/numbers/angles.h"
#include "geometry/numbers/median.h"
#include "geometry/similarity/similarity.h"
#include "io/base/error.h"

namespace megablock {

namespace {

const Eigen::Vector3d kNoPoint = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());

void remove_datum(Block& block) {
  block.control_points.clear();
  block.relative_poses.clear();
  block.lines.clear();
  block.verticals.clear();
  for (Frame& frame : block.frames) frame.position_prior.reset(), frame.attitude_prior.reset();
}

// Frees all mounts but the references, or only those that the project frees without a sigma. The sigma of the position
// is limited by the size of the rig, so that it also holds the scale of a small rig. A receiver is no part of the
// calibration of a rig and stays as the project gives it.
void free_mounts(Rig& rig, bool all, const RigCalibrationOptions& options) {
  if (rig.is_group()) return;
  double extent = 0;
  for (const Mount& mount : rig.cameras())
    extent = std::max(extent, (mount.pose.centre - rig.mounts[0].pose.centre).norm());
  const double limit = extent > 0 ? extent / 2 : options.free_position_sigma_m;
  for (std::size_t m = 1; m < rig.cameras().size(); ++m) {
    Mount& mount = rig.mounts[m];
    if (all || std::isinf(mount.position_sigma_m))
      mount.position_sigma_m = std::min(options.free_position_sigma_m, limit);
    if (all || std::isinf(mount.rotation_sigma_rad))
      mount.rotation_sigma_rad = kDegree * options.free_rotation_sigma_deg;
  }
  if (rig.has_receiver()) rig.mounts.back().rotation_sigma_rad = rig.mounts.back().position_sigma_m = 0;
}

}  // namespace

void RigCalibrationOptions::check() const {
  adjustment.check();
  if (!(free_position_sigma_m > 0 && free_rotation_sigma_deg > 0))
    throw InputError("the sigmas of free mounts must be positive");
  if (!(held_out_share >= 0 && held_out_share <= 0.5)) throw InputError("the share held out must lie in [0, 0.5]");
  if (!(max_position_sigma_m > 0 && max_rotation_sigma_deg > 0))
    throw InputError("the bounds of the mounts' sigmas must be positive");
  if (min_quadrant_measurements < 1) throw InputError("the measurements of a quadrant must be at least 1");
  if (!(largest_ratio >= 1)) throw InputError("the largest ratio to the start must be at least 1");
  if (max_iterations < 1) throw InputError("max_iterations must be at least 1");
}

std::string mode_name(CalibrationMode mode) {
  return mode == CalibrationMode::kOffLine ? "off-line" : mode == CalibrationMode::kOnLine ? "on-line" : "all";
}

Block calibration_block(Block block, const RigCalibrationOptions& options) {
  if (std::none_of(block.rigs.begin(), block.rigs.end(), [](const Rig& rig) { return rig.cameras().size() > 1; }))
    throw InputError(
        "the block has no rig of two or more cameras: there are no mounts to calibrate; give 'rigs' in the project "
        "file");
  if (options.mode == CalibrationMode::kOnLine) remove_datum(block);
  for (Rig& rig : block.rigs) free_mounts(rig, options.mounts == MountFreedom::kFree, options);
  const bool any = std::any_of(block.rigs.begin(), block.rigs.end(), [](const Rig& rig) {
    return std::ranges::any_of(rig.cameras(), [](const Mount& mount) { return !mount.held(); });
  });
  if (!any)
    throw InputError(
        "all mounts are held by the project (sigmas of 0); give --mounts free, or sigma_position_m and "
        "sigma_rotation_deg of 'rigs' in the project file");
  if (!options.estimate_intrinsics)
    for (Camera& camera : block.cameras) camera.prior_sigma.fill(0);
  return block;
}

Block with_rig_held(Block block, const BlockState& rig) {
  for (CameraIndex c(0); block.cameras.contains(c); ++c.value) {
    block.cameras[c].intrinsics = rig.cameras[c];
    block.cameras[c].prior_sigma.fill(0);
  }
  for (RigIndex r(0); block.rigs.contains(r); ++r.value)
    for (std::size_t m = 0; m < block.rigs[r].mounts.size(); ++m) {
      Mount& mount = block.rigs[r].mounts[m];
      mount.pose = rig.mounts[r][m];
      if (block.rigs[r].is_group()) continue;
      mount.position_sigma_m = mount.rotation_sigma_rad = 0;
    }
  return block;
}

TrackSet select_tracks(const TrackSet& tracks, std::int64_t every, bool held_out) {
  TrackSet selected;
  selected.begin.push_back(0);
  for (std::int64_t t = 0; t < tracks.track_count(); ++t) {
    const bool out = every > 0 && t % every == every / 2;
    if (out != held_out) continue;
    selected.id.push_back(tracks.id[static_cast<std::size_t>(t)]);
    const auto first = tracks.begin[static_cast<std::size_t>(t)], last = tracks.begin[static_cast<std::size_t>(t) + 1];
    const auto append = [&](auto& to, const auto& from) {
      to.insert(to.end(), from.begin() + first, from.begin() + last);
    };
    append(selected.image, tracks.image);
    append(selected.x, tracks.x);
    append(selected.y, tracks.y);
    append(selected.feature, tracks.feature);
    selected.begin.push_back(selected.observation_count());
  }
  return selected;
}

WholeBlock whole_block(const Block& block, const BlockState& state, const TrackSet& tracks,
                       const ObservationOptions& options) {
  WholeBlock whole;
  whole.problem = make_tile_problem(block, state, single_tile(block), TileIndex(0), tracks, options);
  whole.state =
      make_tile_state(whole.problem, state, std::vector<Eigen::Vector3d>(whole.problem.points.size(), kNoPoint));
  return whole;
}

WholeBlock adjust_whole(const Block& block, const BlockState& start, const TrackSet& tracks,
                        const AdjustOptions& options) {
  WholeBlock whole = whole_block(block, start, tracks, options.observations);
  adjust_tile(whole.problem, whole.state, options);
  return whole;
}

WholeBlock adjust_with_rig_held(const Block& block, const BlockState& start, const WholeBlock& like,
                                const TrackSet& tracks, const AdjustOptions& options) {
  const Block held = with_rig_held(block, start);
  BlockState state = initial_state(held);
  store_tile_state(like.problem, like.state, state);
  std::fill(state.oriented.begin(), state.oriented.end(), std::uint8_t{0});
  for (const FrameIndex frame : like.problem.frames) state.oriented[frame] = 1;
  state.cameras = start.cameras;
  state.mounts = start.mounts;
  // The problem must be the same as that of `like`: same frames, same tracks, same sigmas, same verdicts. Only then do
  // the residuals compare two rigs.
  WholeBlock whole = whole_block(held, state, tracks, options.observations);
  whole.state.points = like.state.points;
  whole.problem.kept = like.problem.kept;
  whole.problem.inverse_sigma = like.problem.inverse_sigma;
  whole.problem.image_sigma_px = like.problem.image_sigma_px;
  // Two adjustments are compared by their residuals. Both must count all of them in full.
  whole.problem.image_loss = {RobustLoss::Kind::kNone, 1};
  constexpr int kIterations = 50;
  constexpr double kTolerance = 1e-9;  // share of the cost
  const AdjustSummary summary = solve_with_ceres(whole.problem, whole.state, kIterations, kTolerance);
  if (summary.usable) return whole;
  // The mounts were moved so far that, with the start, points of the result lie behind a camera.
  return adjust_whole(held, start, tracks, options);
}

std::vector<ImageFit> fit_by_mount(const WholeBlock& block) {
  std::vector<ImageFit> fits(block.problem.mounts.size());
  const TileProblem& problem = block.problem;
  for (std::int64_t p = 0; p < problem.point_count(); ++p) {
    if (!problem.active(p)) continue;
    for (std::int64_t row = problem.begin[static_cast<std::size_t>(p)];
         row < problem.begin[static_cast<std::size_t>(p) + 1]; ++row) {
      if (!problem.kept[static_cast<std::size_t>(row)]) continue;
      const Eigen::Vector2d residual = image_difference_px(problem, block.state, p, row);
      const LocalImage image = problem.image[static_cast<std::size_t>(row)];
      const std::int32_t mount = problem.images[static_cast<std::size_t>(image.value)].mount;
      if (residual.allFinite()) fits[static_cast<std::size_t>(mount)].add(residual);
    }
  }
  return fits;
}

ImageFit total(const std::vector<ImageFit>& fits) {
  ImageFit sum;
  for (const ImageFit& fit : fits) sum.add(fit);
  return sum;
}

// The held-out tracks are intersected at the poses of the result: their residuals tell the fit of the rig without
// having been fitted.
double intersection_sigma_px(const Block& block, const BlockState& state, const TrackSet& tracks,
                             const AdjustOptions& options) {
  constexpr double kMedian = 1.1774100225;  // median of a Rayleigh distribution of sigma 1
  WholeBlock whole = whole_block(block, state, tracks, options.observations);
  triangulate_points(whole.problem, whole.state, options);
  std::vector<double> lengths;
  for (std::int64_t p = 0; p < whole.problem.point_count(); ++p) {
    if (!whole.problem.active(p)) continue;
    for (std::int64_t row = whole.problem.begin[static_cast<std::size_t>(p)];
         row < whole.problem.begin[static_cast<std::size_t>(p) + 1]; ++row) {
      if (!whole.problem.kept[static_cast<std::size_t>(row)]) continue;
      const double length = image_difference_px(whole.problem, whole.state, p, row).norm();
      if (std::isfinite(length)) lengths.push_back(length);
    }
  }
  if (lengths.empty()) return std::numeric_limits<double>::quiet_NaN();
  return median(lengths) / kMedian;
}

std::optional<PointFit> intersect_known_points(const Block& block, const BlockState& state,
                                               const std::vector<ControlPoint>& points, bool align,
                                               const AdjustOptions& options) {
  Block known = block;
  known.control_points = points;
  // As check points their positions do not act on the intersection.
  for (ControlPoint& point : known.control_points) point.role = PointRole::kCheck;
  TrackSet none;
  none.begin.push_back(0);
  WholeBlock whole = whole_block(known, state, none, options.observations);
  triangulate_points(whole.problem, whole.state, options);
  std::vector<Eigen::Vector3d> found, given;
  for (std::int64_t p = 0; p < whole.problem.point_count(); ++p) {
    const auto row = static_cast<std::size_t>(p);
    const Eigen::Vector3d& position = points[static_cast<std::size_t>(whole.problem.points[row].index)].position;
    if (!whole.problem.active(p) || !whole.state.points[row].allFinite() || !position.allFinite()) continue;
    found.push_back(whole.state.points[row]);
    given.push_back(position);
  }
  // A similarity has seven unknowns: three points fit it nearly, and only a fourth one tells an error.
  if (found.size() < (align ? 4u : 1u)) return std::nullopt;
  if (align) {
    // A free network has no datum. A similarity takes it away from the differences before they are summed.
    const auto move = fit_similarity(found, given);
    if (!move) return std::nullopt;
    for (Eigen::Vector3d& point : found) point = (*move)(point);
  }
  PointFit fit;
  fit.aligned = align;
  fit.points = std::ssize(found);
  double squares = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    const double length = (found[i] - given[i]).norm();
    squares += length * length;
    fit.mean_m += length / static_cast<double>(found.size());
    fit.largest_m = std::max(fit.largest_m, length);
  }
  fit.rms_m = std::sqrt(squares / static_cast<double>(found.size()));
  return fit;
}

}  // namespace megablock
