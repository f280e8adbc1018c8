// The whole block is adjusted as one tile. First some tracks are held out (every n-th, and control points too where
// there are many): the rig calibrated on the others is compared with the start on these, by the residuals of their
// intersections. Then all observations are adjusted together to the optimum of the global adjustment, which gives
// result and sigmas. In comparisons the other side is always adjusted as well, with the rig held: frames and points are
// at their best for each of the two rigs.
#include "merge/rig/rig_calibration.h"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "adjust/terms/linearise.h"
#include "geometry/numbers/angles.h"
#include "geometry/numbers/line_ratio.h"
#include "io/base/error.h"
#include "merge/plan/unknowns.h"
#include "merge/rig/rig_posterior.h"
#include "merge/tree/merge_in_memory.h"

namespace megablock {

namespace {

constexpr double kMinLineRatio = 0.02;  // spread across the line / along it; control points below it lie on one line
constexpr std::size_t kFewControl = 3;

BlockState state_of(const Block& block, const BlockState& start, const WholeBlock& whole) {
  BlockState state = start;
  store_tile_state(whole.problem, whole.state, state);
  state.oriented.assign(block.frames.size(), 0);
  for (const FrameIndex frame : whole.problem.frames) state.oriented[frame] = 1;
  return state;
}

// Compares the adjusted check points with their given positions, in metres. `normalised` is the root mean square of the
// differences over their sigmas, 1 where these are true: the variance of a difference is that of the adjusted point
// plus that of the given one. Without covariances it is 0.
std::optional<PointFit> check_points(const Block& block, const WholeBlock& whole,
                                     const std::vector<Eigen::Matrix3d>* covariances) {
  PointFit fit;
  double squares = 0, ratios = 0;
  for (std::int64_t p = 0; p < whole.problem.point_count(); ++p) {
    const TilePoint& point = whole.problem.points[at(p)];
    if (point.role != PointRole::kCheck || !whole.problem.active(p)) continue;
    const ControlPoint& given = block.control_points[at(point.index)];
    const Eigen::Vector3d off = whole.state.points[at(p)] - given.position;
    if (!off.allFinite()) continue;
    ++fit.points;
    squares += off.squaredNorm();
    fit.mean_m += off.norm();
    fit.largest_m = std::max(fit.largest_m, off.norm());
    if (covariances != nullptr) {
      const Eigen::Vector3d variance = (*covariances)[at(p)].diagonal() + given.sigma.cwiseAbs2();
      ratios += off.cwiseAbs2().cwiseQuotient(variance).sum();
    }
  }
  if (fit.points == 0) return std::nullopt;
  const auto n = static_cast<double>(fit.points);
  fit.rms_m = std::sqrt(squares / n);
  fit.mean_m /= n;
  fit.normalised = std::sqrt(ratios / (3 * n));
  return fit;
}

class RigCalibrator {
 public:
  RigCalibrator(const Block& block, const BlockState& start, const TrackSet& tracks,
                const RigCalibrationOptions& options)
      : given_(block), block_(calibration_block(block, options)), start_(start), options_(options) {
    none_.begin.push_back(0);
    tracks_ = options.mode == CalibrationMode::kOffLine ? &none_ : &tracks;
    result_.mode = mode_name(options.mode);
  }

  CalibratedRig run(const std::optional<VerificationSite>& verification) {
    const auto begun = std::chrono::steady_clock::now();
    check_input();
    need_points();
    compare_held_out();
    const WholeBlock whole = adjust();
    describe_mounts(whole);
    compare_with_start(whole);
    if (verification) verify(*verification);
    judge();
    result_.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
    return {std::move(result_), std::move(state_)};
  }

