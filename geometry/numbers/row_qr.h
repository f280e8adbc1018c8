// Solves least squares by rows. It keeps the triangular factor R of a matrix A with few columns, whose rows arrive one
// by one.
//
// Givens rotations merge each row into R, so memory does not grow with the number of rows. R has the singular values
// and right singular vectors of A. Normal equations A'A would give them too, but would square the condition number;
// null vectors of nearly singular systems would then lose half of their digits.
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

  // Adds one row of A. Each rotation eliminates one element of the row against the diagonal of R.
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
  // R, upper triangular, with R'R = A'A.
  const Square& factor() const { return factor_; }

  // The unit vector x that minimises |A x|. `rank` counts the singular values above `tolerance` times the largest; x is
  // unique where rank >= Columns - 1. rank is 0 where an element of A is not a finite number.
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
