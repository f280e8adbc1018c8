// Joins two blocks into one, with the same cameras and rigs.
#pragma once

#include "io/simulate/blocks/simulate.h"

namespace megablock {

// Appends `other`, moved by `away`; both simulated with the same cameras and rigs, without control points.
inline void append_city(SimulatedBlock& block, const SimulatedBlock& other, const Eigen::Vector3d& away) {
  const auto frames = static_cast<std::int64_t>(block.block.frames.size());
  const auto images = static_cast<std::int64_t>(block.block.images.size());
  for (Frame frame : other.block.frames) {
    frame.name += "_b";
    if (frame.position_prior) frame.position_prior->position += away;
    if (frame.given_pose) frame.given_pose->centre += away;
    block.block.frames.push_back(frame);
  }
  for (ImageIndex i(0); other.block.images.contains(i); ++i.value) {
    Image image = other.block.images[i];
    image.frame.value += frames;
    block.block.add_image(other.block.name_of(i) + "_b", image);
  }
  for (Pose pose : other.truth.frames) {
    pose.centre += away;
    block.truth.frames.push_back(pose);
    block.truth.oriented.push_back(1);
  }
  TrackSet& tracks = block.tracks;
  const std::int64_t ids = tracks.id.back().value + 1;
  for (std::int64_t t = 0; t < other.tracks.track_count(); ++t) {
    for (auto o = static_cast<std::size_t>(other.tracks.begin[static_cast<std::size_t>(t)]);
         o < static_cast<std::size_t>(other.tracks.begin[static_cast<std::size_t>(t + 1)]); ++o) {
      tracks.image.push_back(ImageIndex(images + other.tracks.image[o].value));
      tracks.x.push_back(other.tracks.x[o]);
      tracks.y.push_back(other.tracks.y[o]);
      tracks.feature.push_back(other.tracks.feature[o]);
    }
    tracks.id.push_back(TrackIndex(ids + other.tracks.id[static_cast<std::size_t>(t)].value));
    tracks.begin.push_back(tracks.observation_count());
    block.points.push_back(other.points[static_cast<std::size_t>(t)] + away);
  }
}

}  // namespace megablock
