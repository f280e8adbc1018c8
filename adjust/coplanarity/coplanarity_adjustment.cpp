// Solves the equations of coplanarity_adjustment.h. Their columns are angles of the cameras (3 each), then image
// coordinates of the observations (2 each), without those that are held. A row is one pair of one point,
//
//     F = det(d_1 | d_2 | m),   m = C_2 - C_1,
//
// with the derivatives of coplanarity_determinant(). A forced parameter has a row of its own, weight * (sum of all its
// corrections) = 0.
#include "adjust/coplanarity/coplanarity_adjustment.h"

#include <fmt/core.h>

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <Eigen/SparseQR>
#include <algorithm>
#include <cmath>
#include <limits>

#include "adjust/coplanarity/coplanarity_equations.h"
#include "geometry/numbers/chi_square.h"
#include "io/base/error.h"

namespace megablock {

namespace {

using RowMatrix = Eigen::SparseMatrix<double, Eigen::RowMajor>;

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

// The number of directions that neither the equations nor the forcing determine. Forced and held parameters do not
// count: with forced angles the images have the columns B alone, with forced images the angles have A alone.
std::int64_t open_directions(const CoplanarityDiagnosis& diagnosis, const FreeColumns& free,
                             const CoplanarityOptions& options) {
  if (!options.forced()) return diagnosis.nullity();
  if (options.forcing_angles > 0 && options.forcing_images > 0) return 0;
  if (options.forcing_angles > 0) return free.count - free.angles - diagnosis.image_rank;
  return free.angles - diagnosis.angle_rank();
}

}  // namespace

void CoplanarityOptions::check() const {
  if (!(forcing_angles >= 0 && forcing_images >= 0))
    throw InputError("coplanarity: the weights of the forcing must not be negative");
  if (!(angle_sigma_rad > 0 && image_sigma_px > 0)) throw InputError("coplanarity: sigmas must be positive");
  if (steps < 1) throw InputError("coplanarity: steps must be at least 1");
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