 private:
  // Control points on one line leave the rotation about it to the images. Off-line there is nothing else that could
  // tell it, so this is an error there and a warning on-line.
  void check_input() {
    if (options_.mode == CalibrationMode::kOnLine && tracks_->track_count() == 0)
      throw InputError("there are no tie points: on-line calibration needs them; give 'tie_points' or images");
    std::vector<Eigen::Vector3d> control;
    for (const ControlPoint& point : block_.control_points)
      if (point.role == PointRole::kControl && point.position.allFinite() && !point.measurements.empty())
        control.push_back(point.position);
    const bool line = control.size() < kFewControl || line_ratio(control) < kMinLineRatio;
    if (options_.mode == CalibrationMode::kOffLine && line)
      throw InputError(
          control.size() < kFewControl
              ? fmt::format("there are {} measured control points: off-line calibration needs at least {}, not on one "
                            "line; give 'control' in the project file, or --mode on-line",
                            control.size(), kFewControl)
              : fmt::format("the {} control points lie on one straight line, about which the rig could turn freely; "
                            "measure targets off the line, or calibrate on-line",
                            control.size()));
    if (control.size() >= kFewControl && line)
      warn(
          fmt::format("the {} control points lie on one straight line: they do not give the rotation about it; "
                      "measure one off the line",
                      control.size()));
  }

  // Throws InputError when no point can be intersected, as with a rig that did not move.
  void need_points() const {
    WholeBlock whole = whole_block(block_, start_, *tracks_, options_.adjustment.observations);
    triangulate_points(whole.problem, whole.state, options_.adjustment);
    for (std::int64_t p = 0; p < whole.problem.point_count(); ++p)
      if (whole.problem.active(p)) return;
    throw InputError(
        fmt::format("no point is seen from two places that lie apart (rays of all meet at less than {} degrees): the "
                    "vehicle must move, or targets be measured for --mode off-line",
                    options_.adjustment.min_intersection_deg));
  }

  // Holds out tracks, adjusts the others, and compares result and start on the tracks that were held out.
  void compare_held_out() {
    // At least half of the tracks stay in the adjustment.
    const std::int64_t every =
        options_.held_out_share > 0 ? std::llround(std::max(2.0, 1 / options_.held_out_share)) : 0;
    if (every == 0) return;
    Block training = block_, left_out = block_;
    left_out.control_points.clear();
    training.control_points.clear();
    // Control points are held out as well where there are many.
    const bool many = std::ssize(block_.control_points) >= 4 * every;
    for (std::size_t p = 0; p < block_.control_points.size(); ++p) {
      const bool out = many && static_cast<std::int64_t>(p) % every == every / 2;
      (out ? left_out : training).control_points.push_back(block_.control_points[p]);
    }
    for (ControlPoint& point : left_out.control_points) point.role = PointRole::kCheck;
    const TrackSet kept = select_tracks(*tracks_, every, false), out = select_tracks(*tracks_, every, true);
    result_.held_out = out.track_count() + std::ssize(left_out.control_points);
    if (result_.held_out == 0) return;
    const WholeBlock after = adjust_whole(training, start_, kept, options_.adjustment);
    const WholeBlock before = adjust_with_rig_held(training, start_, after, kept, options_.adjustment);
    result_.held_out_px = intersection_sigma_px(left_out, state_of(block_, start_, after), out, options_.adjustment);
    result_.held_out_before_px =
        intersection_sigma_px(left_out, state_of(block_, start_, before), out, options_.adjustment);
    // The full adjustment starts from here: most of its observations have already been used.
    warm_start_ = state_of(block_, start_, after);
    warm_start_.oriented = start_.oriented;
  }

