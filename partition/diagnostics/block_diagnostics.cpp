#include "partition/diagnostics/block_diagnostics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "geometry/camera/camera.h"
#include "geometry/numbers/median.h"
#include "geometry/transform/rotation.h"
#include "partition/diagnostics/ground_cover.h"
#include "partition/links/link_parts.h"
#include "partition/links/loose_parts.h"
#include "partition/views/flight_lines.h"
#include "partition/views/kd_tree.h"

namespace megablock {

namespace {

constexpr double kDown = 0.7071;            // cosine: an image looks down within 45 degrees of the nadir
constexpr double kLeastSlope = 0.2;         // of the rays to the corners of a footprint
constexpr double kUsualOverlap = 0.75;      // assumed where the height of the ground is unknown
constexpr double kStreetFactor = 2;         // additional factor of gaps along streets, as vehicles stop and turn
constexpr double kNeighbourFootprints = 4;  // search radius of neighbouring lines, in larger footprint sides
constexpr double kParallel = 0.9;           // cosine of the angle between lines that count as parallel
constexpr double kSameLine = 0.1;  // lines closer than this, in larger footprint sides, are one line flown twice
// Exposures of such lines closer than this along the line, in usual steps, are side by side.
constexpr double kSamePlace = 0.7;
constexpr std::size_t kAround = 64;          // number of exposures that decide whether a place is inside the block
constexpr std::int64_t kMostMissing = 1000;  // largest number of exposures, or lines, that one gap reports

double unknown() { return BlockDiagnostics::kUnknown; }

// Number of exposures or lines that fit into a gap of so many usual distances: from 1 to kMostMissing.
std::int64_t missing_in(double usual_distances) {
  return std::llround(std::clamp(usual_distances - 1, 1.0, static_cast<double>(kMostMissing)));
}

// One diagnosis of a block. find() calls the steps in order; each fills in a part of the result.
class Diagnosis {
 public:
  Diagnosis(const Block& block, const BlockState& state, const DiagnosticsOptions& options)
      : block_(block), state_(state) {
    options.check();
    found_.requested = options;
  }

  BlockDiagnostics find(const std::function<TieEvidence(bool)>& gather) {
    found_.frames = std::ranges::count_if(state_.oriented, [](auto oriented) { return oriented != 0; });
    // Ground heights come from tie points, so in aerial blocks these are collected first.
    found_.aerial = looks_down();
    if (found_.aerial) ties_ = gather(true);
    const std::vector<std::vector<FrameIndex>> order = acquisition_order(block_, state_);
    lines_ = found_.aerial ? flight_lines(order, state_) : order;
    if (found_.aerial) found_.lines = static_cast<std::int64_t>(lines_.size());
    find_steps();
    if (found_.aerial) {
      find_down_images();
      find_heights();
      find_footprints();
      find_missing_lines();
      find_pairs();
    }
    if (!found_.aerial) ties_ = gather(false);
    found_.links_known = !ties_.links.empty();
    find_link_parts(block_, state_, ties_.links, found_);
    find_loose_parts(block_, state_, ties_.links, found_);
    if (found_.aerial) {
      GroundCover cover(found_.footprints, found_.requested.min_images);
      place_exposures();
      cover.find_thin([this](const Eigen::Vector2d& place) { return is_inside(place); }, found_);
      propose(cover);
    }
    return std::move(found_);
  }

 private:
  Eigen::Vector2d place(FrameIndex frame) const { return state_.frames[frame].centre.head<2>(); }
  double distance(FrameIndex a, FrameIndex b) const { return (place(a) - place(b)).norm(); }

