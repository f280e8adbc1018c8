// Keeping factors between the upward and the downward pass within a byte budget: in memory while they fit, else in a
// scratch directory, else not at all (recomputed on the way down). The choice never changes tiles or bits.
//
// The downward pass visits nodes in the reverse order of the upward pass, so the earliest factor is needed last and
// leaves first.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "merge/condense.h"

namespace megablock {

struct MemoryOptions {
  std::int64_t factor_bytes = std::int64_t{4} << 30;  // budget of kept factors; the newest is kept in any case
  std::string scratch_directory;                      // for spilling; empty: recompute instead
};

struct MemoryStatistics {
  std::int64_t kept = 0, spilled = 0, dropped = 0;  // factors put, moved to scratch, given up
  std::int64_t recomputed = 0;                      // subtrees condensed again
  std::int64_t peak_bytes = 0;                      // of kept factors
};

// Factors of one node of the merge tree: a tile's cells or an inner node's front.
struct NodeFactors {
  TileFactor tile;
  FrontFactor front;
  std::int64_t byte_count() const { return tile.byte_count() + front.byte_count(); }
  Bytes to_bytes() const;
  static NodeFactors from_bytes(const Bytes& bytes);
};

class FactorStore {
 public:
  explicit FactorStore(MemoryOptions options);
  ~FactorStore();  // removes its scratch files
  FactorStore(const FactorStore&) = delete;
  FactorStore& operator=(const FactorStore&) = delete;

  void put(std::int64_t node, NodeFactors factors);
  // nullptr: dropped, compute it again. The pointer holds until the next put or get.
  const NodeFactors* get(std::int64_t node);
  void clear();
  void note_recomputed() { ++statistics_.recomputed; }
  const MemoryStatistics& statistics() const { return statistics_; }

 private:
  std::string scratch_path(std::int64_t node) const;
  void evict_oldest();

  MemoryOptions options_;
  MemoryStatistics statistics_;
  std::int64_t bytes_ = 0, clock_ = 0;
  std::map<std::int64_t, NodeFactors> kept_;           // by node
  std::map<std::int64_t, std::int64_t> node_by_time_;  // of kept ones
  std::map<std::int64_t, std::int64_t> time_of_node_;
  std::map<std::int64_t, std::string> spilled_;  // node -> file
  NodeFactors loaded_;                           // last one read back
};

}  // namespace megablock
