// Lists the tracks that a frame observes, and those that four frames have in common.
#pragma once

#include "adjust/registration/pair_registration.h"
#include "io/block/block.h"
#include "io/block/registration.h"
#include "io/block/tracks.h"

namespace megablock {

class FrameTracks {
 public:
  FrameTracks(const Block& block, TrackSet tracks);

  const TrackSet& tracks() const { return tracks_; }

  // The place with most tracks in at least `min_frames` frames, among this one and its neighbours one frame before or
  // after it along either pass.
  Place richest(const Place& place, int min_frames) const;

  std::vector<FourFrameTrack> common(const Place& place, int min_frames) const;

 private:
  // The tracks that both passes and at least min_frames of the frames a, b, c, d observe; ascending.
  std::vector<std::int64_t> shared(const Place& place, int min_frames) const;
  bool successive(FrameIndex a, FrameIndex b) const;

  const Block& block_;
  TrackSet tracks_;
  std::vector<std::int64_t> begin_;  // [frames + 1] first row of each frame in rows_
  std::vector<std::int64_t> rows_;   // tracks of each frame, ascending
};

}  // namespace megablock
