#include "geometry/camera/collinearity.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "geometry/numbers/decompositions.h"
#include "geometry/numbers/row_qr.h"
#include "geometry/numbers/solutions.h"

namespace megablock {

namespace {

// Turns the camera axes (y down, z forward) into the image axes (y up, looking along -z), and back.
const Eigen::Matrix3d kHalfTurnAboutX = Eigen::Vector3d(1, -1, -1).asDiagonal();

// Relative to the extent of the points: how far two points must be apart, or off a common plane, to count as different.
constexpr double kApart = 1e-5;

// Whether at least `Needed` of the points are different. A point measured twice adds two equations that errors make
// look independent, but no information.
template <std::size_t Needed>
bool has_distinct(std::span<const Eigen::Vector3d> points) {
  double extent = 0;
  for (const Eigen::Vector3d& p : points) extent = std::max(extent, (p - points.front()).norm());
  Solutions<Eigen::Vector3d, Needed> distinct;
  for (const Eigen::Vector3d& p : points) {
    if (distinct.size() == Needed) break;
    if (std::all_of(distinct.begin(), distinct.end(),
                    [&](const Eigen::Vector3d& other) { return (p - other).norm() > kApart * extent; }))
      distinct.push_back(p);
  }
  return distinct.size() == Needed;
}

}  // namespace

Eigen::Vector2d project(const NineParameters& image, const Eigen::Vector3d& point) {
  const Eigen::Vector3d n = image.rotation * (point - image.centre);
  return image.principal_point - image.principal_distance / n.z() * n.head<2>();
}

Eigen::Vector2d project(const ElevenParameters& image, const Eigen::Vector3d& point) {
  const Eigen::Vector3d m = point - image.origin;
  return Eigen::Vector2d(image.a.dot(m) + image.a4, image.b.dot(m) + image.b4) / (image.c.dot(m) + 1);
}

Pose pose_from(const NineParameters& image) {
  return {Eigen::Quaterniond(Eigen::Matrix3d(kHalfTurnAboutX * image.rotation)).normalized(), image.centre};
}

NineParameters nine_from(const Pose& pose, double principal_distance, const Eigen::Vector2d& principal_point) {
  return {kHalfTurnAboutX * pose.rotation.toRotationMatrix(), pose.centre, principal_point, principal_distance};
}

std::optional<ElevenParameters> eleven_from(const NineParameters& image, const Eigen::Vector3d& origin) {
  const Eigen::Vector3d l1 = image.rotation.row(0), l2 = image.rotation.row(1), l3 = image.rotation.row(2);
  const Eigen::Vector3d s = image.centre - origin;
  const double g = l3.dot(s);
  if (!(std::abs(g) > 1e-6 * s.norm())) return std::nullopt;
  // Equation (3).
  ElevenParameters e{origin, (image.principal_distance * l1 - image.principal_point.x() * l3) / g,
                     (image.principal_distance * l2 - image.principal_point.y() * l3) / g, -l3 / g};
  e.a4 = -e.a.dot(s);
  e.b4 = -e.b.dot(s);
  return e;
}

Eigen::Vector3d origin_before(const NineParameters& image, double distance) {
  return image.centre - distance * image.rotation.row(2).transpose();
}

std::optional<PhysicalParameters> nine_from(const ElevenParameters& e) {
  const double length = e.c.norm();
  const Eigen::Vector3d unit = e.c / length, scaled_a = e.a / length, scaled_b = e.b / length;
  PhysicalParameters result;
  NineParameters& image = result.image;
  image.principal_point = {scaled_a.dot(unit), scaled_b.dot(unit)};
  const Eigen::Vector3d along_x = scaled_a - image.principal_point.x() * unit,
                        along_y = scaled_b - image.principal_point.y() * unit;
  const double px = along_x.norm(), py = along_y.norm();
  image.principal_distance = 0.5 * (px + py);
  Eigen::Matrix3d rows;
  rows << along_x.transpose() / px, along_y.transpose() / py, -unit.transpose();
  const Eigen::Vector3d normal = rows.row(0).cross(rows.row(1));
  result.skew = std::asin(rows.row(0).dot(rows.row(1)));
  result.distance_ratio = py / px;
  // Rows that are parallel or zero have no inverse.
  if (!(length > 0) || !rows.allFinite() || !(normal.norm() > 1e-9)) return std::nullopt;
  if (rows.determinant() < 0) rows = -rows;
  const SingularValues3 svd = singular_values3(rows);
  image.rotation = svd.u * svd.v.transpose();
  // Each row of the system is scaled to length one.
  Eigen::Matrix3d system;
  system << e.a.transpose() / e.a.norm(), e.b.transpose() / e.b.norm(), unit.transpose();
  image.centre =
      e.origin + system.partialPivLu().solve(Eigen::Vector3d(-e.a4 / e.a.norm(), -e.b4 / e.b.norm(), -1 / length));
  if (!image.centre.allFinite() || !image.rotation.allFinite()) return std::nullopt;
  return result;
}

std::optional<ElevenParameters> fit_eleven(std::span<const Eigen::Vector3d> ground,
                                           std::span<const Eigen::Vector2d> image) {
  const std::size_t count = ground.size();
  if (image.size() != count || !has_distinct<6>(ground)) return std::nullopt;
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < count; ++i) {
    origin += ground[i] / static_cast<double>(count);
    middle += image[i] / static_cast<double>(count);
  }
  double extent = 0, size = 0;  // ground and image are scaled to about one, which makes the equations comparable
  for (std::size_t i = 0; i < count; ++i) {
    extent = std::max(extent, (ground[i] - origin).norm());
    size = std::max(size, (image[i] - middle).norm());
  }
  // The test uses the ground coordinates only. Errors of the image coordinates would hide that points in one plane
  // leave the equations singular.
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& m : ground) scatter += (m - origin) * (m - origin).transpose() / (extent * extent);
  const double thinnest = symmetric_eigen3(scatter).values(0);
  if (!(thinnest > kApart * kApart * static_cast<double>(count))) return std::nullopt;
  // The equations (2) times their denominator, A.m + a_4 - x (C.m + 1) = 0, as a null vector of twelve elements.
  RowQr<12> equations;
  for (std::size_t i = 0; i < count; ++i) {
    Eigen::Vector4d m;
    m << (ground[i] - origin) / extent, 1;
    const Eigen::Vector2d at = (image[i] - middle) / size;
    for (int k = 0; k < 2; ++k) {
      Eigen::Matrix<double, 1, 12> row = Eigen::Matrix<double, 1, 12>::Zero();
      row.segment<4>(4 * k) = m.transpose();
      row.tail<4>() = -at[k] * m.transpose();
      equations.add(row);
    }
  }
  const auto null = equations.null_vector(1e-7);
  const double one = null.vector[11];
  if (null.rank < 11 || !(std::abs(one) > 1e-6)) return std::nullopt;
  const Eigen::Vector3d a = null.vector.segment<3>(0) / one, b = null.vector.segment<3>(4) / one,
                        c = null.vector.segment<3>(8) / one;
  // Undo the scaling of ground and image.
  ElevenParameters e{origin, (size * a + middle.x() * c) / extent, (size * b + middle.y() * c) / extent, c / extent};
  e.a4 = size * null.vector[3] / one + middle.x();
  e.b4 = size * null.vector[7] / one + middle.y();
  return e;
}

