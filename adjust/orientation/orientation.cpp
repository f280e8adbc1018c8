// Orients the block in the steps of run(). Each leaves for the next one:
//
//     average()          rotations of the frames from those of the pairs; pairs that disagree are dropped
//     first_centres()    directions and lengths of the baselines, and centres from them, up to a similarity
//     check_verticals()  wrong verticals are set aside; the first two steps are repeated with the others
//     to_ground()        a similarity to the observed positions; the centres are solved once more with them
//     shape_by_images()  instead of it where fewer than half of the positions fit, or where they turn the block over:
//                        the steps below without positions, then the similarity, unless the positions are mirrored
//     position()         centres and points from the rays alone, rotations held
//     adjust()           three adjustments of everything, with limits of 25, 10 and 4 px
//
// Errors are angles between rays, so that points need not be projected; a limit in pixels is divided by the smallest
// focal length. The limits fall with the errors that are left: averaged rotations are good to a degree, the coarse
// adjustments to some pixels.
#include "adjust/orientation/orientation.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "adjust/orientation/graph_verticals.h"
#include "adjust/orientation/mirrored_lists.h"
#include "adjust/orientation/orientation_parts.h"
#include "adjust/orientation/steps/baselines.h"
#include "adjust/orientation/steps/coarse_adjustment.h"
#include "adjust/orientation/steps/global_positioning.h"
#include "adjust/orientation/steps/ground_alignment.h"
#include "adjust/orientation/steps/orientation_graph.h"
#include "adjust/orientation/steps/resection.h"
#include "adjust/orientation/steps/rotation_averaging.h"
#include "adjust/orientation/vertical_check.h"
#include "geometry/numbers/angles.h"
#include "io/base/error.h"

namespace megablock {

namespace {

// Runs the steps for one component. Each step improves `values_`.
class Orientation {
 public:
  Orientation(const Block& block, const BlockState& start, const OrientationOptions& options, OrientationGraph graph)
      : block_(block), options_(options), graph_(std::move(graph)) {
    values_.frames.resize(graph_.frames.size());
    reasons_.assign(graph_.frames.size(), "no verified pair links it to the rest");
    for (CameraIndex camera : graph_.cameras) values_.cameras.push_back(start.cameras[camera]);
    for (const auto& frame : graph_.frames) {
      any_position_ |= frame.position.has_value();
      any_given_ |= frame.given.has_value();
    }
    known_angles_ = known_angles(graph_);
  }

  void run() {
    rays_ = viewing_rays(graph_, values_.cameras);
    average();
    first_centres();
    if (check_verticals()) {
      use_verticals_ = true;
      average();
      first_centres();
    }
    const auto similarity = ground_similarity();
    if (similarity && !any_given_ && shape_by_images(*similarity)) return;
    if (similarity) to_ground(*similarity);
    position();
    adjust();
    if (!in_ground_) move(similarity_to_free_frame(graph_, values_, known_angles_, metric_rigs()));
  }

  // Frames without a pose get the reason of the last step that lost them.
  OrientationResult result(const BlockState& start) const {
    OrientationResult result;
    result.state = start;
    std::int64_t oriented = 0, points = 0;
    for (std::size_t f = 0; f < graph_.frames.size(); ++f) {
      const FrameIndex index = graph_.frames[f].index;
      if (values_.frames[f]) {
        result.state.frames[index] = *values_.frames[f];
        result.state.oriented[index] = 1;
        ++oriented;
      } else {
        result.state.oriented[index] = 0;
        result.failed.emplace_back(index, reasons_[f]);
      }
    }
    std::sort(result.failed.begin(), result.failed.end());
    result.verticals_aside = aside_;
    std::sort(result.verticals_aside.begin(), result.verticals_aside.end(),
              [](const SetAsideVertical& a, const SetAsideVertical& b) { return a.image < b.image; });
    for (std::size_t c = 0; c < graph_.cameras.size(); ++c)
      result.state.cameras[graph_.cameras[c]] = values_.cameras[c];
    for (const auto& point : values_.points) points += point.has_value();
    std::ostringstream text;
    text << oriented << " of " << graph_.frames.size() << " frames oriented, " << points << " points, "
         << (in_ground_ ? "ground frame" : "free block") << ", " << dropped_edges_ << " of " << graph_.edges.size()
         << " relative rotations dropped";
    result.summary = text.str();
    return result;
  }

