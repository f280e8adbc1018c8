// Counts how many footprints cover each cell of the ground, and finds insufficiently covered ground between covered
// ground.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "io/block/block_diagnostics.h"

namespace megablock {

using Quadrilateral = std::array<Eigen::Vector2d, 4>;  // convex, corners in order around it

// Area of the intersection of two quadrilaterals over the area of the smaller one; 0 where one has no area.
double common_share(const Quadrilateral& a, const Quadrilateral& b);

// A grid over the ground with the number of footprints at each cell centre. It may have at most 10^6 cells plus 16 per
// image; cells are enlarged to keep this limit.
class GroundCover {
 public:
  // `enough` is the number of footprints that a cell needs.
  GroundCover(const std::vector<BlockDiagnostics::Footprint>& footprints, int enough);

  // Counts one more footprint.
  void add(const Quadrilateral& footprint);
  // Fills in thin_ground and cell_m of the diagnostics. `inside` tells whether a place is inside the block, not on its
  // rim.
  void find_thin(const std::function<bool(const Eigen::Vector2d&)>& inside, BlockDiagnostics& diagnostics) const;
  // Whether nine tenths of these cells (given by their centres) are now covered sufficiently.
  bool mostly_enough(const std::vector<Eigen::Vector2d>& cells) const;

 private:
  Eigen::Vector2d centre(std::int64_t column, std::int64_t row) const {
    return origin_ + side_ * Eigen::Vector2d(static_cast<double>(column) + 0.5, static_cast<double>(row) + 0.5);
  }
  bool enough(std::int64_t cell) const { return count_[static_cast<std::size_t>(cell)] >= enough_; }
  void mark_between(std::int64_t first, std::int64_t step, std::int64_t length, std::vector<std::uint8_t>& thin) const;

  std::uint8_t enough_;
  double side_ = 0, footprint_side_ = 0;
  Eigen::Vector2d origin_ = Eigen::Vector2d::Zero();
  std::int64_t columns_ = 0, rows_ = 0;
  std::vector<std::uint8_t> count_;  // [rows][columns] number of footprints, at most 255
};

}  // namespace megablock
