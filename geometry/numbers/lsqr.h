// LSQR solves the least-squares problem min |A x - b| of a large sparse matrix. It needs only products of A and A' with
// vectors (C. C. Paige and M. A. Saunders, "LSQR: an algorithm for sparse linear equations and sparse least squares",
// ACM TOMS 8(1), 1982).
//
// It runs the bidiagonalisation of Golub and Kahan,
//
//     beta u' = A v - alpha u,     alpha' v' = A' u' - beta v,
//
// from u = b / |b|, and reduces the bidiagonal matrix to a triangular one by one plane rotation in each iteration.
// Mathematically it equals conjugate gradients on the normal equations, but it does not square the condition number.
//
// The iteration starts at x = 0 and therefore converges to the solution of least norm where A has not full rank.
// Stopped early, it leaves x close to zero along directions that A hardly determines; `max_condition` uses this to
// regularise.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>

namespace megablock {

struct LsqrOptions {
  double tolerance = 1e-8;          // on |A'r| / (|A| |r|), and for consistent systems on |r| / (|b| + |A| |x|)
  double max_condition = 1e8;       // the iteration ends when the estimated condition number of A exceeds this
  std::int64_t max_iterations = 0;  // 0 means twice the number of columns
};

struct LsqrResult {
  // Why the iteration ended: b or A'b is zero, the system is solved exactly, the residual is perpendicular to the
  // columns, the condition limit was reached, or the number of iterations.
  enum class Stop { kZero, kExact, kLeastSquares, kCondition, kIterations } stop = Stop::kZero;
  Eigen::VectorXd x;
  std::int64_t iterations = 0;
  double condition = 0;  // estimate of the condition number of A in the Frobenius norm
};

// Minimises |A x - b|. `Matrix` is any type with rows(), cols(), A * v and A.transpose() * v. Does not throw; the
// caller reads from `stop` whether the iteration converged (kExact or kLeastSquares).
template <typename Matrix>
LsqrResult lsqr(const Matrix& a, const Eigen::VectorXd& b, const LsqrOptions& options = {}) {
  LsqrResult result;
  result.x = Eigen::VectorXd::Zero(a.cols());
  const std::int64_t limit = options.max_iterations > 0 ? options.max_iterations : 2 * a.cols();
  double beta = b.norm();
  if (!(beta > 0)) return result;
  const double b_norm = beta;
  Eigen::VectorXd u = b / beta, v = a.transpose() * u;
  double alpha = v.norm();
  if (!(alpha > 0)) return result;
  v /= alpha;
  Eigen::VectorXd w = v;
  double phi_bar = beta, rho_bar = alpha, squared_norm = 0, squared_directions = 0;
  result.stop = LsqrResult::Stop::kIterations;
  while (result.iterations < limit) {
    ++result.iterations;
    squared_norm += alpha * alpha;
    u = a * v - alpha * u;
    beta = u.norm();
    squared_norm += beta * beta;
    if (beta > 0) {
      u /= beta;
      v = a.transpose() * u - beta * v;
      alpha = v.norm();
      if (alpha > 0) v /= alpha;
    }
    // A plane rotation removes beta from the bidiagonal matrix and extends the solution along w.
    const double rho = std::hypot(rho_bar, beta), c = rho_bar / rho, s = beta / rho, phi = c * phi_bar;
    squared_directions += w.squaredNorm() / (rho * rho);
    result.x += (phi / rho) * w;
    w = v - (s * alpha / rho) * w;
    rho_bar = -c * alpha;
    phi_bar = s * phi_bar;

    // Estimates of |A|, |r| and |A'r| come out of the recurrence at no cost.
    const double norm = std::sqrt(squared_norm), residual = phi_bar, gradient = alpha * std::abs(s * phi);
    result.condition = norm * std::sqrt(squared_directions);
    if (residual <= options.tolerance * (b_norm + norm * result.x.norm())) {
      result.stop = LsqrResult::Stop::kExact;
      break;
    }
    if (gradient <= options.tolerance * norm * residual) {
      result.stop = LsqrResult::Stop::kLeastSquares;
      break;
    }
    if (result.condition >= options.max_condition) {
      result.stop = LsqrResult::Stop::kCondition;
      break;
    }
  }
  return result;
}

}  // namespace megablock
