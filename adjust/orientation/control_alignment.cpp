// Least trimmed squares over the control points (P. Rousseeuw, "Least median of squares regression", JASA 79, 1984).
//
// A similarity S is proposed by every sample of three control points, from their intersections in the frame of the
// block. Its residual at a point i is the median, over the marks of the point, of the distance in the image between the
// mark and the known position, r_i(S) = med |project(S^-1 X_i) - x_ij|, in pixels. The best proposal has the smallest
//
//     sum over the h smallest r_i^2,   h = floor((n + p + 1) / 2),   p = 3 points of a sample,
//
// which n - h wrong points cannot spoil: one of five, three of ten. Residuals in the images compare points with one
// mark and points without a height alike, and need no sigma. The proposal is then fitted to the h points and to all
// that agree with them, until they no longer change.
//
// The first orientation of a block is bent by some pixels, and by more in long strips. A point agrees within
// max(mark_px, kAgree s), with s^2 the mean of the h smallest squares.
#include "adjust/orientation/control_alignment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <utility>

#include "adjust/orientation/steps/levelling.h"
#include "adjust/tile/consistent_rays.h"
#include "geometry/numbers/median.h"
#include "geometry/numbers/straight_line.h"
#include "geometry/similarity/minimal_control.h"
#include "geometry/similarity/minimal_similarity.h"
#include "io/block/held_priors.h"

namespace megablock {

namespace {

constexpr double kAgree = 4;                // times the rms of the best points
constexpr std::size_t kMostSamples = 4000;  // all samples of three among 29 points

// A control point as the block sees it.
struct SeenControl {
  std::int64_t row = 0;  // of Block::control_points
  Eigen::Vector3d ground = Eigen::Vector3d::Zero();
  std::array<bool, 3> known{};  // coordinates
  std::vector<PointView> marks;
  std::optional<Eigen::Vector3d> model;  // intersection in the frame of the block, where two marks or more agree
  bool place() const { return known[0] && known[1] && model; }
  bool height() const { return known[2] && model; }
  bool full() const { return place() && height(); }
};

Eigen::Vector3d centroid(const std::vector<Eigen::Vector3d>& places) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& place : places) sum += place;
  return sum / static_cast<double>(places.size());
}

class ControlAligner {
 public:
  ControlAligner(const Block& block, const BlockState& state, const std::vector<FrameIndex>& frames, double mark_px)
      : block_(block), state_(state), frames_(frames), mark_px_(mark_px) {
    for (const FrameIndex frame : frames_)
      for (const Mount& mount : block.rig_of(frame).cameras()) metric_ = metric_ || mount.pose.centre.norm() > 0;
    for (std::size_t row = 0; row < block.control_points.size(); ++row) see(row);
  }

  std::optional<ControlAlignment> align() {
    propose_all();
    if (!best_) return std::nullopt;
    refine();
    ControlAlignment result{*best_, std::ssize(points_)};
    std::vector<double> fitting;
    const double limit = limit_of(*best_);
    result.best_rms_px = best_rms_px(*best_);
    for (const SeenControl& point : points_) {
      const double r = residual_px(*best_, point);
      if (r <= limit)
        fitting.push_back(r);
      else if (point.model)
        result.misfits.push_back({point.row, r, off(*best_, point)});
    }
    result.agreeing = std::ssize(fitting);
    if (2 * result.agreeing <= result.points || fitting.size() < 2) return std::nullopt;
    result.median_residual_px = median(std::move(fitting));
    result.on_a_line = level(result.similarity);
    if (metric_) keep_scale(result.similarity);
    return result;
  }

 private:
  void see(std::size_t row) {
    const ControlPoint& point = block_.control_points[row];
    if (point.role != PointRole::kControl) return;
    SeenControl seen;
    seen.row = static_cast<std::int64_t>(row);
    for (int axis = 0; axis < 3; ++axis) {
      seen.known[static_cast<std::size_t>(axis)] =
          std::isfinite(point.position[axis]) && point.sigma[axis] < kUnknownHeightSigma;
      if (seen.known[static_cast<std::size_t>(axis)]) seen.ground[axis] = point.position[axis];
    }
    SeenMarks marks = see_marks(block_, state_, frames_, point);
    seen.marks = std::move(marks.marks);
    seen.model = marks.place;
    const bool all_known = seen.known[0] && seen.known[1] && seen.known[2];
    if (seen.model ? (seen.place() || seen.height()) : (all_known && !seen.marks.empty()))
      points_.push_back(std::move(seen));
  }

