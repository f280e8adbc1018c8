// The tiles of one rank, out of core: whole in memory while they fit a byte budget; of the others the measurements and
// points lie in the rank's scratch directory and are read when the tile's turn comes, one tile at a time.
//
// Those in scratch are packed (packed_columns.h): about 15 bytes a measurement of a street instead of 39. Whether one
// has room there (scratch_space.h), with a trial's points beside the present ones, is asked with its unpacked size and
// once. What is screened later may lengthen its flags' runs; where these have no room the tile moves to memory.
//
// Which tiles stay is decided once, in the order in which they are added: passes go over all tiles again and again, now
// upwards, now downwards, and with a fixed choice each of them reads the others exactly once. A scratch disk that is
// full keeps a tile in memory: it costs memory, never the tile. The choice never changes bits.
//
// Frames, cameras, mounts and their values ("outline") are small and always there, and so are lines, verticals and the
// priors of points, cameras and mounts; images, measurements and the other observations of a tile in scratch are not.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "adjust/problem/tile_problem.h"
#include "merge/step/memory.h"

namespace megablock {

// One tile as its rank holds it.
struct RankTile {
  std::int64_t tile = -1;
  TileProblem problem;
  TileState state;
};

class TileStore {
 public:
  // Uses options.tile_bytes and the scratch.
  explicit TileStore(const MemoryOptions& options);
  ~TileStore();  // removes its scratch files
  TileStore(const TileStore&) = delete;
  TileStore& operator=(const TileStore&) = delete;

  // Tiles are added by ascending number; `row` below counts them.
  void add(RankTile tile);
  std::size_t size() const { return slots_.size(); }
  std::int64_t number(std::size_t row) const { return slots_[row].tile.tile; }

  bool in_scratch(std::size_t row) const { return slots_[row].in_scratch; }

  // Without what is in scratch: its tables may be empty.
  const RankTile& outline(std::size_t row) const { return slots_[row].tile; }
  // Whole. The reference holds until another row is asked for.
  const RankTile& whole(std::size_t row);
  // Calls change(RankTile&) on the whole tile and keeps what it made of it.
  template <typename Change>
  void change(std::size_t row, Change&& change) {
    change(load(row));
    save(row);
  }

  // States after a step, beside the present ones until all are accepted or none.
  void put_trial(std::size_t row, TileState trial);
  void accept();
  void reject();

  std::int64_t spilled() const { return spilled_; }        // tiles in scratch
  std::int64_t kept_bytes() const { return kept_bytes_; }  // measurements and points in memory, all time

 private:
  struct Slot {
    RankTile tile;
    TileState trial;
    bool in_scratch = false;
    bool points_here = false, trial_here = false;  // of a tile in scratch whose points did not fit there
    int points_file = 0;                           // of two: the present ones; the other has the trial's
  };

  RankTile& load(std::size_t row);
  void save(std::size_t row);
  void forget(Slot& slot);  // its measurements and points, which are in scratch
  bool spill(Slot& slot);   // its files; false, and none of them: they have no room
  void remove_files(const Slot& slot) const;

  MemoryOptions options_;
  std::vector<Slot> slots_;
  std::int64_t loaded_ = -1;  // row of the tile in scratch that is whole
  std::int64_t kept_bytes_ = 0, spilled_ = 0;
};

}  // namespace megablock
