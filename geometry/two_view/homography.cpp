#include "geometry/two_view/homography.h"

#include <cmath>

#include "geometry/numbers/decompositions.h"
#include "geometry/numbers/row_qr.h"
#include "geometry/two_view/fundamental.h"

namespace megablock {

namespace {

constexpr double kHomographyRank = 1e-9;

// Least-squares solution of p . (H a) = 0 for two directions p perpendicular to each b, with Frobenius norm one.
// `ray_a` and `ray_b` return the i-th vector.
template <typename RayA, typename RayB>
std::optional<Eigen::Matrix3d> algebraic_homography(std::size_t count, const RayA& ray_a, const RayB& ray_b) {
  RowQr<9> equations;
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d a = ray_a(i), b = ray_b(i), first = b.unitOrthogonal(), second = b.cross(first);
    for (const Eigen::Vector3d& p : {first, second}) {
      Eigen::Matrix<double, 1, 9> row;
      row << p.x() * a.transpose(), p.y() * a.transpose(), p.z() * a.transpose();
      equations.add(row);
    }
  }
  const auto null = equations.null_vector(kHomographyRank);
  if (null.rank < 8) return std::nullopt;
  Eigen::Matrix3d h;
  h << null.vector.head<3>().transpose(), null.vector.segment<3>(3).transpose(), null.vector.tail<3>().transpose();
  return h;
}

}  // namespace

std::optional<Eigen::Matrix3d> fit_homography(std::span<const Eigen::Vector3d> a, std::span<const Eigen::Vector3d> b) {
  if (a.size() < 4 || a.size() != b.size()) return std::nullopt;
  const auto h = algebraic_homography(
      a.size(), [&](std::size_t i) { return a[i]; }, [&](std::size_t i) { return b[i]; });
  if (!h) return std::nullopt;
  // The sign of H is such that most points have positive depth; its scale makes the middle singular value one.
  std::size_t front = 0;
  for (std::size_t i = 0; i < a.size(); ++i) front += b[i].dot(*h * a[i]) > 0;
  if (a.size() == 4 && front != 0 && front != 4) return std::nullopt;
  const double middle = singular_values3(*h).values[1];
  if (!(middle > kHomographyRank)) return std::nullopt;
  return *h * ((2 * front >= a.size() ? 1 : -1) / middle);
}

std::optional<Eigen::Matrix3d> solve_four_point_homography(const std::array<Eigen::Vector3d, 4>& a,
                                                           const std::array<Eigen::Vector3d, 4>& b) {
  constexpr double kOneLine = 1e-9;  // limit of a determinant, relative to the lengths of its columns
  // Returns det(A) l and det(A) of a_4 = sum l_i a_i, or zeros where three points lie on one line. The columns of the
  // cofactor matrix are the rows of the inverse times det(A).
  const auto coordinates = [&](const std::array<Eigen::Vector3d, 4>& p, Eigen::Matrix3d& cofactor) {
    Eigen::Matrix3d m;
    m << p[0], p[1], p[2];
    cofactor = cofactors(m);
    Eigen::Vector4d l;
    l << cofactor.transpose() * p[3], p[0].dot(cofactor.col(0));
    const Eigen::Vector4d n(p[0].norm(), p[1].norm(), p[2].norm(), p[3].norm());
    const Eigen::Vector4d least = n.prod() * n.cwiseInverse();
    return (l.cwiseAbs().array() > kOneLine * least.array()).all() ? l : Eigen::Vector4d::Zero().eval();
  };
  Eigen::Matrix3d cofactor_a, cofactor_b;
  const Eigen::Vector4d l = coordinates(a, cofactor_a), m = coordinates(b, cofactor_b);
  if (!(l.w() * m.w() != 0)) return std::nullopt;
  const Eigen::Vector3d ratio = m.head<3>().cwiseQuotient(l.head<3>());
  // H takes a_1 to a_3 to positive multiples of b_1 to b_3 and a_4 to b_4; all signs must agree.
  const double sign = l.w() * m.w() > 0 ? 1 : -1;
  if (!((sign * ratio).minCoeff() > 0) || !ratio.allFinite()) return std::nullopt;
  Eigen::Matrix3d from;
  from << ratio.x() * b[0], ratio.y() * b[1], ratio.z() * b[2];
  return Eigen::Matrix3d(from * cofactor_a.transpose() * (m.w() > 0 ? 1 : -1));
}