namespace {

using Vector9 = Eigen::Matrix<double, 9, 1>;
using Matrix9 = Eigen::Matrix<double, 9, 9>;

struct NineEquations {
  Matrix9 normal = Matrix9::Zero();
  Vector9 gradient = Vector9::Zero();
  double squares = 0;
};

// Normal equations of (1) for the increments of rotation (3), S, x_p, y_p, p. Returns false where a point lies behind
// the image.
bool linearise_nine(const NineParameters& image, std::span<const Eigen::Vector3d> ground,
                    std::span<const Eigen::Vector2d> measured, NineEquations& equations) {
  equations = {};
  const double p = image.principal_distance;
  for (std::size_t i = 0; i < ground.size(); ++i) {
    const Eigen::Vector3d d = ground[i] - image.centre, n = image.rotation * d;
    if (!(n.z() < 0)) return false;
    const Eigen::Vector2d ratio = n.head<2>() / n.z(), residual = image.principal_point - p * ratio - measured[i];
    Eigen::Matrix<double, 2, 3> by_inside;
    by_inside << -p / n.z(), 0, p * ratio.x() / n.z(), 0, -p / n.z(), p * ratio.y() / n.z();
    const Eigen::Matrix<double, 2, 3> by_ground = by_inside * image.rotation;
    Eigen::Matrix<double, 2, 9> jacobian;
    jacobian << -by_ground * skew<double>(d), -by_ground, Eigen::Matrix2d::Identity(), -ratio;
    equations.normal += jacobian.transpose() * jacobian;
    equations.gradient += jacobian.transpose() * residual;
    equations.squares += residual.squaredNorm();
  }
  return std::isfinite(equations.squares);
}

}  // namespace

