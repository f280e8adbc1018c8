// Converts lists of square matrices to the values of HDF5 datasets, and back. Internal to io/.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace megablock {

// The elements of all matrices, one matrix after the other. The matrices are symmetric, so the order of rows and
// columns does not matter.
template <typename Scalar, typename Matrices>
std::vector<Scalar> flattened(const Matrices& matrices) {
  std::vector<Scalar> values;
  std::size_t size = 0;
  for (const auto& matrix : matrices) size += static_cast<std::size_t>(matrix.size());
  values.reserve(size);
  for (const auto& matrix : matrices)
    for (Eigen::Index i = 0; i < matrix.size(); ++i) values.push_back(static_cast<Scalar>(matrix.data()[i]));
  return values;
}

// The inverse of flattened().
template <typename Matrix, typename Scalar>
std::vector<Matrix> square_matrices(const std::vector<Scalar>& values) {
  constexpr std::size_t kSize = Matrix::SizeAtCompileTime;
  std::vector<Matrix> matrices(values.size() / kSize);
  for (std::size_t m = 0; m < matrices.size(); ++m)
    for (std::size_t i = 0; i < kSize; ++i) matrices[m].data()[i] = static_cast<double>(values[m * kSize + i]);
  return matrices;
}

}  // namespace megablock