  // Adjusts all observations to the optimum.
  WholeBlock adjust() {
    WholeBlock whole = adjust_whole(block_, result_.held_out > 0 ? warm_start_ : start_, *tracks_, options_.adjustment);
    MergeInMemory runner(single_tile(block_).tree, {whole.problem}, {whole.state});
    GlobalOptions global;
    global.max_iterations = options_.max_iterations;
    GlobalState progress = start_global(global);
    adjust_globally(runner, global, progress);
    if (progress.outcome != GlobalOutcome::kConverged && progress.outcome != GlobalOutcome::kRoundingFloor)
      warn("the adjustment has not converged (" + describe(progress) +
           "): too few observations determine it; hold the cameras (--hold-intrinsics), state sigmas of the mounts, or "
           "measure "
           "more");
    const SubtreeSums sums = runner.final_up().sums;
    whole.state = runner.states().front();
    const std::vector<TileCovariance> covariances = runner.covariances();
    state_ = state_of(block_, start_, whole);

    result_.iterations = progress.iterations;
    result_.frames = std::ssize(whole.problem.frames);
    for (std::int64_t p = 0; p < whole.problem.point_count(); ++p) {
      if (!whole.problem.active(p)) continue;
      ++(whole.problem.points[at(p)].role == PointRole::kControl ? result_.control_points : result_.points);
    }
    // Residuals less unknowns. Held unknowns take no degree of freedom, and neither do the free directions of the
    // datum.
    const std::int64_t redundancy =
        sums.residuals - sums.unknowns + std::ssize(sums.held) + sums.held_points + runner.block_gauge().defect();
    // Image observations alone; their redundancy numbers add up to their part of the degrees of freedom.
    result_.residuals = 2 * sums.observations;
    result_.redundancy = 0;
    for (const ObservationKind kind :
         {ObservationKind::kTieImage, ObservationKind::kControlImage, ObservationKind::kCheckImage})
      result_.redundancy += covariances.front().observations[kind].redundancy;
    result_.sigma0 = redundancy > 0 ? std::sqrt(sums.weighted_squares / static_cast<double>(redundancy)) : 0;
    result_.image_sigma_px = whole.problem.image_sigma_px;
    free_datum_ = runner.block_gauge().free();
    result_.gauge =
        free_datum_ ? fmt::format("free network of {} frames, defect {}", result_.frames, runner.block_gauge().defect())
                    : "fixed by control and priors";
    if (free_datum_ && result_.control_points > 0)
      warn("control and priors do not fix the datum (" + result_.gauge +
           "): positions are good up to it, the mounts do not depend on it; measure control points off one line");
    describe_cameras(whole, covariances.front());
    if (!free_datum_) result_.after.check_points = check_points(block_, whole, &covariances.front().points);
    return whole;
  }

  void describe_cameras(const WholeBlock& whole, const TileCovariance& covariance) {
    for (CameraIndex c(0); block_.cameras.contains(c); ++c.value) {
      CameraCalibration camera{block_.cameras[c].name, start_.cameras[c], state_.cameras[c]};
      const auto row = std::lower_bound(whole.problem.cameras.begin(), whole.problem.cameras.end(), c) -
                       whole.problem.cameras.begin();
      if (row < std::ssize(whole.problem.cameras) && whole.problem.cameras[at(row)] == c)
        for (int k = 0; k < camera.intrinsics.size(); ++k)
          camera.sigma[static_cast<std::size_t>(k)] = std::sqrt(std::max(0.0, covariance.cameras[at(row)](k, k)));
      result_.cameras.push_back(camera);
    }
  }

  // A rig of a single camera has nothing to calibrate.
  void describe_mounts(const WholeBlock& whole) {
    for (RigIndex rig(0); block_.rigs.contains(rig); ++rig.value) {
      if (block_.rigs[rig].cameras().size() < 2) continue;
      for (std::size_t m = 0; m < block_.rigs[rig].cameras().size(); ++m) {
        const Mount& mount = block_.rigs[rig].mounts[m];
        MountCalibration row;
        row.rig = rig;
        row.mount = static_cast<std::int32_t>(m);
        row.camera = mount.camera;
        row.name = mount_name(block_, rig, row.mount);
        row.held = mount.held();
        row.start = start_.mounts[rig][m];
        row.pose = state_.mounts[rig][m];
        row.field = ResidualField(block_.cameras[mount.camera]);
        result_.mounts.push_back(row);
      }
    }
    const RigPosterior posterior = rig_posterior(whole.problem, whole.state, options_.mounts == MountFreedom::kFree);
    for (const RigPosterior::MountPosterior& p : posterior.mounts) {
      const MountId& id = whole.problem.mounts[at(p.mount)];
      MountCalibration* row = row_of(id);
      if (row == nullptr) continue;
      row->covariance = p.covariance;
      row->rotation_determined = p.rotation_determined;
      row->position_determined = p.position_determined;
    }
    if (!posterior.scale_determined)
      result_.gauge += "; the rig keeps the scale of its start, which no measurement gives";
    count_measurements(whole);
    for (const MountCalibration& mount : result_.mounts) warn_of(mount);
  }