std::optional<FittedNine> fit_nine(const NineParameters& start, std::span<const Eigen::Vector3d> ground,
                                   std::span<const Eigen::Vector2d> measured) {
  if (measured.size() != ground.size() || !has_distinct<5>(ground)) return std::nullopt;
  FittedNine fitted{start, 0, Matrix9::Zero()};
  NineEquations equations;
  if (!linearise_nine(start, ground, measured, equations)) return std::nullopt;
  double damping = 1e-6;
  constexpr int kMaxIterations = 100;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    // Angles, metres and pixels differ by orders of magnitude; scaling makes the diagonal one.
    const Vector9 scale = equations.normal.diagonal().cwiseSqrt().cwiseInverse();
    Matrix9 scaled = scale.asDiagonal() * equations.normal * scale.asDiagonal();
    if (!scaled.allFinite()) return std::nullopt;
    const Vector9 gradient = scale.cwiseProduct(equations.gradient);
    Matrix9 damped = scaled;
    damped.diagonal().array() += damping;
    const Vector9 step = -damped.ldlt().solve(gradient), d = scale.cwiseProduct(step);
    NineParameters next = fitted.image;
    next.rotation = fitted.image.rotation * rotation_exp<double>(d.head<3>()).toRotationMatrix();
    next.centre += d.segment<3>(3);
    next.principal_point += d.segment<2>(6);
    next.principal_distance += d[8];
    NineEquations there;
    const double decrement = -step.dot(gradient);
    const bool settled = decrement <= 1e-16 * (1 + equations.squares);
    if (linearise_nine(next, ground, measured, there) && there.squares <= equations.squares) {
      fitted.image = next;
      equations = there;
      damping = std::max(0.1 * damping, 1e-15);
    } else if (!settled) {
      damping = std::max(10 * damping, 1e-12);
      if (damping > 1e6) return std::nullopt;
      continue;
    }
    if (!settled) continue;
    const Eigen::LDLT<Matrix9> factor(scaled);
    if (factor.info() != Eigen::Success || !(factor.vectorD().minCoeff() > 1e-14)) return std::nullopt;
    fitted.squares = equations.squares;
    fitted.cofactors = scale.asDiagonal() * factor.solve(Matrix9(Matrix9::Identity())) * scale.asDiagonal();
    fitted.image.rotation = Eigen::Quaterniond(fitted.image.rotation).normalized().toRotationMatrix();
    return fitted;
  }
  return std::nullopt;
}

std::optional<Eigen::Vector3d> restitute(std::span<const ElevenParameters> images,
                                         std::span<const Eigen::Vector2d> coordinates) {
  if (images.size() < 2 || coordinates.size() != images.size()) return std::nullopt;
  const Eigen::Vector3d reference = images.front().origin;
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  // relative to `reference`
  constexpr int kPasses = 3;
  for (int pass = 0; pass < kPasses; ++pass) {
    RowQr<4> equations;
    for (std::size_t i = 0; i < images.size(); ++i) {
      const ElevenParameters& e = images[i];
      const Eigen::Vector3d shift = e.origin - reference;
      const double denominator = pass == 0 ? 1 : e.c.dot(point - shift) + 1;
      for (int k = 0; k < 2; ++k) {
        const double x = coordinates[i][k];
        const Eigen::Vector3d row = (k == 0 ? e.a : e.b) - x * e.c;
        Eigen::Matrix<double, 1, 4> augmented;
        augmented << row.transpose(), x - (k == 0 ? e.a4 : e.b4) + row.dot(shift);
        equations.add(augmented / denominator);
      }
    }
    const Eigen::Matrix3d triangle = equations.factor().topLeftCorner<3, 3>();
    const SingularValues3 svd = singular_values3(triangle);
    if (!triangle.allFinite() || !(svd.values[2] > 1e-7 * svd.values[0])) return std::nullopt;
    point = svd.v * (svd.u.transpose() * equations.factor().topRightCorner<3, 1>()).cwiseQuotient(svd.values);
  }
  point += reference;
  if (!point.allFinite()) return std::nullopt;
  for (const ElevenParameters& image : images)
    if (!in_front(image, point)) return std::nullopt;
  return point;
}

}  // namespace megablock
