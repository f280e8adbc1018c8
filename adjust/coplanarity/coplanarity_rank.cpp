// Ranks. B is block diagonal by points. With B_j = U S V' of a point and U_0 the columns of U beyond its rank,
//
//     rank (A B) = sum rank B_j + rank of the stacked U_0' A_j,
//
// since U_0' takes out what the image coordinates of the point can absorb. Only matrices of one point and of all angles
// are formed. Rows are divided by |m| |d_1| |d_2|, and columns of images multiplied by f, so that the singular values
// of different points can be compared.
#include "adjust/coplanarity/coplanarity_rank.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "adjust/coplanarity/coplanarity_equations.h"
#include "geometry/intersection/triangulation.h"
#include "geometry/numbers/decompositions.h"
#include "geometry/numbers/straight_line.h"

namespace megablock {

namespace {

// Normal equations hold the squares of the singular values. Their rounding, 1e-16 of the largest, is 1e-8 in the
// singular values themselves.
constexpr double kAngles = 1e-6;  // share of the largest singular value, from normal equations of the angles

// The number of descending values above a share of the first.
std::int64_t rank_of(std::span<const double> values, double tolerance) {
  const auto above = [&](double value) { return value > tolerance * values.front() && value > 0; };
  return std::ranges::find_if_not(values, above) - values.begin();
}

// The image coordinates at which the rays of every point meet, so that noise does not raise the ranks. Points whose
// rays do not meet in front of the cameras are left out.
CoplanarityNetwork brought_together(const CoplanarityNetwork& network, std::vector<std::uint8_t>& met) {
  CoplanarityNetwork result = network;
  met.assign(static_cast<std::size_t>(network.point_count()), 0);
  for (std::size_t j = 0; j < met.size(); ++j) {
    std::vector<Ray> rays;
    for (auto o = static_cast<std::size_t>(network.begin[j]); o < static_cast<std::size_t>(network.begin[j + 1]); ++o) {
      const auto camera = static_cast<std::size_t>(network.camera[o]);
      rays.push_back({network.centres[camera],
                      angled_ray(network.angles[camera], network.image[o], network.focal_px).direction.normalized()});
    }
    const auto point = intersect_rays(rays);
    if (!point) continue;
    std::vector<Eigen::Vector2d> image;
    for (auto o = static_cast<std::size_t>(network.begin[j]); o < static_cast<std::size_t>(network.begin[j + 1]); ++o) {
      const auto camera = static_cast<std::size_t>(network.camera[o]);
      const Eigen::Vector3d inside = rotation_from(network.angles[camera]) * (*point - network.centres[camera]);
      if (!(inside.z() > 0)) break;
      image.push_back(network.focal_px * inside.hnormalized());
    }
    if (image.size() < rays.size()) continue;
    met[j] = 1;
    std::copy(image.begin(), image.end(), result.image.begin() + network.begin[j]);
  }
  return result;
}

// Whether the cameras of every point that three or more see lie on one line. Two cameras always do, with 2K - 3 = K - 1
// conditions.
bool on_one_line(const CoplanarityNetwork& network) {
  bool any = false;
  for (std::size_t j = 0; j + 1 < network.begin.size(); ++j) {
    const auto first = static_cast<std::size_t>(network.begin[j]), end = static_cast<std::size_t>(network.begin[j + 1]);
    if (end - first < 3) continue;
    any = true;
    const auto centre = [&](std::size_t o) { return network.centres[static_cast<std::size_t>(network.camera[o])]; };
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (std::size_t o = first; o < end; ++o) mean += centre(o) / static_cast<double>(end - first);
    Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
    for (std::size_t o = first; o < end; ++o) scatter += (centre(o) - mean) * (centre(o) - mean).transpose();
    if (!straight_line(scatter)) return false;
  }
  return any;
}

// The columns of the free parameters of one point: the angles of its cameras, or its image coordinates.
std::vector<std::int64_t> free_columns(const CoplanarityNetwork& network, const FreeColumns& free, std::int64_t point,
                                       bool angles) {
  std::vector<std::int64_t> columns;
  const auto end = static_cast<std::size_t>(network.begin[static_cast<std::size_t>(point) + 1]);
  for (auto o = static_cast<std::size_t>(network.begin[static_cast<std::size_t>(point)]); o < end; ++o)
    for (std::size_t k = 0; k < (angles ? 3u : 2u); ++k) {
      const std::int64_t column =
          angles ? free.angle[3 * static_cast<std::size_t>(network.camera[o]) + k] : free.image[2 * o + k];
      if (column >= 0) columns.push_back(column);
    }
  std::sort(columns.begin(), columns.end());
  return columns;
}

// The equations of one point, with every row divided by |m| |d_1| |d_2|.
struct PointEquations {
  std::vector<std::int64_t> angles;      // columns of the free angles of its cameras
  Eigen::MatrixXd by_angles, by_images;  // [pairs x angles], [pairs x free coordinates of the point]
};
PointEquations point_equations(const CoplanarityNetwork& network, const FreeColumns& free, std::int64_t point) {
  const std::int64_t views =
      network.begin[static_cast<std::size_t>(point) + 1] - network.begin[static_cast<std::size_t>(point)];
  PointEquations result;
  result.angles = free_columns(network, free, point, true);
  const std::vector<std::int64_t> images = free_columns(network, free, point, false);
  result.by_angles = Eigen::MatrixXd::Zero(views * (views - 1) / 2, std::ssize(result.angles));
  result.by_images = Eigen::MatrixXd::Zero(views * (views - 1) / 2, std::ssize(images));
  const auto place = [](const std::vector<std::int64_t>& columns, std::int64_t column) {
    return std::lower_bound(columns.begin(), columns.end(), column) - columns.begin();
  };
  std::int64_t row = 0;
  visit_pairs(network, point, [&](std::size_t a, std::size_t b) {
    const double scale = 1 / scale_of_determinant(network, a, b);
    visit_derivatives(network, free, a, b, determinant(network, a, b), [&](std::int64_t column, double value) {
      if (column < free.angles)
        result.by_angles(row, place(result.angles, column)) = scale * value;
      else
        result.by_images(row, place(images, column)) = scale * network.focal_px * value;
    });
    ++row;
  });
  return result;
}

// normal += A'A, for rows A that have only these columns.
void add_normal(const Eigen::MatrixXd& rows, const std::vector<std::int64_t>& columns, Eigen::MatrixXd& normal) {
  const Eigen::MatrixXd squared = rows.transpose() * rows;
  for (std::size_t r = 0; r < columns.size(); ++r)
    for (std::size_t c = 0; c < columns.size(); ++c)
      normal(columns[r], columns[c]) += squared(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(c));
}

// Uses only points whose rays met.
std::vector<double> singular_values_of_angles(const CoplanarityNetwork& network, const FreeColumns& free,
                                              const std::vector<std::uint8_t>& met) {
  if (free.angles == 0) return {};
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(free.angles, free.angles);
  for (std::int64_t j = 0; j < network.point_count(); ++j) {
    if (!met[static_cast<std::size_t>(j)]) continue;
    visit_pairs(network, j, [&](std::size_t a, std::size_t b) {
      std::vector<std::pair<std::int64_t, double>> entries;
      visit_derivatives(network, free, a, b, determinant(network, a, b), [&](std::int64_t column, double value) {
        if (column < free.angles) entries.emplace_back(column, value);
      });
      for (const auto& [r, x] : entries)
        for (const auto& [c, y] : entries) normal(r, c) += x * y;
    });
  }
  const SymmetricEigen eigen = symmetric_eigen(normal);
  std::vector<double> values;
  for (Eigen::Index i = eigen.values.size(); i-- > 0;) values.push_back(std::sqrt(std::max(0.0, eigen.values(i))));
  return values;
}

}  // namespace

std::int64_t CoplanarityDiagnosis::angle_rank() const { return rank_of(angle_values, kAngles); }

double CoplanarityDiagnosis::angle_condition() const {
  if (angle_values.empty()) return 1;
  return angle_values.back() > 0 ? angle_values.front() / angle_values.back() : std::numeric_limits<double>::infinity();
}

CoplanarityDiagnosis diagnose(const CoplanarityNetwork& network) {
  network.check();
  constexpr double kRank = 1e-9;  // share of the largest singular value, for exact rays
  std::vector<std::uint8_t> met;
  const CoplanarityNetwork exact = brought_together(network, met);
  const FreeColumns free(network);
  CoplanarityDiagnosis result;
  result.rows = pair_count(network);
  result.columns = free.count;
  result.collinear = on_one_line(network);
  result.angle_values = singular_values_of_angles(exact, free, met);

  // The part of A that remains after the image coordinates have absorbed theirs: U_0'A with B = U S V', U_0 beyond the
  // rank.
  Eigen::MatrixXd left = Eigen::MatrixXd::Zero(free.angles, free.angles), whole = left;
  for (std::int64_t j = 0; j < network.point_count(); ++j) {
    if (!met[static_cast<std::size_t>(j)]) continue;
    const PointEquations point = point_equations(exact, free, j);
    // Without free image coordinates of the point, nothing is absorbed.
    Eigen::MatrixXd remaining = point.by_angles;
    if (point.by_images.cols() > 0) {
      const SingularValues svd = singular_values(point.by_images);
      const std::int64_t rank = rank_of({svd.values.data(), static_cast<std::size_t>(svd.values.size())}, kRank);
      result.image_rank += rank;
      remaining = svd.u.rightCols(svd.u.cols() - rank).transpose() * point.by_angles;
    }
    add_normal(remaining, point.angles, left);
    add_normal(point.by_angles, point.angles, whole);
  }
  result.rank = result.image_rank;
  if (free.angles == 0) return result;
  // The scale of the ranks is that of A before anything is absorbed.
  const double largest = symmetric_eigen(whole).values(free.angles - 1);
  const SymmetricEigen values = symmetric_eigen(left);
  for (Eigen::Index i = 0; i < values.values.size(); ++i) result.rank += values.values(i) > kAngles * kAngles * largest;
  return result;
}

CoplanaritySpectrum spectrum(const CoplanarityNetwork& network) {
  const CoplanarityDiagnosis diagnosis = diagnose(network);
  std::vector<std::uint8_t> met;
  const CoplanarityNetwork exact = brought_together(network, met);
  const FreeColumns free(network);
  // Rows of points whose rays do not meet stay zero.
  Eigen::MatrixXd both = Eigen::MatrixXd::Zero(diagnosis.rows, free.count);
  Eigen::Index row = 0;
  for (std::int64_t j = 0; j < network.point_count(); ++j) {
    if (!met[static_cast<std::size_t>(j)]) continue;
    visit_pairs(network, j, [&](std::size_t a, std::size_t b) {
      visit_derivatives(exact, free, a, b, determinant(exact, a, b),
                        [&](std::int64_t column, double value) { both(row, column) = value; });
      ++row;
    });
  }
  // The eigenvalues of (0 C; C' 0), half of them negative. No squares are formed, which would lose the small ones. The
  // rank of the scaled rows tells how many are not zero.
  const auto above_zero = [](const Eigen::MatrixXd& c, std::int64_t rank) -> std::vector<double> {
    Eigen::MatrixXd symmetric = Eigen::MatrixXd::Zero(c.rows() + c.cols(), c.rows() + c.cols());
    // symmetric_eigen() reads the lower triangle.
    symmetric.bottomLeftCorner(c.cols(), c.rows()) = c.transpose();
    const Eigen::VectorXd values = symmetric_eigen(symmetric).values.reverse().head(rank);
    return {values.begin(), values.end()};
  };
  return {above_zero(both.leftCols(free.angles), diagnosis.angle_rank()),
          above_zero(both.rightCols(free.count - free.angles), diagnosis.image_rank), above_zero(both, diagnosis.rank)};
}

}  // namespace megablock
