#include "partition/candidates/cells.h"

#include <algorithm>
#include <numeric>

namespace megablock {

namespace {

constexpr double kHalfExtent = 1 << 23;
constexpr int kMaxDepth = 68;  // parts of about a millimetre; places closer together are divided by number

// Halves parts recursively; see cells.h.
class CellMaker {
 public:
  CellMaker(const std::vector<Eigen::Vector2d>& places, std::size_t limit) : places_(places), limit_(limit) {}

  void run(std::vector<std::int64_t> members, Eigen::Vector2d low, double width, double height, int depth) {
    if (members.empty()) return;
    if (members.size() <= limit_) return cells_.push_back(std::move(members));
    if (depth == kMaxDepth) return cut_by_number(members);
    const int axis = depth % 2;
    double& side = axis == 0 ? width : height;
    side /= 2;
    const double middle = low[axis] + side;
    // erase_if keeps the order, so the places of a cell stay ascending.
    std::vector<std::int64_t> upper;
    std::erase_if(members, [&](std::int64_t i) {
      const bool above = places_[static_cast<std::size_t>(i)][axis] >= middle;
      if (above) upper.push_back(i);
      return above;
    });
    Eigen::Vector2d upper_low = low;
    upper_low[axis] = middle;
    run(std::move(members), low, width, height, depth + 1);
    run(std::move(upper), upper_low, width, height, depth + 1);
  }
  std::vector<std::vector<std::int64_t>> take() { return std::move(cells_); }

 private:
  // Places that no cut can separate are divided in their order.
  void cut_by_number(const std::vector<std::int64_t>& members) {
    for (std::size_t i = 0; i < members.size(); i += limit_)
      cells_.emplace_back(members.begin() + static_cast<std::ptrdiff_t>(i),
                          members.begin() + static_cast<std::ptrdiff_t>(std::min(i + limit_, members.size())));
  }

  const std::vector<Eigen::Vector2d>& places_;
  std::size_t limit_;
  std::vector<std::vector<std::int64_t>> cells_;
};

}  // namespace

std::vector<std::vector<std::int64_t>> cells_of(const std::vector<Eigen::Vector2d>& places, std::int64_t limit) {
  std::vector<std::int64_t> all(places.size());
  std::iota(all.begin(), all.end(), std::int64_t{0});
  CellMaker maker(places, static_cast<std::size_t>(limit));
  maker.run(std::move(all), Eigen::Vector2d::Constant(-kHalfExtent), 2 * kHalfExtent, 2 * kHalfExtent, 0);
  return maker.take();
}

}  // namespace megablock
