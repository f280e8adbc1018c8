#include "io/evaluation/receivers.h"

#include <fmt/core.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "geometry/numbers/angles.h"
#include "geometry/numbers/median.h"
#include "geometry/transform/rotation.h"
#include "io/block/held_priors.h"
#include "io/block/observed_poses.h"
#include "io/evaluation/used_sigmas.h"
#include "io/text/side_text.h"

namespace megablock {

namespace {

constexpr std::size_t kFewestDifferences = 8;         // differences of a rig
constexpr double kOfOwnSigma = 5;                     // times this a vector is named
constexpr double kUsual = 3.5, kOfMedian = 1.4826;    // median absolute value of normal errors to their sigma
constexpr double kLeastM = 0.01, kLeastRad = 0.0002;  // smaller vectors matter to nobody

// The sigma that is proposed, in lengths of the vector that was found. The block has followed part of the error.
constexpr double kOfLength = 3;

struct Difference {
  Eigen::Vector3d in_rig;     // y_f
  Eigen::Matrix3d by_ground;  // R_f
  double sigma = 0;           // stated, the mean of the three axes
};

struct Common {
  Eigen::Vector3d vector, sigma;
  double scatter = 0;  // sigma of what remains of the differences, per axis
};

// Sigmas between those of held and of unknown values.
struct KnownSigmas {
  double held, unknown;
  bool contain(const Eigen::Vector3d& sigma) const { return sigma.minCoeff() > 2 * held && sigma.maxCoeff() < unknown; }
};

// c of the differences that `takes` marks, with the sigma that the scatter gives. An axis along which c and g depend on
// each other has an infinite sigma: z of a camera that always looks down, and all axes where all frames look the same
// way. Also returns the lengths of what remains of the differences.
Common solve(const std::vector<Difference>& differences, const std::vector<std::uint8_t>& takes,
             std::vector<double>& lengths) {
  using NormalOfBoth = Eigen::Matrix<double, 6, 6>;
  using ErrorAndDatum = Eigen::Matrix<double, 6, 1>;
  NormalOfBoth normal = NormalOfBoth::Zero();
  ErrorAndDatum right = ErrorAndDatum::Zero();
  double count = 0;
  const auto design = [](const Difference& d) {
    Eigen::Matrix<double, 3, 6> by;
    by << Eigen::Matrix3d::Identity(), d.by_ground;
    return by;
  };
  for (std::size_t i = 0; i < differences.size(); ++i) {
    if (!takes[i]) continue;
    const Eigen::Matrix<double, 3, 6> by = design(differences[i]);
    normal += by.transpose() * by;
    right += by.transpose() * differences[i].in_rig;
    ++count;
  }
  constexpr double kApart = 1e-3;  // of `count`: headings that scatter by two or three degrees
  constexpr double kOpen = 0.01;   // share of an axis in what depends on each other
  const Eigen::SelfAdjointEigenSolver<NormalOfBoth> eigen(normal);
  ErrorAndDatum x = ErrorAndDatum::Zero(), variance = ErrorAndDatum::Zero(), open = ErrorAndDatum::Zero();
  for (int k = 0; k < 6; ++k) {
    const ErrorAndDatum v = eigen.eigenvectors().col(k);
    const double information = eigen.eigenvalues()[k];
    if (information > kApart * count) {
      x += v * (v.dot(right) / information);
      variance += v.cwiseAbs2() / information;
    } else {
      open += v.cwiseAbs2();
    }
  }
  double squares = 0;
  for (std::size_t i = 0; i < differences.size(); ++i) {
    const Eigen::Vector3d rest = differences[i].in_rig - design(differences[i]) * x;
    lengths[i] = rest.norm();
    if (takes[i]) squares += rest.squaredNorm();
  }
  const double of_one = squares / std::max(1.0, 3 * count - 6);
  Common common{x.head<3>(), (of_one * variance.head<3>()).cwiseSqrt(), std::sqrt(of_one)};
  for (int k = 0; k < 3; ++k)
    if (open[k] > kOpen) common.sigma[k] = std::numeric_limits<double>::infinity();
  return common;
}

std::optional<Common> common_in_rig(const std::vector<Difference>& differences) {
  if (differences.size() < kFewestDifferences) return std::nullopt;
  std::vector<std::uint8_t> takes(differences.size(), 1);
  std::vector<double> lengths(differences.size(), 0);
  Common common = solve(differences, takes, lengths);
  for (int again = 0; again < 2; ++again) {
    const double limit = kUsual * kOfMedian * median(lengths);
    for (std::size_t i = 0; i < takes.size(); ++i) takes[i] = lengths[i] <= limit;
    common = solve(differences, takes, lengths);
  }
  return common;
}

// Whether the vector is far from zero along some axis: for its own sigma, for a single observation as stated and as it
// is, and at all. Errors of positions often drift, and drifts of long drives have a mean that is no lever arm.
bool is_named(const Common& common, const std::vector<Difference>& differences, double least) {
  std::vector<double> stated;
  for (const Difference& d : differences) stated.push_back(d.sigma);
  const double enough = std::max({least, common.scatter, median(std::move(stated))});
  return ((common.vector.array().abs() > kOfOwnSigma * common.sigma.array()) && (common.vector.array().abs() > enough))
      .any();
}

// "0.102, -0.601, ?": an axis without a finite sigma is not known.
std::string axis_texts(const Eigen::Vector3d& v, const Eigen::Vector3d& sigma, int digits) {
  std::string text;
  for (int k = 0; k < 3; ++k)
    text += (k > 0 ? ", " : "") + (std::isfinite(sigma[k]) ? fmt::format("{:.{}f}", v[k], digits) : std::string("?"));
  return text;
}

double length_of(const Common& common) {
  return common.sigma.array().isFinite().select(common.vector.array(), 0).matrix().norm();
}

Eigen::Vector3d given_lever_arm(const BlockResult& result, RigIndex rig) {
  for (const Frame& frame : result.block.frames)
    if (frame.rig == rig && frame.position_prior) return frame.position_prior->lever_arm;
  return Eigen::Vector3d::Zero();
}

std::string of_rig(const BlockResult& result, RigIndex rig) {
  return std::ranges::count_if(result.block.rigs, [](const Rig& r) { return !r.is_group(); }) == 1
             ? ""
             : " of rig '" + result.block.rigs[rig].name + "'";
}

// The differences of the rigs, by rig. A value that was held has none.
using DifferencesByRig = std::vector<std::vector<Difference>>;

// Collects differences with the stated sigmas: a wrong lever arm may be why the adjustment used larger ones.
template <typename Residual>
DifferencesByRig by_rig(const BlockResult& result, const std::vector<Residual>& residuals, const auto& stated_sigma,
                        const KnownSigmas& known, bool in_ground) {
  DifferencesByRig differences(result.block.rigs.size());
  for (const Residual& r : residuals) {
    const Frame& frame = result.block.frames[r.frame];
    const Eigen::Vector3d sigma = stated_sigma(frame);
    if (!known.contain(sigma)) continue;
    const Eigen::Matrix3d rotation = result.state.frames[r.frame].rotation.toRotationMatrix();
    const Eigen::Vector3d observed = -r.difference;
    differences[static_cast<std::size_t>(frame.rig.value)].push_back(
        {in_ground ? Eigen::Vector3d(rotation * observed) : observed, rotation, sigma.mean()});
  }
  return differences;
}

}  // namespace

std::vector<ReceiverFigures> receivers_of(const BlockResult& result) {
  std::vector<ReceiverFigures> receivers;
  for (RigIndex r(0); result.block.rigs.contains(r) && result.state.mounts.contains(r); ++r.value) {
    const Rig& rig = result.block.rigs[r];
    if (!rig.has_receiver() || rig.is_group() || rig.mounts.back().held()) continue;
    const Pose& pose = result.state.mounts[r].back();
    ReceiverFigures figures;
    figures.rig = r;
    figures.lever_arm = given_lever_arm(result, r) + pose.centre;
    figures.lever_arm_change = pose.centre - rig.mounts.back().pose.centre;
    figures.boresight = kDegreesPerRadian * rotation_log<double>(pose.rotation);
    if (result.mount_covariance.contains(r)) {
      const PoseIncrement sigma = result.mount_covariance[r].back().diagonal().cwiseMax(0).cwiseSqrt();
      if (rig.mounts.back().position_sigma_m > 0) figures.lever_arm_sigma = sigma.tail<3>();
      if (rig.mounts.back().rotation_sigma_rad > 0) figures.boresight_sigma = kDegreesPerRadian * sigma.head<3>();
    }
    receivers.push_back(figures);
  }
  return receivers;
}

std::vector<ShiftFigures> shifts_of(const BlockResult& result) {
  const auto& covariances =
      result.empirical.mount_covariance.empty() ? result.mount_covariance : result.empirical.mount_covariance;
  std::vector<ShiftFigures> shifts;
  for (RigIndex r(0); result.block.rigs.contains(r) && covariances.contains(r); ++r.value) {
    if (!result.block.rigs[r].is_group()) continue;
    const auto is_member = [&](const Frame& frame) { return frame.position_prior && frame.position_prior->group == r; };
    const auto member = std::ranges::find_if(result.block.frames, is_member);
    if (member == result.block.frames.end()) continue;
    const Eigen::Vector3d axes = member->position_prior->shifted.cast<double>();
    const Eigen::Vector3d variance = covariances[r].front().diagonal().tail<3>();
    ShiftFigures figures;
    figures.group = r;
    figures.shift = axes.cwiseProduct(result.state.mounts[r].front().centre);
    figures.sigma = axes.cwiseProduct(Eigen::Vector3d(variance.cwiseMax(0).cwiseSqrt()));
    figures.scale = position_scale(result, r);
    const auto& own = result.position_scales;
    figures.own_scale = std::ranges::find(own, r, &PositionScale::group) != own.end();
    if (!figures.sigma.isZero(0) && !figures.shift.isZero(0)) shifts.push_back(figures);
  }
  return shifts;
}

std::string shift_text(const BlockResult& result, const ShiftFigures& figures) {
  std::string text =
      fmt::format("in the adjusted block the {} lie {} their places (sigma {:.2g} m)",
                  result.block.rigs[figures.group].name, side_text(figures.shift), figures.sigma.maxCoeff());
  const auto [group, horizontal, height] = figures.scale;
  if (figures.own_scale && (horizontal > 1 || height > 1))
    text += fmt::format(
        ", and scatter more than their sigmas predict: the adjustment used these times {:.1f} (horizontal) and {:.1f} "
        "(height); 'merge: {{scale_contradicted_sigmas: false}}' keeps the stated ones",
        horizontal, height);
  return text;
}

std::vector<std::string> receiver_remarks(const BlockResult& result, const report::Figures& figures) {
  std::vector<std::string> lines;
  const auto positions = by_rig(
      result, figures.positions, [](const Frame& frame) { return frame.position_prior->sigma; },
      {kHeldPositionSigma, kUnknownHeightSigma}, true);
  const auto attitudes = by_rig(
      result, figures.attitudes, [](const Frame& frame) { return frame.attitude_prior->sigma_rad; },
      {kHeldAttitudeSigma, std::numeric_limits<double>::infinity()}, false);
  for (RigIndex rig(0); result.block.rigs.contains(rig); ++rig.value) {
    const auto row = static_cast<std::size_t>(rig.value);
    const Rig& given = result.block.rigs[rig];
    const bool arm_free = given.has_receiver() && given.mounts.back().position_sigma_m > 0;
    const bool boresight_free = given.has_receiver() && given.mounts.back().rotation_sigma_rad > 0;
    if (const auto arm = common_in_rig(positions[row]); !arm_free && arm && is_named(*arm, positions[row], kLeastM))
      lines.push_back(fmt::format(
          "The antenna{} lies {} m (sigma {} m; x right, y down, z ahead) from where 'gps.lever_arm_m' has it: correct "
          "the lever arm, or estimate it with 'gps: {{lever_arm_sigma_m: {:.1g}}}'",
          of_rig(result, rig), axis_texts(arm->vector, arm->sigma, 3), axis_texts(arm->sigma, arm->sigma, 3),
          kOfLength * length_of(*arm)));
    if (const auto turn = common_in_rig(attitudes[row]);
        !boresight_free && turn && is_named(*turn, attitudes[row], kLeastRad))
      lines.push_back(fmt::format(
          "The attitudes{} are turned against the images by {} degrees (sigma {} degrees; about x right, y down, z "
          "ahead) in all frames: correct them, or estimate this boresight with 'attitude: {{boresight_sigma_deg: "
          "{:.1g}}}'",
          of_rig(result, rig), axis_texts(kDegreesPerRadian * turn->vector, turn->sigma, 3),
          axis_texts(kDegreesPerRadian * turn->sigma, turn->sigma, 3),
          kOfLength * kDegreesPerRadian * length_of(*turn)));
  }
  return lines;
}

}  // namespace megablock
