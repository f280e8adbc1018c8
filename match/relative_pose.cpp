#include "match/relative_pose.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <array>
#include <cmath>

#include "geometry/rotation.h"
#include "geometry/rotation_fit.h"

namespace megablock {

namespace {

using Matrix5 = Eigen::Matrix<double, 5, 5>;
using Vector5 = Eigen::Matrix<double, 5, 1>;

// Two unit vectors that complete t to an orthogonal basis.
std::array<Eigen::Vector3d, 2> tangent_basis(const Eigen::Vector3d& t) {
  const Eigen::Vector3d first = t.unitOrthogonal();
  return {first, t.cross(first)};
}

struct Linearised {
  Matrix5 normal = Matrix5::Zero();
  Vector5 gradient = Vector5::Zero();
  double cost = 0;
};

// Geman-McClure: rho(r) = r^2 / (1 + r^2/s^2), weight 1 / (1 + r^2/s^2)^2; its reach is about 3 s.
Linearised linearise(const RelativePoseEstimate& pose, const PointPairs& points, double scale) {
  const Eigen::Matrix3d rotation = pose.rotation.toRotationMatrix();
  const Eigen::Matrix3d essential = skew<double>(pose.translation) * rotation;
  std::array<Eigen::Matrix3d, 5> derivative;
  for (int i = 0; i < 3; ++i)
    derivative[static_cast<std::size_t>(i)] = essential * skew<double>(Eigen::Vector3d::Unit(i));
  const auto basis = tangent_basis(pose.translation);
  for (std::size_t i = 0; i < 2; ++i) derivative[3 + i] = skew<double>(basis[i]) * rotation;

  Linearised result;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d a = points.a[i].homogeneous(), b = points.b[i].homogeneous();
    const Eigen::Vector3d line_b = essential * a, line_a = essential.transpose() * b;
    const double n = b.dot(line_b), d = line_b.head<2>().squaredNorm() + line_a.head<2>().squaredNorm();
    if (!(d > 0)) continue;
    const double root = 1 / std::sqrt(d), r = n * root;
    const double q = 1 + r * r / (scale * scale), weight = 1 / (q * q);
    result.cost += r * r / q;
    if (weight < 1e-3) continue;
    Vector5 jacobian;
    for (int j = 0; j < 5; ++j) {
      const Eigen::Matrix3d& e = derivative[static_cast<std::size_t>(j)];
      const Eigen::Vector3d by_a = e * a;
      const Eigen::Vector2d by_b = (e.transpose() * b).head<2>();
      const double dn = b.dot(by_a);
      const double half_dd = line_b.head<2>().dot(by_a.head<2>()) + line_a.head<2>().dot(by_b);
      jacobian[j] = root * (dn - n * half_dd / d);
    }
    result.normal.noalias() += weight * jacobian * jacobian.transpose();
    result.gradient += weight * r * jacobian;
  }
  return result;
}

RelativePoseEstimate update(const RelativePoseEstimate& pose, const Vector5& step) {
  const auto basis = tangent_basis(pose.translation);
  return {rotation_update(pose.rotation, step.head<3>()),
          (pose.translation + step[3] * basis[0] + step[4] * basis[1]).normalized()};
}

// Whether the rays meet in front of both cameras; parallel within `tolerance` (radians) counts as yes.
bool in_front(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& t, const Eigen::Vector2d& a,
              const Eigen::Vector2d& b, double tolerance) {
  const Eigen::Vector3d u = rotation * a.homogeneous(), v = b.homogeneous();
  const Eigen::Vector3d normal = v.cross(u);
  const double square = normal.squaredNorm();
  if (square < tolerance * tolerance * u.squaredNorm() * v.squaredNorm()) return true;
  // s u + t = r v: cross products with v and u.
  const double s = -normal.dot(v.cross(t)), r = normal.dot(t.cross(u));
  return s > 0 && r > 0;
}

void count(Support& support, std::size_t i, double residual_squared, double limit_squared) {
  if (!(residual_squared <= limit_squared)) return;
  support.inlier[i] = 1;
  ++support.count;
  support.score += 1 - residual_squared / limit_squared;
}

}  // namespace

