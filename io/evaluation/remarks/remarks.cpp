#include "io/evaluation/remarks/remarks.h"

#include <fmt/core.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "geometry/numbers/angles.h"
#include "io/block/held_priors.h"
#include "io/evaluation/figures.h"
#include "io/evaluation/parts.h"
#include "io/evaluation/position_groups.h"
#include "io/evaluation/receivers.h"
#include "io/evaluation/remarks/camera_remarks.h"
#include "io/evaluation/remarks/control_remarks.h"
#include "io/evaluation/remarks/upward_remark.h"
#include "io/evaluation/used_sigmas.h"
#include "io/result/result_option.h"
#include "io/text/counted.h"

namespace megablock {

namespace {

constexpr std::size_t kParts = 5;           // number of parts with a free datum that are described
constexpr double kUnusableRotationDeg = 5;  // attitudes and heights with a larger sigma of the rotation are useless
constexpr double kMisstated = 2;            // residuals that are so many times the stated sigmas get a line
// The same for tie points. Pairs are verified to 3 px across the epipolar line (matching.max_residual_px), which is two
// sigmas of three times the default. Errors of matching alone therefore give no larger factor.
constexpr double kMisstatedImage = 3;

constexpr const char* kAboutTheVertical = " about the vertical";

// The observations that place a part: the number of positions (of frames and of control points that take part), and the
// number of attitudes.
struct Placing {
  std::int64_t positions = 0, heights = 0, attitudes = 0;  // heights: positions with a known height
};

// Median over the frames of a part of the largest sigma of the rotation, degrees.
double rotation_deg_of(const BlockResult& result, const report::Figures& figures, std::int32_t part) {
  std::vector<double> sigmas;
  for (FrameIndex f(0); result.frame_covariance.contains(f); ++f.value)
    if (figures.part_of_frame[f] == part)
      sigmas.push_back(std::sqrt(result.frame_covariance[f].diagonal().head<3>().maxCoeff()) * kDegreesPerRadian);
  return report::spread(std::move(sigmas)).median;
}

Placing placing_of(const BlockResult& result, const report::Figures& figures, std::int32_t part) {
  Placing placing;
  for (FrameIndex f(0); result.block.frames.contains(f); ++f.value) {
    if (figures.part_of_frame[f] != part) continue;
    if (const auto& prior = result.block.frames[f].position_prior) {
      ++placing.positions;
      placing.heights += prior->sigma.z() < kUnknownHeightSigma;
    }
    placing.attitudes += result.block.frames[f].attitude_prior.has_value();
  }
  for (std::size_t p = 0; p < std::min(result.control.size(), result.block.control_points.size()); ++p) {
    const ControlPoint& given = result.block.control_points[p];
    if (given.role != PointRole::kControl) continue;
    bool here = false;
    for (std::size_t m = 0; m < std::min(given.measurements.size(), result.control[p].residual_px.size()); ++m)
      here = here || (result.control[p].takes_part(m) &&
                      figures.part_of_frame[result.block.images[given.measurements[m].image].frame] == part);
    placing.positions += here;
    placing.heights += here && std::isfinite(given.position.z()) && given.sigma.z() < kUnknownHeightSigma;
  }
  return placing;
}

// The datum parameters that are undetermined. Several positions leave one rotation free only if they lie on a line
// (merge/datum/gauge.h).
std::string undetermined(int defect, const Placing& placing) {
  // A similarity has seven parameters: three of place, three of direction, one of scale. Their number tells which of
  // them are open only together with what was observed.
  if (defect >= 7) return "place, direction and scale";
  if (defect == 6) return "place and direction";
  if (defect == 4) return placing.positions == 0 && placing.attitudes > 0 ? "place and scale" : "direction and scale";
  if (defect == 3) return placing.positions == 0 && placing.attitudes > 0 ? "its place" : "its direction";
  if (defect == 1)
    return placing.positions > 1 ? "the rotation about the line on which the positions or control points lie" : "scale";
  if (defect == 2 && placing.positions > 2 && placing.heights == 0) return "its tilt, as no position has a height";
  return fmt::format("{} of the seven parameters of place, direction and scale", defect);
}

// Describes an axis in the ground frame (east or x, north or y, up). Its sign does not matter.
std::string axis_text(Eigen::Vector3d axis) {
  constexpr double kNear = 20;  // degrees
  if (axis.z() < 0) axis = -axis;
  const double rise = std::asin(std::min(1.0, axis.z())) * kDegreesPerRadian;
  if (rise > 90 - kNear) return kAboutTheVertical;
  // From north over east.
  double azimuth = std::atan2(axis.x(), axis.y()) * kDegreesPerRadian;
  if (rise >= kNear)
    return fmt::format(" about an axis {:.0f} degrees above azimuth {:.0f}", rise,
                       azimuth < 0 ? azimuth + 360 : azimuth);
  azimuth = std::fmod(azimuth + 180, 180);
  return fmt::format(" about a level axis of azimuth {:.0f} degrees", azimuth);
}

// The axis about which the rotations are least certain by far; empty if there is no such axis.
std::string weak_axis(const BlockResult& result, const report::Figures& figures, std::int32_t part) {
  // The rotation of a part as a whole is common to all its frames. In the sum of their covariances it stands out, and
  // the errors of single frames average out.
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (FrameIndex f(0); result.frame_covariance.contains(f); ++f.value)
    if (figures.part_of_frame[f] == part) sum += result.frame_covariance[f].topLeftCorner<3, 3>();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(sum);
  constexpr double kByFar = 4;  // variances
  if (!(eigen.eigenvalues()[2] > kByFar * eigen.eigenvalues()[1])) return "";
  return axis_text(eigen.eigenvectors().col(2));
}

// Verticals as a remedy for rotations about other axes than the vertical; empty if the block has verticals already.
std::string or_verticals(const BlockResult& result) {
  return result.block.verticals.empty() ? ", or verticals where walls are seen ('megablock verticals')" : "";
}

// Describes a part most of whose positions the block contradicts. The robust loss gives them hardly any weight, so the
// datum seems free although it is observed. Empty for other parts.
std::string positions_without_hold(const report::Figures& figures, std::int32_t part) {
  std::vector<double> distances;
  std::size_t positions = 0;
  for (const report::PositionResidual& r : figures.positions) {
    if (figures.part_of_frame[r.frame] != part) continue;
    ++positions;
    if (r.difference.cwiseQuotient(r.sigma).norm() > kContradictedSigmas) distances.push_back(r.difference.norm());
  }
  if (2 * distances.size() <= positions) return "";
  const std::size_t wrong = distances.size();
  const double median = report::spread(std::move(distances)).median;
  return fmt::format(
      "{} of its {} positions do not determine it, because they differ from the block by {:.{}f} m (median): correct "
      "start values ('poses') that are far off, or positions in another coordinate system, and run again",
      wrong, positions, median, median < 10 ? 2 : 0);
}

std::string consequence(const BlockResult& result, int defect, const Placing& placing) {
  if (defect >= 6) return "coordinates are relative; add positions or three control points";
  if (defect == 1 && placing.positions > 1)
    return "heights and attitudes are not usable; add attitudes or control points away from that line" +
           or_verticals(result);
  if (defect == 2 && placing.positions > 2 && placing.heights == 0)
    return "the block is as level as its images were taken to be; heights and attitudes are not usable; add heights, "
           "attitudes or control points" +
           or_verticals(result);
  if (defect == 1 || defect == 4) return "lengths or directions are not usable; add positions or control points";
  return "coordinates are not usable as they are; add positions, attitudes or control points";
}

// The figures of the report that remarks need; empty before the orientation.
report::Figures figures_for_remarks(const BlockResult& result, const TrackBatches& tracks) {
  report::Figures figures;
  if (result.state.oriented.size() != result.block.frames.size()) return figures;
  report::find_parts(result, tracks, figures);
  report::find_near_limit(result, tracks, figures);
  report::find_prior_residuals(result, figures);
  return figures;
}

struct Contradiction {
  FrameIndex frame;
  double sigmas = 0, size = 0;  // of the difference; metres or degrees
};

// Names the frames whose observed position or attitude the block contradicts, worst first; empty if there are none.
// The observations of the frames `aside` took no part.
template <typename Residual>
std::string contradicted_text(const BlockResult& result, const std::vector<Residual>& residuals, double held_sigma,
                              const char* kind, double unit, const char* unit_name,
                              const std::vector<FrameIndex>& aside = {}) {
  std::vector<Contradiction> wrong;
  std::int64_t observed = 0;
  for (const Residual& r : residuals) {
    if (r.sigma.minCoeff() <= 2 * held_sigma) continue;  // the adjustment held this value, so it has no residual
    ++observed;
    const double sigmas = r.difference.cwiseQuotient(r.sigma).norm();
    if (sigmas > kContradictedSigmas || std::ranges::binary_search(aside, r.frame))
      wrong.push_back({r.frame, sigmas, r.difference.norm() * unit});
  }
  if (wrong.empty()) return "";
  std::stable_sort(wrong.begin(), wrong.end(), [](const auto& a, const auto& b) { return a.sigmas > b.sigmas; });
  std::string text = fmt::format("{} of {} {} {} from the block by more than {:.0f} sigmas: ", wrong.size(), observed,
                                 kind, wrong.size() == 1 ? "differs" : "differ", shown_limit(wrong.back().sigmas));
  for (std::size_t i = 0; i < std::min(kNamedInLine, wrong.size()); ++i)
    text += fmt::format("{}{} by {:.{}f} {}", i > 0 ? ", " : "", result.block.frames[wrong[i].frame].name,
                        wrong[i].size, wrong[i].size < 10 ? 2 : 0, unit_name);
  if (wrong.size() > kNamedInLine) text += fmt::format(" and {} more", wrong.size() - kNamedInLine);
  return text;
}

// "positions are held", "positions are stated to 0.01 m" (median sigma); empty if there are none.
std::string stated_text(const char* kind, std::vector<double> sigmas, double held_sigma, const char* unit) {
  if (sigmas.empty()) return "";
  const double sigma = report::spread(std::move(sigmas)).median;
  return sigma <= 2 * held_sigma ? fmt::format("{} are held", kind)
                                 : fmt::format("{} are stated to {:.2g} {}", kind, sigma, unit);
}

// Lists the observations other than tie points that place the oriented frames, with their stated sigmas.
std::string placing_text(const BlockResult& result) {
  std::vector<double> positions, attitudes;
  for (FrameIndex f(0); result.block.frames.contains(f); ++f.value) {
    const Frame& frame = result.block.frames[f];
    if (!result.state.oriented[f]) continue;
    if (frame.position_prior) positions.push_back(frame.position_prior->sigma.minCoeff());
    if (frame.attitude_prior) attitudes.push_back(frame.attitude_prior->sigma_rad.minCoeff() * kDegreesPerRadian);
  }
  if (option_of(result, "adjustment.use_position_priors") == "false") positions.clear();
  if (option_of(result, "adjustment.use_attitude_priors") == "false") attitudes.clear();
  const auto control = std::count_if(result.block.control_points.begin(), result.block.control_points.end(),
                                     [](const ControlPoint& point) { return point.role == PointRole::kControl; });
  std::string text;
  for (const std::string& part :
       {stated_text("positions", positions, kHeldPositionSigma, "m"),
        stated_text("attitudes", attitudes, kHeldAttitudeSigma * kDegreesPerRadian, "degrees"),
        control > 0 ? counted(control, "control point") : std::string()})
    if (!part.empty()) text += (text.empty() ? "" : ", ") + part;
  return text;
}

// Compares the residuals of tie points with the sigma that the options assume. Sigma naught does not show large
// residuals if the sigma of the tie points is estimated, because it is estimated from the same residuals.
std::string image_sigma_text(const BlockResult& result) {
  const std::string stated = option_of(result, "adjustment.image_sigma_px");
  const double factor = result.observation_table[ObservationKind::kTieImage].sigma_factor();
  const double assumed = std::strtod(stated.c_str(), nullptr);
  // image_sigma_px was used in the adjustment; the factor says how the residuals compare with it. A smaller one is no
  // weakness.
  const double shown = result.image_sigma_px * (factor > 1 ? factor : 1);
  if (!(assumed > 0 && shown > kMisstatedImage * assumed)) return "";
  const std::string placing = placing_text(result);
  return fmt::format(
      "Tie points fit to {:.1f} px only, {:.1f} times the {} px of adjustment.image_sigma_px: {}the camera model is "
      "wrong, or many matches are wrong{}",
      shown, shown / assumed, stated,
      placing.empty() ? "" : "the observations that place the block contradict the images (" + placing + "), ",
      placing.empty() ? "; see cameras and images in the report"
                      : "; state larger sigmas, and run with 'adjustment: {use_position_priors: false, "
                        "use_attitude_priors: false}' to see how the images alone fit");
}

std::string rotation_text(double rotation_deg) {
  if (!std::isfinite(rotation_deg) || rotation_deg < 1) return "";
  return fmt::format(" (sigma of the rotations {:.0f} degrees)", rotation_deg);
}

}  // namespace

std::vector<std::string> datum_texts(const BlockResult& result) {
  return datum_texts(result, figures_for_remarks(result, WholeTracks(result)));
}

std::vector<std::string> datum_texts(const BlockResult& result, const report::Figures& figures) {
  std::vector<std::string> lines;
  if (result.state.oriented.size() != result.block.frames.size()) return lines;  // before the orientation
  std::size_t free = 0;
  for (std::size_t p = 0; p < figures.parts.size(); ++p) {
    const report::BlockPart& part = figures.parts[p];
    const double rotation_deg = rotation_deg_of(result, figures, static_cast<std::int32_t>(p));
    const bool whole = figures.parts.size() == 1;
    if (part.defect > 0) {
      if (++free > kParts) continue;
      const Placing placing = placing_of(result, figures, static_cast<std::int32_t>(p));
      const std::string wrong_positions = positions_without_hold(figures, static_cast<std::int32_t>(p));
      lines.push_back(
          fmt::format("{} free: nothing determines {}{}; {}",
                      whole ? "The datum is" : fmt::format("The datum of part {} ({} frames) is", p + 1, part.frames),
                      undetermined(part.defect, placing), rotation_text(rotation_deg),
                      wrong_positions.empty() ? consequence(result, part.defect, placing) : wrong_positions));
    } else if (rotation_deg > kUnusableRotationDeg) {
      const std::string axis = weak_axis(result, figures, static_cast<std::int32_t>(p));
      lines.push_back(
          fmt::format("The rotations{}{} are known to {:.0f} degrees only (sigma): {} are not usable; add control "
                      "points or attitudes{}",
                      whole ? "" : fmt::format(" of part {}", p + 1), axis, rotation_deg,
                      axis == kAboutTheVertical ? "directions in plan" : "heights and attitudes",
                      axis == kAboutTheVertical ? "" : or_verticals(result)));
    }
  }
  if (free > kParts) lines.push_back(fmt::format("The datum of {} more parts is free", free - kParts));
  return lines;
}

double chance_of_factor(double redundancy) { return 5 / std::sqrt(2 * redundancy); }

std::vector<std::string> misstated_texts(const BlockResult& result) {
  using enum ObservationKind;
  std::vector<std::string> lines;
  const bool estimated = option_of(result, "merge.estimate_sigmas") == "true";
  if (std::string text = image_sigma_text(result); !text.empty()) lines.push_back(std::move(text));
  for (std::size_t k = 0; k < kObservationKinds; ++k) {
    const auto kind = static_cast<ObservationKind>(k);
    const ObservationStatistics& s = result.observation_table.kinds[k];
    const double factor = s.sigma_factor();
    if (kind == kTieImage || kind == kCheckImage ||
        !(factor > std::max(kMisstated, 1 + chance_of_factor(s.redundancy))))
      continue;
    lines.push_back(fmt::format(
        "Residuals of {} ({}) are {:.1f} times as large as the stated sigmas predict: some observations "
        "are wrong, or the sigmas are too small{}",
        name_of(kind), counted(s.count, "observation"), factor,
        !estimated && s.scale > 1 ? fmt::format("; the adjustment used the stated sigmas times {:.1f} ('merge: "
                                                "{{scale_contradicted_sigmas: false}}' keeps the stated ones)",
                                                s.scale)
        : !estimates_sigma(kind)  ? ""
        : estimated               ? "; the adjustment used estimated sigmas ('merge: {estimate_sigmas: true}')"
                                  : "; 'merge: {estimate_sigmas: true}' estimates these sigmas from the residuals"));
  }
  return lines;
}

std::vector<std::string> contradicted_texts(const BlockResult& result, const report::Figures& figures) {
  std::vector<std::string> lines;
  for (const std::string& text :
       {contradicted_text(result, figures.positions, kHeldPositionSigma, "positions", 1, "m", result.positions_aside),
        contradicted_text(result, figures.attitudes, kHeldAttitudeSigma, "attitudes", kDegreesPerRadian, "degrees")})
    if (!text.empty()) lines.push_back(text);
  return lines;
}

std::string sigma_naught_text(const BlockResult& result) {
  // Every real block fails the chi-square test, because its redundancy is high. The line is for readers of sigmas, so
  // it comes when the factor matters, and chance does not explain it.
  constexpr double kTooLarge = 1.5, kTooSmall = 0.5;
  const auto redundancy = static_cast<double>(result.degrees_of_freedom);
  if (result.degrees_of_freedom <= 0 || !(result.variance_factor > 0)) return "";
  const double s0 = std::sqrt(result.variance_factor), chance = chance_of_factor(redundancy);
  const bool large = s0 > std::max(kTooLarge, 1 + chance);
  if (!large && !(s0 < std::min(kTooSmall, 1 - chance))) return "";
  const bool held = option_of(result, "adjustment.estimate_image_sigma") == "false";
  return fmt::format(
      "Residuals are {:.{}f} times as large as the stated sigmas predict (variance factor {:.3g}, {} degrees of "
      "freedom{}): {}",
      s0, large ? 1 : 2, result.variance_factor, result.degrees_of_freedom,
      held ? fmt::format("; the sigma of tie points is held at {:.2g} px", result.image_sigma_px) : "",
      result.sigma_scaled ? "the formal sigmas are multiplied by it"
                          : fmt::format("the formal sigmas are too {} by this factor; 'merge: {{scale_sigma: true}}' "
                                        "multiplies them by it",
                                        large ? "small" : "large"));
}

// Each tile at first decides alone which of its observations take part. Blocks without outliers have at most half as
// many observations near the limit as normal errors give; real images have 1.7 to 3.8 times as many, and the BAL
// problem of Dubrovnik 2.9 to 3.3 times. The choice of tiles matters if images alone place the block: the results with
// one tile and with several differ by up to 29 sigmas of the rotations (BAL), and by 1.1 (167 real images without their
// positions). With positions to some metres the difference is hidden (0.1).
std::string near_limit_text(const BlockResult& result, const report::Figures& figures) {
  constexpr double kMany = 2.5, kChance = 5;  // limits: times the expected number, and standard deviations above it
  const report::NearLimit& found = figures.near_limit;
  // The number near the limit is about Poisson distributed: its standard deviation is the root of its mean.
  const double expected = found.expected * static_cast<double>(found.tested);
  const auto near = static_cast<double>(found.near);
  if (!(near > std::max(kMany * expected, expected + kChance * std::sqrt(expected + 1)))) return "";
  return fmt::format(
      "{} of {} tie point observations ({:.2f} %) lie within {:.0f} % of the limit of screening, {:.1f} times as many "
      "as normal errors would: the division into tiles decides which of them are kept, and changes poses and estimated "
      "sigmas by a sigma and more; "
      "with 'adjustment: {{image_sigma_px: {:.2g}, estimate_image_sigma: false, max_residual_sigmas: 1000}}' all are "
      "kept, and only the robust loss weights them, in every division alike",
      found.near, found.tested, 100 * found.share(), 100 * report::NearLimit::kNear, found.share() / found.expected,
      result.image_sigma_px);
}

std::vector<std::string> remarks(const BlockResult& result) { return remarks(result, WholeTracks(result)); }

std::vector<std::string> remarks(const BlockResult& result, const TrackBatches& tracks) {
  return remarks(result, figures_for_remarks(result, tracks));
}

std::vector<std::string> remarks(const BlockResult& result, const report::Figures& figures) {
  std::vector<std::string> lines = datum_texts(result, figures);
  if (std::string text = upward_text(result); !text.empty()) lines.push_back(std::move(text));
  for (std::string& text : camera_texts(result)) lines.push_back(std::move(text));
  if (std::string text = sigma_naught_text(result); !text.empty()) lines.push_back(std::move(text));
  for (std::string& text : misstated_texts(result)) lines.push_back(std::move(text));
  for (std::string& text : contradicted_texts(result, figures)) lines.push_back(std::move(text));
  if (std::string text = position_groups_text(result, figures.positions); !text.empty())
    lines.push_back(std::move(text));
  for (std::string& text : receiver_remarks(result, figures)) lines.push_back(std::move(text));
  if (std::string text = near_limit_text(result, figures); !text.empty()) lines.push_back(std::move(text));
  for (std::string& text : wrong_control_texts(result)) lines.push_back(std::move(text));
  for (const PointRole role : {PointRole::kControl, PointRole::kCheck})
    if (std::string text = unused_points_text(result, role); !text.empty()) lines.push_back(std::move(text));
  return lines;
}

}  // namespace megablock