 private:
  // The relative rotations of the pairs of images as rotations between their frames.
  std::vector<RelativeRotation> relative_rotations() const {
    std::vector<RelativeRotation> relative;
    for (const auto& edge : graph_.edges) {
      const auto &a = graph_.images[row(edge.a)], &b = graph_.images[row(edge.b)];
      // R_ab turns camera a into camera b. Between the frames it is M_b' R_ab M_a, with M the rotation of a mount.
      relative.push_back({a.frame, b.frame, b.mount.rotation.conjugate() * edge.rotation * a.mount.rotation,
                          edge.inliers, edge.rotation_sigma});
    }
    return relative;
  }

  // Given poses are held (sigma 0); attitudes are priors of their own sigma. Edges farther than max_rotation_error_deg
  // from the average take no part in what follows.
  void average() {
    const std::vector<RelativeRotation> relative = relative_rotations();
    std::vector<std::optional<RotationPrior>> priors(graph_.frames.size());
    for (std::size_t f = 0; f < priors.size(); ++f) {
      const auto& frame = graph_.frames[f];
      if (frame.given)
        priors[f] = {frame.given->rotation, 0.0};
      else if (frame.attitude)
        // A sigma of zero would hold the rotation; 1e-4 rad is far below the errors of averaged rotations.
        priors[f] = {frame.attitude->rotation_cw, std::max(1e-4, frame.attitude->sigma_rad.norm())};
    }
    const AveragedRotations averaged =
        average_rotations(graph_.frame_count(), relative, priors, options_.max_rotation_error_deg * kDegree,
                          use_verticals_ ? known_verticals(block_, graph_, values_) : std::vector<KnownVertical>());
    usable_ = averaged.kept;
    dropped_edges_ = std::count(usable_.begin(), usable_.end(), 0);
    rotations_ = averaged.rotation;
    for (std::size_t f = 0; f < rotations_.size(); ++f)
      if (rotations_[f]) reasons_[f] = "no baseline to other images could be measured";
  }

  // Sets aside the verticals that contradict the rotations averaged without them, the positions or the attitudes.
  // Returns whether any are left.
  // The verticals are judged by rotations that were averaged without them; verticals that confirm each other through
  // the average would judge themselves.
  bool check_verticals() {
    const auto [seen, images] = seen_verticals(block_, graph_, values_);
    if (seen.empty()) return false;
    const std::vector<VerticalVerdict> verdicts = judge_verticals(rotations_, relative_rotations(), usable_, seen,
                                                                  known_down(block_, graph_, values_, known_angles_));
    for (std::size_t v = 0; v < verdicts.size(); ++v) {
      if (verdicts[v] == VerticalVerdict::kBelieved) continue;
      auto& image = graph_.images[images[v]];
      aside_.push_back({image.index, verdicts[v]});
      image.vertical = nullptr;
    }
    known_angles_ = known_angles(graph_);
    return aside_.size() < seen.size();
  }

  void first_centres() {
    std::vector<std::optional<Eigen::Quaterniond>> image_rotations;
    for (const auto& image : graph_.images) {
      const auto& frame = rotations_[row(image.frame)];
      image_rotations.push_back(frame ? std::optional(image.mount.rotation * *frame) : std::nullopt);
    }
    baselines_ = measure_baselines(graph_, image_rotations, usable_, rays_);
    centres_from_baselines(1, {}, {});
  }

