#include "partition/diagnostics/ground_cover.h"

#include <algorithm>
#include <cmath>

#include "geometry/numbers/median.h"

namespace megablock {

namespace {

constexpr double kCellsPerSide = 8;   // of a footprint's smaller side
constexpr double kMostCells = 16;     // grid cells per image
constexpr double kFewestCells = 1e6;  // number of grid cells that is always allowed
constexpr double kMostDistance = 3;   // between covered ground, in larger footprint sides
constexpr double kMostlyEnough = 0.9;

using Polygon = std::vector<Eigen::Vector2d>;

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

double signed_area(const Polygon& p) {
  double twice = 0;
  for (std::size_t i = 0; i < p.size(); ++i) twice += cross(p[i] - p[0], p[(i + 1) % p.size()] - p[0]);
  return twice / 2;
}

// The corners in counter-clockwise order.
Polygon polygon_of(const Quadrilateral& q) {
  Polygon p(q.begin(), q.end());
  if (signed_area(p) < 0) std::reverse(p.begin(), p.end());
  return p;
}

// The part of a polygon to the left of the line from a to b (I. Sutherland and G. Hodgman, Communications of the ACM
// 17(1), 1974).
Polygon clipped(const Polygon& p, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const auto side = [&](const Eigen::Vector2d& point) { return cross(b - a, point - a); };
  Polygon kept;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const Eigen::Vector2d &from = p[i], &to = p[(i + 1) % p.size()];
    const double s = side(from), t = side(to);
    if (s >= 0) kept.push_back(from);
    if ((s > 0 && t < 0) || (s < 0 && t > 0)) kept.emplace_back(from + s / (s - t) * (to - from));
  }
  return kept;
}

}  // namespace

double common_share(const Quadrilateral& a, const Quadrilateral& b) {
  const Polygon pa = polygon_of(a), pb = polygon_of(b);
  const double smaller = std::min(signed_area(pa), signed_area(pb));
  if (!(smaller > 0)) return 0;
  Polygon common = pa;
  for (std::size_t i = 0; i < pb.size() && !common.empty(); ++i)
    common = clipped(common, pb[i], pb[(i + 1) % pb.size()]);
  return common.empty() ? 0 : std::clamp(signed_area(common) / smaller, 0.0, 1.0);
}

GroundCover::GroundCover(const std::vector<BlockDiagnostics::Footprint>& footprints, int enough)
    : enough_(static_cast<std::uint8_t>(std::clamp(enough, 0, 255))) {
  if (footprints.empty()) return;
  std::vector<double> smaller, larger;
  Eigen::Vector2d low = footprints.front().corners[0], high = low;
  for (const auto& [image, c] : footprints) {
    const double a = (c[1] - c[0]).norm(), b = (c[2] - c[1]).norm();
    smaller.push_back(std::min(a, b));
    larger.push_back(std::max(a, b));
    for (const Eigen::Vector2d& corner : c) low = low.cwiseMin(corner), high = high.cwiseMax(corner);
  }
  side_ = median(std::move(smaller)) / kCellsPerSide;
  footprint_side_ = median(std::move(larger));
  if (!(side_ > 0)) return;
  const double most = kFewestCells + kMostCells * static_cast<double>(footprints.size());
  const Eigen::Vector2d size = high - low;
  // A block that is spread over a large area with few images would otherwise need an enormous grid.
  while ((size.x() / side_ + 1) * (size.y() / side_ + 1) > most) side_ *= 2;
  origin_ = low;
  columns_ = static_cast<std::int64_t>(size.x() / side_) + 1;
  rows_ = static_cast<std::int64_t>(size.y() / side_) + 1;
  count_.assign(static_cast<std::size_t>(columns_ * rows_), 0);
  for (const auto& footprint : footprints) add(footprint.corners);
}

void GroundCover::add(const Quadrilateral& footprint) {
  if (count_.empty()) return;
  const Polygon p = polygon_of(footprint);
  Eigen::Vector2d low = p[0], high = p[0];
  for (const Eigen::Vector2d& corner : p) low = low.cwiseMin(corner), high = high.cwiseMax(corner);
  const auto index = [&](double value, double origin, std::int64_t size) {
    return std::clamp<std::int64_t>(static_cast<std::int64_t>(std::floor((value - origin) / side_)), 0, size - 1);
  };
  for (std::int64_t row = index(low.y(), origin_.y(), rows_); row <= index(high.y(), origin_.y(), rows_); ++row)
    for (std::int64_t column = index(low.x(), origin_.x(), columns_); column <= index(high.x(), origin_.x(), columns_);
         ++column) {
      const Eigen::Vector2d c = centre(column, row);
      // The cell counts if its centre lies to the left of all sides of the counter-clockwise polygon.
      bool inside = true;
      for (std::size_t i = 0; i < p.size() && inside; ++i) inside = cross(p[(i + 1) % p.size()] - p[i], c - p[i]) >= 0;
      std::uint8_t& count = count_[static_cast<std::size_t>(row * columns_ + column)];
      if (inside && count < 255) ++count;
    }
}

