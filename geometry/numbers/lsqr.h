// LSQR: least squares of a sparse matrix by products with it and its transpose alone (C. C. Paige and M. A. Saunders,
// ACM TOMS 8, 1982). From zero, it goes to the solution of least norm; stopped early, it stays nearer to zero along
// what the matrix hardly determines.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>

namespace megablock {

struct LsqrOptions {
  double tolerance = 1e-8;          // of |A'r| / |A||r| and, where a solution is exact, of |r| / (|b| + |A||x|)
  double max_condition = 1e8;       // ends when the estimated condition of A is beyond
  std::int64_t max_iterations = 0;  // 0: twice the number of columns
};

struct LsqrResult {
  enum class Stop { kZero, kExact, kLeastSquares, kCondition, kIterations } stop = Stop::kZero;
  Eigen::VectorXd x;
  std::int64_t iterations = 0;
  double condition = 0;  // estimate, in the norm of Frobenius
};

// Least |A x - b|. Matrix: anything with rows(), cols(), A * v and A.transpose() * v.
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
    const double rho = std::hypot(rho_bar, beta), c = rho_bar / rho, s = beta / rho, phi = c * phi_bar;
    squared_directions += w.squaredNorm() / (rho * rho);
    result.x += (phi / rho) * w;
    w = v - (s * alpha / rho) * w;
    rho_bar = -c * alpha;
    phi_bar = s * phi_bar;

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