  Pose camera_of(ImageIndex image) const {
    const Image& i = block_.images[image];
    return camera_pose(state_.frames[i.frame],
                       state_.mounts[block_.frames[i.frame].rig][static_cast<std::size_t>(i.mount)]);
  }
  double slope_down(ImageIndex image) const {
    return -(camera_of(image).rotation.conjugate() * Eigen::Vector3d::UnitZ()).z();
  }
  // Whether "up" is known. Without positions, attitudes, control points, lines or verticals the frame is that of the
  // images alone, whose "up" is only a guess: the normal of the plane of the exposures, even for a facade.
  bool vertical_is_known() const {
    const auto tells = [](const Frame& frame) {
      return frame.position_prior || frame.attitude_prior || frame.given_pose;
    };
    const auto holds = [](const ControlPoint& point) { return point.role == PointRole::kControl; };
    return std::ranges::any_of(block_.control_points, holds) || !block_.lines.empty() || !block_.verticals.empty() ||
           std::ranges::any_of(block_.frames, tells);
  }
  // Whether most oriented images look down.
  bool looks_down() const {
    if (!vertical_is_known()) return false;
    std::int64_t down = 0, all = 0;
    for (ImageIndex i(0); block_.images.contains(i); ++i.value) {
      if (!state_.oriented[block_.images[i].frame]) continue;
      ++all;
      down += slope_down(i) > kDown;
    }
    return 2 * down > all;
  }

  // For each frame the image that looks down most steeply.
  void find_down_images() {
    down_image_.assign(block_.frames.size(), ImageIndex());
    IndexedVector<FrameIndex, double> steepest(block_.frames.size(), kDown);
    for (ImageIndex i(0); block_.images.contains(i); ++i.value) {
      const FrameIndex frame = block_.images[i].frame;
      if (!state_.oriented[frame]) continue;
      const double slope = slope_down(i);
      if (slope > steepest[frame]) steepest[frame] = slope, down_image_[frame] = i;
    }
  }

  // Heights above ground of the frames that look down. Ground heights come from tie points, else from control points;
  // without either, the height follows from the spacing of the exposures and the usual overlap.
  void find_heights() {
    std::vector<double> known;
    for (const double height : ties_.ground_height)
      if (std::isfinite(height)) known.push_back(height);
    if (known.empty())
      for (const ControlPoint& point : block_.control_points)
        if (std::isfinite(point.position.z())) known.push_back(point.position.z());
    const double middle = known.empty() ? unknown() : median(std::move(known));
    std::vector<double> heights;
    height_.assign(block_.frames.size(), unknown());
    for (FrameIndex f(0); block_.frames.contains(f); ++f.value) {
      const ImageIndex image = down_image_[f];
      if (!image.valid()) continue;
      const double seen = ties_.ground_height.contains(image) ? ties_.ground_height[image] : unknown();
      const double ground = std::isfinite(seen) ? seen : middle;
      height_[f] = std::isfinite(ground) ? state_.frames[f].centre.z() - ground : height_of_overlap(image);
      if (!(height_[f] > 0)) height_[f] = unknown();
      if (std::isfinite(height_[f])) heights.push_back(height_[f]);
    }
    if (!heights.empty()) found_.height_m = median(std::move(heights));
  }
  double height_of_overlap(ImageIndex image) const {
    const Camera& camera = block_.cameras[block_.camera_of(image)];
    return found_.usual_step_m / (1 - kUsualOverlap) * camera.intrinsics[kFocal] /
           std::min(camera.width, camera.height);
  }

  // Corners of an image's footprint on horizontal ground. Empty where a corner's ray is too flat.
  std::optional<std::array<Eigen::Vector2d, 4>> footprint_of(const Camera& camera, const Pose& pose,
                                                             double height) const {
    std::array<Eigen::Vector2d, 4> corners;
    const double w = camera.width, h = camera.height;
    const std::array<Eigen::Vector2d, 4> pixels = {Eigen::Vector2d(0, 0), {w, 0}, {w, h}, {0, h}};
    for (std::size_t k = 0; k < 4; ++k) {
      const auto ray = viewing_ray(camera.intrinsics, pixels[k]);
      if (!ray) return std::nullopt;
      const Eigen::Vector3d direction = pose.rotation.conjugate() * *ray;
      if (!(direction.z() < -kLeastSlope)) return std::nullopt;
      corners[k] = pose.centre.head<2>() - height / direction.z() * direction.head<2>();
    }
    return corners;
  }
  Camera camera_now(ImageIndex image) const {
    const CameraIndex index = block_.camera_of(image);
    Camera camera = block_.cameras[index];
    camera.intrinsics = state_.cameras[index];
    return camera;
  }