  // Projection centres of the frames from the baselines times `scale`. Mounts count only where the scale is metric,
  // that is, where `known` holds priors.
  void centres_from_baselines(double scale, const std::vector<std::optional<CentrePrior>>& known,
                              const std::vector<std::optional<Eigen::Vector3d>>& start) {
    constexpr double kRelativeSigma = 0.1;  // of a baseline, besides the noise of its matches
    std::vector<CentreDifference> differences;
    for (const Baseline& baseline : baselines_) {
      const auto &a = graph_.images[row(baseline.a)], &b = graph_.images[row(baseline.b)];
      Eigen::Vector3d offset = scale * baseline.length * baseline.direction;
      // A baseline joins two cameras; the difference of two frames lacks the arms of their mounts, in ground axes.
      if (!known.empty())
        offset += rotations_[row(a.frame)]->conjugate() * a.mount.centre -
                  rotations_[row(b.frame)]->conjugate() * b.mount.centre;
      differences.push_back(
          // The length of a baseline follows from ratios of depths, so that its error grows with the length.
          {a.frame, b.frame, offset, std::hypot(kRelativeSigma, baseline.sigma) * scale * baseline.length});
    }
    auto priors = known;
    priors.resize(graph_.frames.size());
    const auto centres = solve_centres(graph_.frame_count(), differences, priors, start);
    const bool linked = !baselines_.empty();
    for (std::size_t f = 0; f < centres.size(); ++f) {
      values_.frames[f].reset();
      // Without any baseline solve_centres() puts all free nodes at the origin. Only the frames with priors then have a
      // centre.
      if (rotations_[f] && centres[f] && (linked || priors[f])) values_.frames[f] = Pose{*rotations_[f], *centres[f]};
    }
  }

  // From the centres to the observed positions.
  std::optional<Similarity> ground_similarity() {
    if (!any_position_) return std::nullopt;
    intersect(3 * kDegree, 1 * kDegree);
    return similarity_of_points();
  }
  std::optional<Similarity> similarity_of_points() const {
    // The median distance of the points tells an aerial block from a street, where positions on a line leave it open.
    const double distance =
        median_of_kept([](const Eigen::Vector3d&, const Eigen::Vector3d& inside) { return inside.norm(); });
    return similarity_to_ground(graph_, values_, distance, known_angles_);
  }

  // A narrow image hardly tells a small turn from a shift, so that the first centres of such images may be bent until
  // hardly any position fits them, and the few that fit would turn the block anyhow. The images together give the shape
  // of the block then, and the positions its place. Positions with east and north exchanged turn a flat block over, or
  // do not fit: where the shape shows them to be mirrored, the block stays free. Returns whether this was needed, and
  // the positions are mirrored or more of them fit in the end; otherwise nothing changes.
  bool shape_by_images(const Similarity& of_first_centres) {
    constexpr double kMost = 0.5;  // share of the positions
    const double first = share_that_fits(graph_, values_, of_first_centres);
    const bool fits = first >= kMost;
    if (fits && !turns_over(of_first_centres)) return false;
    const OrientationValues values = values_;
    const std::vector<std::string> reasons = reasons_;
    try {
      position();
      adjust();
      if (mirrored_positions()) {
        move(similarity_to_free_frame(graph_, values_, known_angles_, metric_rigs()));
        return true;
      }
      const auto similarity = similarity_of_points();
      if (!fits && similarity && share_that_fits(graph_, values_, *similarity) > first) {
        move(*similarity);
        in_ground_ = true;
        return true;
      }
    } catch (const ComputeError&) {
      // The images alone do not hold the block together.
    }
    values_ = values;
    reasons_ = reasons;
    rays_ = viewing_rays(graph_, values_.cameras);
    return false;
  }

  // Whether the images look up, or stand on their heads, after a similarity.
  bool turns_over(const Similarity& similarity) const {
    constexpr double kClear = 0.3;
    const MeanAxes axes = mean_axes(graph_, values_);
    return (similarity.rotation * (axes.view + axes.down)).z() > kClear;
  }

