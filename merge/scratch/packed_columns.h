// Packs the columns of a tile for its file in scratch, and unpacks them without losing a bit. An iteration reads a tile
// twice, and for a large block these reads are most of the memory traffic, so that narrow columns save time. The form
// of a column depends on its type:
//
//   integers   the difference from the smallest one, in 0, 1, 2, 4 or 8 bytes each
//   steps      the first integer, then the differences of neighbours as integers (for ascending ranges and indices)
//   doubles    runs of equal values (sigmas), or multiples of kPixelUnit in 4 bytes (observations of tie points) up to
//              the first value that is no multiple (those of control points come last); the rest unchanged
//   bytes      runs of equal values (flags), or unchanged
//   others     unchanged: plain values, and positions of three doubles each
//
// The state of the file says whether everything was written, or read. A reader knows how many values a column has: any
// other number in the file marks damage, and takes no memory.
// Internal to merge/: it is not installed.
#pragma once

#include <cstdint>
#include <istream>
#include <ostream>
#include <vector>

#include "adjust/problem/tile_problem.h"

namespace megablock {

void write_column(std::ostream& file, const std::vector<double>& values);
void write_column(std::ostream& file, const std::vector<std::uint8_t>& values);
void write_column(std::ostream& file, const std::vector<std::int64_t>& values);  // steps
void write_column(std::ostream& file, const std::vector<LocalImage>& values);    // integers
void write_column(std::ostream& file, const std::vector<TilePoint>& values);     // roles as bytes, indices as steps

void read_column(std::istream& file, std::size_t count, std::vector<double>& values);
void read_column(std::istream& file, std::size_t count, std::vector<std::uint8_t>& values);
void read_column(std::istream& file, std::size_t count, std::vector<std::int64_t>& values);
void read_column(std::istream& file, std::size_t count, std::vector<LocalImage>& values);
void read_column(std::istream& file, std::size_t count, std::vector<TilePoint>& values);

template <typename T>
void write_column(std::ostream& file, const std::vector<T>& values) {
  const auto count = static_cast<std::uint64_t>(values.size());
  file.write(reinterpret_cast<const char*>(&count), sizeof count);
  file.write(reinterpret_cast<const char*>(values.data()), static_cast<std::streamsize>(count * sizeof(T)));
}

template <typename T>
void read_column(std::istream& file, std::size_t count, std::vector<T>& values) {
  std::uint64_t stored = 0;
  if (!file.read(reinterpret_cast<char*>(&stored), sizeof stored)) return;
  if (stored != count) return file.setstate(std::ios::failbit);
  values.resize(count);
  file.read(reinterpret_cast<char*>(values.data()), static_cast<std::streamsize>(count * sizeof(T)));
}

}  // namespace megablock
