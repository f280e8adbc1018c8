// Divides the points of a tile into portions of a few hundred, cell by cell, so that threads share even a tile of few
// cells evenly. The portions depend on the plan alone. Sums over the points of a portion, added in the order of the
// portions, therefore have the same bits for any number of threads.
// Internal to merge/: it is not installed.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "merge/plan/tile_plan.h"

namespace megablock {

// The object keeps the unpacked rows of all points of the tile, four bytes each.
class PointPortions {
 public:
  explicit PointPortions(const TilePlan& plan) {
    constexpr std::size_t kPoints = 512;
    rows_.reserve(plan.points.size());
    for (const RowList& cell : plan.points) {
      rows_.push_back(cell.rows());
      for (std::span<const std::int32_t> rest = rows_.back(); !rest.empty();) {
        portions_.push_back(rest.first(std::min(kPoints, rest.size())));
        rest = rest.subspan(portions_.back().size());
      }
    }
  }
  PointPortions(const PointPortions&) = delete;
  PointPortions& operator=(const PointPortions&) = delete;

  std::int64_t size() const { return std::ssize(portions_); }
  std::span<const std::int32_t> operator[](std::int64_t i) const { return portions_[static_cast<std::size_t>(i)]; }

 private:
  std::vector<std::vector<std::int32_t>> rows_;  // [cells]
  std::vector<std::span<const std::int32_t>> portions_;
};

}  // namespace megablock