  bool mirrored_positions() const {
    std::vector<FramePosition> positions;
    for (std::size_t f = 0; f < graph_.frames.size(); ++f)
      if (values_.frames[f] && graph_.frames[f].position)
        positions.push_back({values_.frames[f]->centre, *graph_.frames[f].position});
    return find_mirrored_positions(positions, mean_axes(graph_, values_)).has_value();
  }

  // Transforms rotations and centres to the observed positions and solves the centres once more with these as priors.
  void to_ground(const Similarity& similarity) {
    in_ground_ = true;
    for (auto& rotation : rotations_)
      // R takes axes of the ground now; X_old = S' (X - t) / s leads to R S'.
      if (rotation) rotation = (*rotation * similarity.rotation.conjugate()).normalized();
    for (Baseline& baseline : baselines_) baseline.direction = similarity.rotation * baseline.direction;
    std::vector<std::optional<CentrePrior>> priors(graph_.frames.size());
    std::vector<std::optional<Eigen::Vector3d>> start(graph_.frames.size());
    for (std::size_t f = 0; f < priors.size(); ++f) {
      const auto& node = graph_.frames[f];
      if (node.given) rotations_[f] = node.given->rotation;
      if (node.position && rotations_[f]) {
        // The antenna is at C + R' l.
        const Eigen::Vector3d arm = rotations_[f]->conjugate() * node.position->lever_arm;
        priors[f] = CentrePrior{node.position->position - arm, node.position->sigma};
        start[f] = priors[f]->position;
      }
      if (values_.frames[f]) start[f] = similarity(values_.frames[f]->centre);
    }
    centres_from_baselines(similarity.scale, priors, start);
    restore_given();
  }

  void position() {
    // The second run has half the limit and half the sigma of the rays, because the first one has removed the bend of
    // the centres from the baselines.
    for (const auto& [limit, sigma] : {std::pair(3.0, 0.01), std::pair(1.5, 0.005)}) {
      intersect(limit * kDegree, 1 * kDegree);
      PositioningOptions positioning;
      positioning.ray_sigma_rad = sigma;
      positioning.use_positions = in_ground_;
      position_globally(graph_, rays_, positioning, values_);
    }
  }

  void adjust() {
    struct Round {
      double limit_px;
      int radial_terms;  // refined, besides the focal length
    };
    for (const Round& round : {Round{25, 0}, Round{10, 1}, Round{4, 2}}) {
      rays_ = viewing_rays(graph_, values_.cameras);
      const double limit = intersect_within(round.limit_px);
      drop_weak_frames();
      if (round.limit_px < 25) resect(limit);
      if (oriented() < 2) throw ComputeError("fewer than two images could be oriented");
      CoarseOptions coarse;
      coarse.observations = options_.observations;
      coarse.use_positions = in_ground_;
      // Observations at the limit have three times Cauchy's scale, and a tenth of the weight.
      coarse.loss_scale_px = limit * smallest_focal() / 3;
      // The next round changes what takes part, so that the first two need not converge.
      if (round.limit_px > 4) coarse.function_tolerance = 1e-3;
      // The three rounds estimate the focal length of unknown cameras, then every focal length and one radial term,
      // then two.
      coarse.camera_free = free_intrinsics(round.radial_terms, round.limit_px >= 25);
      adjust_coarsely(block_, graph_, coarse, values_);
      check_focals();
    }
    rays_ = viewing_rays(graph_, values_.cameras);
    intersect_within(4);
    drop_weak_frames();
    if (oriented() < 2) throw ComputeError("fewer than two images could be oriented");
  }

  // Intersects the tracks with a limit in pixels and returns the limit in radians. Given poses may be approximate and
  // do not move; with them the limit is at least four times the median error.
  double intersect_within(double limit_px) {
    double limit = limit_px / smallest_focal();
    if (any_given_) {
      intersect(3 * kDegree, 1 * kDegree);
      limit = std::max(limit, 4 * median_of_kept([](const Eigen::Vector3d& ray, const Eigen::Vector3d& inside) {
                                return (ray - inside.normalized()).norm();
                              }));
    }
    intersect(limit, 1 * kDegree);
    return limit;
  }