  // The median distance of the marks from the known position. A coordinate that is not known is that of the model.
  double residual_px(const Similarity& similarity, const SeenControl& point) const {
    Eigen::Vector3d target = point.ground;
    if (point.model) {
      const Eigen::Vector3d seen = similarity(*point.model);
      for (int axis = 0; axis < 3; ++axis)
        if (!point.known[static_cast<std::size_t>(axis)]) target[axis] = seen[axis];
    }
    const Eigen::Vector3d model = similarity.inverse()(target);
    std::vector<double> distances;
    for (const PointView& mark : point.marks) distances.push_back(residual_sigmas(mark, model));
    return median(std::move(distances));
  }

  static Eigen::Vector3d off(const Similarity& similarity, const SeenControl& point) {
    Eigen::Vector3d result = point.ground - similarity(*point.model);
    for (int axis = 0; axis < 3; ++axis)
      if (!point.known[static_cast<std::size_t>(axis)]) result[axis] = 0;
    return result;
  }

  // The number h of points that decide on a similarity.
  std::size_t decisive() const { return std::min(points_.size(), (points_.size() + 4) / 2); }
  // The sum of the h smallest squares.
  double trimmed_squares(const Similarity& similarity) const {
    std::vector<double> squares;
    for (const SeenControl& point : points_) {
      const double r = residual_px(similarity, point);
      squares.push_back(r * r);
    }
    std::sort(squares.begin(), squares.end());
    double sum = 0;
    for (std::size_t i = 0; i < decisive(); ++i) sum += squares[i];
    return sum;
  }
  double best_rms_px(const Similarity& similarity) const {
    return std::sqrt(trimmed_squares(similarity) / static_cast<double>(decisive()));
  }
  double limit_of(const Similarity& similarity) const { return std::max(mark_px_, kAgree * best_rms_px(similarity)); }

  void propose(const Similarity& similarity) {
    const double squares = trimmed_squares(similarity);
    if (!(squares < best_squares_)) return;
    best_squares_ = squares;
    best_ = similarity;
  }

  void propose_all() {
    std::vector<std::size_t> full, places, heights;
    for (std::size_t i = 0; i < points_.size(); ++i) {
      if (points_[i].full()) full.push_back(i);
      if (points_[i].place()) places.push_back(i);
      if (points_[i].height()) heights.push_back(i);
    }
    if (full.size() >= 3) {
      propose_triples(full);
    } else if (places.size() >= 2 && places.size() + heights.size() > 3) {
      propose_mixed(places, heights);
    }
    if (!best_ && full.size() == 2) propose_pair(full);
  }

  void propose_triple(std::size_t a, std::size_t b, std::size_t c) {
    const SeenControl &p = points_[a], &q = points_[b], &r = points_[c];
    if (const auto similarity = solve_similarity({*p.model, *q.model, *r.model}, {p.ground, q.ground, r.ground}))
      propose(*similarity);
  }
  void propose_triples(const std::vector<std::size_t>& full) {
    const std::size_t n = full.size();
    if (n * (n - 1) * (n - 2) / 6 <= kMostSamples) {
      for (std::size_t a = 0; a < n; ++a)
        for (std::size_t b = a + 1; b < n; ++b)
          for (std::size_t c = b + 1; c < n; ++c) propose_triple(full[a], full[b], full[c]);
      return;
    }
    std::mt19937_64 random(n);
    for (std::size_t k = 0; k < kMostSamples; ++k) {
      const std::size_t a = random() % n, b = random() % n, c = random() % n;
      if (a != b && b != c && a != c) propose_triple(full[a], full[b], full[c]);
    }
  }

  // Draws of five or four points in the two minimal mixes.
  void propose_mixed(const std::vector<std::size_t>& places, const std::vector<std::size_t>& heights) {
    std::mt19937_64 random(points_.size());
    const auto place = [&] {
      const SeenControl& p = points_[places[random() % places.size()]];
      return PlaceControl{*p.model, p.ground.head<2>()};
    };
    const auto height = [&] {
      const SeenControl& p = points_[heights[random() % heights.size()]];
      return HeightControl{*p.model, p.ground.z()};
    };
    // A draw that takes a point twice is degenerate and gives no solution.
    for (std::size_t k = 0; k < kMostSamples; ++k) {
      if (heights.size() >= 3) {
        const std::array two{place(), place()};
        const std::array three{height(), height(), height()};
        for (const Similarity& similarity : solve_minimal_control(two, three)) propose(similarity);
      }
      if (places.size() >= 3 && !heights.empty()) {
        const std::array three{place(), place(), place()};
        for (const Similarity& similarity : solve_minimal_control(three, height())) propose(similarity);
      }
    }
  }

