// Solves the equations of coplanarity_adjustment.h. Their columns are angles of the cameras (3 each), then image
// coordinates of the observations (2 each), without those that are held. A row is one pair of one point,
//
//     F = det(d_1 | d_2 | m),   m = C_2 - C_1,
//
// with the derivatives of coplanarity_determinant(). A forced parameter has a row of its own, weight * (sum of all its
// corrections) = 0.
//
// Ranks. B is block diagonal by points. With B_j = U S V' of a point and U_0 the columns of U beyond its rank,
//
//     rank (A B) = sum rank B_j + rank of the stacked U_0' A_j,
//
// since U_0' takes out what the image coordinates of the point can absorb. Only matrices of one point and of all angles
// are formed. Rows are divided by |m| |d_1| |d_2|, and columns of images multiplied by f, so that the singular values
// of different points can be compared.
#include "adjust/coplanarity/coplanarity_adjustment.h"

#include <fmt/core.h>

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <Eigen/SparseQR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "adjust/orientation/straight_line.h"
#include "geometry/intersection/triangulation.h"
#include "geometry/numbers/chi_square.h"
#include "geometry/numbers/decompositions.h"
#include "io/base/error.h"

namespace megablock {

namespace {

using RowMatrix = Eigen::SparseMatrix<double, Eigen::RowMajor>;

// The columns of the free parameters: angles camera by camera, then image coordinates observation by observation; -1:
// held.
struct FreeColumns {
  std::vector<std::int64_t> angle, image;  // [3 x cameras], [2 x observations]
  std::int64_t angles = 0, count = 0;