  // Resects the frames that have no pose yet from the intersected points, and repeats while new frames come in.
  void resect(double limit) {
    while (true) {
      std::int64_t found = 0;
      for (std::int32_t f = 0; f < graph_.frame_count(); ++f) {
        if (values_.frames[row(f)]) continue;
        values_.frames[row(f)] = resect_frame(graph_, rays_, f, limit, options_.min_points_per_image, values_);
        found += values_.frames[row(f)].has_value();
      }
      if (found == 0) return;
      intersect(limit, 1 * kDegree);
      // Frames that come in and go out again would let the loop go on without end.
      if (drop_weak_frames() >= found) return;
    }
  }

  // Takes the pose from frames with too few points and returns their number. A dropped frame may leave others with too
  // few, so the test repeats.
  std::int64_t drop_weak_frames() {
    std::int64_t dropped = 0;
    while (true) {
      std::vector<std::int64_t> count(graph_.frames.size(), 0);
      for (std::size_t t = 0; t < values_.points.size(); ++t)
        for (auto o = graph_.begin[t]; values_.points[t] && o < graph_.begin[t + 1]; ++o)
          if (const auto i = static_cast<std::size_t>(o); values_.kept[i])
            ++count[row(graph_.images[row(graph_.observations[i].image)].frame)];
      std::vector<std::size_t> weak;
      for (std::size_t f = 0; f < count.size(); ++f)
        if (values_.frames[f] && !graph_.frames[f].given && count[f] < options_.min_points_per_image) weak.push_back(f);
      if (weak.empty()) return dropped;
      for (std::size_t f : weak) {
        values_.frames[f].reset();
        reasons_[f] = "only " + std::to_string(count[f]) + " of its points could be intersected";
      }
      dropped += static_cast<std::int64_t>(weak.size());
      remove_observations_without_pose();
    }
  }

  void remove_observations_without_pose() {
    for (std::size_t t = 0; t < values_.points.size(); ++t) {
      int kept = 0;
      for (auto o = static_cast<std::size_t>(graph_.begin[t]); o < static_cast<std::size_t>(graph_.begin[t + 1]); ++o) {
        if (!values_.frames[row(graph_.images[row(graph_.observations[o].image)].frame)]) values_.kept[o] = 0;
        kept += values_.kept[o];
      }
      if (kept < 2) values_.points[t].reset();
    }
  }

  std::vector<ParameterMask> free_intrinsics(int terms, bool unknown_focal_only) const {
    constexpr std::size_t kFewestFrames = 4;
    std::vector<ParameterMask> result(graph_.cameras.size(), 0);
    if (oriented() < kFewestFrames || any_given_) return result;  // given poses belong to the given cameras
    for (std::size_t c = 0; c < result.size(); ++c) {
      const Camera& camera = block_.cameras[graph_.cameras[c]];
      if (unknown_focal_only && camera.focal_known) continue;
      const ParameterMask wanted = mask_of(kFocal) | radial_terms(camera.intrinsics.model(), terms);
      for (int k = 0; k < camera.intrinsics.size(); ++k)
        if (camera.prior_sigma[static_cast<std::size_t>(k)] > 0) result[c] |= wanted & mask_of(k);
    }
    return result;
  }

  // Resets a camera whose focal length left the range of 0.2 to 10 times the longer side of its image. Fisheyes and
  // panoramas are exempt.
  void check_focals() {
    for (std::size_t c = 0; c < values_.cameras.size(); ++c) {
      const Camera& camera = block_.cameras[graph_.cameras[c]];
      const double ratio = values_.cameras[c][kFocal] / std::max(camera.width, camera.height);
      if (sees_sideways(camera.intrinsics.model())) continue;
      if (!(ratio > 0.2 && ratio < 10)) values_.cameras[c] = camera.intrinsics;
    }
  }

