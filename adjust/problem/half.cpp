#include "adjust/problem/half.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "geometry/numbers/student.h"
#include "geometry/transform/rotation.h"
#include "io/base/hash.h"
#include "io/block/held_priors.h"

namespace megablock {

namespace {

// What a number is drawn for: the first of its key.
enum class Kind : std::int64_t {
  kTrack = 1,
  kPosition,
  kAttitude,
  kRelative,
  kMeasured,
  kPoint,
  kPointImage,
  kCamera,
  kMount,
  kRow
};

std::uint64_t hash_of(const HalfChoice& choice, Kind kind, std::initializer_list<std::int64_t> key) {
  Hasher hasher;
  hasher.add(choice.division).add(static_cast<std::int64_t>(kind));
  for (const std::int64_t part : key) hasher.add(part);
  return hasher.value();
}

bool first_half(Half half) { return half == Half::kTiePoints1 || half == Half::kImages1; }

// Gives values of one observation their error in the half, and its sigmas the factor sqrt 2.
class Draw {
 public:
  Draw(const HalfChoice& choice, Kind kind, std::initializer_list<std::int64_t> key)
      : sign_(first_half(choice.half) ? 1 : -1), hash_(hash_of(choice, kind, key)) {}
  // The next error, of the sigma given.
  double error(double sigma) {
    Hasher hasher;
    hasher.add(hash_).add(count_++);
    const double share = (static_cast<double>(hasher.value() >> 11) + 0.5) * 0x1p-53;  // 0 < share < 1
    return std::isfinite(sigma) ? sign_ * sigma * normal_quantile(share) : 0;
  }
  Eigen::Vector3d errors(const Eigen::Vector3d& sigma) {
    const double x = error(sigma.x()), y = error(sigma.y());
    return {x, y, error(sigma.z())};
  }
  // The numbers differ between blocks: they depend on the observation, too.
  Draw& of(double value) {
    hash_ = Hasher().add(hash_).add(value).value();
    return *this;
  }
  void apply(double& value, double& sigma) {
    of(value);
    value += error(sigma);
    sigma *= std::numbers::sqrt2;
  }
  void apply(Eigen::Vector3d& value, Eigen::Vector3d& sigma) {
    of(value.x()).of(value.y()).of(value.z());
    value += errors(sigma);
    sigma *= std::numbers::sqrt2;
  }
  // R becomes Exp(error) R.
  void apply(Eigen::Quaterniond& rotation, const Eigen::Vector3d& sigma) {
    of(rotation.x()).of(rotation.y()).of(rotation.z());
    rotation = (rotation_exp<double>(errors(sigma)) * rotation).normalized();
  }

