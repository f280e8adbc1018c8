// A frame is judged only by points that others hold in place: two other frames intersect such a point without it. The
// points that only the frame and one other observe follow the frame and agree with any pose of it.
#include "adjust/tile/lost_frames.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "adjust/resection/observed_points.h"

namespace megablock {

namespace {

// A pose has six unknowns and a sample of three points satisfies itself. Twelve observations that agree, and three
// tenths of all, are far more than agree with a wrong pose by accident.
constexpr std::size_t kMinAgreeing = 12;
constexpr double kMinShare = 0.3;

// For each frame, the rows of its observations of points that two or more other frames keep.
std::vector<std::vector<std::int64_t>> rows_of_frames(const TileProblem& problem,
                                                      std::vector<std::int64_t>& point_of_row) {
  std::vector<std::vector<std::int64_t>> result(problem.frames.size());
  point_of_row.assign(problem.image.size(), -1);
  std::vector<std::int32_t> keeping;
  for (std::int64_t p = 0; p < problem.point_count(); ++p) {
    const auto frame_of = [&](std::int64_t row) { return problem.images[problem.image[row].value].frame.value; };
    keeping.clear();
    for (std::int64_t row = problem.begin[p]; row < problem.begin[p + 1]; ++row)
      if (problem.kept[row]) keeping.push_back(frame_of(row));
    std::sort(keeping.begin(), keeping.end());
    keeping.erase(std::unique(keeping.begin(), keeping.end()), keeping.end());
    for (std::int64_t row = problem.begin[p]; row < problem.begin[p + 1]; ++row) {
      if (!problem.image[row].valid()) continue;
      const std::int32_t frame = frame_of(row);
      const bool itself = std::binary_search(keeping.begin(), keeping.end(), frame);
      if (keeping.size() < (itself ? 3u : 2u)) continue;
      point_of_row[row] = p;
      result[frame].push_back(row);
    }
  }
  return result;
}

class Resection {
 public:
  Resection(const TileProblem& problem, const TileState& state, const std::vector<std::int64_t>& point_of_row,
            double threshold)
      : problem_(problem), state_(state), point_of_row_(point_of_row), threshold_(threshold) {}

  std::optional<Pose> find(const std::vector<std::int64_t>& rows, std::uint64_t seed) const {
    // Scoring every sample by 300 observations is enough to find the pose. All observations then judge it.
    constexpr std::size_t kMostObservations = 300;
    std::vector<ObservedPoint> observations;
    const std::size_t stride = 1 + (rows.size() - 1) / kMostObservations;
    for (std::size_t i = 0; i < rows.size(); i += stride)
      if (const auto observation = observation_of(rows[i])) observations.push_back(*observation);
    const std::optional<Pose> found = find_lost_pose(observations, threshold_, seed);
    if (!found) return std::nullopt;
    const std::size_t agree = agreeing(*found, rows);
    const bool enough = agree >= kMinAgreeing && static_cast<double>(agree) >= kMinShare * std::ssize(rows);
    return enough ? found : std::nullopt;
  }

  std::size_t agreeing(const Pose& frame, const std::vector<std::int64_t>& rows) const {
    return static_cast<std::size_t>(
        std::count_if(rows.begin(), rows.end(), [&](std::int64_t row) { return agrees(frame, row); }));
  }

 private:
  const TileImage& image_of(std::int64_t row) const { return problem_.images[problem_.image[row].value]; }

  bool agrees(const Pose& frame, std::int64_t row) const {
    const TileImage& image = image_of(row);
    const Eigen::Vector3d inside = to_camera(frame, state_.mounts[image.mount], state_.points[point_of_row_[row]]);
    const Eigen::Vector2d measured(problem_.x[row], problem_.y[row]);
    return reprojection(state_.cameras[image.camera.value], inside, measured).norm() * problem_.inverse_sigma[row] <=
           threshold_;
  }

  std::optional<ObservedPoint> observation_of(std::int64_t row) const {
    const TileImage& image = image_of(row);
    const auto ray =
        rig_ray(state_.mounts[image.mount], state_.cameras[image.camera.value], {problem_.x[row], problem_.y[row]});
    if (!ray) return std::nullopt;
    const std::int64_t point = point_of_row_[row];
    // The points count as exact: thresholds here are many times their errors.
    return ObservedPoint{*ray, state_.points[point], Eigen::Matrix3d::Zero(), 1 / problem_.inverse_sigma[row], point};
  }

  const TileProblem& problem_;
  const TileState& state_;
  const std::vector<std::int64_t>& point_of_row_;
  double threshold_;
};

}  // namespace

std::vector<LocalFrame> recover_lost_frames(const TileProblem& problem, TileState& state, double threshold_sigmas) {
  std::vector<std::int64_t> point_of_row;
  const std::vector<std::vector<std::int64_t>> rows = rows_of_frames(problem, point_of_row);
  const Resection resection(problem, state, point_of_row, threshold_sigmas);
  // All frames are sought before any of them moves, so that the result does not depend on their order.
  std::vector<std::optional<Pose>> found(rows.size());
  for (std::size_t f = 0; f < rows.size(); ++f) {
    if (rows[f].size() < kMinAgreeing) continue;
    const std::size_t now = resection.agreeing(state.frames[f], rows[f]);
    // The frame is not lost.
    if (static_cast<double>(now) >= kMinShare * static_cast<double>(rows[f].size())) continue;
    found[f] = resection.find(rows[f], static_cast<std::uint64_t>(problem.frames[f].value));
    // A pose that explains no more than the present one is no gain.
    if (found[f] && resection.agreeing(*found[f], rows[f]) <= now) found[f].reset();
  }
  std::vector<LocalFrame> frames;
  for (std::size_t f = 0; f < found.size(); ++f) {
    if (!found[f]) continue;
    state.frames[f] = *found[f];
    frames.emplace_back(static_cast<std::int32_t>(f));
  }
  return frames;
}

}  // namespace megablock
