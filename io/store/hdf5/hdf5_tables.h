// Turns lists of items into the matrices of files and back: poses, vectors, indices. Only the readers and writers of
// io/ use it.
//
// Absent vectors are rows of NaN, so that every column has one row per item.
// Internal to io/: it is not installed.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <vector>

#include "geometry/transform/pose.h"
#include "io/base/index.h"
#include "io/store/hdf5/hdf5_file.h"

namespace megablock {

inline constexpr double kAbsent = std::numeric_limits<double>::quiet_NaN();

// One value for each item: column(items, [](const Item&) -> value).
template <typename Items, typename Get>
auto column(const Items& items, Get get) {
  using Value = std::decay_t<decltype(get(*items.begin()))>;
  std::vector<Value> values;
  values.reserve(items.size());
  for (const auto& item : items) values.push_back(get(item));
  return values;
}

// Three values for each item, row-major.
template <typename Items, typename Get>
std::vector<double> vectors3(const Items& items, Get get) {
  std::vector<double> values;
  values.reserve(3 * items.size());
  for (const auto& item : items) {
    const Eigen::Vector3d v = get(item);
    values.insert(values.end(), {v.x(), v.y(), v.z()});
  }
  return values;
}

// Quaternions (w, x, y, z), row-major.
template <typename Items, typename Get>
std::vector<double> quaternions(const Items& items, Get get) {
  std::vector<double> values;
  values.reserve(4 * items.size());
  for (const auto& item : items) {
    const Eigen::Quaterniond q = get(item);
    values.insert(values.end(), {q.w(), q.x(), q.y(), q.z()});
  }
  return values;
}

inline Eigen::Vector3d vector3(const std::vector<double>& values, std::size_t row) {
  return {values[3 * row], values[3 * row + 1], values[3 * row + 2]};
}
inline Eigen::Quaterniond quaternion(const std::vector<double>& values, std::size_t row) {
  return {values[4 * row], values[4 * row + 1], values[4 * row + 2], values[4 * row + 3]};
}

inline Eigen::Quaterniond absent_quaternion() { return {kAbsent, kAbsent, kAbsent, kAbsent}; }
inline Eigen::Vector3d absent_vector() { return Eigen::Vector3d::Constant(kAbsent); }

// A list of poses as the datasets <group>/rotation_wxyz [n,4] and <group>/centre [n,3].
template <typename Poses>
void write_poses(Hdf5Writer& file, const std::string& group, const Poses& poses, const std::string& inside,
                 const std::string& outside) {
  file.matrix(group + "/rotation_wxyz", quaternions(poses, [](const Pose& p) { return p.rotation; }), 4,
              {"", "unit quaternion, " + outside + " -> " + inside});
  file.matrix(group + "/centre", vectors3(poses, [](const Pose& p) { return p.centre; }), 3,
              {"m", "origin of the " + inside + " in the " + outside});
}
inline std::vector<Pose> read_poses(const Hdf5Reader& file, const std::string& group, std::int64_t rows = -1) {
  const std::vector<double> rotations = file.matrix<double>(group + "/rotation_wxyz", 4, rows);
  const auto count = rotations.size() / 4;
  const std::vector<double> centres = file.matrix<double>(group + "/centre", 3, static_cast<std::int64_t>(count));
  std::vector<Pose> poses(count);
  for (std::size_t i = 0; i < count; ++i) poses[i] = {quaternion(rotations, i), vector3(centres, i)};
  return poses;
}

// Indices as 64-bit integers, and back.
template <typename Indices>
std::vector<std::int64_t> plain(const Indices& indices) {
  return column(indices, [](const auto& index) -> std::int64_t { return index.value; });
}
template <typename Index>
std::vector<Index> indices(const std::vector<std::int64_t>& values) {
  std::vector<Index> result;
  result.reserve(values.size());
  for (const std::int64_t value : values) result.push_back(Index(static_cast<decltype(Index::value)>(value)));
  return result;
}

// First differences, the first one against zero: small numbers if the values ascend, which compress well. cumulate() is
// the inverse.
inline std::vector<std::int64_t> differences(std::vector<std::int64_t> values) {
  for (std::size_t i = values.size(); i-- > 1;) values[i] -= values[i - 1];
  return values;
}
inline std::vector<std::int64_t> cumulate(std::vector<std::int64_t> values) {
  for (std::size_t i = 1; i < values.size(); ++i) values[i] += values[i - 1];
  return values;
}

// Row offsets of lists that are stored one after the other: files have counts [n], memory has begin [n + 1].
inline std::vector<std::int64_t> counts_of(const std::vector<std::int64_t>& begin) {
  std::vector<std::int64_t> counts;
  for (std::size_t i = 1; i < begin.size(); ++i) counts.push_back(begin[i] - begin[i - 1]);
  return counts;
}
// Throws StoreError if a count is negative, or if the sum is not `total` (not tested if negative).
inline std::vector<std::int64_t> begin_of(const Hdf5Reader& file, const std::string& name,
                                          const std::vector<std::int64_t>& counts, std::int64_t total = -1) {
  std::vector<std::int64_t> begin(counts.size() + 1, 0);
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] < 0) file.fail(name, "holds a negative count");
    begin[i + 1] = begin[i] + counts[i];
  }
  if (total >= 0 && begin.back() != total)
    file.fail(name, "adds up to " + std::to_string(begin.back()) + " rows, there are " + std::to_string(total));
  return begin;
}

}  // namespace megablock