  void intersect(double max_error_rad, double min_intersection_rad) {
    intersect_tracks(graph_, rays_, {max_error_rad, min_intersection_rad}, values_);
  }

  // Median over the kept observations of a function of the ray and the point, both in camera axes; 0 without any.
  template <typename Function>
  double median_of_kept(Function function) const {
    std::vector<double> results;
    for (std::size_t t = 0; t < values_.points.size(); ++t)
      for (auto o = static_cast<std::size_t>(graph_.begin[t]);
           values_.points[t] && o < static_cast<std::size_t>(graph_.begin[t + 1]); ++o)
        if (values_.kept[o]) {
          const Pose camera = *values_.camera(graph_, graph_.observations[o].image);
          results.push_back(function(rays_[o], to_inside(camera, *values_.points[t])));
        }
    if (results.empty()) return 0;
    const auto middle = results.begin() + static_cast<std::ptrdiff_t>(results.size() / 2);
    std::nth_element(results.begin(), middle, results.end());
    return *middle;
  }

  double smallest_focal() const {
    double focal = std::numeric_limits<double>::infinity();
    for (const Intrinsics& camera : values_.cameras) focal = std::min(focal, camera[kFocal]);
    return focal;
  }

  std::size_t oriented() const {
    return static_cast<std::size_t>(
        std::count_if(values_.frames.begin(), values_.frames.end(), [](const auto& f) { return f.has_value(); }));
  }

  bool metric_rigs() const {
    return std::any_of(graph_.images.begin(), graph_.images.end(),
                       [](const auto& image) { return image.mount.centre.norm() > 0; });
  }

  void move(const Similarity& similarity) {
    for (auto& frame : values_.frames)
      if (frame) frame = similarity(*frame);
    for (auto& point : values_.points)
      if (point) point = similarity(*point);
  }

  void restore_given() {
    for (std::size_t f = 0; f < graph_.frames.size(); ++f)
      if (graph_.frames[f].given) values_.frames[f] = graph_.frames[f].given;
  }

  const Block& block_;
  const OrientationOptions& options_;
  OrientationGraph graph_;
  OrientationValues values_;
  std::vector<Eigen::Vector3d> rays_;                         // [observations] camera axes
  std::vector<std::optional<Eigen::Quaterniond>> rotations_;  // [frames]
  std::vector<std::uint8_t> usable_;                          // [edges]
  std::vector<Baseline> baselines_;
  std::vector<std::string> reasons_;  // [frames] why it has no pose
  std::vector<SetAsideVertical> aside_;
  std::int64_t dropped_edges_ = 0;
  bool any_position_ = false, any_given_ = false, in_ground_ = false, use_verticals_ = false;
  GroundAngles known_angles_ = GroundAngles::kNone;
};

}  // namespace

OrientationResult orient_component(const Block& block, const BlockState& start, const std::vector<FrameIndex>& frames,
                                   const std::vector<VerifiedPair>& pairs, const TrackSet& tracks,
                                   const OrientationOptions& options) {
  options.check();
  if (frames.size() < 2) throw ComputeError("a component needs at least two frames");
  const auto placed = [&](FrameIndex frame) {
    return start.oriented[frame] ||
           (options.observations.use_position_priors && block.frames[frame].position_prior.has_value());
  };
  // Positions join parts without any assembly, and given poses are held: such blocks are oriented as a whole.
  if (options.part_frames > 0 && std::ssize(frames) > options.part_frames &&
      std::none_of(frames.begin(), frames.end(), placed))
    return orient_in_parts(block, start, frames, pairs, tracks, options);
  Orientation orientation(block, start, options, make_orientation_graph(block, start, frames, pairs, tracks, options));
  orientation.run();
  return orientation.result(start);
}

}  // namespace megablock
