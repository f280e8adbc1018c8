// From merged tiles to the tracks of the result. Each rank writes the tracks of its tiles to the job's disk as
// soon as their covariances are there; the first rank then reads them all, merged by their keys, a small piece of each
// tile at a time: no rank holds more of the result than a tile.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "adjust/checks/common_motion.h"
#include "io/result/track_batches.h"
#include "merge/step/tile_store.h"
#include "merge/tile/condense.h"

namespace megablock {

// What a tile contributes besides its tracks.
struct TilePart {
  std::int64_t tile = -1;
  std::int64_t track_count = 0;
  std::int64_t measured = 0, kept = 0;     // tie point measurements; those that take part
  std::vector<FrameIndex> frames;          // touched by observations that take part
  std::vector<std::int64_t> control_rows;  // in block.control_points
  std::vector<BlockResult::ControlResult> control;
  std::vector<std::vector<Eigen::Vector2d>> control_measured;  // px, corrected as they were adjusted
  std::int32_t component = -1;                                 // of the block; -1: nothing to judge of its motion
  CommonMotion motion;
  Bytes to_bytes() const;
  static TilePart from_bytes(const Bytes& bytes);
};

// Writes the tracks of a merged tile, whose first points they are, to `path`, ascending by their keys; positions are
// those that the tile was adjusted with (adjust/problem/environment_correction.h).
// A full disk is an InputError.
TilePart write_part(const std::string& path, const RankTile& tile, const TrackSet& tracks,
                    const TileCovariance& covariance);

// All tiles' tracks with dense indices in the order of their keys; file_tracks has the keys. Covariances are multiplied
// by `covariance_factor`. Throws StoreError when a file cannot be read.
class PartTracks final : public TrackBatches {
 public:
  struct File {
    std::string path;
    std::int64_t track_count = 0;
  };
  // `after_batch` is called behind every batch of a visit, of which there may be several at a time.
  PartTracks(std::vector<File> files, double covariance_factor, std::function<void()> after_batch = {});
  std::int64_t track_count() const override { return count_; }
  void visit(const Visit& visit) const override;

 private:
  std::vector<File> files_;  // [tiles]
  double covariance_factor_;
  std::function<void()> after_batch_;
  std::int64_t count_ = 0;
};

}  // namespace megablock
