#include "adjust/problem/long_tracks.h"

#include <algorithm>
#include <functional>
#include <numeric>
#include <unordered_map>

namespace megablock {

namespace {

class TrackChooser {
 public:
  explicit TrackChooser(TileProblem& problem) : problem_(problem), covered_(problem.images.size(), 0) {
    std::vector<std::int64_t> images(problem.frames.size(), 0);
    for (const TileImage& image : problem.images) ++images[row(image.frame)];
    for (const TileImage& image : problem.images)
      enough_.push_back(std::max(kTracksOfImage, kTracksOfFrame / images[row(image.frame)]));
  }

  bool run() {
    if (problem_.observation_count() < 2 * std::accumulate(enough_.begin(), enough_.end(), std::int64_t{0}))
      return false;
    std::vector<std::int64_t> order(problem_.points.size());
    std::iota(order.begin(), order.end(), 0);
    const auto length = [&](std::int64_t p) { return problem_.begin[p + 1] - problem_.begin[p]; };
    std::ranges::stable_sort(order, std::greater(), length);
    for (const std::int64_t p : order)
      if (needed(p))
        count();
      else
        std::fill(problem_.kept.begin() + problem_.begin[p], problem_.kept.begin() + problem_.begin[p + 1], 0);
    return true;
  }

 private:
  static std::size_t row(auto local) { return static_cast<std::size_t>(local.value); }

  // Lists images and pairs of frames of the kept observations of a track.
  void load(std::int64_t p) {
    images_.clear();
    frames_.clear();
    pairs_.clear();
    for (std::int64_t o = problem_.begin[p]; o < problem_.begin[p + 1]; ++o) {
      if (!problem_.kept[o]) continue;
      images_.push_back(row(problem_.image[o]));
      frames_.push_back(problem_.images[images_.back()].frame.value);
    }
    std::ranges::sort(frames_);
    frames_.erase(std::unique(frames_.begin(), frames_.end()), frames_.end());
    for (std::size_t a = 0; a < frames_.size(); ++a)
      for (std::size_t b = 0; b < a; ++b)
        pairs_.push_back(static_cast<std::int64_t>(frames_[a]) * std::ssize(problem_.frames) + frames_[b]);
  }

  bool needed(std::int64_t p) {
    load(p);
    return problem_.points[static_cast<std::size_t>(p)].role == PointRole::kControl ||
           std::ranges::any_of(images_, [&](std::size_t image) { return covered_[image] < enough_[image]; }) ||
           std::ranges::any_of(pairs_, [&](std::int64_t pair) { return common_[pair] < kTracksOfPair; });
  }
  // Counts the loaded track.
  void count() {
    for (const std::size_t image : images_) ++covered_[image];
    for (const std::int64_t pair : pairs_) ++common_[pair];
  }

  TileProblem& problem_;
  std::vector<std::int64_t> enough_, covered_;             // [images] tracks
  std::unordered_map<std::int64_t, std::int64_t> common_;  // tracks, by pairs of frames
  // These belong to the present track.
  std::vector<std::size_t> images_;
  std::vector<std::int32_t> frames_;
  std::vector<std::int64_t> pairs_;
};

}  // namespace

bool choose_long_tracks(TileProblem& problem) { return TrackChooser(problem).run(); }

}  // namespace megablock