  // Two points leave the rotation about their line to level().
  void propose_pair(const std::vector<std::size_t>& full) {
    const SeenControl &p = points_[full[0]], &q = points_[full[1]];
    const std::array from{*p.model, *q.model}, to{p.ground, q.ground};
    const auto similarity = fit_similarity(from, to);
    if (!similarity) return;
    best_ = similarity;
    // Points with a single mark see the rotation about the line, which is still open.
    points_ = {p, q};
  }

  // The points with all coordinates that agree with a similarity, in both frames.
  struct PlacePairs {
    std::vector<Eigen::Vector3d> model, ground;
  };
  PlacePairs agreeing_places(const Similarity& similarity) const {
    PlacePairs pairs;
    const double limit = limit_of(similarity);
    for (const SeenControl& point : points_) {
      if (!point.full() || !(residual_px(similarity, point) <= limit)) continue;
      pairs.model.push_back(*point.model);
      pairs.ground.push_back(point.ground);
    }
    return pairs;
  }

  // Fits the similarity to the points that agree, as long as this makes it better.
  void refine() {
    constexpr int kRounds = 10;
    for (int round = 0; round < kRounds; ++round) {
      const PlacePairs pairs = agreeing_places(*best_);
      if (pairs.model.size() < 3) return;
      const auto fitted = fit_similarity(pairs.model, pairs.ground);
      if (!fitted) return;
      const double before = best_squares_;
      propose(*fitted);
      if (!(best_squares_ < before)) return;
    }
  }

  // Turns the block about the line of its control so that the images look or stand as they should. Returns whether the
  // points lie on a line.
  bool level(Similarity& similarity) const {
    const std::vector<Eigen::Vector3d> places = agreeing_places(similarity).ground;
    if (places.size() < 2) return false;
    const Eigen::Vector3d mean = centroid(places);
    Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
    for (const Eigen::Vector3d& place : places) scatter += (place - mean) * (place - mean).transpose();
    const auto line = straight_line(scatter);
    if (!line) return false;
    MeanAxes axes = mean_axes(block_, state_, frames_);
    axes.view = similarity.rotation * axes.view;
    axes.down = similarity.rotation * axes.down;
    const Eigen::Vector3d down = which_points_down(axes, *line, distance(similarity));
    const Eigen::Quaterniond turn = turn_about(*line, down, -Eigen::Vector3d::UnitZ());
    similarity.translation = mean + turn * (similarity.translation - mean);
    similarity.rotation = (turn * similarity.rotation).normalized();
    return true;
  }
  // Sets the scale to one, with the centroid of the points that agree in its place.
  void keep_scale(Similarity& similarity) const {
    const PlacePairs pairs = agreeing_places(similarity);
    if (pairs.model.empty()) return;
    similarity.scale = 1;
    similarity.translation = centroid(pairs.ground) - similarity.rotation * centroid(pairs.model);
  }
  // The median distance of the control points from the images that see them, metres.
  double distance(const Similarity& similarity) const {
    std::vector<double> distances;
    for (const SeenControl& point : points_)
      for (const PointView& mark : point.marks)
        if (point.full()) distances.push_back((similarity(mark.camera.centre) - point.ground).norm());
    return median(std::move(distances));
  }

  const Block& block_;
  const BlockState& state_;
  const std::vector<FrameIndex>& frames_;
  double mark_px_;
  std::vector<SeenControl> points_;
  bool metric_ = false;
  std::optional<Similarity> best_;
  double best_squares_ = std::numeric_limits<double>::infinity();
};

}  // namespace

std::optional<ControlAlignment> align_with_control(const Block& block, const BlockState& state,
                                                   const std::vector<FrameIndex>& frames, double mark_px) {
  return ControlAligner(block, state, frames, mark_px).align();
}

void move_frames(const Similarity& similarity, const std::vector<FrameIndex>& frames, BlockState& state) {
  for (const FrameIndex frame : frames)
    if (state.oriented[frame]) state.frames[frame] = similarity(state.frames[frame]);
}

}  // namespace megablock
