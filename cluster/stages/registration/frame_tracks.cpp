#include "cluster/stages/registration/frame_tracks.h"

#include <algorithm>
#include <array>
#include <numeric>

namespace megablock {

namespace {

std::array<FrameIndex, 4> frames_of(const Place& place) { return {place.a, place.b, place.c, place.d}; }

}  // namespace

FrameTracks::FrameTracks(const Block& block, TrackSet tracks) : block_(block), tracks_(std::move(tracks)) {
  begin_.assign(block.frames.size() + 1, 0);
  const auto each = [&](const auto& visit) {
    std::vector<FrameIndex> frames;
    for (std::int64_t t = 0; t < tracks_.track_count(); ++t) {
      frames.clear();
      for (auto o = tracks_.begin[static_cast<std::size_t>(t)]; o < tracks_.begin[static_cast<std::size_t>(t) + 1]; ++o)
        frames.push_back(block.images[tracks_.image[static_cast<std::size_t>(o)]].frame);
      std::sort(frames.begin(), frames.end());
      frames.erase(std::unique(frames.begin(), frames.end()), frames.end());
      for (const FrameIndex f : frames) visit(static_cast<std::size_t>(f.value), t);
    }
  };
  each([&](std::size_t f, std::int64_t) { ++begin_[f + 1]; });
  std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
  rows_.resize(static_cast<std::size_t>(begin_.back()));
  std::vector<std::int64_t> next(begin_.begin(), begin_.end() - 1);
  each([&](std::size_t f, std::int64_t t) { rows_[static_cast<std::size_t>(next[f]++)] = t; });
}

std::vector<std::int64_t> FrameTracks::shared(const Place& place, int min_frames) const {
  struct Seen {
    std::int64_t track;
    int frame;
  };
  std::vector<Seen> seen;
  const auto frames = frames_of(place);
  for (int k = 0; k < 4; ++k) {
    const auto f = static_cast<std::size_t>(frames[static_cast<std::size_t>(k)].value);
    for (auto row = begin_[f]; row < begin_[f + 1]; ++row) seen.push_back({rows_[static_cast<std::size_t>(row)], k});
  }
  std::sort(seen.begin(), seen.end(),
            [](const Seen& x, const Seen& y) { return std::pair(x.track, x.frame) < std::pair(y.track, y.frame); });
  std::vector<std::int64_t> tracks;
  for (std::size_t i = 0, j = 0; i < seen.size(); i = j) {
    while (j < seen.size() && seen[j].track == seen[i].track) ++j;
    const bool both_passes = seen[i].frame < 2 && seen[j - 1].frame >= 2;
    if (both_passes && static_cast<int>(j - i) >= min_frames) tracks.push_back(seen[i].track);
  }
  return tracks;
}

bool FrameTracks::successive(FrameIndex a, FrameIndex b) const {
  const auto count = static_cast<std::int64_t>(block_.frames.size());
  return a.value >= 0 && b.value >= 0 && a.value < count && b.value < count &&
         block_.frames[a].pass == block_.frames[b].pass;
}

Place FrameTracks::richest(const Place& place, int min_frames) const {
  Place best = place;
  std::size_t most = shared(place, min_frames).size();
  for (const std::int64_t first : {-2, -1, 0, 1})
    for (const std::int64_t second : {-2, -1, 0, 1}) {
      const Place other{FrameIndex(place.a.value + first), FrameIndex(place.a.value + first + 1),
                        FrameIndex(place.c.value + second), FrameIndex(place.c.value + second + 1), place.component};
      if (!successive(other.a, place.a) || !successive(other.a, other.b) || !successive(other.c, place.c) ||
          !successive(other.c, other.d))
        continue;
      const std::size_t count = shared(other, min_frames).size();
      if (count > most) best = other, most = count;
    }
  return best;
}

std::vector<FourFrameTrack> FrameTracks::common(const Place& place, int min_frames) const {
  const auto frames = frames_of(place);
  std::vector<FourFrameTrack> result;
  for (const std::int64_t t : shared(place, min_frames)) {
    FourFrameTrack track;
    for (auto o = tracks_.begin[static_cast<std::size_t>(t)]; o < tracks_.begin[static_cast<std::size_t>(t) + 1]; ++o) {
      const auto row = static_cast<std::size_t>(o);
      const ImageIndex image = tracks_.image[row];
      const auto k = std::find(frames.begin(), frames.end(), block_.images[image].frame) - frames.begin();
      if (k == 4) continue;
      const Eigen::Vector2d pixel(from_fixed_pixel(tracks_.x[row]), from_fixed_pixel(tracks_.y[row]));
      const auto ray = rig_ray(block_.mount_of(image).pose, block_.cameras[block_.camera_of(image)].intrinsics, pixel);
      if (ray) track.views.push_back({static_cast<std::int32_t>(k), *ray});
    }
    result.push_back(std::move(track));
  }
  return result;
}

}  // namespace megablock
