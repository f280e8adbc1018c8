// Normal equations of an adjustment of similarities, one of seven unknowns (SimilarityStep) for each model, solved by
// sparse Cholesky factorisation.
#pragma once

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "geometry/similarity.h"

namespace megablock {

using Block7 = SimilarityCovariance;

inline std::size_t nth(std::int32_t i) { return static_cast<std::size_t>(i); }

// Normal equations of seven unknowns a model; those of held models are left out.
class SimilarityEquations {
 public:
  explicit SimilarityEquations(const std::vector<std::uint8_t>& held) : row_(held.size(), -1), right_(held.size()) {
    for (std::size_t m = 0; m < held.size(); ++m)
      if (!held[m]) row_[m] = rows_++;
    clear();
  }
  void clear() {
    blocks_.clear();
    std::fill(right_.begin(), right_.end(), SimilarityStep::Zero());
  }
  // Rows of m, columns of n.
  void add(std::int32_t m, std::int32_t n, const Block7& block) {
    if (row_[nth(m)] < row_[nth(n)] || row_[nth(n)] < 0) return;  // the lower triangle
    blocks_.try_emplace({row_[nth(m)], row_[nth(n)]}, Block7::Zero()).first->second += block;
  }
  void add(std::int32_t m, const SimilarityStep& right) { right_[nth(m)] += right; }

  // Steps of all models, zero for held ones. False: not determined.
  bool factorise() {
    if (rows_ == 0) return true;
    std::vector<Eigen::Triplet<double>> entries;
    entries.reserve(49 * blocks_.size());
    for (const auto& [key, block] : blocks_)
      for (int i = 0; i < 7; ++i)
        for (int j = 0; j < (key.first == key.second ? i + 1 : 7); ++j)
          entries.emplace_back(7 * key.first + i, 7 * key.second + j, block(i, j));
    Eigen::SparseMatrix<double> matrix(7 * rows_, 7 * rows_);
    matrix.setFromTriplets(entries.begin(), entries.end());
    factor_.compute(matrix);
    return factor_.info() == Eigen::Success && factor_.vectorD().allFinite() && factor_.vectorD().minCoeff() > 0;
  }
  std::vector<SimilarityStep> solution() const {
    std::vector<SimilarityStep> steps(row_.size(), SimilarityStep::Zero());
    if (rows_ == 0) return steps;
    Eigen::VectorXd right(7 * rows_);
    for (std::size_t m = 0; m < row_.size(); ++m)
      if (row_[m] >= 0) right.segment<7>(7 * row_[m]) = right_[m];
    const Eigen::VectorXd all = factor_.solve(right);
    for (std::size_t m = 0; m < row_.size(); ++m)
      if (row_[m] >= 0) steps[m] = all.segment<7>(7 * row_[m]);
    return steps;
  }
  // Length of the steps of one model in the metric of its own normal equations.
  double length(std::int32_t m, const SimilarityStep& step) const {
    const auto found = blocks_.find({row_[nth(m)], row_[nth(m)]});
    return found == blocks_.end() ? 0 : std::sqrt(std::max(0.0, step.dot(found->second * step)));
  }
  Block7 covariance(std::int32_t m) const {
    if (row_[nth(m)] < 0) return Block7::Zero();
    Eigen::Matrix<double, Eigen::Dynamic, 7> unit(7 * rows_, 7);
    unit.setZero();
    unit.middleRows<7>(7 * row_[nth(m)]).setIdentity();
    const Eigen::Matrix<double, Eigen::Dynamic, 7> columns = factor_.solve(unit);
    const Block7 result = columns.middleRows<7>(7 * row_[nth(m)]);
    return 0.5 * (result + result.transpose());
  }

 private:
  std::vector<int> row_;
  int rows_ = 0;
  std::map<std::pair<int, int>, Block7> blocks_;
  std::vector<SimilarityStep> right_;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor_;
};

}  // namespace megablock
