// Gives the weights of the robust losses, and the linearised residuals without a point of a cell. Condensation and
// covariances use them; point_equations.h has the residuals with a point.
//
// The second derivative of 1/2 rho(|r|^2) by r is rho' (I + 2 rho''/rho' r r'). With s = |r|^2 this is rho' across the
// residual, and rho' (1 + 2 s rho''/rho') along it. With c the scale of the loss, this second factor is
//
//     Huber, s > c^2             rho' = c / sqrt(s)         1 + 2 s rho''/rho' = 0
//     Cauchy                     rho' = 1 / (1 + s / c^2)   (1 - s / c^2) / (1 + s / c^2), negative beyond the scale
//     Cauchy's tail, s > 4 c^2   rho' = 2 c^2 / s           -1
//
// Normal equations with rho' I alone are iteratively reweighted least squares; they define decrement and covariances.
// They overestimate the curvature along such residuals, and approach the optimum by a constant factor per step. A sweep
// with curvature takes the smaller value along the residual, but no less than kLeastCurvature rho', so that the normal
// equations stay positive definite. It scales J and r by sqrt(rho') and, along r, further by (1 - k) and 1 / (1 - k),
// where (1 - k)^2 is that value over rho' (Triggs et al. 2000, "Bundle adjustment", 4.3). The gradient stays the same.
// A decrement of 1e-2 took 197, 58 and 185 iterations on three blocks of photographs by reweighting alone, and 3, 4 and
// 4 with the curvature and the other measures of docs/developer/decisions.md.
#pragma once

#include <array>
#include <cmath>
#include <functional>
#include <limits>

#include "adjust/terms/linearise.h"
#include "io/base/error.h"
#include "io/block/observation_statistics.h"
#include "merge/tile/condense.h"

namespace megablock {

inline constexpr double kLeastCurvature = 0.1;

// The largest squared norm s up to which rho(s) = s; -1: there is none.
inline double end_of_squares(const RobustLoss& loss) {
  if (loss.kind == RobustLoss::Kind::kNone) return std::numeric_limits<double>::max();
  return loss.has_corner() ? loss.scale * loss.scale : -1;
}

// The weight of a residual under a loss. Multiplying J by sqrt(rho') (I - along r r') and r by sqrt(rho') / (1 - k)
// gives J'J with the curvature above and the true gradient rho' J'r.
struct LossWeight {
  double rho = 0, first = 1;  // of the squared norm
  double root = 1;            // sqrt(rho')
  double along = 0;           // k / s: J is scaled by root (I - along r r')
  double residual_scale = 1;  // of r
  LossWeight(const RobustLoss& loss, double squared_norm, bool curvature) {
    const auto values = loss.evaluate(squared_norm);
    rho = values[0];
    first = values[1];
    if (first != 1) root = residual_scale = std::sqrt(first);
    if (!curvature || values[2] >= 0 || squared_norm == 0) return;
    const double left = std::sqrt(std::max(kLeastCurvature, 1 + 2 * squared_norm * values[2] / first));
    along = (1 - left) / squared_norm;
    residual_scale = root / left;
  }
  // sqrt(rho') (I - along r r') J, for the Jacobian by any unknown. `residual` is r before it is scaled.
  template <typename Jacobian, typename Residual>
  auto weighted(const Jacobian& jacobian, const Residual& residual) const {
    typename Jacobian::PlainObject result = root * jacobian;
    if (along != 0) result -= residual * ((root * along) * (residual.transpose() * jacobian));
    return result;
  }
};

// The weighted Jacobian of a residual by one unknown, which is a position in TilePlan::unknowns.
template <typename Jacobian>
struct JacobianBlock {
  std::int64_t unknown = -1;
  Jacobian jacobian;
};

// A residual without a point, divided by sigma and weighted by its loss.
struct TermResidual {
  using Jacobian = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 6, kMaxIntrinsics>;
  Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, 6, 1> residual;
  std::array<JacobianBlock<Jacobian>, 3> blocks;
  int block_count = 0;
  std::array<ObservationKind, 6> kinds{};  // [residual]
  double rho = 0;                          // of the squared norm
  double weighted_squares = 0;             // rho' |r|^2

  void add_block(std::int64_t unknown, const Eigen::Ref<const Eigen::MatrixXd>& jacobian) {
    if (unknown < 0) return;
    blocks[static_cast<std::size_t>(block_count)].unknown = unknown;
    blocks[static_cast<std::size_t>(block_count++)].jacobian = jacobian;
  }
  void weight(const RobustLoss& loss, const Sweep& sweep) {
    const double squares = residual.squaredNorm();
    const LossWeight w(loss, squares, sweep.curvature);
    rho = w.rho;
    weighted_squares = w.first * squares;
    for (int b = 0; b < block_count; ++b) {
      auto& jacobian = blocks[static_cast<std::size_t>(b)].jacobian;
      jacobian = w.weighted(jacobian, residual);
    }
    residual *= w.residual_scale;
  }
};

// Calls `visit` for every observation without a point that belongs to a cell.
void visit_terms(const TileProblem& problem, const TilePlan& plan, const TileState& state, const Sweep& sweep,
                 std::size_t cell, const std::function<void(const TermResidual&)>& visit);

}  // namespace megablock