std::optional<Eigen::Matrix3d> fit_pixel_homography(std::span<const Eigen::Vector2d> a,
                                                    std::span<const Eigen::Vector2d> b) {
  if (a.size() < 4 || a.size() != b.size()) return std::nullopt;
  const auto normal_a = normalising_transformation(a), normal_b = normalising_transformation(b);
  if (!normal_a || !normal_b) return std::nullopt;
  const auto h = algebraic_homography(
      a.size(), [&](std::size_t i) { return Eigen::Vector3d(*normal_a * a[i].homogeneous()); },
      [&](std::size_t i) { return Eigen::Vector3d(*normal_b * b[i].homogeneous()); });
  if (!h) return std::nullopt;
  const double scale = (*normal_b)(0, 0);
  Eigen::Matrix3d back;  // the inverse of normal_b
  back << 1 / scale, 0, -(*normal_b)(0, 2) / scale, 0, 1 / scale, -(*normal_b)(1, 2) / scale, 0, 0, 1;
  const Eigen::Matrix3d pixels = back * *h * *normal_a;
  return pixels / pixels.norm();
}

Solutions<PlanarOrientation, 4> orientations_of_homography(const Eigen::Matrix3d& h, double min_base_to_distance) {
  Solutions<PlanarOrientation, 4> found;
  if (!h.allFinite()) return found;
  const SymmetricEigen3 eigen = symmetric_eigen3(h.transpose() * h);
  const Eigen::Vector3d v1 = eigen.vectors.col(2), v2 = eigen.vectors.col(1), v3 = eigen.vectors.col(0);
  const double p = std::max(eigen.values[2], 1.0), q = std::min(eigen.values[0], 1.0);
  // |t|/d = sigma_1 - sigma_3.
  if (!(std::sqrt(p) - std::sqrt(std::max(q, 0.0)) > min_base_to_distance)) {
    const SingularValues3 svd = singular_values3(h);
    const Eigen::Matrix3d rotation = svd.u * svd.v.transpose();
    if (rotation.determinant() > 0) found.push_back({{Eigen::Quaterniond(rotation).normalized()}});
    return found;
  }
  for (const double sign : {1.0, -1.0}) {
    const Eigen::Vector3d u = ((std::sqrt(1 - q) * v1 + sign * std::sqrt(p - 1) * v3) / std::sqrt(p - q)).normalized();
    const Eigen::Vector3d normal = v2.cross(u);
    Eigen::Matrix3d from, to;
    from << v2, u, normal;
    to.col(0) = h * v2;
    to.col(1) = h * u;
    to.col(2) = to.col(0).cross(to.col(1));
    const Eigen::Quaterniond rotation = Eigen::Quaterniond(Eigen::Matrix3d(to * from.transpose())).normalized();
    const Eigen::Vector3d base = (h - rotation.toRotationMatrix()) * normal;
    const double length = base.norm();
    if (!rotation.coeffs().allFinite() || !(length > 0)) continue;
    found.push_back({{rotation, base / length}, normal, length});
    found.push_back({{rotation, -base / length}, -normal, length});
  }
  return found;
}

Solutions<PlanarOrientation, 2> visible_orientations(const Eigen::Matrix3d& homography,
                                                     std::span<const Eigen::Vector3d> a, double min_base_to_distance) {
  const auto all = orientations_of_homography(homography, min_base_to_distance);
  Solutions<PlanarOrientation, 2> found;
  if (all.size() == 1) {
    found.push_back(all.front());
    return found;
  }
  std::array<std::size_t, 4> visible{};
  for (std::size_t k = 0; k < all.size(); ++k)
    for (const Eigen::Vector3d& ray : a) visible[k] += all[k].normal.dot(ray) > 0;
  for (int round = 0; round < 2; ++round) {
    std::size_t best = 0;
    for (std::size_t k = 1; k < all.size(); ++k)
      if (visible[k] > visible[best]) best = k;
    if (all.empty() || 2 * visible[best] < a.size()) break;
    found.push_back(all[best]);
    visible[best] = 0;
  }
  return found;
}

}  // namespace megablock