// Marks the insufficiently covered cells of one row or column that lie between sufficiently covered ones.
void GroundCover::mark_between(std::int64_t first, std::int64_t step, std::int64_t length,
                               std::vector<std::uint8_t>& thin) const {
  const auto farthest = static_cast<std::int64_t>(kMostDistance * footprint_side_ / side_);
  std::int64_t last_enough = -1;
  for (std::int64_t i = 0; i < length; ++i) {
    if (!enough(first + i * step)) continue;
    if (last_enough >= 0 && i - last_enough <= farthest)
      for (std::int64_t k = last_enough + 1; k < i; ++k) thin[static_cast<std::size_t>(first + k * step)] = 1;
    last_enough = i;
  }
}

void GroundCover::find_thin(const std::function<bool(const Eigen::Vector2d&)>& inside,
                            BlockDiagnostics& diagnostics) const {
  diagnostics.cell_m = side_;
  if (count_.empty()) return;
  std::vector<std::uint8_t> thin(count_.size(), 0);
  for (std::int64_t row = 0; row < rows_; ++row) mark_between(row * columns_, 1, columns_, thin);
  for (std::int64_t column = 0; column < columns_; ++column) mark_between(column, columns_, rows_, thin);
  for (std::int64_t row = 0; row < rows_; ++row)
    for (std::int64_t column = 0; column < columns_; ++column) {
      std::uint8_t& cell = thin[static_cast<std::size_t>(row * columns_ + column)];
      cell = cell && inside(centre(column, row));
    }
  // Only areas two cells wide in both directions remain; narrower ones come from the jagged edges of footprints.
  const auto at = [&](std::int64_t column, std::int64_t row) {
    return thin[static_cast<std::size_t>(row * columns_ + column)];
  };
  std::vector<std::uint8_t> wide(count_.size(), 0);
  for (std::int64_t row = 0; row + 1 < rows_; ++row)
    for (std::int64_t column = 0; column + 1 < columns_; ++column)
      if (at(column, row) && at(column + 1, row) && at(column, row + 1) && at(column + 1, row + 1))
        for (const std::int64_t cell : {row * columns_ + column, row * columns_ + column + 1,
                                        (row + 1) * columns_ + column, (row + 1) * columns_ + column + 1})
          wide[static_cast<std::size_t>(cell)] = 1;
  // Collects connected cells into areas.
  std::vector<std::int64_t> open;
  for (std::int64_t start = 0; start < static_cast<std::int64_t>(wide.size()); ++start) {
    if (!wide[static_cast<std::size_t>(start)]) continue;
    BlockDiagnostics::ThinGround ground;
    ground.centre.setZero();
    const auto visit = [&](std::int64_t cell) {
      if (!wide[static_cast<std::size_t>(cell)]) return;
      wide[static_cast<std::size_t>(cell)] = 0;
      open.push_back(cell);
    };
    visit(start);
    while (!open.empty()) {
      const std::int64_t cell = open.back(), column = cell % columns_, row = cell / columns_;
      open.pop_back();
      ground.cells.push_back(centre(column, row));
      ground.centre += ground.cells.back();
      if (column > 0) visit(cell - 1);
      if (column + 1 < columns_) visit(cell + 1);
      if (row > 0) visit(cell - columns_);
      if (row + 1 < rows_) visit(cell + columns_);
    }
    ground.centre /= static_cast<double>(ground.cells.size());
    ground.area_m2 = static_cast<double>(ground.cells.size()) * side_ * side_;
    diagnostics.thin_ground.push_back(std::move(ground));
  }
}

bool GroundCover::mostly_enough(const std::vector<Eigen::Vector2d>& cells) const {
  std::size_t good = 0;
  for (const Eigen::Vector2d& c : cells) {
    const auto column = static_cast<std::int64_t>((c.x() - origin_.x()) / side_),
               row = static_cast<std::int64_t>((c.y() - origin_.y()) / side_);
    good += enough(row * columns_ + column);
  }
  return static_cast<double>(good) >= kMostlyEnough * static_cast<double>(cells.size());
}

}  // namespace megablock
