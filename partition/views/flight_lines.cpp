#include "partition/views/flight_lines.h"

#include <cmath>

#include "geometry/numbers/median.h"
#include "partition/views/views.h"

namespace megablock {

namespace {

constexpr double kStraight = 0.766;  // cosine of 40 degrees
constexpr double kTinyStep = 0.2;    // of the usual step: shorter steps have no direction
constexpr std::size_t kLeastLine = 3;

// Finds the lines of one pass.
class LineFinder {
 public:
  LineFinder(const std::vector<FrameIndex>& order, const BlockState& state, double usual) : order_(order) {
    for (std::size_t i = 0; i + 1 < order.size(); ++i) {
      steps_.emplace_back((state.frames[order[i + 1]].centre - state.frames[order[i]].centre).head<2>());
      if (steps_.back().norm() < kTinyStep * usual) steps_.back().setZero();
    }
  }

  void find(std::vector<FlightLine>& lines) const {
    for (std::size_t first = 0, last; first < order_.size(); first = last) {
      // Frames [first, last) are a line while each step has about the direction of the line's last step that had one.
      Eigen::Vector2d way = Eigen::Vector2d::Zero();
      for (last = first + 1; last < order_.size() && agree(way, steps_[last - 1]); ++last)
        if (!steps_[last - 1].isZero()) way = steps_[last - 1];
      if (last - first >= kLeastLine)
        lines.emplace_back(order_.begin() + static_cast<std::ptrdiff_t>(first),
                           order_.begin() + static_cast<std::ptrdiff_t>(last));
      // Two frames only make a turn; the second one begins the next line.
      if (last - first == 2 && last < order_.size()) --last;
    }
  }

 private:
  static bool agree(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return a.isZero() || b.isZero() || a.dot(b) > kStraight * a.norm() * b.norm();
  }
  const std::vector<FrameIndex>& order_;
  std::vector<Eigen::Vector2d> steps_;  // from each frame to the next
};

}  // namespace

std::vector<std::vector<FrameIndex>> acquisition_order(const Block& block, const BlockState& state) {
  std::vector<std::vector<FrameIndex>> order;
  // A frame of a rig appears in the passes of all its mounts, but counts once.
  IndexedVector<FrameIndex, std::uint8_t> taken(block.frames.size(), 0);
  for (const std::vector<ImageIndex>& pass : passes_of(block)) {
    std::vector<FrameIndex> frames;
    for (const ImageIndex image : pass) {
      const FrameIndex frame = block.images[image].frame;
      if (taken[frame] || !state.oriented[frame]) continue;
      taken[frame] = 1;
      frames.push_back(frame);
    }
    if (!frames.empty()) order.push_back(std::move(frames));
  }
  return order;
}

std::vector<FlightLine> flight_lines(const std::vector<std::vector<FrameIndex>>& order, const BlockState& state) {
  std::vector<double> distances;
  for (const auto& pass : order)
    for (std::size_t i = 0; i + 1 < pass.size(); ++i)
      distances.push_back((state.frames[pass[i + 1]].centre - state.frames[pass[i]].centre).head<2>().norm());
  const double usual = median(std::move(distances));
  std::vector<FlightLine> lines;
  for (const auto& pass : order) LineFinder(pass, state, usual).find(lines);
  return lines;
}

}  // namespace megablock
