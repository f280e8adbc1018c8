#include "geometry/similarity/minimal_similarity.h"

#include <Eigen/LU>
#include <cmath>

#include "geometry/transform/triangle_pose.h"

namespace megablock {

namespace {

bool is_triangle(const std::array<Eigen::Vector3d, 3>& p) {
  const Eigen::Vector3d first = p[1] - p[0], second = p[2] - p[0];
  return first.cross(second).norm() > kMinTriangleArea * (first.squaredNorm() + second.squaredNorm());
}

}  // namespace

std::optional<Similarity> solve_similarity(const std::array<Eigen::Vector3d, 3>& from,
                                           const std::array<Eigen::Vector3d, 3>& to) {
  if (!is_triangle(from) || !is_triangle(to)) return std::nullopt;
  std::array<Eigen::Vector3d, 3> d, e;
  double squares_from = 0, squares_to = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    d[i] = from[(i + 1) % 3] - from[i];
    e[i] = to[(i + 1) % 3] - to[i];
    squares_from += d[i].squaredNorm();
    squares_to += e[i].squaredNorm();
  }
  const double scale = std::sqrt(squares_to / squares_from);
  // No turn, and the half turns about the three axes, as signs of the coordinates.
  static constexpr double kTurns[4][3] = {{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}};
  Eigen::Matrix3d best = Eigen::Matrix3d::Zero();
  double largest = 0;
  int chosen = -1;
  for (int k = 0; k < 4; ++k) {
    // With m = e + s d the equation is -[m]x v = e - s d; the normal matrix is the sum of [m]x' [m]x = |m|^2 I - m m'.
    const Eigen::Vector3d turn = scale * Eigen::Vector3d(kTurns[k][0], kTurns[k][1], kTurns[k][2]);
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    for (std::size_t i = 0; i < 3; ++i) {
      const Eigen::Vector3d sum = e[i] + turn.cwiseProduct(d[i]);
      normal -= sum * sum.transpose();
      normal.diagonal().array() += sum.squaredNorm();
    }
    const double determinant = normal.determinant();
    if (!(determinant > largest)) continue;
    largest = determinant;
    best = normal;
    chosen = k;
  }
  if (chosen < 0 || !std::isfinite(scale)) return std::nullopt;
  const Eigen::Vector3d signs(kTurns[chosen][0], kTurns[chosen][1], kTurns[chosen][2]);
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < 3; ++i) {
    const Eigen::Vector3d turned = scale * signs.cwiseProduct(d[i]);
    right += (e[i] + turned).cross(e[i] - turned);
  }
  const Eigen::Vector3d v = best.inverse() * right;
  const Eigen::Quaterniond half_turn =
      chosen == 0 ? Eigen::Quaterniond::Identity() : Eigen::Quaterniond(0, chosen == 1, chosen == 2, chosen == 3);
  Similarity result;
  result.scale = scale;
  result.rotation = (Eigen::Quaterniond(1, v.x(), v.y(), v.z()) * half_turn).normalized();
  const Eigen::Vector3d mean_from = (from[0] + from[1] + from[2]) / 3, mean_to = (to[0] + to[1] + to[2]) / 3;
  result.translation = mean_to - scale * (result.rotation * mean_from);
  if (!result.translation.allFinite() || !result.rotation.coeffs().allFinite()) return std::nullopt;
  return result;
}

}  // namespace megablock
