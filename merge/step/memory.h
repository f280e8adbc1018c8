// Gives the memory budgets of a rank, and stores its factors between the sweep up and the sweep down. tile_store.h
// holds the tiles.
//
// Factors stay in memory within a budget of bytes. Beyond it they go to the scratch directory of the rank, as long as
// that has room (scratch_space.h). Without room there they are dropped and computed again in the sweep down. The choice
// never changes tiles or bits.
//
// The sweep down visits the nodes in the reverse order of the sweep up. The oldest factor is needed last, so it leaves
// memory first.
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
  std::int64_t factor_bytes = std::int64_t{4} << 30;  // budget of factors in memory; the newest stays in any case
  // The directory of this process alone. Without one all tiles stay in memory, and factors beyond the budget are
  // computed again.
  std::shared_ptr<ScratchSpace> scratch = std::make_shared<ScratchSpace>();
  std::int64_t tile_bytes = std::int64_t{4} << 30;  // budget of the observations and points of tiles (tile_store.h)
};
// The name of the file that holds the factors of a node.
std::string factor_file(std::int64_t node);

struct MemoryStatistics {
  std::int64_t put = 0, spilled = 0;  // factors stored, and those moved to scratch
  std::int64_t recomputed = 0;        // subtrees condensed again
  std::int64_t peak_bytes = 0;        // of factors in memory
};

// The factors of one node of the merge tree: those of the cells of a tile, or of the front of an inner node. While
// seams are checked, the condensed normal equations of a tile are kept as well.
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

  // Factors that fit neither in memory nor in scratch are dropped (kRecompute) or kept in memory all the same (kNever).
  // Only factors whose recomputation needs no other rank may be dropped.
  enum class Loss { kRecompute, kNever };
  void put(std::int64_t node, NodeFactors factors, Loss loss = Loss::kRecompute);
  // Returns nullptr when the factors were dropped and must be computed again. The pointer is valid until the next put
  // or get.
  const NodeFactors* get(std::int64_t node);
  void discard(std::int64_t node);  // the factors are not needed any more
  // Reduces the budget by so many bytes from now on. They are the memory of the fronts at work, and of the updates and
  // values that wait for a parent or a child.
  void leave_room(std::int64_t bytes);
  void clear();

  // For records of a sweep (sweep_record.h). bytes_without_copy(): bytes in memory that have no copy in scratch.
  // copy_to_scratch() copies them there, and returns false when there is no room. nodes_in_scratch(): nodes whose
  // factors are in scratch. adopt(), after clear(), takes over the factors of these nodes that an earlier run left
  // there.
  std::int64_t bytes_without_copy() const;
  bool copy_to_scratch();
  std::vector<std::int64_t> nodes_in_scratch() const;
  void adopt(const std::vector<std::int64_t>& nodes);

  void note_recomputed() { ++statistics_.recomputed; }
  const MemoryStatistics& statistics() const { return statistics_; }

 private:
  bool spill(std::int64_t node, const NodeFactors& factors);  // false when there is no room
  void make_room();

  MemoryOptions options_;
  MemoryStatistics statistics_;
  std::int64_t bytes_ = 0, others_ = 0, clock_ = 0;
  bool scratch_full_ = false;                          // no space on its disk
  std::map<std::int64_t, NodeFactors> kept_;           // by node, the factors in memory
  std::map<std::int64_t, std::int64_t> node_by_time_;  // the nodes of kept_
  std::map<std::int64_t, std::int64_t> time_of_node_;
  std::set<std::int64_t> never_lost_;
  std::set<std::int64_t> spilled_;  // nodes whose factors are in scratch
  std::set<std::int64_t> written_;  // these and the nodes of spare files, which later factors overwrite
  NodeFactors loaded_;              // the factors that were read last
};

}  // namespace megablock
