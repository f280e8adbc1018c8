// Collects the tracks of the result from the merged tiles. Each rank writes the tracks of its tiles to the disk of the
// job when their covariances are known. The first rank then reads the tracks of all tiles, merged by their keys, in
// small pieces. No rank holds more of the result than one tile.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "adjust/checks/common_motion.h"
#include "io/result/track_batches.h"
#include "merge/step/tile_store.h"
#include "merge/tile/condense.h"

namespace megablock {

// The part of a tile in the result, apart from its tracks.
struct TilePart {
  std::int64_t tile = -1;
  std::int64_t track_count = 0;
  std::int64_t measured = 0, kept = 0;     // observations of tie points; the kept ones among them
  std::vector<FrameIndex> frames;          // frames of kept observations
  std::vector<std::int64_t> control_rows;  // in block.control_points
  std::vector<BlockResult::ControlResult> control;
  std::vector<std::vector<Eigen::Vector2d>> control_measured;  // px, with the corrections of the adjustment
  std::int32_t component = -1;  // component of the block; -1: its common motion cannot be judged
  CommonMotion motion;
  Bytes to_bytes() const;
  static TilePart from_bytes(const Bytes& bytes);
};

// Writes the tracks of a merged tile, which are its first points, to `path`, ascending by their keys. The image
// coordinates are those of the adjustment (adjust/problem/environment_correction.h). Throws InputError on a full disk.
TilePart write_part(const std::string& path, const RankTile& tile, const TrackSet& tracks,
                    const TileCovariance& covariance);

// The tracks of all tiles with dense indices in the order of their keys; file_tracks has the keys. Covariances are
// multiplied by `covariance_factor`. Throws StoreError when a file cannot be read.
class PartTracks final : public TrackBatches {
 public:
  struct File {
    std::string path;
    std::int64_t track_count = 0;
  };
  // `after_batch` is called after every batch of a visit. Several visits may run at the same time.
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
