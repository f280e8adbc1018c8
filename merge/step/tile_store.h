// Stores the tiles of one rank, partly out of core. Whole tiles stay in memory within a budget of bytes. The
// observations and points of the other tiles are in the scratch directory of the rank. They are read when the tile is
// visited, one tile at a time.
//
// A tile in scratch is packed (packed_columns.h): about 15 bytes for an observation of a street, instead of 39. The
// store asks once whether the tile has room there (scratch_space.h), with its unpacked size and the points of a trial
// beside the present ones. Later screening may lengthen the runs of its flags; when these do not fit, the tile moves to
// memory.
//
// The choice of the tiles that stay in memory is made once, in the order in which they are added. Sweeps visit all
// tiles again and again, up and down; with a fixed choice each sweep reads every other tile exactly once. When the
// scratch disk is full, a tile stays in memory. The choice never changes bits.
//
// Frames, cameras, mounts and their values (the "outline" of a tile) are small and always in memory, as are lines,
// verticals and the priors of points, cameras and mounts. Images, image observations and the other observations of a
// tile in scratch are not.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "adjust/problem/tile_problem.h"
#include "merge/step/memory.h"

namespace megablock {

// A tile of this rank.
struct RankTile {
  std::int64_t tile = -1;
  TileProblem problem;
  TileState state;
};

class TileStore {
 public:
  // Uses options.tile_bytes and options.scratch.
  explicit TileStore(const MemoryOptions& options);
  ~TileStore();  // removes its scratch files
  TileStore(const TileStore&) = delete;
  TileStore& operator=(const TileStore&) = delete;

  // Tiles are added by ascending number; `row` below counts them.
  void add(RankTile tile);
  std::size_t size() const { return slots_.size(); }
  std::int64_t number(std::size_t row) const { return slots_[row].tile.tile; }

  bool in_scratch(std::size_t row) const { return slots_[row].in_scratch; }

  // The tile without its data in scratch: some of its tables may be empty.
  const RankTile& outline(std::size_t row) const { return slots_[row].tile; }
  // The whole tile. The reference is valid until another row is asked for.
  const RankTile& whole(std::size_t row);
  // Calls change(RankTile&) on the whole tile and stores the changed tile.
  template <typename Change>
  void change(std::size_t row, Change&& change) {
    change(load(row));
    save(row);
  }

  // Calls change(RankTile&) on the part of the tile that is always in memory, and stores nothing.
  template <typename Change>
  void change_outline(std::size_t row, Change&& change) {
    change(slots_[row].tile);
  }

  // Stores the state after a step beside the present one. accept() or reject() then decides on the states of all tiles.
  // The trial of every tile must be put before accept().
  void put_trial(std::size_t row, TileState trial);
  void accept();
  void reject();

  std::int64_t spilled() const { return spilled_; }        // tiles in scratch
  std::int64_t kept_bytes() const { return kept_bytes_; }  // observations and points that stay in memory

 private:
  struct Slot {
    RankTile tile;
    TileState trial;
    bool in_scratch = false;
    std::vector<std::size_t> sizes;  // of the tables in scratch, with which a damaged file is known
    // The points of a tile in scratch are in memory, because they did not fit there.
    bool points_here = false, trial_here = false;
    int points_file = 0;  // number of the file with the present points; the other of the two files holds the trial's
  };

  RankTile& load(std::size_t row);
  void save(std::size_t row);
  void forget(Slot& slot);  // frees the observations and points, which are in scratch
  bool spill(Slot& slot);   // writes its files; false, and no file, when there is no room
  void remove_files(const Slot& slot) const;

  MemoryOptions options_;
  std::vector<Slot> slots_;
  std::int64_t loaded_ = -1;  // row of the tile in scratch that is in memory now
  std::int64_t kept_bytes_ = 0, spilled_ = 0;
};

}  // namespace megablock
