// Resects a part as one rig. Let X = G(X_now) be the movement of the ground that puts a part where it belongs. A ray of
// the part's frames, taken in the ground axes of the present poses, is a ray of a rig whose pose relative to the
// correct ground is sought: X_now = R (X - C). Resection of this rig from the points of the standing frames gives (R,
// C), and
//
//     X = R' X_now + C,   R_frame <- R_frame R,   C_frame <- R' C_frame + C
//
// brings the frames and the points of the part to the correct ground.
//
// Sets of frames. The graph of frames is weighted by tracks: shared by two frames, and kept by both. It is contracted
// as long as two sets keep half or more of the tracks that they share, with the sums over all pairs of their frames. A
// single pair of frames with few tracks would decide by accident; hence the least number of shared tracks.
#include "adjust/tile/lost_parts.h"

#include <algorithm>
#include <map>
#include <optional>

#include "adjust/resection/observed_points.h"
#include "io/base/disjoint_sets.h"

namespace megablock {

namespace {

// A part of two frames is a matter of single frames (lost_frames.h). Thirty observations that agree, and three tenths
// of all, are far more than agree with a wrong pose by accident.
constexpr std::size_t kFewestOfPart = 3, kFewestAgreeing = 30;
constexpr double kAgreeingShare = 0.3;

// The number of tracks that two frames, or two sets of frames, both observe, and of those that both keep.
struct PartAgreement {
  std::int64_t shared = 0, kept = 0;
  bool hangs_together() const {
    constexpr std::int64_t kFewestShared = 10;
    return shared >= kFewestShared && 2 * kept >= shared;
  }
};
using FramePair = std::pair<std::int64_t, std::int64_t>;  // ascending
using Agreements = std::map<FramePair, PartAgreement>;

std::int32_t frame_of(const TileProblem& problem, std::int64_t row) {
  return problem.images[problem.image[row].value].frame.value;
}

// Uses every n-th track, which is enough. Of a track it uses the pairs of neighbouring frames and that of its first and
// last frame, so that a long track does not count more than a short one. Tracks without a kept observation, too narrow
// ones for example, do not count.
Agreements agreements_of_frames(const TileProblem& problem) {
  const std::int64_t enough = std::max<std::int64_t>(20'000, 40 * std::ssize(problem.frames));
  const std::int64_t stride = std::max<std::int64_t>(1, problem.point_count() / enough);
  // A sorted list of pairs is summed in one run; to add every pair to a map would take a search for each.
  std::vector<std::pair<FramePair, bool>> pairs;
  std::map<std::int64_t, bool> frames;  // frames of a track, and whether one of its observations there is kept
  for (std::int64_t p = 0; p < problem.point_count(); p += stride) {
    frames.clear();
    for (std::int64_t row = problem.begin[p]; row < problem.begin[p + 1]; ++row)
      if (problem.image[row].valid()) frames[frame_of(problem, row)] |= problem.kept[row] != 0;
    const auto is_kept = [](const auto& frame) { return frame.second; };
    if (frames.size() < 2 || std::none_of(frames.begin(), frames.end(), is_kept)) continue;
    const auto add = [&](const auto& a, const auto& b) { pairs.push_back({{a.first, b.first}, a.second && b.second}); };
    for (auto a = frames.begin(), b = std::next(a); b != frames.end(); ++a, ++b) add(*a, *b);
    if (frames.size() > 2) add(*frames.begin(), *frames.rbegin());
  }
  std::sort(pairs.begin(), pairs.end());
  Agreements sums;
  for (const auto& [pair, kept] : pairs) {
    PartAgreement& sum = sums.emplace_hint(sums.end(), pair, PartAgreement())->second;
    ++sum.shared;
    sum.kept += kept;
  }
  return sums;
}

// The sets of connected frames, the largest first; of equal ones, that with the lowest frame.
std::vector<std::vector<std::int64_t>> parts_of(const TileProblem& problem) {
  const auto count = static_cast<std::int64_t>(problem.frames.size());
  DisjointSets sets(count);
  Agreements open = agreements_of_frames(problem);
  // Uniting two sets adds up their tracks with a third one, so that others may hang together then.
  for (bool changed = true; changed;) {
    changed = false;
    Agreements between;  // between the present sets
    for (const auto& [pair, agreement] : open)
      if (agreement.hangs_together()) changed = sets.unite(pair.first, pair.second) || changed;
    for (const auto& [pair, agreement] : open) {
      const std::int64_t a = sets.find(pair.first), b = sets.find(pair.second);
      if (a == b) continue;
      PartAgreement& sum = between[std::minmax(a, b)];
      sum.shared += agreement.shared;
      sum.kept += agreement.kept;
    }
    open = std::move(between);
  }
  std::map<std::int64_t, std::vector<std::int64_t>> by_lowest;
  for (std::int64_t f = 0; f < count; ++f) by_lowest[sets.find(f)].push_back(f);
  std::vector<std::vector<std::int64_t>> parts;
  for (auto& [lowest, frames] : by_lowest) parts.push_back(std::move(frames));
  std::stable_sort(parts.begin(), parts.end(), [](const auto& a, const auto& b) { return a.size() > b.size(); });
  return parts;
}

class PartFinder {
 public:
  PartFinder(const TileProblem& problem, TileState& state, double threshold)
      : problem_(problem), state_(state), threshold_(threshold), stands_(problem.frames.size(), 0) {}

  void let_stand(const std::vector<std::int64_t>& frames) {
    for (const std::int64_t f : frames) stands_[static_cast<std::size_t>(f)] = 1;
  }

  // Moves the part and lets it stand, if its place is found.
  bool find(const std::vector<std::int64_t>& frames) {
    mark(frames);
    const std::vector<ObservedPoint> observations = observations_of_part();
    const std::optional<Pose> pose = place(
        observations, static_cast<std::uint64_t>(problem_.frames[static_cast<std::size_t>(frames.front())].value));
    if (!pose) return false;
    move(frames, *pose);
    let_stand(frames);
    return true;
  }

 private:
  void mark(const std::vector<std::int64_t>& frames) {
    in_part_.assign(stands_.size(), 0);
    for (const std::int64_t f : frames) in_part_[static_cast<std::size_t>(f)] = 1;
  }
  bool of_part(std::int64_t row) const { return in_part_[static_cast<std::size_t>(frame_of(problem_, row))] != 0; }

  // Whether two or more standing frames keep the point, and apart from them only the part itself.
  bool stands(std::int64_t p) const {
    std::int32_t first = -1;
    bool several = false;
    for (std::int64_t row = problem_.begin[p]; row < problem_.begin[p + 1]; ++row) {
      if (!problem_.kept[row]) continue;
      if (of_part(row)) continue;
      const std::int32_t frame = frame_of(problem_, row);
      // A point that another part keeps too may stand where that part stands.
      if (!stands_[static_cast<std::size_t>(frame)]) return false;
      several = several || (first >= 0 && frame != first);
      first = frame;
    }
    return several;
  }

  // The observations that the part has of standing points, as those of one rig in ground axes.
  std::vector<ObservedPoint> observations_of_part() const {
    std::vector<ObservedPoint> observations;
    for (std::int64_t p = 0; p < problem_.point_count(); ++p) {
      if (!stands(p)) continue;
      for (std::int64_t row = problem_.begin[p]; row < problem_.begin[p + 1]; ++row) {
        if (!problem_.image[row].valid() || !of_part(row)) continue;
        const TileImage& image = problem_.images[problem_.image[row].value];
        const auto ray =
            rig_ray(state_.mounts[image.mount], state_.cameras[image.camera.value], {problem_.x[row], problem_.y[row]});
        if (ray)
          observations.push_back({carried(*ray, state_.frames[image.frame.value]), state_.points[p],
                                  Eigen::Matrix3d::Zero(), 1 / problem_.inverse_sigma[row], p});
      }
    }
    return observations;
  }

  std::size_t agreeing(const std::vector<ObservedPoint>& observations, const Pose& pose) const {
    return static_cast<std::size_t>(
        std::count_if(observations.begin(), observations.end(), [&](const ObservedPoint& observation) {
          const auto residual = whitened(observation, pose, false);
          return residual && residual->residual.norm() <= threshold_;
        }));
  }

  // The pose from the correct ground axes to those in which the part is now. Empty where enough observations agree
  // already, or where too few agree with any pose.
  std::optional<Pose> place(const std::vector<ObservedPoint>& observations, std::uint64_t seed) const {
    constexpr std::size_t kMostObservations = 500;
    const auto enough = [&](std::size_t agree) {
      return agree >= kFewestAgreeing &&
             static_cast<double>(agree) >= kAgreeingShare * static_cast<double>(observations.size());
    };
    if (observations.size() < kFewestAgreeing || enough(agreeing(observations, Pose{}))) return std::nullopt;
    std::vector<ObservedPoint> some;
    for (std::size_t i = 0; i < observations.size(); i += 1 + (observations.size() - 1) / kMostObservations)
      some.push_back(observations[i]);
    const std::optional<Pose> found = find_lost_pose(some, threshold_, seed);
    return found && enough(agreeing(observations, *found)) ? found : std::nullopt;
  }

  // X_now = R (X - C) for the correct X. Moves the frames of the part, and the points that it alone keeps, to X.
  void move(const std::vector<std::int64_t>& frames, const Pose& pose) {
    const auto moved = [&](const Eigen::Vector3d& now) -> Eigen::Vector3d {
      return pose.rotation.conjugate() * now + pose.centre;
    };
    for (const std::int64_t f : frames) {
      Pose& frame = state_.frames[static_cast<std::size_t>(f)];
      frame = {(frame.rotation * pose.rotation).normalized(), moved(frame.centre)};
    }
    for (std::int64_t p = 0; p < problem_.point_count(); ++p) {
      // Control points have known positions and stay.
      if (problem_.points[static_cast<std::size_t>(p)].role != PointRole::kTie) continue;
      bool own = false, others = false;
      for (std::int64_t row = problem_.begin[p]; row < problem_.begin[p + 1]; ++row)
        if (problem_.kept[row]) (of_part(row) ? own : others) = true;
      if (own && !others) state_.points[p] = moved(state_.points[p]);
    }
  }

  const TileProblem& problem_;
  TileState& state_;
  double threshold_;
  std::vector<std::uint8_t> stands_, in_part_;  // [frames]
};

}  // namespace

std::vector<LocalFrame> recover_lost_parts(const TileProblem& problem, TileState& state, double threshold_sigmas) {
  const std::vector<std::vector<std::int64_t>> parts = parts_of(problem);
  std::vector<LocalFrame> moved;
  PartFinder finder(problem, state, threshold_sigmas);
  if (!parts.empty()) finder.let_stand(parts.front());
  for (std::size_t i = 1; i < parts.size() && parts[i].size() >= kFewestOfPart; ++i)
    if (finder.find(parts[i]))
      for (const std::int64_t f : parts[i]) moved.emplace_back(static_cast<std::int32_t>(f));
  std::sort(moved.begin(), moved.end());
  return moved;
}

}  // namespace megablock