double sampson_residual(const Eigen::Matrix3d& essential, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const Eigen::Vector3d line_b = essential * a.homogeneous(), line_a = essential.transpose() * b.homogeneous();
  const double d = line_b.head<2>().squaredNorm() + line_a.head<2>().squaredNorm();
  return b.homogeneous().dot(line_b) / std::sqrt(d);
}

Eigen::Matrix3d essential_matrix(const RelativePoseEstimate& pose) {
  return skew<double>(pose.translation) * pose.rotation.toRotationMatrix();
}

std::vector<RelativePoseEstimate> decompose_essential(const Eigen::Matrix3d& essential) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(essential, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d u = svd.matrixU(), v = svd.matrixV();
  if (u.determinant() < 0) u = -u;
  if (v.determinant() < 0) v = -v;
  Eigen::Matrix3d quarter;
  quarter << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  std::vector<RelativePoseEstimate> poses;
  for (const Eigen::Matrix3d& rotation :
       {Eigen::Matrix3d(u * quarter * v.transpose()), Eigen::Matrix3d(u * quarter.transpose() * v.transpose())}) {
    for (const double sign : {1.0, -1.0}) {
      poses.push_back({Eigen::Quaterniond(rotation).normalized(), sign * u.col(2)});
    }
  }
  return poses;
}

double intersection_angle(const Eigen::Quaterniond& rotation, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const Eigen::Vector3d u = rotation * a.homogeneous(), v = b.homogeneous();
  return std::atan2(u.cross(v).norm(), u.dot(v));
}

Support support_of(const RelativePoseEstimate& pose, const PointPairs& points, double max_residual) {
  Support support{std::vector<std::uint8_t>(points.size(), 0)};
  const Eigen::Matrix3d rotation = pose.rotation.toRotationMatrix(), essential = essential_matrix(pose);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double r = sampson_residual(essential, points.a[i], points.b[i]);
    if (!(std::abs(r) <= max_residual)) continue;
    if (!in_front(rotation, pose.translation, points.a[i], points.b[i], max_residual)) continue;
    count(support, i, r * r, max_residual * max_residual);
  }
  return support;
}

Support support_of_rotation(const Eigen::Quaterniond& rotation, const PointPairs& points, double max_residual) {
  Support support{std::vector<std::uint8_t>(points.size(), 0)};
  const Eigen::Matrix3d matrix = rotation.toRotationMatrix();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d turned = matrix * points.a[i].homogeneous();
    if (!(turned.z() > 0)) continue;
    count(support, i, (turned.hnormalized() - points.b[i]).squaredNorm(), max_residual * max_residual);
  }
  return support;
}

Support support_of_fundamental(const Eigen::Matrix3d& fundamental, const PointPairs& points, double max_residual) {
  Support support{std::vector<std::uint8_t>(points.size(), 0)};
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double r = sampson_residual(fundamental, points.a[i], points.b[i]);
    count(support, i, r * r, max_residual * max_residual);
  }
  return support;
}

RelativePoseEstimate refine(const RelativePoseEstimate& start, const PointPairs& points, double scale) {
  constexpr int kMaxIterations = 30;
  RelativePoseEstimate pose = start;
  Linearised current = linearise(pose, points, scale);
  double damping = 1e-6;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    Matrix5 damped = current.normal;
    damped.diagonal() *= 1 + damping;
    damped.diagonal().array() += 1e-12 * current.normal.trace();
    const Vector5 step = -damped.ldlt().solve(current.gradient);
    if (!step.allFinite()) break;
    const RelativePoseEstimate next = update(pose, step);
    const Linearised there = linearise(next, points, scale);
    if (there.cost < current.cost) {
      pose = next;
      current = there;
      damping = std::max(damping * 0.1, 1e-9);
    } else {
      damping *= 100;
      if (damping > 1e6) break;
    }
    if (step.norm() < 1e-9) break;
  }
  return pose;
}

Eigen::Quaterniond fit_rotation(const PointPairs& points, const std::vector<std::size_t>& rows) {
  std::vector<Eigen::Vector3d> from, to;
  for (const std::size_t i : rows) {
    from.push_back(points.a[i].homogeneous().normalized());
    to.push_back(points.b[i].homogeneous().normalized());
  }
  return fit_rotation(from, to);
}

}  // namespace megablock
