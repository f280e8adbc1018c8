// A sample must be connected well, or its cameras would be determined by single tie points. It therefore grows by the
// frame that shares most tracks with it. Within the sample the tracks are thinned by a fixed step, so that the sample
// is the same in every run.
#include "adjust/calibration/block_sample.h"

#include <algorithm>
#include <map>
#include <set>

#include "io/base/error.h"

namespace megablock {

void BlockSampleOptions::check() const {
  if (max_frames < 2) throw InputError("max_frames must be at least 2");
  if (max_observations < 100) throw InputError("max_observations must be at least 100");
}

namespace {

class Sampler {
 public:
  Sampler(const Block& block, const BlockState& state, const TrackSet& tracks)
      : block_(block),
        state_(state),
        tracks_(tracks),
        tracks_of_frame_(block.frames.size()),
        taken_(block.frames.size()) {
    for (std::int64_t t = 0; t < tracks.track_count(); ++t)
      for (const FrameIndex frame : frames_of(t)) tracks_of_frame_[frame].push_back(t);
  }

  // Takes frames until there are `max_frames`, or until none shares a track with the sample. Returns their number.
  std::int64_t grow(std::int64_t max_frames) {
    FrameIndex next(0);
    for (FrameIndex f(0); tracks_of_frame_.contains(f); ++f.value)
      if (tracks_of_frame_[f].size() > tracks_of_frame_[next].size()) next = f;
    std::int64_t count = 0;
    for (; next.valid() && count < max_frames; ++count) {
      take(next);
      next = FrameIndex();
      std::int64_t most = 0;
      // The map is ascending, and only more tracks than before win: of equal frames the lowest one is taken.
      for (const auto& [frame, shared] : shared_)
        if (shared > most) {
          most = shared;
          next = frame;
        }
    }
    return count;
  }
  bool taken(FrameIndex frame) const { return taken_[frame] != 0; }

 private:
  std::set<FrameIndex> frames_of(std::int64_t track) const {
    std::set<FrameIndex> frames;
    for (std::int64_t row = tracks_.begin[track]; row < tracks_.begin[track + 1]; ++row) {
      const FrameIndex frame = block_.images[tracks_.image[row]].frame;
      if (state_.oriented[frame]) frames.insert(frame);
    }
    return frames;
  }
  void take(FrameIndex frame) {
    taken_[frame] = 1;
    shared_.erase(frame);
    for (const std::int64_t t : tracks_of_frame_[frame])
      for (const FrameIndex other : frames_of(t))
        if (!taken_[other]) ++shared_[other];
  }

  const Block& block_;
  const BlockState& state_;
  const TrackSet& tracks_;
  IndexedVector<FrameIndex, std::vector<std::int64_t>> tracks_of_frame_;
  IndexedVector<FrameIndex, std::uint8_t> taken_;
  std::map<FrameIndex, std::int64_t> shared_;  // tracks that frames outside the sample share with its frames
};

void append_track(const TrackSet& from, std::int64_t track, const std::vector<std::int64_t>& rows, TrackSet& to) {
  to.id.push_back(from.id[track]);
  for (const std::int64_t row : rows) {
    to.image.push_back(from.image[row]);
    to.x.push_back(from.x[row]);
    to.y.push_back(from.y[row]);
    to.feature.push_back(from.feature[row]);
  }
  to.begin.push_back(to.observation_count());
}

}  // namespace

BlockSample sample_block(const Block& block, const BlockState& state, const TrackSet& tracks,
                         const BlockSampleOptions& options) {
  options.check();
  Sampler sampler(block, state, tracks);
  BlockSample sample{state, {}};
  sample.frames = sampler.grow(options.max_frames);
  if (sample.frames < 2)
    throw InputError(
        "no two oriented frames of the block share tie points; give a job that was run to the end, or a "
        "project with poses and tie points");
  for (FrameIndex f(0); block.frames.contains(f); ++f.value) sample.state.oriented[f] &= sampler.taken(f);
  for (const Image& image : block.images) sample.images += sample.state.oriented[image.frame] != 0;

  std::vector<std::pair<std::int64_t, std::vector<std::int64_t>>> usable;
  std::int64_t observations = 0;
  for (std::int64_t t = 0; t < tracks.track_count(); ++t) {
    std::vector<std::int64_t> rows;
    std::set<FrameIndex> frames;
    for (std::int64_t row = tracks.begin[t]; row < tracks.begin[t + 1]; ++row) {
      const FrameIndex frame = block.images[tracks.image[row]].frame;
      if (!sampler.taken(frame)) continue;
      rows.push_back(row);
      frames.insert(frame);
    }
    // A track within one frame says nothing of its distance.
    if (frames.size() < 2) continue;
    observations += std::ssize(rows);
    usable.emplace_back(t, std::move(rows));
  }
  // Every step-th track brings the number of observations to about the limit.
  const auto step = static_cast<std::size_t>((observations + options.max_observations - 1) / options.max_observations);
  sample.tracks.begin = {0};
  for (std::size_t i = 0; i < usable.size(); i += std::max<std::size_t>(1, step))
    append_track(tracks, usable[i].first, usable[i].second, sample.tracks);
  return sample;
}

}  // namespace megablock