 private:
  double sign_;
  std::uint64_t hash_;
  std::int64_t count_ = 0;
};

Eigen::Vector3d three(double sigma) { return Eigen::Vector3d::Constant(sigma); }

void divide_pose(Draw draw, Pose& pose, double& rotation_sigma, double& position_sigma) {
  draw.apply(pose.rotation, three(rotation_sigma));
  pose.centre += draw.errors(three(position_sigma));
  rotation_sigma *= std::numbers::sqrt2;
  position_sigma *= std::numbers::sqrt2;
}

}  // namespace

bool takes_track(const HalfChoice& choice, ImageIndex middle) {
  if (choice.half != Half::kTiePoints1 && choice.half != Half::kTiePoints2) return true;
  const std::int64_t place = middle.value + choice.division % 2;
  const std::uint64_t of_pair = hash_of(choice, Kind::kTrack, {place / 2});
  return ((of_pair + static_cast<std::uint64_t>(place)) % 2 == 0) == first_half(choice.half);
}

bool takes_row(const HalfChoice& choice, std::initializer_list<std::int64_t> numbers) {
  return choice.half == Half::kNone || (hash_of(choice, Kind::kRow, numbers) % 2 == 0) == first_half(choice.half);
}

std::vector<std::uint8_t> frames_of_half(const Block& block, Half half) {
  if (half != Half::kImages1 && half != Half::kImages2) return {};
  std::vector<std::int64_t> of_rig(block.rigs.size(), 0), before(block.rigs.size(), 0);
  for (const Frame& frame : block.frames) ++of_rig[static_cast<std::size_t>(frame.rig.value)];
  std::vector<std::uint8_t> in_half;
  for (const Frame& frame : block.frames) {
    const auto rig = static_cast<std::size_t>(frame.rig.value);
    const bool first = 2 * before[rig]++ < of_rig[rig];
    in_half.push_back(first == first_half(half));
  }
  return in_half;
}

void divide_priors(const HalfChoice& choice, TileProblem& problem) {
  if (choice.half == Half::kNone) return;
  const auto frame = [&](LocalFrame local) { return problem.frames[static_cast<std::size_t>(local.value)].value; };
  for (auto& term : problem.positions)
    if (!held(term.prior))
      Draw(choice, Kind::kPosition, {frame(term.frame)}).apply(term.prior.position, term.prior.sigma);
  for (auto& term : problem.attitudes)
    if (!held(term.prior)) {
      Draw(choice, Kind::kAttitude, {frame(term.frame)}).apply(term.prior.rotation_cw, term.prior.sigma_rad);
      term.prior.sigma_rad *= std::numbers::sqrt2;
    }
  for (auto& term : problem.relatives)
    divide_pose(Draw(choice, Kind::kRelative, {frame(term.from), frame(term.to)}), term.pose, term.rotation_sigma_rad,
                term.position_sigma_m);
  for (auto& [key, terms] : problem.measured)
    for (auto& term : terms)
      Draw(choice, Kind::kMeasured, {frame(term.from), frame(term.to)}).apply(term.value, term.sigma);
  for (auto& term : problem.point_priors)
    Draw(choice, Kind::kPoint, {problem.points[static_cast<std::size_t>(term.point.value)].index})
        .apply(term.position, term.sigma);
  for (std::size_t p = 0; p < problem.points.size(); ++p) {
    if (problem.points[p].role == PointRole::kTie) continue;
    for (std::int64_t row = problem.begin[p]; row < problem.begin[p + 1]; ++row) {
      const auto o = static_cast<std::size_t>(row);
      Draw draw(choice, Kind::kPointImage, {problem.points[p].index, row - problem.begin[p]});
      const double sigma = 1 / problem.inverse_sigma[o];
      draw.of(problem.x[o]).of(problem.y[o]);
      problem.x[o] += draw.error(sigma);
      problem.y[o] += draw.error(sigma);
      problem.inverse_sigma[o] /= std::numbers::sqrt2;
    }
  }
  for (auto& term : problem.intrinsic_priors) {
    Draw draw(choice, Kind::kCamera, {problem.cameras[static_cast<std::size_t>(term.camera.value)].value});
    for (int k = 0; k < term.value.size(); ++k)
      if (double& sigma = term.sigma[static_cast<std::size_t>(k)]; sigma > 0) draw.apply(term.value[k], sigma);
  }
  // The prior of a shift is too loose to be an observation: its error would carry a tile hundreds of metres away.
  const auto is_shift = [&](std::int32_t mount) {
    return std::ranges::find(problem.positions, mount, &TileProblem::PositionTerm::group) != problem.positions.end();
  };
  for (auto& term : problem.mount_priors) {
    if (is_shift(term.mount)) continue;
    const MountId& id = problem.mounts[static_cast<std::size_t>(term.mount)];
    divide_pose(Draw(choice, Kind::kMount, {id.rig.value, id.mount}), term.value, term.rotation_sigma_rad,
                term.position_sigma_m);
  }
  std::erase_if(problem.lines, [&](const TileProblem::LineTerm& line) {
    // Its rays tell the lines of a frame apart.
    Hasher rays;
    for (const Eigen::Vector3d* ray : {&line.middle, &line.across, &line.other_normal})
      for (int k = 0; k < 3; ++k) rays.add((*ray)[k]);
    return !takes_row(choice, {frame(line.frame), static_cast<std::int64_t>(rays.value())});
  });
  std::erase_if(problem.verticals, [&](const TileProblem::VerticalTerm& vertical) {
    return !takes_row(choice, {problem.images[static_cast<std::size_t>(vertical.image.value)].image.value});
  });
}

}  // namespace megablock