  explicit FreeColumns(const CoplanarityNetwork& network) {
    const auto take = [this](std::size_t size, const std::vector<std::uint8_t>& held) {
      std::vector<std::int64_t> columns(size);
      for (std::size_t i = 0; i < size; ++i) columns[i] = !held.empty() && held[i] ? -1 : count++;
      return columns;
    };
    angle = take(3 * network.centres.size(), network.angles_held);
    angles = count;
    image = take(2 * network.image.size(), network.images_held);
  }
  bool holds_angles() const { return angles < std::ssize(angle); }
  bool frees_images() const { return count > angles; }
};

// Calls use(first observation, second observation) for every pair of every point, in the order of the rows.
template <typename Use>
void visit_pairs(const CoplanarityNetwork& network, std::int64_t point, Use use) {
  const auto end = static_cast<std::size_t>(network.begin[static_cast<std::size_t>(point) + 1]);
  for (auto a = static_cast<std::size_t>(network.begin[static_cast<std::size_t>(point)]); a < end; ++a)
    for (std::size_t b = a + 1; b < end; ++b) use(a, b);
}

Eigen::Vector3d base_of(const CoplanarityNetwork& network, std::size_t a, std::size_t b) {
  return network.centres[static_cast<std::size_t>(network.camera[b])] -
         network.centres[static_cast<std::size_t>(network.camera[a])];
}

CoplanarityDeterminant determinant(const CoplanarityNetwork& network, std::size_t a, std::size_t b) {
  return coplanarity_determinant(base_of(network, a, b), network.focal_px,
                                 network.angles[static_cast<std::size_t>(network.camera[a])], network.image[a],
                                 network.angles[static_cast<std::size_t>(network.camera[b])], network.image[b]);
}

// Calls use(column, derivative) for the free parameters of a pair.
template <typename Use>
void visit_derivatives(const CoplanarityNetwork& network, const FreeColumns& free, std::size_t a, std::size_t b,
                       const CoplanarityDeterminant& f, Use use) {
  const auto side = [&](std::size_t observation, const Eigen::Matrix<double, 1, 5>& by) {
    const auto camera = static_cast<std::size_t>(network.camera[observation]);
    for (std::size_t k = 0; k < 3; ++k)
      if (const std::int64_t c = free.angle[3 * camera + k]; c >= 0) use(c, by[static_cast<Eigen::Index>(k)]);
    for (std::size_t k = 0; k < 2; ++k)
      if (const std::int64_t c = free.image[2 * observation + k]; c >= 0) use(c, by[static_cast<Eigen::Index>(3 + k)]);
  };
  side(a, f.by_first);
  side(b, f.by_second);
}

std::int64_t pair_count(const CoplanarityNetwork& network) {
  std::int64_t rows = 0;
  for (std::size_t j = 0; j + 1 < network.begin.size(); ++j) {
    const std::int64_t views = network.begin[j + 1] - network.begin[j];
    rows += views * (views - 1) / 2;
  }
  return rows;
}

// |m| |d_1| |d_2|, the size of the determinant where the three vectors are far from coplanar.
double scale_of_determinant(const CoplanarityNetwork& network, std::size_t a, std::size_t b) {
  const auto length = [&](std::size_t o) { return std::hypot(1.0, network.image[o].norm() / network.focal_px); };
  return base_of(network, a, b).norm() * length(a) * length(b);
}

// The mean over all pairs of all points.
struct MeanDeterminant {
  double value = 0;     // of |F|
  double rounding = 0;  // bound of the effect of rounding
};
MeanDeterminant mean_determinant(const CoplanarityNetwork& network) {
  // A ray has the rounding errors of its angles (up to pi), of their sines and cosines, and of two successive products
  // and sums; the determinant of two rays has those of its own three. These are some sixteen roundings of half an
  // epsilon.
  constexpr double kRoundings = 8 * std::numeric_limits<double>::epsilon();
  MeanDeterminant mean;
  const auto rows = static_cast<double>(pair_count(network));
  for (std::int64_t j = 0; j < network.point_count(); ++j)
    visit_pairs(network, j, [&](std::size_t a, std::size_t b) {
      mean.value += std::abs(determinant(network, a, b).value) / rows;
      mean.rounding += kRoundings * scale_of_determinant(network, a, b) / rows;
    });
  return mean;
}

// The equations of a step. `total` holds the corrections made so far, which the forcing pulls back to zero.
struct Equations {
  RowMatrix matrix;
  Eigen::VectorXd right;
};
Equations equations(const CoplanarityNetwork& network, const FreeColumns& free, const CoplanarityOptions& options,
                    const Eigen::VectorXd& total) {
  const std::int64_t rows = pair_count(network), forced = options.forced() ? free.count : 0;
  // Rows: the pairs of all points in their order, then the forced parameters.
  std::vector<Eigen::Triplet<double, std::int64_t>> entries;
  Equations result;
  result.right = Eigen::VectorXd::Zero(rows + forced);
  std::int64_t row = 0;
  for (std::int64_t j = 0; j < network.point_count(); ++j)
    visit_pairs(network, j, [&](std::size_t a, std::size_t b) {
      const CoplanarityDeterminant f = determinant(network, a, b);
      visit_derivatives(network, free, a, b, f,
                        [&](std::int64_t column, double value) { entries.emplace_back(row, column, value); });
      result.right[row++] = -f.value;
    });
  for (std::int64_t c = 0; c < forced; ++c, ++row) {
    const double weight = c < free.angles ? options.forcing_angles / options.angle_sigma_rad
                                          : options.forcing_images / options.image_sigma_px;
    entries.emplace_back(row, c, weight);
    result.right[row] = -weight * total[c];
  }
  result.matrix.resize(rows + forced, free.count);
  result.matrix.setFromTriplets(entries.begin(), entries.end());
  return result;
}

// Columns are scaled to unit length, because radians and pixels differ by the focal length.
Eigen::VectorXd solve_directly(const Equations& system) {
  Eigen::SparseMatrix<double> scaled = system.matrix;
  Eigen::VectorXd scale(scaled.cols());
  for (Eigen::Index c = 0; c < scaled.cols(); ++c) {
    const double length = scaled.col(c).norm();
    scale[c] = length > 0 ? 1 / length : 0;
    scaled.col(c) *= scale[c];
  }
  scaled.makeCompressed();
  const Eigen::SparseQR<Eigen::SparseMatrix<double>, Eigen::COLAMDOrdering<int>> qr(scaled);
  if (qr.info() != Eigen::Success || qr.rank() < scaled.cols())
    throw ComputeError(
        fmt::format("coplanarity: the equations determine {} of {} parameters; hold some, force them, or "
                    "take the solution of least norm (lsqr)",
                    qr.rank(), scaled.cols()));
  const Eigen::VectorXd y = qr.solve(system.right);
  return scale.cwiseProduct(y);
}

void correct(CoplanarityNetwork& network, const FreeColumns& free, const Eigen::VectorXd& step) {
  const auto add = [&](std::int64_t column, double& value) {
    if (column >= 0) value += step[column];
  };
  for (std::size_t i = 0; i < network.angles.size(); ++i) {
    add(free.angle[3 * i], network.angles[i].alpha);
    add(free.angle[3 * i + 1], network.angles[i].beta);
    add(free.angle[3 * i + 2], network.angles[i].gamma);
  }
  for (std::size_t o = 0; o < network.image.size(); ++o) {
    add(free.image[2 * o], network.image[o].x());
    add(free.image[2 * o + 1], network.image[o].y());
  }
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

// Normal equations hold the squares of the singular values. Their rounding, 1e-16 of the largest, is 1e-8 in the
// singular values themselves.
constexpr double kAngles = 1e-6;  // share of the largest singular value, from normal equations of the angles

// The number of descending values above a share of the first.
std::int64_t rank_of(const Eigen::VectorXd& values, double tolerance) {
  std::int64_t rank = 0;
  while (rank < values.size() && values(rank) > tolerance * values(0) && values(rank) > 0) ++rank;
  return rank;
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

// The number of directions that neither the equations nor the forcing determine. Forced and held parameters do not
// count: with forced angles the images have the columns B alone, with forced images the angles have A alone.
std::int64_t open_directions(const CoplanarityDiagnosis& diagnosis, const FreeColumns& free,
                             const CoplanarityOptions& options) {
  if (!options.forced()) return diagnosis.nullity();
  if (options.forcing_angles > 0 && options.forcing_images > 0) return 0;
  if (options.forcing_angles > 0) return free.count - free.angles - diagnosis.image_rank;
  const auto& values = diagnosis.angle_values;
  return free.angles - rank_of(Eigen::VectorXd::Map(values.data(), std::ssize(values)), kAngles);
}

}  // namespace

void CoplanarityNetwork::check() const {
  const auto require = [](bool holds, const std::string& what) {
    if (!holds) throw InputError("coplanarity: " + what);
  };
  require(focal_px > 0, "the focal length must be positive (pixels)");
  require(centres.size() == angles.size() && centres.size() >= 2, "two cameras with positions and angles are needed");
  require(!begin.empty() && begin.front() == 0 && begin.back() == std::ssize(camera) && camera.size() == image.size(),
          "the tables of points and observations differ in length");
  require(angles_held.empty() || angles_held.size() == 3 * angles.size(), "angles_held needs three entries per camera");
  require(images_held.empty() || images_held.size() == 2 * image.size(),
          "images_held needs two entries per observation");
  for (std::size_t i = 0; i < centres.size(); ++i)
    require(centres[i].allFinite() && std::isfinite(angles[i].alpha + angles[i].beta + angles[i].gamma),
            fmt::format("camera {} has a position or angle that is not a number", i));
  for (std::size_t j = 0; j + 1 < begin.size(); ++j) {
    std::set<std::int32_t> seen;
    require(begin[j] <= begin[j + 1], fmt::format("point {} ends before it begins", j));
    for (auto o = static_cast<std::size_t>(begin[j]); o < static_cast<std::size_t>(begin[j + 1]); ++o) {
      require(camera[o] >= 0 && static_cast<std::size_t>(camera[o]) < centres.size(),
              fmt::format("point {} names camera {}, which is not there", j, camera[o]));
      require(image[o].allFinite(), fmt::format("point {} has a coordinate that is not a number", j));
      require(seen.insert(camera[o]).second, fmt::format("point {} is seen twice by camera {}", j, camera[o]));
    }
  }
  require(pair_count(*this) > 0, "no point is seen by two cameras");
  for (std::size_t a = 0; a < centres.size(); ++a)
    for (std::size_t b = a + 1; b < centres.size(); ++b)
      // Two cameras at one place have no base: their determinant is zero for any rays.
      require(centres[a] != centres[b], fmt::format("cameras {} and {} stand at the same place", a, b));
}

void CoplanarityOptions::check() const {
  if (!(forcing_angles >= 0 && forcing_images >= 0))
    throw InputError("coplanarity: the weights of the forcing must not be negative");
  if (!(angle_sigma_rad > 0 && image_sigma_px > 0)) throw InputError("coplanarity: sigmas must be positive");
  if (steps < 1) throw InputError("coplanarity: steps must be at least 1");
}

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
      const std::int64_t rank = rank_of(svd.values, kRank);
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
  const auto& angles = diagnosis.angle_values;
  return {
      above_zero(both.leftCols(free.angles), rank_of(Eigen::VectorXd::Map(angles.data(), std::ssize(angles)), kAngles)),
      above_zero(both.rightCols(free.count - free.angles), diagnosis.image_rank), above_zero(both, diagnosis.rank)};
}

CoplanaritySolution adjust_by_coplanarity(const CoplanarityNetwork& network, const CoplanarityOptions& options) {
  options.check();
  CoplanaritySolution solution;
  solution.diagnosis = diagnose(network);
  solution.network = network;
  solution.mean_before = mean_determinant(network).value;
  const FreeColumns free(network);
  solution.open_directions = open_directions(solution.diagnosis, free, options);
  solution.rank_deficient = solution.open_directions > 0;
  if (solution.rank_deficient && options.solver == CoplanarityOptions::Solver::kDirect)
    throw ComputeError(
        fmt::format("coplanarity: the equations determine {} of {} parameters; hold some, force them, or "
                    "take the solution of least norm (lsqr)",
                    free.count - solution.open_directions, free.count));
  Eigen::VectorXd total = Eigen::VectorXd::Zero(free.count);
  for (int step = 0; step < options.steps; ++step) {
    // Each step linearises at the corrected angles and coordinates.
    const Equations system = equations(solution.network, free, options, total);
    Eigen::VectorXd x;
    if (options.solver == CoplanarityOptions::Solver::kLsqr) {
      const LsqrResult found = lsqr(system.matrix, system.right, options.lsqr);
      solution.iterations += found.iterations;
      x = found.x;
    } else {
      x = solve_directly(system);
    }
    correct(solution.network, free, x);
    total += x;
  }
  const MeanDeterminant after = mean_determinant(solution.network);
  solution.mean_after = after.value;
  solution.rounding = after.rounding;

  constexpr double kFalseAlarm = 1e-6;
  // The corrections of all parameters over their sigmas. Where held angles are right, the corrections are errors of the
  // images, and the sum is chi-square with as many degrees of freedom as the equations have rank.
  const double chi2 = total.head(free.angles).squaredNorm() / std::pow(options.angle_sigma_rad, 2) +
                      total.tail(free.count - free.angles).squaredNorm() / std::pow(options.image_sigma_px, 2);
  const std::int64_t freedom = solution.diagnosis.rank;
  solution.chi2_per_freedom = freedom > 0 ? chi2 / static_cast<double>(freedom) : 0;
  solution.held_contradicted =
      free.holds_angles() && free.frees_images() && freedom > 0 && chi2 > chi_square_quantile(kFalseAlarm, freedom);
  return solution;
}

std::vector<std::string> CoplanaritySolution::remarks() const {
  std::vector<std::string> lines;
  if (rank_deficient)
    lines.push_back(
        fmt::format("rank-deficient: {} of {} parameters are determined, the solution is one of many and "
                    "need not be nearer to the truth; give priors (forcing) to angles and images",
                    diagnosis.columns - open_directions, diagnosis.columns));
  if (diagnosis.collinear)
    lines.push_back("the cameras of every point lie on one line: their rays are only brought into planes through it");
  if (held_contradicted)
    lines.push_back(
        fmt::format("the held angles contradict the images: corrections of {:.3g} times their sigmas; "
                    "estimate the angles too",
                    std::sqrt(chi2_per_freedom)));
  if (mean_after > mean_before + rounding)
    lines.push_back(
        "the determinants have grown: the step leads away from the solution; begin nearer to it, or take more steps "
        "and more forcing");
  return lines;
}

}  // namespace megablock
