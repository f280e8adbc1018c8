// The parts of a track are found one after the other: the largest consistent set of the observations that are left
// (consistent_rays.h), until less than two are left, or what is found is no point of its own.
#include "adjust/tile/track_parts.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "adjust/tile/consistent_rays.h"
#include "io/base/error.h"

namespace megablock {

namespace {

constexpr std::uint8_t kMostParts = 4;  // further parts of a track

class TrackPartFinder {
 public:
  TrackPartFinder(const TileProblem& problem, const TileState& state, double threshold, const AdjustOptions& options)
      : problem_(problem),
        state_(state),
        threshold_(threshold),
        cos_min_angle_(std::cos(options.min_intersection_deg * std::numbers::pi / 180)) {
    for (const TileImage& image : problem.images)
      cameras_.push_back(camera_pose(state.frames[image.frame.value], state.mounts[image.mount]));
  }

  void find(std::int64_t p, TrackParts& parts) {
    if (std::count(problem_.kept.begin() + problem_.begin[p], problem_.kept.begin() + problem_.begin[p + 1], 0) < 2)
      return;  // the usual case
    split(p);
    for (std::uint8_t part = 1; part <= kMostParts && rest_.size() >= 2; ++part) {
      const auto found = find_consistent_rays(rest_, threshold_, static_cast<std::uint64_t>(problem_.points[p].index));
      if (!found || !meet_wider_than(rest_, found->passing, found->point, cos_min_angle_) || same_point(found->point))
        return;
      std::vector<PointView> left;
      std::vector<std::int64_t> left_rows;
      for (std::size_t i = 0; i < rest_.size(); ++i) {
        if (found->passing[i]) {
          parts[static_cast<std::size_t>(rest_rows_[i])] = part;
          taken_.push_back(rest_[i]);
        } else {
          left.push_back(rest_[i]);
          left_rows.push_back(rest_rows_[i]);
        }
      }
      rest_ = std::move(left);
      rest_rows_ = std::move(left_rows);
    }
  }

 private:
  // Splits a point by all its observations, kept and rejected ones.
  void split(std::int64_t p) {
    taken_.clear();
    rest_.clear();
    rest_rows_.clear();
    for (std::int64_t row = problem_.begin[p]; row < problem_.begin[p + 1]; ++row) {
      const LocalImage local = problem_.image[row];
      if (!local.valid()) continue;
      const PointView view{cameras_[local.value],
                           &state_.cameras[problem_.images[local.value].camera.value],
                           {problem_.x[row], problem_.y[row]},
                           problem_.inverse_sigma[row]};
      if (problem_.kept[row]) {
        taken_.push_back(view);
      } else {
        rest_.push_back(view);
        rest_rows_.push_back(row);
      }
    }
  }

  // Rejected observations of a good track may intersect close to its point. If more than half of the earlier
  // observations fit the new point within the threshold, it is the same ground point.
  bool same_point(const Eigen::Vector3d& point) const {
    const auto passing = std::count_if(taken_.begin(), taken_.end(), [&](const PointView& view) {
      return residual_sigmas(view, point) <= threshold_;
    });
    return 2 * passing > std::ssize(taken_);
  }

  const TileProblem& problem_;
  const TileState& state_;
  const double threshold_, cos_min_angle_;
  std::vector<Pose> cameras_;
  // Of the present point: the observations of the parts found so far, and the other ones.
  std::vector<PointView> taken_, rest_;
  std::vector<std::int64_t> rest_rows_;
};

}  // namespace

TrackParts find_track_parts(const TileProblem& problem, const TileState& state, double threshold_sigmas,
                            const AdjustOptions& options) {
  // The rows of tie points come first and are those of the track file; control points follow.
  std::int64_t rows = 0;
  for (std::int64_t p = 0; p < problem.point_count(); ++p)
    if (problem.points[p].role == PointRole::kTie) rows = problem.begin[p + 1];
  TrackParts parts(static_cast<std::size_t>(rows), 0);
  TrackPartFinder finder(problem, state, threshold_sigmas, options);
  for (std::int64_t p = 0; p < problem.point_count(); ++p)
    if (problem.points[p].role == PointRole::kTie && problem.active(p)) finder.find(p, parts);
  return parts;
}

std::vector<std::int64_t> rows_of_split(const TrackSet& tracks, const TrackParts& parts) {
  if (std::ssize(parts) != tracks.observation_count())
    throw StoreError("the parts of a tile's tracks belong to other tracks: " + std::to_string(parts.size()) +
                     " observations instead of " + std::to_string(tracks.observation_count()));
  std::vector<std::int64_t> rows(parts.size());
  for (std::size_t row = 0; row < rows.size(); ++row) rows[row] = static_cast<std::int64_t>(row);
  for (std::size_t t = 0; t < tracks.id.size(); ++t)
    // The order within a part stays that of the images.
    std::stable_sort(rows.begin() + tracks.begin[t], rows.begin() + tracks.begin[t + 1],
                     [&](std::int64_t a, std::int64_t b) {
                       return parts[static_cast<std::size_t>(a)] < parts[static_cast<std::size_t>(b)];
                     });
  return rows;
}

// A part begins where the number of the part changes within a track.
TrackSet split_tracks(const TrackSet& tracks, const TrackParts& parts) {
  const std::vector<std::int64_t> rows = rows_of_split(tracks, parts);
  TrackSet split;
  split.image.reserve(rows.size());
  for (std::vector<std::int32_t>* column : {&split.x, &split.y, &split.feature}) column->reserve(rows.size());
  for (std::size_t t = 0; t < tracks.id.size(); ++t) {
    int part = -1;
    for (std::int64_t i = tracks.begin[t]; i < tracks.begin[t + 1]; ++i) {
      const auto row = static_cast<std::size_t>(rows[static_cast<std::size_t>(i)]);
      if (parts[row] != part) {
        part = parts[row];
        split.id.push_back(tracks.id[t]);
        split.begin.push_back(i);
      }
      split.image.push_back(tracks.image[row]);
      split.x.push_back(tracks.x[row]);
      split.y.push_back(tracks.y[row]);
      split.feature.push_back(tracks.feature[row]);
    }
  }
  split.begin.push_back(tracks.observation_count());
  return split;
}

}  // namespace megablock