  MountCalibration* row_of(const MountId& id) {
    for (MountCalibration& row : result_.mounts)
      if (row.rig == id.rig && row.mount == id.mount) return &row;
    return nullptr;
  }

  void count_measurements(const WholeBlock& whole) {
    const TileProblem& problem = whole.problem;
    std::vector<std::uint8_t> seen(problem.images.size(), 0);
    for (std::int64_t p = 0; p < problem.point_count(); ++p) {
      if (!problem.active(p)) continue;
      for (std::int64_t o = problem.begin[at(p)]; o < problem.begin[at(p) + 1]; ++o) {
        if (!problem.kept[at(o)]) continue;
        const std::size_t local = at(problem.image[at(o)].value);
        const TileImage& image = problem.images[local];
        MountCalibration* row = row_of(problem.mounts[at(image.mount)]);
        if (row == nullptr) continue;
        row->images += !seen[local];
        seen[local] = 1;
        const Camera& camera = block_.cameras[row->camera];
        const Eigen::Vector2d pixel(problem.x[at(o)], problem.y[at(o)]);
        row->field.add(camera, pixel, image_difference_px(problem, whole.state, p, o));
        ++row->quadrant[static_cast<std::size_t>((pixel.y() < camera.height / 2.0 ? 0 : 2) +
                                                 (pixel.x() < camera.width / 2.0 ? 0 : 1))];
      }
    }
  }

  void warn(const std::string& text) { result_.warnings.push_back(text); }

  void warn_of(const MountCalibration& mount) {
    std::string empty;
    for (std::size_t q = 0; q < 4; ++q)
      if (mount.quadrant[q] < options_.min_quadrant_measurements)
        empty += (empty.empty() ? "" : ", ") + std::string(kQuadrants[q]);
    if (mount.field.observations == 0)
      warn(mount.name + ": no measurement takes part; its mount stays at the start");
    else if (!empty.empty())
      warn(mount.name + ": hardly any measurements in the sensor's quadrant " + empty +
           "; drive so that the camera sees points all over its image");
    if (mount.held || mount.field.observations == 0) return;
    if (!mount.position_determined || !mount.rotation_determined) {
      warn(fmt::format(
          "{}: the measurements do not determine the {} of its mount; it follows from its start. Drive curves "
          "(an S or a loop), so that several cameras see the same points in turn, or measure targets that "
          "it sees",
          mount.name,
          !mount.position_determined && !mount.rotation_determined ? "position and the rotation"
          : mount.position_determined                              ? "rotation"
                                                                   : "position"));
      return;
    }
    std::string weak;
    if (mount.position_sigma_m() > options_.max_position_sigma_m)
      weak = fmt::format(" of its position {:.1f} mm (bound {:.1f})", 1e3 * mount.position_sigma_m(),
                         1e3 * options_.max_position_sigma_m);
    if (mount.rotation_sigma_rad() > kDegree * options_.max_rotation_sigma_deg)
      weak += fmt::format("{} of its rotation {:.3f} degrees (bound {:.3f})", weak.empty() ? "" : ",",
                          mount.rotation_sigma_rad() / kDegree, options_.max_rotation_sigma_deg);
    if (!weak.empty())
      warn(mount.name + ": posterior sigma" + weak + "; measure more points, or hold the cameras (--hold-intrinsics)");
  }

