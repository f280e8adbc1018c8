#include "io/evaluation/remarks/control_remarks.h"

#include <fmt/core.h>

#include <functional>

#include "geometry/numbers/median.h"
#include "io/evaluation/used_sigmas.h"
#include "io/result/result_option.h"
#include "io/text/counted.h"

namespace megablock {

namespace {

constexpr std::size_t kMarks = 3;  // number of marks of a point that a line names

// A length in pixels, which may be impossibly large: 12.3, 4810, 1.4e6.
std::string pixels(double value) {
  if (value < 100) return fmt::format("{:.1f}", value);
  if (value < 1e5) return fmt::format("{:.0f}", value);
  return "more than 100 000";  // beside or behind the camera
}

}  // namespace

std::vector<UnusedPoint> unused_points(const BlockResult& result, PointRole role) {
  std::vector<UnusedPoint> unused;
  for (std::size_t p = 0; p < std::min(result.control.size(), result.block.control_points.size()); ++p) {
    const ControlPoint& given = result.block.control_points[p];
    const BlockResult::ControlResult& control = result.control[p];
    if (given.role != role || control.takes_part()) continue;
    UnusedPoint point{p, {}};
    for (std::size_t m = 0; m < std::min(given.measurements.size(), control.residual_px.size()); ++m) {
      const double length = control.residual_px[m].norm();
      if (std::isfinite(length)) point.marks.push_back({length, given.measurements[m].image});
    }
    std::ranges::stable_sort(point.marks, std::greater(), &UnusedPoint::Mark::px);
    unused.push_back(point);
  }
  std::ranges::stable_sort(unused, std::greater(), &UnusedPoint::worst_px);
  return unused;
}

namespace {

// Why no mark of a point has a residual. Marks without an intersection have none, although their images are oriented.
std::string without_residuals(const BlockResult& result, const ControlPoint& point) {
  std::int64_t marks = 0;
  for (const auto& mark : point.measurements) {
    const FrameIndex frame = result.block.images[mark.image].frame;
    marks += result.state.oriented.contains(frame) && result.state.oriented[frame];
  }
  if (marks == 0) return "not seen by an oriented image)";
  if (marks == 1) return "only 1 mark in an oriented image)";
  return fmt::format("all {} marks in oriented images rejected)", marks);
}

}  // namespace

std::string unused_points_text(const BlockResult& result, PointRole role) {
  const std::vector<UnusedPoint> unused = unused_points(result, role);
  if (unused.empty()) return "";
  const bool one = unused.size() == 1;
  std::string text =
      fmt::format("{} {} {} take{} no part: ", unused.size(), role == PointRole::kCheck ? "check" : "control",
                  one ? "point" : "points", one ? "s" : "");
  for (std::size_t i = 0; i < std::min(kNamedInLine, unused.size()); ++i) {
    const UnusedPoint& point = unused[i];
    text += (i > 0 ? ", " : "") + result.block.control_points[point.point].name + " (";
    // Marks that contradict one another may all be rejected, and the worst need not be the wrong one.
    for (std::size_t m = 0; m < std::min(kMarks, point.marks.size()); ++m)
      text += pixels(point.marks[m].px) + " px in " + result.block.name_of(point.marks[m].image) + ", ";
    text += point.marks.empty() ? without_residuals(result, result.block.control_points[point.point]) : "rejected)";
  }
  if (unused.size() > kNamedInLine) text += fmt::format(" and {} more", unused.size() - kNamedInLine);
  return text;
}

namespace {

// A control or check point, with its difference from the given position.
struct WrongPoint {
  const ControlPoint* point = nullptr;
  Eigen::Vector3d off = Eigen::Vector3d::Zero(), sigma = Eigen::Vector3d::Zero();  // adjusted - given; metres
  double sigmas = 0, metres = 0, worst_px = 0;
  bool aside = false;  // the adjustment left its position out
};

// The length of adjusted - given over the sigmas of the adjustment, on the axes that are given. A check point's own
// covariance counts too.
WrongPoint difference_of(const BlockResult& result, const ControlPoint& given,
                         const BlockResult::ControlResult& control) {
  WrongPoint wrong{&given};
  const Eigen::Vector3d sigma = used_sigma(result, given);
  for (int axis = 0; axis < 3; ++axis) {
    const double difference = control.adjusted[axis] - given.position[axis];
    double variance = sigma[axis] * sigma[axis];
    if (given.role == PointRole::kCheck) variance += control.covariance(axis, axis);
    if (!std::isfinite(difference) || !std::isfinite(variance)) continue;
    wrong.off[axis] = difference;
    wrong.sigma[axis] = std::sqrt(variance);
    wrong.sigmas = std::hypot(wrong.sigmas, difference / std::sqrt(variance));
    wrong.metres = std::hypot(wrong.metres, difference);
  }
  for (std::size_t m = 0; m < std::min(given.measurements.size(), control.residual_px.size()); ++m)
    if (control.takes_part(m)) wrong.worst_px = std::max(wrong.worst_px, control.residual_px[m].norm());
  return wrong;
}

// The points of one role, and those of them that the block contradicts, the worst first.
struct Comparison {
  std::vector<WrongPoint> all, wrong;
  std::int64_t aside = 0;
};

Comparison compare_points(const BlockResult& result, PointRole role) {
  Comparison found;
  for (std::size_t p = 0; p < std::min(result.control.size(), result.block.control_points.size()); ++p) {
    const ControlPoint& given = result.block.control_points[p];
    if (given.role != role || !result.control[p].takes_part()) continue;
    WrongPoint point = difference_of(result, given, result.control[p]);
    point.aside = std::ranges::binary_search(result.control_aside, static_cast<std::int64_t>(p));
    found.all.push_back(point);
    if (!point.aside && !(point.sigmas > kContradictedSigmas)) continue;
    found.aside += point.aside;
    found.wrong.push_back(point);
  }
  std::ranges::stable_sort(found.wrong, std::greater(), &WrongPoint::sigmas);
  return found;
}

// The number of oriented frames whose position is good enough to show an error of this length in a point.
std::int64_t positions_that_check(const BlockResult& result, double metres) {
  constexpr double kShown = 3;  // sigmas
  if (option_of(result, "adjustment.use_position_priors") == "false") return 0;
  std::int64_t count = 0;
  for (FrameIndex f(0); result.state.oriented.contains(f); ++f.value)
    if (const auto& prior = result.block.frames[f].position_prior; prior && result.state.oriented[f])
      count += kShown * used_sigma(result, *prior).maxCoeff() < metres;
  return count;
}

// Few points bend the block to the wrong one, and the largest difference may be that of a right one. With five points
// each is checked by the others (docs/guide/reading-the-report.md), and positions check points as points do.
bool tells_which_is_wrong(const BlockResult& result, const Comparison& control) {
  constexpr std::int64_t kChecked = 5;
  return control.wrong.empty() || control.aside > 0 || control.all.size() < 2 ||
         std::ssize(control.all) + positions_that_check(result, control.wrong.front().metres) >= kChecked;
}

// "A, B and C"
std::string names_of(const std::vector<WrongPoint>& points) {
  std::string text;
  for (std::size_t i = 0; i < points.size(); ++i)
    text += (i == 0 ? "" : i + 1 == points.size() ? " and " : ", ") + points[i].point->name;
  return text;
}

std::string contradictory_points_text(const Comparison& control) {
  double metres = 0, worst_px = 0;
  for (const WrongPoint& point : control.all) {
    metres = std::max(metres, point.metres);
    worst_px = std::max(worst_px, point.worst_px);
  }
  return fmt::format(
      "The {} control points contradict each other: they differ from the block by up to {:.{}f} m, more than {:.0f} "
      "sigmas (their marks fit within {} px), and so few cannot tell which of them is wrong; check the coordinates and "
      "names of {}",
      control.all.size(), metres, metres < 10 ? 3 : 1, shown_limit(control.wrong.front().sigmas), pixels(worst_px),
      names_of(control.all));
}

// `advised`: whether to ask for a check of these points.
std::string wrong_points_text(const Comparison& found, PointRole role, bool advised) {
  const std::vector<WrongPoint>& wrong = found.wrong;
  if (wrong.empty()) return "";
  const bool one = wrong.size() == 1, control = role == PointRole::kControl;
  const char* part = !control ? ""
                     : found.aside == std::ssize(wrong)
                         ? (one ? " and takes no part" : " and take no part")
                         : (one ? " and has hardly any weight" : " and have hardly any weight");
  std::string text =
      fmt::format("{} of {} {} differ{} from the block by more than {:.0f} sigmas{}: ", wrong.size(), found.all.size(),
                  control ? "control points" : "check points", one ? "s" : "", shown_limit(wrong.back().sigmas), part);
  for (std::size_t i = 0; i < std::min(kNamedInLine, wrong.size()); ++i)
    text += fmt::format("{}{} by {:.{}f} m (its marks fit within {} px)", i > 0 ? ", " : "", wrong[i].point->name,
                        wrong[i].metres, wrong[i].metres < 10 ? 3 : 1, pixels(wrong[i].worst_px));
  if (wrong.size() > kNamedInLine) text += fmt::format(" and {} more", wrong.size() - kNamedInLine);
  if (!advised) return text + "; the control points that contradict each other move the block";
  return text + (one ? "; check its coordinates and its name" : "; check their coordinates and names");
}

std::string rejected_marks_text(const BlockResult& result) {
  struct Mark {
    std::string place;
    double px = 0;
  };
  std::vector<Mark> marks;
  for (std::size_t p = 0; p < std::min(result.control.size(), result.block.control_points.size()); ++p) {
    const ControlPoint& given = result.block.control_points[p];
    const BlockResult::ControlResult& control = result.control[p];
    if (!control.takes_part()) continue;
    for (std::size_t m = 0; m < std::min(given.measurements.size(), control.residual_px.size()); ++m)
      if (!control.takes_part(m) && control.residual_px[m].allFinite())
        marks.push_back(
            {given.name + " in " + result.block.name_of(given.measurements[m].image), control.residual_px[m].norm()});
  }
  if (marks.empty()) return "";
  std::stable_sort(marks.begin(), marks.end(), [](const auto& a, const auto& b) { return a.px > b.px; });
  std::string text = fmt::format("{} of control and check points {} rejected: ", counted(std::ssize(marks), "mark"),
                                 marks.size() == 1 ? "is" : "are");
  for (std::size_t i = 0; i < std::min(kNamedInLine, marks.size()); ++i)
    text += fmt::format("{}{} by {} px", i > 0 ? ", " : "", marks[i].place, pixels(marks[i].px));
  if (marks.size() > kNamedInLine) text += fmt::format(" and {} more", marks.size() - kNamedInLine);
  return text;
}

bool positions_place(const BlockResult& result) {
  return option_of(result, "adjustment.use_position_priors") != "false" &&
         std::ranges::any_of(result.block.frames, [](const Frame& frame) { return frame.position_prior.has_value(); });
}

// Where all control and check points, three or more, are off by one vertical vector, their heights and those of the
// positions are of two systems, and no point is to blame. Empty otherwise, and without positions.
std::string common_height_text(const BlockResult& result, const Comparison& control, const Comparison& check) {
  constexpr std::size_t kFewest = 3;
  constexpr double kShare = 0.05, kSigmas = 3;  // of the height; of a difference
  std::vector<WrongPoint> points = control.all;
  points.insert(points.end(), check.all.begin(), check.all.end());
  if (points.size() < kFewest || !positions_place(result)) return "";
  std::vector<double> heights;
  for (const WrongPoint& point : points) heights.push_back(point.off.z());
  const double height = median(std::move(heights));
  for (const WrongPoint& point : points) {
    const Eigen::Vector3d rest = point.off - Eigen::Vector3d(0, 0, height);
    const Eigen::Vector3d limit = (kSigmas * point.sigma).cwiseMax(kShare * std::abs(height));
    if (!(point.sigmas > kContradictedSigmas) || (rest.array().abs() > limit.array()).any()) return "";
  }
  std::string text = control.all.empty() ? "" : counted(std::ssize(control.all), "control point");
  if (!check.all.empty()) text += (text.empty() ? "" : " and ") + counted(std::ssize(check.all), "check point");
  return fmt::format(
      "{} lie {:.1f} m {} the block that the positions place: ellipsoidal against orthometric heights? Name a system "
      "with a vertical part{}",
      text, std::abs(height), height > 0 ? "below" : "above",
      control.all.size() < 3 ? ", or give three control points, which show it before the adjustment" : "");
}

}  // namespace

std::vector<std::string> wrong_control_texts(const BlockResult& result) {
  std::vector<std::string> lines;
  const Comparison control = compare_points(result, PointRole::kControl);
  const Comparison check = compare_points(result, PointRole::kCheck);
  std::vector<std::string> wrong{common_height_text(result, control, check)};
  if (wrong.front().empty()) {
    const bool tells = tells_which_is_wrong(result, control);
    wrong = {tells ? wrong_points_text(control, PointRole::kControl, true) : contradictory_points_text(control),
             wrong_points_text(check, PointRole::kCheck, tells)};
  }
  wrong.push_back(rejected_marks_text(result));
  for (const std::string& text : wrong)
    if (!text.empty()) lines.push_back(text);
  return lines;
}

}  // namespace megablock
