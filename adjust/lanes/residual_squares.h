// Gives the squared residuals |r|^2 of image observations, divided by their variances, many at once
// (observation_lanes.h).
#pragma once

#include <array>

#include "adjust/lanes/observation_lanes.h"

namespace megablock {

class ResidualSquares {
 public:
  // Problem, state and views outlive the object. The views are those of the state's frames, cameras and mounts; its
  // points may move.
  ResidualSquares(const TileProblem& problem, const TileState& state, const SeenImages& images)
      : problem_(problem), state_(state), images_(images) {
    lanes_.reserve(kLanes);
  }

  // The points that take part.
  std::vector<std::int64_t> active_points() const {
    std::vector<std::int64_t> list;
    for (std::int64_t p = 0; p < problem_.point_count(); ++p)
      if (problem_.active(p)) list.push_back(p);
    return list;
  }

  // Calls visit(point, row, |r|^2) for the kept observations of the points, in their order; not finite where the camera
  // cannot project the point.
  template <typename Points, typename Visit>
  void visit(const Points& points, Visit&& visit) {
    for (const std::int64_t point : points) {
      for (std::int64_t row = problem_.begin[point]; row < problem_.begin[point + 1]; ++row) {
        if (!problem_.kept[row]) continue;
        sources_[static_cast<std::size_t>(lanes_.size())] = {point, row};
        lanes_.add(images_.lanes[problem_.image[row].value], state_.points[point], problem_.x[row], problem_.y[row],
                   problem_.inverse_sigma[row]);
        if (lanes_.size() == kLanes) flush(visit);
      }
    }
    flush(visit);
  }

 private:
  static constexpr std::int64_t kLanes = ObservationLanes::kUsual;
  struct Source {
    std::int64_t point, row;
  };

  template <typename Visit>
  void flush(Visit&& visit) {
    lanes_.project();
    for (std::int64_t lane = 0; lane < lanes_.size(); ++lane) {
      const auto [point, row] = sources_[static_cast<std::size_t>(lane)];
      visit(point, row, squares(point, row, lane));
    }
    lanes_.clear();
  }
  // The kernels know Brown's model only; other cameras are projected one observation at a time.
  double squares(std::int64_t point, std::int64_t row, std::int64_t lane) const {
    const std::int64_t image = problem_.image[row].value;
    if (images_.lanes[image].simple) return lanes_.residual(lane).squaredNorm();
    return (problem_.inverse_sigma[row] *
            images_.views[image].difference_px(state_.points[point], {problem_.x[row], problem_.y[row]}))
        .squaredNorm();
  }

  const TileProblem& problem_;
  const TileState& state_;
  const SeenImages& images_;
  ObservationLanes lanes_;
  std::array<Source, kLanes> sources_;
};

}  // namespace megablock
