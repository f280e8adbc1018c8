// Writes and reads fixed-size matrices and vectors of them in messages. merge/scratch/bytes.h takes plain values only.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <vector>

#include "geometry/transform/pose.h"
#include "merge/scratch/bytes.h"

namespace megablock {

template <typename Matrix>
void write_matrices(ByteWriter& writer, const std::vector<Matrix>& matrices) {
  std::vector<double> flat;
  flat.reserve(matrices.size() * static_cast<std::size_t>(Matrix::SizeAtCompileTime));
  for (const Matrix& m : matrices) flat.insert(flat.end(), m.data(), m.data() + m.size());
  writer.values(flat);
}

template <typename Matrix>
std::vector<Matrix> read_matrices(ByteReader& reader) {
  const std::vector<double> flat = reader.values<double>();
  constexpr auto kSize = static_cast<std::size_t>(Matrix::SizeAtCompileTime);
  std::vector<Matrix> matrices(flat.size() / kSize);
  for (std::size_t i = 0; i < matrices.size(); ++i) matrices[i] = Eigen::Map<const Matrix>(flat.data() + i * kSize);
  return matrices;
}

// A square matrix of any size.
inline void write_matrix(ByteWriter& writer, const Eigen::MatrixXd& matrix) {
  writer.values(std::vector<double>(matrix.data(), matrix.data() + matrix.size()));
}
inline Eigen::MatrixXd read_matrix(ByteReader& reader) {
  const std::vector<double> flat = reader.values<double>();
  const auto size = static_cast<Eigen::Index>(std::lround(std::sqrt(static_cast<double>(flat.size()))));
  return Eigen::Map<const Eigen::MatrixXd>(flat.data(), size, size);
}

// Each pose is x, y, z, w of the quaternion, then the centre.
inline void write_poses(ByteWriter& writer, const std::vector<Pose>& poses) {
  std::vector<double> flat;
  for (const Pose& pose : poses) {
    flat.insert(flat.end(), pose.rotation.coeffs().data(), pose.rotation.coeffs().data() + 4);
    flat.insert(flat.end(), pose.centre.data(), pose.centre.data() + 3);
  }
  writer.values(flat);
}

inline std::vector<Pose> read_poses(ByteReader& reader) {
  const std::vector<double> flat = reader.values<double>();
  std::vector<Pose> poses(flat.size() / 7);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    poses[i].rotation.coeffs() = Eigen::Map<const Eigen::Vector4d>(flat.data() + 7 * i);
    poses[i].centre = Eigen::Map<const Eigen::Vector3d>(flat.data() + 7 * i + 4);
  }
  return poses;
}

}  // namespace megablock
