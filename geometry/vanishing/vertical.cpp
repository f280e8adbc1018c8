#include "geometry/vanishing/vertical.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "geometry/camera/camera.h"
#include "geometry/estimation/gauss_helmert.h"
#include "geometry/transform/rotation.h"
#include "geometry/transform/rotation_fit.h"

namespace megablock {

namespace {

// Vanishing points closer to the candidate than this do not count against it.
constexpr double kNearlyParallel = 10 * kDegree;
// Largest cost of a candidate.
constexpr double kMostCost = 16;

double angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

// Whether two axes are perpendicular within the given angle or three standard deviations.
bool are_orthogonal(const AxisDirection& a, const AxisDirection& b, double within) {
  const double cosine = a.direction.dot(b.direction);
  const double variance = a.direction.dot(b.covariance * a.direction) + b.direction.dot(a.covariance * b.direction);
  return std::abs(std::asin(std::clamp(cosine, -1.0, 1.0))) < std::max(within, 3 * std::sqrt(std::max(0.0, variance)));
}

// Rotation from `down` to the axis, split into roll and pitch (radians).
Eigen::Vector2d roll_and_pitch(const Eigen::Vector3d& down, const Eigen::Vector3d& axis) {
  const Eigen::Vector3d cross = down.cross(axis);
  const double size = cross.norm();
  if (size == 0) return Eigen::Vector2d::Zero();
  Eigen::Vector3d roll_axis = Eigen::Vector3d::UnitZ() - down.z() * down;
  // For a camera that looks straight down, roll is undefined. Any axis will do, as pitch is the weaker condition.
  roll_axis = roll_axis.norm() > 1e-9 ? roll_axis.normalized() : Eigen::Vector3d(tangent_plane(down).col(0));
  const Eigen::Vector3d turn = angle_between(down, axis) / size * cross;
  return {turn.dot(roll_axis), turn.dot(roll_axis.cross(down))};
}

// Gauss-Helmert equations of an attitude: the seen direction has no component perpendicular to R times the ground axis.
struct AttitudeEquations {
  static constexpr int kUnknowns = 3, kEquations = 2, kMeasurements = 3, kConstraints = 0;
  using State = Eigen::Quaterniond;
  std::span<const SeenAxis> axes;
  void linearise(const State& rotation, const Eigen::Vector3d& seen, std::size_t axis,
                 GroupEquations<AttitudeEquations>& out) const {
    const Eigen::Vector3d& ground = axes[axis].ground;
    const Eigen::Matrix<double, 2, 3> across = tangent_plane(rotation * ground).transpose();
    out.value = across * seen;
    out.by_unknowns = across * rotation.toRotationMatrix() * skew(ground);
    out.by_measurements = across;
  }
  void move(State& rotation, const Eigen::Vector3d& step) const { rotation = rotation_update(rotation, step); }
};

}  // namespace

Eigen::Vector3d down_of_exif_orientation(int code) {
  switch (code) {
    case 3:
    case 4:
      return -Eigen::Vector3d::UnitY();
    case 5:
    case 6:
      return Eigen::Vector3d::UnitX();
    case 7:
    case 8:
      return -Eigen::Vector3d::UnitX();
    default:
      return Eigen::Vector3d::UnitY();
  }
}

std::optional<Vertical> find_vertical(std::span<const VanishingPoint> points, const VerticalPrior& prior) {
  double most = 0;
  for (const VanishingPoint& p : points) most = std::max(most, static_cast<double>(p.lines.size()));
  // 2 ln((1 - q) / q) with q = 0.05, see the head of vertical.h.
  const double not_orthogonal = 2 * std::log(0.95 / 0.05);
  std::optional<Vertical> best;
  std::vector<Vertical> candidates;
  double least = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    AxisDirection down = points[i].axis;
    if (!down.direction.allFinite()) continue;
    if (down.direction.dot(prior.down) < 0) down.direction = -down.direction;
    const Eigen::Vector2d turn = roll_and_pitch(prior.down, down.direction);
    const double roll = turn.x() / prior.roll_sigma, pitch = turn.y() / prior.pitch_sigma;
    if (!(std::abs(roll) <= 3 && std::abs(pitch) <= 3)) continue;
    double oblique = 0;
    for (std::size_t j = 0; j < points.size(); ++j) {
      const AxisDirection& other = points[j].axis;
      if (j == i || down.direction.cross(other.direction).norm() < std::sin(kNearlyParallel)) continue;
      if (!are_orthogonal(down, other, prior.orthogonal_within))
        oblique += static_cast<double>(points[j].lines.size()) / std::max(1.0, most);
    }
    const double cost = roll * roll + pitch * pitch + not_orthogonal * oblique;
    if (!(cost <= kMostCost)) continue;
    candidates.push_back({static_cast<int>(i), down, roll});
    if (candidates.size() > 1 && cost >= least) continue;
    least = cost;
    best = candidates.back();
  }
  if (!best) return best;
  // Of nearly parallel candidates the one with most lines is taken: a leaning wall must not replace the vertical.
  const AxisDirection upright = best->down;
  for (const Vertical& other : candidates)
    if (points[static_cast<std::size_t>(other.point)].lines.size() >
            points[static_cast<std::size_t>(best->point)].lines.size() &&
        upright.direction.cross(other.down.direction).norm() < std::sin(kNearlyParallel))
      best = other;
  return best;
}

RollPitch roll_pitch_of(const AxisDirection& down) {
  const Eigen::Vector3d& v = down.direction;
  const double level = std::hypot(v.x(), v.y());
  Eigen::Matrix<double, 2, 3> j;
  j << v.y() / (level * level), -v.x() / (level * level), 0,  //
      v.z() * v.x() / level, v.z() * v.y() / level, -level;
  return {std::atan2(v.x(), v.y()), std::atan2(-v.z(), level), propagated(j, down.covariance)};
}

Eigen::Matrix3d levelling_rotation(const Eigen::Vector3d& down) {
  const double sine = std::hypot(down.x(), down.z()), cosine = down.y();
  // Rodrigues' formula with cos(angle) = down.y, about the horizontal axis perpendicular to `down`.
  if (sine == 0)
    return cosine > 0 ? Eigen::Matrix3d::Identity() : Eigen::Vector3d(1, -1, -1).asDiagonal().toDenseMatrix();
  const Eigen::Vector3d axis(-down.z() / sine, 0, down.x() / sine);
  return cosine * Eigen::Matrix3d::Identity() + sine * skew(axis) + (1 - cosine) * axis * axis.transpose();
}

std::optional<AttitudeFromAxes> attitude_from_axes(std::span<const SeenAxis> axes) {
  if (axes.size() < 2) return std::nullopt;
  std::vector<Eigen::Vector3d> ground, seen;
  std::vector<Eigen::Matrix3d> covariances;
  for (const SeenAxis& axis : axes) {
    ground.push_back(axis.ground);
    seen.push_back(axis.seen.direction);
    covariances.push_back(axis.seen.covariance);
    if (!axis.ground.allFinite() || !axis.seen.direction.allFinite()) return std::nullopt;
  }
  // The closed form without weights is the approximation; the adjustment weighs the axes by their covariances.
  const auto fit =
      fit_gauss_helmert(AttitudeEquations{axes}, fit_rotation(ground, seen), std::span<const Eigen::Vector3d>(seen),
                        std::span<const Eigen::Matrix3d>(covariances));
  if (!fit) return std::nullopt;
  return AttitudeFromAxes{fit->state, fit->covariance, fit->weighted_squares, fit->redundancy};
}

}  // namespace megablock
