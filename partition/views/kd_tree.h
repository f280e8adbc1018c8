// Finds nearest neighbours among points of the ground plane by a k-d tree (J. L. Bentley, Communications of the ACM
// 18(9), 1975).
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <limits>
#include <numeric>
#include <vector>

namespace megablock {

// The tree is stored without pointers: the middle element of each range of order_ splits the range, across x and y in
// turn.
class KdTree {
 public:
  struct Neighbour {
    double squared_distance;
    std::int64_t point;
    friend auto operator<=>(const Neighbour&, const Neighbour&) = default;
  };

  // Of points at equal distances the one listed first is nearer. Coordinates must be finite.
  explicit KdTree(std::vector<Eigen::Vector2d> points) : points_(std::move(points)), order_(points_.size()) {
    std::iota(order_.begin(), order_.end(), std::int64_t{0});
    build(0, order_.size(), 0);
  }

  // Returns the `count` nearest points within `radius` that `admits(point)` accepts, nearest first.
  template <typename Admits>
  std::vector<Neighbour> nearest(const Eigen::Vector2d& place, std::size_t count, double radius,
                                 const Admits& admits) const {
    std::vector<Neighbour> heap;  // the farthest is on top
    if (count > 0) search(place, count, radius * radius, admits, 0, order_.size(), 0, heap);
    std::sort_heap(heap.begin(), heap.end());
    return heap;
  }

 private:
  const Eigen::Vector2d& at(std::size_t i) const { return points_[static_cast<std::size_t>(order_[i])]; }

  // The median of [begin, end) along this axis splits the range.
  void build(std::size_t begin, std::size_t end, int axis) {
    if (end - begin < 2) return;
    const std::size_t middle = begin + (end - begin) / 2;
    const auto key = [&](std::int64_t i) { return std::pair(points_[static_cast<std::size_t>(i)][axis], i); };
    std::nth_element(order_.begin() + static_cast<std::ptrdiff_t>(begin),
                     order_.begin() + static_cast<std::ptrdiff_t>(middle),
                     order_.begin() + static_cast<std::ptrdiff_t>(end),
                     [&](std::int64_t a, std::int64_t b) { return key(a) < key(b); });
    build(begin, middle, 1 - axis);
    build(middle + 1, end, 1 - axis);
  }

  template <typename Admits>
  void search(const Eigen::Vector2d& place, std::size_t count, double limit, const Admits& admits, std::size_t begin,
              std::size_t end, int axis, std::vector<Neighbour>& heap) const {
    if (begin >= end) return;
    const std::size_t middle = begin + (end - begin) / 2;
    const Neighbour here{(at(middle) - place).squaredNorm(), order_[middle]};
    if (here.squared_distance <= limit && (heap.size() < count || here < heap.front()) && admits(here.point)) {
      if (heap.size() == count) {
        std::pop_heap(heap.begin(), heap.end());
        heap.pop_back();
      }
      heap.push_back(here);
      std::push_heap(heap.begin(), heap.end());
    }
    // Searches the side of the place first. The other side can be skipped if the dividing line is farther than the
    // worst neighbour.
    const double offset = place[axis] - at(middle)[axis];
    const auto left = [&] { search(place, count, limit, admits, begin, middle, 1 - axis, heap); };
    const auto right = [&] { search(place, count, limit, admits, middle + 1, end, 1 - axis, heap); };
    offset < 0 ? left() : right();
    const double reach = heap.size() < count ? limit : std::min(limit, heap.front().squared_distance);
    if (offset * offset > reach) return;
    offset < 0 ? right() : left();
  }

  std::vector<Eigen::Vector2d> points_;
  std::vector<std::int64_t> order_;
};

}  // namespace megablock
