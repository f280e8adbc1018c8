// What a rank keeps, and where: budgets, and the factors between the two passes. The tiles: tile_store.h.
//
// Keeping factors between the upward and the downward pass within a byte budget: in memory while they fit, else in the
// rank's scratch directory while it has room (scratch_space.h), else not at all (recomputed on the way down). The
// choice never changes tiles or bits.
//
// The downward pass visits nodes in the reverse order of the upward pass, so the earliest factor is needed last and
// leaves first.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "merge/scratch/scratch_space.h"
#include "merge/tile/condense.h"

namespace megablock {

struct MemoryOptions {
  std::int64_t factor_bytes = std::int64_t{4} << 30;  // budget of kept factors; the newest is kept in any case
  // Of this process alone; one nowhere: keep all tiles, recompute factors instead of spilling them.
  std::shared_ptr<ScratchSpace> scratch = std::make_shared<ScratchSpace>();
  std::int64_t tile_bytes = std::int64_t{4} << 30;  // budget of tiles' measurements and points (tile_store.h)
};
// Of a node's factors in a scratch directory.
std::string factor_file(std::int64_t node);

struct MemoryStatistics {
  std::int64_t put = 0, spilled = 0;  // factors put, moved to scratch
  std::int64_t recomputed = 0;        // subtrees condensed again
  std::int64_t peak_bytes = 0;        // of kept factors
};

// Factors of one node of the merge tree: a tile's cells or an inner node's front; while seams are checked also a tile's
// condensed normal equations.
struct NodeFactors {
  TileFactor tile;
  FrontFactor front;
  UpdateMatrix condensed = {};
  std::int64_t byte_count() const { return tile.byte_count() + front.byte_count() + condensed.byte_count(); }
  void write(ByteWriter& out) const;
  static NodeFactors read(ByteReader& in);
};

class FactorStore {
 public:
  explicit FactorStore(MemoryOptions options);
  ~FactorStore();  // removes its scratch files
  FactorStore(const FactorStore&) = delete;
  FactorStore& operator=(const FactorStore&) = delete;

  // What may happen to factors that fit neither in memory nor in scratch.
  enum class Loss { kRecompute, kNever };
  void put(std::int64_t node, NodeFactors factors, Loss loss = Loss::kRecompute);
  // nullptr: dropped, compute it again. The pointer holds until the next put or get.
  const NodeFactors* get(std::int64_t node);
  void discard(std::int64_t node);  // it is not needed any more
  // From now on so much of the budget is taken by others: fronts at work, what waits for a parent or a child.
  void leave_room(std::int64_t bytes);
  void clear();

  // For records of a pass (pass_record.h). Bytes in memory that are not in scratch; copies them there: false where they
  // have no room; the nodes whose factors are in scratch; after clear(): takes over those that an earlier run left
  // there.
  std::int64_t bytes_without_copy() const;
  bool copy_to_scratch();
  std::vector<std::int64_t> nodes_in_scratch() const;
  void adopt(const std::vector<std::int64_t>& nodes);

  void note_recomputed() { ++statistics_.recomputed; }
  const MemoryStatistics& statistics() const { return statistics_; }

 private:
  bool spill(std::int64_t node, const NodeFactors& factors);  // false: no room
  void make_room();

  MemoryOptions options_;
  MemoryStatistics statistics_;
  std::int64_t bytes_ = 0, others_ = 0, clock_ = 0;
  bool scratch_full_ = false;                          // its disk
  std::map<std::int64_t, NodeFactors> kept_;           // by node
  std::map<std::int64_t, std::int64_t> node_by_time_;  // of kept ones
  std::map<std::int64_t, std::int64_t> time_of_node_;
  std::set<std::int64_t> never_lost_;
  std::set<std::int64_t> spilled_;  // nodes whose factors are in scratch
  std::set<std::int64_t> written_;  // and those that passes before wrote: spare, to be written over
  NodeFactors loaded_;              // last one read back
};

}  // namespace megablock