  // The result is compared with the rig held at the start, with frames and points adjusted to it. Both use the
  // observations that the result keeps.
  void compare_with_start(const WholeBlock& whole) {
    const WholeBlock before = adjust_with_rig_held(block_, start_, whole, *tracks_, options_.adjustment);
    const std::vector<ImageFit> fits = fit_by_mount(whole), earlier = fit_by_mount(before);
    for (std::size_t m = 0; m < fits.size(); ++m)
      if (MountCalibration* row = row_of(whole.problem.mounts[m])) row->after = fits[m], row->before = earlier[m];
    result_.after.images = total(fits);
    result_.before.images = total(earlier);
    if (free_datum_) {
      result_.after.check_points =
          intersect_known_points(block_, state_, given_.control_points, true, options_.adjustment);
      result_.before.check_points = intersect_known_points(block_, state_of(block_, start_, before),
                                                           given_.control_points, true, options_.adjustment);
    } else {
      result_.before.check_points = check_points(block_, before, nullptr);
    }
  }

  // Adjusts frames and points of the other site twice: with the rig held at the start, and held at the result.
  void verify(const VerificationSite& site) {
    RigCalibration earlier = result_;
    for (MountCalibration& mount : earlier.mounts) mount.pose = mount.start;
    for (CameraCalibration& camera : earlier.cameras) camera.intrinsics = camera.start;
    result_.verification_before = fit_on(site, earlier);
    result_.verification = fit_on(site, result_);
  }

  // Adjusts the other site with the calibration held, and compares its check points: by the adjustment where the datum
  // is fixed, else after a similarity.
  RigFit fit_on(const VerificationSite& site, const RigCalibration& calibration) const {
    Block block = site.block;
    apply_calibration(calibration, true, block);
    const BlockState start = initial_state(block);
    WholeBlock whole = adjust_whole(block, start, site.tracks, options_.adjustment);
    MergeInMemory runner(single_tile(block).tree, {whole.problem}, {whole.state});
    runner.final_up();
    const std::vector<TileCovariance> covariances = runner.covariances();
    RigFit fit;
    fit.images = total(fit_by_mount(whole));
    if (runner.block_gauge().free()) {
      const BlockState state = state_of(block, start, whole);
      fit.check_points = intersect_known_points(block, state, block.control_points, true, options_.adjustment);
    } else {
      fit.check_points = check_points(block, whole, &covariances.front().points);
    }
    return fit;
  }

  // Refuses a result that fits observations it has not seen worse than the start does: those of the other site if there
  // is one, else those that were held out, and check points.
  void judge() {
    const auto refuse = [&](const char* where, double before, double after, const char* unit) {
      if (!(after > options_.largest_ratio * before) || !result_.refused.empty()) return;
      result_.refused = fmt::format("{} {:.3f} {} with the calibration and {:.3f} {} with the start", where, after,
                                    unit, before, unit);
    };
    if (result_.verification) {
      refuse("residuals on the verification site are", result_.verification_before->images.rms_px(),
             result_.verification->images.rms_px(), "px");
      const auto &before = result_.verification_before->check_points, &after = result_.verification->check_points;
      if (before && after) refuse("check points of the verification site are off by", before->rms_m, after->rms_m, "m");
      return;
    }
    if (result_.held_out > 0)
      refuse("measurements held out fit to", result_.held_out_before_px, result_.held_out_px, "px");
    const auto &before = result_.before.check_points, &after = result_.after.check_points;
    if (before && after) refuse("check points are off by", before->rms_m, after->rms_m, "m");
  }

  const Block& given_;
  const Block block_;
  const BlockState& start_;
  const TrackSet* tracks_;
  TrackSet none_;
  const RigCalibrationOptions& options_;
  BlockState warm_start_, state_;
  bool free_datum_ = false;
  RigCalibration result_;
};

}  // namespace

CalibratedRig calibrate_rig(const Block& block, const BlockState& start, const TrackSet& tracks,
                            const RigCalibrationOptions& options, const std::optional<VerificationSite>& verification) {
  options.check();
  return RigCalibrator(block, start, tracks, options).run(verification);
}

}  // namespace megablock
