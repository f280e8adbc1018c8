// Stores an ascending list of rows of a table as the distances between neighbours, one byte each. A distance of 255 and
// more takes further bytes; this is rare where some dozen lists share the rows of a table.
//
// The lists save memory: each tile's plan has one for every cell, and for a million images these lists of points would
// take 80 MiB as 32-bit numbers. A list is read from its beginning only, which is all that sweeps do.
#pragma once

#include <cassert>
#include <cstdint>
#include <vector>

#include "merge/scratch/bytes.h"

namespace megablock {

class RowList {
 public:
  // `row` is larger than all rows before it and smaller than the largest 32-bit number.
  void push_back(std::int32_t row) {
    assert(row > last_);
    std::int32_t distance = row - last_;
    for (; distance >= kMore; distance -= kMore) distances_.push_back(kMore);
    distances_.push_back(static_cast<std::uint8_t>(distance));
    last_ = row;
    ++size_;
  }
  void shrink_to_fit() { distances_.shrink_to_fit(); }
  std::int64_t size() const { return size_; }
  void write(ByteWriter& out) const {
    out.values(distances_);
    out.value(last_);
    out.value(size_);
  }
  static RowList read(ByteReader& in) {
    RowList list;
    list.distances_ = in.values<std::uint8_t>();
    list.last_ = in.value<std::int32_t>();
    list.size_ = in.value<std::int32_t>();
    if (list.size_ < 0 || static_cast<std::size_t>(list.size_) > list.distances_.size())
      throw StoreError("merge: a list of rows has the wrong size");
    return list;
  }
  std::vector<std::int32_t> rows() const {
    std::vector<std::int32_t> rows;
    rows.reserve(static_cast<std::size_t>(size_));
    std::int32_t row = -1;
    for (const std::uint8_t distance : distances_) {
      row += distance;
      if (distance < kMore) rows.push_back(row);
    }
    return rows;
  }

 private:
  static constexpr std::uint8_t kMore = 255;  // the distance continues in the next byte
  std::vector<std::uint8_t> distances_;
  std::int32_t last_ = -1;
  std::int32_t size_ = 0;
};

}  // namespace megablock
