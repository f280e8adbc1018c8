// Holds a simulated block together with its truth.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "io/block/block.h"
#include "io/block/tracks.h"

namespace megablock {

// The object that a simulated observation shows.
enum class Verdict : std::uint8_t {
  kRight = 0,     // the point, with image_noise_px
  kStray = 1,     // anything, anywhere in the image
  kRepeated = 2,  // another place of a repeated facade, the same one in neighbouring observations of the track
  kVehicle = 3    // a spot on a moving vehicle, the same one in neighbouring observations
};

// The reception of satellites at a frame of a simulated trajectory.
enum class Gnss : std::uint8_t { kNone = 0, kMasked = 1, kClear = 2 };

struct SimulatedTracks {
  TrackSet tracks;                      // noisy observations
  std::vector<Eigen::Vector3d> points;  // true positions [tracks]
  std::vector<std::uint8_t> outlier;    // [observations] Verdict; 0 = right
};

// A simulated block with its truth. It has all tracks, or none if they were passed to a sink.
struct SimulatedBlock : SimulatedTracks {
  Block block;  // the block that the job gets
  BlockState truth;
  std::vector<Eigen::Vector3d> control_truth;  // true positions [block.control_points]
  std::vector<Gnss> gnss;                      // [frames] in the scene Stereopolis, else empty
};

// Receives the tracks of a block in batches, in the order of their indices.
using TrackSink = std::function<void(const SimulatedTracks&)>;

}  // namespace megablock