  void find_footprints() {
    footprint_row_.assign(block_.frames.size(), -1);
    for (ImageIndex i(0); block_.images.contains(i); ++i.value) {
      const FrameIndex frame = block_.images[i].frame;
      if (!state_.oriented[frame] || !std::isfinite(height_[frame]) || !(slope_down(i) > kDown)) continue;
      const auto corners = footprint_of(camera_now(i), camera_of(i), height_[frame]);
      if (!corners) continue;
      if (i == down_image_[frame]) footprint_row_[frame] = static_cast<std::int64_t>(found_.footprints.size());
      found_.footprints.push_back({i, *corners});
    }
    // The median of the larger sides is the unit in which distances to neighbouring lines are judged.
    std::vector<double> sides;
    for (const auto& footprint : found_.footprints)
      sides.push_back(std::max((footprint.corners[1] - footprint.corners[0]).norm(),
                               (footprint.corners[2] - footprint.corners[1]).norm()));
    largest_side_ = median(std::move(sides));
  }

  void find_steps() {
    std::vector<double> steps;
    for (const FlightLine& line : lines_)
      for (std::size_t i = 0; i + 1 < line.size(); ++i) steps.push_back(distance(line[i], line[i + 1]));
    std::erase(steps, 0.0);  // cameras at one place that are separate frames
    if (steps.empty()) return;
    found_.usual_step_m = median(std::move(steps));
    const double factor = found_.requested.gap_factor * (found_.aerial ? 1 : kStreetFactor);
    for (const FlightLine& line : lines_) {
      // Without known passes, the order of frames along streets means nothing.
      if (!found_.aerial && block_.frames[line.front()].pass < 0) continue;
      for (std::size_t i = 0; i + 1 < line.size(); ++i) {
        const std::int64_t missing = missing_between(line[i], line[i + 1], factor);
        if (missing == 0) continue;
        found_.gaps.push_back(
            {false, line[i], line[i + 1], place(line[i]), place(line[i + 1]), missing, distance(line[i], line[i + 1])});
      }
    }
  }

  // An exposure on a flight line. `along` is the direction of the line, with a sign that is common to parallel lines.
  struct OnLine {
    FrameIndex frame;
    std::int64_t line;
    Eigen::Vector2d along;
    double to_left = unknown();  // distance to the next line
  };

  // For each line 1 or -1: whether it was flown in the direction that stands for all parallel lines. The first such
  // direction is east. A line that is not parallel to any direction so far adds its own, with the sign of the most
  // similar one. The sign is decided once per line: for single exposures of a line across the first direction, noise
  // would decide it.
  std::vector<double> signs_of_lines() const {
    std::vector<double> signs;
    std::vector<Eigen::Vector2d> ways = {Eigen::Vector2d::UnitX()};
    for (const FlightLine& line : lines_) {
      const Eigen::Vector2d flown = (place(line.back()) - place(line.front())).normalized();
      double cosine = 0;
      for (const Eigen::Vector2d& way : ways)
        if (std::abs(way.dot(flown)) > std::abs(cosine)) cosine = way.dot(flown);
      signs.push_back(cosine < 0 ? -1 : 1);
      if (std::abs(cosine) <= kParallel && !flown.isZero()) ways.emplace_back(signs.back() * flown);
    }
    return signs;
  }

  std::vector<OnLine> exposures_on_lines() const {
    // The direction at an exposure is that between its neighbours on the line.
    const std::vector<double> signs = signs_of_lines();
    std::vector<OnLine> on;
    for (std::size_t l = 0; l < lines_.size(); ++l) {
      const FlightLine& line = lines_[l];
      for (std::size_t i = 0; i < line.size(); ++i) {
        Eigen::Vector2d along = place(line[std::min(i + 1, line.size() - 1)]) - place(line[i > 0 ? i - 1 : 0]);
        if (along.isZero()) along = place(line.back()) - place(line.front());
        if (along.isZero()) continue;
        along = signs[l] * along.normalized();
        if (along.allFinite()) on.push_back({line[i], static_cast<std::int64_t>(l), along});
      }
    }
    return on;
  }

