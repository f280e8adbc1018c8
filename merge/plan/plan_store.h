// Stores the plans of one rank's tiles. Where the observations of a tile are in the rank's scratch directory
// (tile_store.h), its plan is stored there too and read when it is needed. A plan without room there stays in memory.
// The choice never changes the bits of a result.
#pragma once

#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "merge/plan/tile_plan.h"
#include "merge/scratch/scratch_space.h"

namespace megablock {

class PlanStore {
 public:
  explicit PlanStore(std::shared_ptr<ScratchSpace> scratch) : scratch_(std::move(scratch)) {}
  ~PlanStore();  // removes its scratch files
  PlanStore(const PlanStore&) = delete;
  PlanStore& operator=(const PlanStore&) = delete;

  // Plans are added in the order of the tiles, and `row` below counts them. `tile` is the number of the tile in the
  // block.
  void add(std::int64_t tile, TilePlan plan, bool to_scratch);
  bool in_scratch(std::size_t row) const { return slots_[row].in_scratch; }
  // The reference is valid until another row is read from scratch, which overwrites it. Threads that work ahead on the
  // next tile must therefore not ask for a plan in scratch (MergeTreeRunner::in_memory). Throws StoreError when the
  // file cannot be read.
  const TilePlan& operator[](std::size_t row) const;

 private:
  struct Slot {
    std::int64_t tile = -1;
    bool in_scratch = false;
    TilePlan plan;  // empty when it is in scratch
  };

  std::shared_ptr<ScratchSpace> scratch_;
  std::vector<Slot> slots_;
  // The plan that was read last.
  mutable TilePlan loaded_;
  mutable std::int64_t loaded_row_ = -1;
};

}  // namespace megablock
