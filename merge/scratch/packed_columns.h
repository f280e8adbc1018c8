// Columns of a tile on their way to scratch and back, in a narrow one of a few forms that give every bit back: a tile
// is read twice a step, and what it is read from is most of what a large block moves through memory.
//
//   integers   less their least one, in 0, 1, 2, 4 or 8 bytes each
//   steps      the first integer, and the others less the one before as integers (what ascends: ranges, indices)
//   doubles    runs of one value (sigmas), or multiples of kPixelUnit in 4 bytes (measurements of tie points) up to the
//              first value that is none (those of control points, which come last), and from there as they are
//   bytes      runs of one value (flags), or as they are
//   others     as they are; of plain values, and of positions of three doubles each
//
// Writers leave the file's state to say whether all went there; readers, whether all came back.
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

void read_column(std::istream& file, std::vector<double>& values);
void read_column(std::istream& file, std::vector<std::uint8_t>& values);
void read_column(std::istream& file, std::vector<std::int64_t>& values);
void read_column(std::istream& file, std::vector<LocalImage>& values);
void read_column(std::istream& file, std::vector<TilePoint>& values);

template <typename T>
void write_column(std::ostream& file, const std::vector<T>& values) {
  const auto count = static_cast<std::uint64_t>(values.size());
  file.write(reinterpret_cast<const char*>(&count), sizeof count);
  file.write(reinterpret_cast<const char*>(values.data()), static_cast<std::streamsize>(count * sizeof(T)));
}

template <typename T>
void read_column(std::istream& file, std::vector<T>& values) {
  std::uint64_t count = 0;
  if (!file.read(reinterpret_cast<char*>(&count), sizeof count)) return;
  values.resize(count);
  file.read(reinterpret_cast<char*>(values.data()), static_cast<std::streamsize>(count * sizeof(T)));
}

}  // namespace megablock
