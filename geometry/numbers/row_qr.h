// Triangular factor of a matrix with few columns that is read row by row (Givens rotations), in place: the singular
// values and right singular vectors of any number of equations without forming normal equations, which would square
// the condition.
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "geometry/numbers/decompositions.h"

namespace megablock {

template <int Columns>
class RowQr {
 public:
  using Row = Eigen::Matrix<double, 1, Columns>;
  using Square = Eigen::Matrix<double, Columns, Columns, Eigen::RowMajor>;

  void add(Row row) {
    for (int i = 0; i < Columns; ++i) {
      if (row[i] == 0) continue;
      const double length = std::hypot(factor_(i, i), row[i]);
      const double c = factor_(i, i) / length, s = row[i] / length;
      for (int j = i; j < Columns; ++j) {
        const double above = factor_(i, j);
        factor_(i, j) = c * above + s * row[j];
        row[j] = c * row[j] - s * above;
      }
    }
  }
  // Upper triangular, R'R = A'A.
  const Square& factor() const { return factor_; }

  // The unit vector that the rows leave shortest. `rank`: how many singular values exceed `tolerance` times the first;
  // the vector is unique where that is Columns - 1 at least. Zero rank where something is not a number.
  struct NullVector {
    Eigen::Matrix<double, Columns, 1> vector;
    int rank = 0;
  };
  NullVector null_vector(double tolerance) const {
    NullVector result{Eigen::Matrix<double, Columns, 1>::Zero()};
    if (!factor_.allFinite()) return result;
    static_assert(Columns <= SmallMatrix::MaxColsAtCompileTime);
    const RightSingularVectors svd = right_singular_vectors(factor_);
    result.vector = svd.v.col(Columns - 1);
    for (int i = 0; i < Columns; ++i) result.rank += svd.values[i] > tolerance * svd.values[0];
    return result;
  }

 private:
  Square factor_ = Square::Zero();
};

}  // namespace megablock