  // Distances to the next line on the left. If a line was flown twice, the one listed first represents both.
  void look_left(std::vector<OnLine>& on) const {
    std::vector<Eigen::Vector2d> places;
    for (const OnLine& o : on) places.push_back(place(o.frame));
    const KdTree tree(places);
    const double close = kSameLine * largest_side_;
    for (std::size_t i = 0; i < on.size(); ++i) {
      const Eigen::Vector2d u = on[i].along, left(-u.y(), u.x());
      const auto to = [&](std::int64_t other) -> Eigen::Vector2d {
        return places[static_cast<std::size_t>(other)] - places[i];
      };
      const auto parallel = [&](std::int64_t other) {
        const OnLine& o = on[static_cast<std::size_t>(other)];
        return o.line != on[i].line && std::abs(u.dot(o.along)) > kParallel;
      };
      // Of a line flown twice only the line listed first searches, so that each gap is reported once.
      const auto looks_for_this = [&](std::int64_t other) {
        return on[static_cast<std::size_t>(other)].line < on[i].line && parallel(other) &&
               std::abs(left.dot(to(other))) <= close && std::abs(u.dot(to(other))) < kSamePlace * found_.usual_step_m;
      };
      const auto beside = [&](std::int64_t other) {
        return left.dot(to(other)) > std::max(close, std::abs(u.dot(to(other)))) && parallel(other);
      };
      if (!tree.nearest(places[i], 1, largest_side_, looks_for_this).empty()) continue;
      for (const auto& n : tree.nearest(places[i], 1, kNeighbourFootprints * largest_side_, beside))
        on[i].to_left = left.dot(to(n.point));
    }
  }

  void find_missing_lines() {
    std::vector<OnLine> on = exposures_on_lines();
    look_left(on);
    std::vector<double> distances;
    for (const OnLine& o : on)
      if (std::isfinite(o.to_left)) distances.push_back(o.to_left);
    if (distances.empty()) return;
    // Neighbouring exposures of one line that all see a wide gap on their left form one missing line.
    const double usual = median(std::move(distances));
    found_.line_distance_m = usual;
    const auto wide = [&](const OnLine& o) { return o.to_left > found_.requested.gap_factor * usual; };
    for (std::size_t first = 0, last; first < on.size(); first = last) {
      last = first + 1;
      if (!wide(on[first])) continue;
      while (last < on.size() && on[last].line == on[first].line && wide(on[last])) ++last;
      add_missing_line(
          {on.begin() + static_cast<std::ptrdiff_t>(first), on.begin() + static_cast<std::ptrdiff_t>(last)}, usual);
    }
  }

  // Adds a gap beside these exposures of one line, and proposes the exposures of the missing lines.
  void add_missing_line(const std::vector<OnLine>& beside, double usual) {
    if (beside.size() < 2) return;
    std::vector<double> widths;
    for (const OnLine& o : beside) widths.push_back(o.to_left);
    const double width = median(std::move(widths));
    const auto across = [](const OnLine& o) { return Eigen::Vector2d(-o.along.y(), o.along.x()); };
    const std::int64_t missing = missing_in(width / usual);
    const auto middle = [&](const OnLine& o) -> Eigen::Vector2d { return place(o.frame) + width / 2 * across(o); };
    found_.gaps.push_back({true, beside.front().frame, beside.back().frame, middle(beside.front()),
                           middle(beside.back()), missing, width});
    std::vector<BlockDiagnostics::Proposal> exposures;
    for (std::int64_t j = 1; j <= missing; ++j)
      for (std::size_t i = 0; i < beside.size(); ++i) {
        const OnLine& o = beside[i];
        const Eigen::Vector2d shift = o.to_left * static_cast<double>(j) / static_cast<double>(missing + 1) * across(o);
        const auto add = [&](BlockDiagnostics::Proposal exposure) {
          exposure.centre.head<2>() += shift;
          exposures.push_back(exposure);
        };
        add({state_.frames[o.frame].centre, state_.frames[o.frame].rotation});
        if (i + 1 == beside.size()) continue;
        // Where the line beside has a gap itself, the missing line is proposed without one.
        const std::int64_t between_them = missing_between(o.frame, beside[i + 1].frame, found_.requested.gap_factor);
        for (const auto& exposure : between(o.frame, beside[i + 1].frame, between_them)) add(exposure);
      }
    line_proposals_.push_back(std::move(exposures));
  }

