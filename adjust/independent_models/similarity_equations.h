// Holds and solves the normal equations of an adjustment of similarities. Each model has seven unknowns
// (SimilarityStep). The factorisation is a sparse Cholesky factorisation and also gives the covariance of each model.
// Internal to adjust/: it is not installed.
#pragma once

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "geometry/similarity/similarity.h"

namespace megablock {

using Block7 = SimilarityCovariance;

inline std::size_t nth(std::int32_t i) { return static_cast<std::size_t>(i); }

// Held models have no unknowns in the equations.
class SimilarityEquations {
 public:
  explicit SimilarityEquations(const std::vector<std::uint8_t>& held) { hold(held); }
  // Starts new equations with these models held.
  void hold(const std::vector<std::uint8_t>& held) {
    row_.assign(held.size(), -1);
    right_.resize(held.size());
    rows_ = 0;
    for (std::size_t m = 0; m < held.size(); ++m)
      if (!held[m]) row_[m] = rows_++;
    clear();
  }
  void clear() {
    blocks_.clear();
    std::fill(right_.begin(), right_.end(), SimilarityStep::Zero());
  }
  // Adds a block with the rows of m and the columns of n. Callers add both (m, n) and (n, m); the lower one is kept.
  void add(std::int32_t m, std::int32_t n, const Block7& block) {
    if (row_[nth(m)] < row_[nth(n)] || row_[nth(n)] < 0) return;  // the lower triangle
    blocks_.try_emplace({row_[nth(m)], row_[nth(n)]}, Block7::Zero()).first->second += block;
  }
  void add(std::int32_t m, const SimilarityStep& right) { right_[nth(m)] += right; }

  // Returns -1, or the model at which the factorisation meets a similarity that is not determined.
  std::int32_t factorise() {
    if (rows_ == 0) return -1;
    std::vector<Eigen::Triplet<double>> entries;
    entries.reserve(49 * blocks_.size());
    for (const auto& [key, block] : blocks_)
      for (int i = 0; i < 7; ++i)
        for (int j = 0; j < (key.first == key.second ? i + 1 : 7); ++j)
          entries.emplace_back(7 * key.first + i, 7 * key.second + j, block(i, j));
    Eigen::SparseMatrix<double> matrix(7 * rows_, 7 * rows_);
    matrix.setFromTriplets(entries.begin(), entries.end());
    factor_.compute(matrix);
    constexpr double kOpen = 1e-14;  // smallest share of a diagonal element that the elimination may leave
    const Eigen::VectorXd diagonal = matrix.diagonal();
    // The pivots come in the order of the elimination. A similarity is open where a pivot is nothing but the rounding
    // of its diagonal element.
    const auto& row = factor_.permutationPinv().indices();
    for (int i = 0; i < diagonal.size(); ++i) {
      if (factor_.vectorD()(i) > kOpen * diagonal(row[i])) continue;
      const auto open = std::find(row_.begin(), row_.end(), row[i] / 7);
      return static_cast<std::int32_t>(open - row_.begin());
    }
    return -1;
  }
  // Steps of all models, zero for held ones; after factorise().
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
  // The diagonal blocks of the inverse, zero for held models. They need only the entries of the inverse where the
  // factor has entries (K. Takahashi, J. Fagan, M.-S. Chin, "Formation of a sparse bus impedance matrix", 1973). After
  // factorise().
  std::vector<Block7> covariances() const {
    std::vector<Block7> result(row_.size(), Block7::Zero());
    if (rows_ == 0) return result;
    const SelectedInverse inverse = selected_inverse();
    const auto& place = factor_.permutationP().indices();
    for (std::size_t m = 0; m < row_.size(); ++m) {
      if (row_[m] < 0) continue;
      for (int i = 0; i < 7; ++i)
        for (int j = 0; j <= i; ++j)
          result[m](i, j) = result[m](j, i) = inverse(place[7 * row_[m] + i], place[7 * row_[m] + j]);
    }
    return result;
  }

 private:
  // Z = (L D L')^-1 where L has entries, lower triangle. For column j, with the rows R below its diagonal,
  //
  //     Z_Rj = -Z_RR L_Rj,     Z_jj = 1 / d_j - L_Rj' Z_Rj,
  //
  // and Z_RR lies in the columns of R, which come after j.
  struct SelectedInverse {
    Eigen::SparseMatrix<double> below;  // strictly lower
    Eigen::VectorXd diagonal;
    double operator()(int i, int j) const { return i == j ? diagonal(i) : below.coeff(std::max(i, j), std::min(i, j)); }
  };
  // Works in place, from the last column to the first: the columns after j hold Z already, column j still holds L.
  // `sum` is Z_RR L_Rj. Of Z_RR only the lower triangle is stored, so that an entry (b, a) adds to sum[a] and to
  // sum[b].
  SelectedInverse selected_inverse() const {
    SelectedInverse z{factor_.matrixL().nestedExpression(), factor_.vectorD().cwiseInverse()};
    using Column = Eigen::SparseMatrix<double>::InnerIterator;
    const auto columns = static_cast<int>(z.below.cols());
    std::vector<int> rows, place(nth(columns), -1);
    std::vector<double> l, sum;
    for (int j = columns - 1; j >= 0; --j) {
      rows.clear();
      l.clear();
      for (Column entry(z.below, j); entry; ++entry) {
        place[nth(entry.row())] = static_cast<int>(rows.size());
        rows.push_back(entry.row());
        l.push_back(entry.value());
      }
      sum.assign(rows.size(), 0);
      for (std::size_t a = 0; a < rows.size(); ++a) {
        sum[a] += z.diagonal(rows[a]) * l[a];
        for (Column entry(z.below, rows[a]); entry; ++entry) {
          if (place[nth(entry.row())] < 0) continue;
          const std::size_t b = nth(place[nth(entry.row())]);
          sum[a] += entry.value() * l[b];
          sum[b] += entry.value() * l[a];
        }
      }
      std::size_t a = 0;
      for (Column entry(z.below, j); entry; ++entry, ++a) {
        entry.valueRef() = -sum[a];
        z.diagonal(j) += l[a] * sum[a];
        place[nth(entry.row())] = -1;
      }
    }
    return z;
  }

  std::vector<int> row_;
  int rows_ = 0;
  std::map<std::pair<int, int>, Block7> blocks_;
  std::vector<SimilarityStep> right_;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor_;
};

}  // namespace megablock
