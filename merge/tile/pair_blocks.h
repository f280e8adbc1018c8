// Sums the contributions of points to the blocks between two frames of a cell, apart from the front. In the front the
// six columns of a block lie far apart and across cache lines. Here a block is contiguous, and few blocks are used
// together.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "adjust/lanes/observation_lanes.h"
#include "merge/tile/point_kernels.h"

namespace megablock {

// The blocks of pairs (i, j), i > j, of numbered frames: [6 x 6] column by column, with columns
// point_kernels::kPairStride apart. All are zero when nothing has been added since the last call of take().
class PairBlocks {
 public:
  // Makes room for the pairs of so many frames. All blocks must be zero then, as they are after take(): growing may
  // move their beginning.
  void reserve(std::int64_t frames) {
    const std::int64_t count = point_kernels::pair_number(frames, 0);
    if (count <= std::ssize(used_)) return;
    values_.resize(count * point_kernels::kPairSize);
    used_.resize(static_cast<std::size_t>(count));
  }
  point_kernels::Pairs pairs() { return {values_.data(), used_.data()}; }
  // Calls add(i, j, block) for the blocks of the first `frames` frames to which something was added, and clears them.
  template <typename Add>
  void take(std::int64_t frames, Add add) {
    for (std::int64_t i = 0, number = 0; i < frames; ++i) {
      for (std::int64_t j = 0; j < i; ++j, ++number) {
        if (!used_[static_cast<std::size_t>(number)]) continue;
        double* block = values_.data() + number * point_kernels::kPairSize;
        add(i, j, block);
        std::fill_n(block, point_kernels::kPairSize, 0.0);
        used_[static_cast<std::size_t>(number)] = 0;
      }
    }
  }

 private:
  AlignedValues values_;
  std::vector<std::uint8_t> used_;
};

}  // namespace megablock