  // Number of exposures that the usual distance would put between two; 0 where the two are not far apart.
  std::int64_t missing_between(FrameIndex a, FrameIndex b, double factor) const {
    const double steps = distance(a, b) / found_.usual_step_m;
    return steps > factor ? missing_in(steps) : 0;
  }

  // Stereo pairs: successive exposures of lines. If most frames are on no line, the pairs with enough tie points
  // instead.
  void find_pairs() {
    std::size_t on_lines = 0, all = 0;
    for (const FlightLine& line : lines_) on_lines += line.size();
    for (const auto flag : state_.oriented) all += flag != 0;
    if (2 * on_lines >= all) {
      for (const FlightLine& line : lines_)
        for (std::size_t i = 0; i + 1 < line.size(); ++i) add_pair(line[i], line[i + 1]);
    } else {
      ties_.links.visit([this](const FrameEdge& edge) {
        if (edge.weight >= found_.requested.min_link_points && state_.oriented[edge.a] && state_.oriented[edge.b])
          add_pair(edge.a, edge.b);
      });
    }
  }

  void add_pair(FrameIndex a, FrameIndex b) {
    BlockDiagnostics::StereoPair pair{a, b};
    pair.base_m = (state_.frames[a].centre - state_.frames[b].centre).norm();
    pair.base_to_height = 2 * pair.base_m / (height_[a] + height_[b]);
    const std::int64_t fa = footprint_row_[a], fb = footprint_row_[b];
    if (fa >= 0 && fb >= 0)
      pair.overlap = common_share(found_.footprints[static_cast<std::size_t>(fa)].corners,
                                  found_.footprints[static_cast<std::size_t>(fb)].corners);
    found_.pairs.push_back(pair);
  }

  // Exposures at equal distances between two.
  std::vector<BlockDiagnostics::Proposal> between(FrameIndex before, FrameIndex after, std::int64_t missing) const {
    const Pose &a = state_.frames[before], &b = state_.frames[after];
    std::vector<BlockDiagnostics::Proposal> exposures;
    for (std::int64_t k = 1; k <= missing; ++k) {
      const double share = static_cast<double>(k) / static_cast<double>(missing + 1);
      exposures.push_back({a.centre + share * (b.centre - a.centre), a.rotation.slerp(share, b.rotation)});
    }
    return exposures;
  }

  // Prepares the search for exposures by place; only those with a known height count.
  void place_exposures() {
    std::vector<Eigen::Vector2d> places;
    for (FrameIndex f(0); block_.frames.contains(f); ++f.value)
      if (std::isfinite(height_[f])) places.push_back(place(f)), exposures_.push_back(f);
    tree_.emplace(std::move(places));
  }
  std::vector<FrameIndex> exposures_about(const Eigen::Vector2d& where, std::size_t count, double radius) const {
    std::vector<FrameIndex> found;
    for (const auto& n : tree_->nearest(where, count, radius, [](std::int64_t) { return true; }))
      found.push_back(exposures_[static_cast<std::size_t>(n.point)]);
    return found;
  }

  // Whether exposures lie on all sides of a place: no half plane is without one.
  bool is_inside(const Eigen::Vector2d& where) const {
    std::vector<double> directions;
    for (const FrameIndex f : exposures_about(where, kAround, kNeighbourFootprints * largest_side_)) {
      const Eigen::Vector2d d = place(f) - where;
      directions.push_back(std::atan2(d.y(), d.x()));
    }
    if (directions.size() < 3) return false;
    std::sort(directions.begin(), directions.end());
    double widest = directions.front() + 2 * std::numbers::pi - directions.back();
    for (std::size_t i = 0; i + 1 < directions.size(); ++i)
      widest = std::max(widest, directions[i + 1] - directions[i]);
    return widest < std::numbers::pi;
  }

  // Proposes exposures for gaps, then for thin ground that these do not cover.
  void propose(GroundCover& cover) {
    std::size_t line = 0;
    for (const BlockDiagnostics::Gap& gap : found_.gaps)
      for (const auto& exposure : gap.line ? line_proposals_[line++] : between(gap.before, gap.after, gap.missing))
        add_proposal(exposure, gap.before, cover);
    for (const BlockDiagnostics::ThinGround& ground : found_.thin_ground) {
      if (cover.mostly_enough(ground.cells)) continue;
      for (const FrameIndex nearest : exposures_about(ground.centre, 1, std::numeric_limits<double>::infinity())) {
        Pose pose = state_.frames[nearest];
        // Shifts the nearest exposure so that the centre of its footprint comes to the centre of the gap.
        pose.centre.head<2>() += ground.centre - middle_of(nearest);
        add_proposal({pose.centre, pose.rotation}, nearest, cover);
      }
    }
  }

  Eigen::Vector2d middle_of(FrameIndex frame) const {
    const std::int64_t row = footprint_row_[frame];
    if (row < 0) return place(frame);
    const auto& c = found_.footprints[static_cast<std::size_t>(row)].corners;
    return (c[0] + c[1] + c[2] + c[3]) / 4;
  }

  // Adds a proposal with the height above ground of the exposure `like`.
  void add_proposal(const BlockDiagnostics::Proposal& exposure, FrameIndex like, GroundCover& cover) {
    found_.proposals.push_back(exposure);
    const ImageIndex image = down_image_[like];
    if (!image.valid() || !std::isfinite(height_[like])) return;
    const Image& i = block_.images[image];
    const Pose camera = camera_pose({exposure.rotation, exposure.centre},
                                    state_.mounts[block_.frames[like].rig][static_cast<std::size_t>(i.mount)]);
    if (const auto corners = footprint_of(camera_now(image), camera, height_[like])) cover.add(*corners);
  }

  const Block& block_;
  const BlockState& state_;
  TieEvidence ties_;
  BlockDiagnostics found_;
  std::vector<FlightLine> lines_;
  IndexedVector<FrameIndex, ImageIndex> down_image_;       // invalid: no image looks down
  IndexedVector<FrameIndex, double> height_;               // above ground, metres
  IndexedVector<FrameIndex, std::int64_t> footprint_row_;  // of the frame's down image; -1: none
  double largest_side_ = 0;                                // median over the footprints of their larger side
  std::vector<FrameIndex> exposures_;
  std::optional<KdTree> tree_;                                           // of the exposures
  std::vector<std::vector<BlockDiagnostics::Proposal>> line_proposals_;  // for each gap that is a missing line
};

}  // namespace

BlockDiagnostics diagnose(const Block& block, const BlockState& state,
                          const std::function<TieEvidence(bool with_heights)>& gather,
                          const DiagnosticsOptions& options) {
  return Diagnosis(block, state, options).find(gather);
}

BlockState state_of_priors(const Block& block) {
  BlockState state = initial_state(block);
  for (FrameIndex f(0); block.frames.contains(f); ++f.value) {
    const Frame& frame = block.frames[f];
    if (state.oriented[f] || !frame.position_prior || !frame.attitude_prior) continue;
    const PositionPrior& position = *frame.position_prior;
    Pose& pose = state.frames[f];
    pose.rotation = frame.attitude_prior->rotation_cw;
    pose.centre = position.position - pose.rotation.conjugate() * position.lever_arm;
    state.oriented[f] = 1;
  }
  return state;
}

}  // namespace megablock
