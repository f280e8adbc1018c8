// The record of a sweep up, from which a killed run resumes in the middle of the sweep. It holds the updates of
// finished subtrees. The factors of their nodes are in the scratch directory of the rank, or are copied there
// (memory.h). A resumed sweep has the same bits, because it reads back the values that were computed.
//
// A record survives the process, but not a restart of the machine: nothing is forced to the disk. A record of an
// earlier start of the machine, or of another machine, is ignored, and the sweep begins again.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "merge/checks/seam_check.h"
#include "merge/front/front.h"
#include "merge/scratch/scratch_space.h"

namespace megablock {

struct PassRecord {
  std::uint64_t state = 0;             // hash of the state at which the sweep linearises
  std::uint64_t pass = 0;              // hash of this state and of the kind of the sweep
  Bytes position;                      // where the global adjustment stands, as its owner writes it
  std::int64_t tiles = 0;              // number of them in the finished subtrees
  std::vector<std::int64_t> subtrees;  // nodes whose subtree is finished, none within another's
  std::vector<std::int64_t> factors;   // nodes of the subtrees whose factors are in scratch
  std::vector<SeamReport> seams;       // of the nodes of the subtrees, where the sweep checks seams
};

// The record of one rank in its scratch directory.
class PassRecordFiles {
 public:
  explicit PassRecordFiles(std::shared_ptr<ScratchSpace> scratch) : scratch_(std::move(scratch)) {}

  // Writes the update of a subtree. It comes before the record that names it. False when there is no room.
  bool write_update(std::int64_t node, const UpdateMatrix& update) const;
  // Throws StoreError.
  UpdateMatrix read_update(std::int64_t node) const;
  void remove_update(std::int64_t node) const;

  // Replaces the record as a whole. False when there is no room, or when this system does not tell when it was started.
  bool write(const PassRecord& record) const;
  // Returns nothing when there is no record, when it is of another start of the machine, when files that it names are
  // missing or have another size, or when they exceed the budget of the scratch directory.
  std::optional<PassRecord> read() const;
  void remove() const;  // the record alone
  void remove_files_of(const PassRecord& record) const;
  // Removes all files of the scratch directory except those of this record.
  void keep_only(const std::optional<PassRecord>& record) const;

 private:
  std::vector<std::int64_t> sizes_of(const PassRecord& record) const;  // of its files; empty: one is not there

  std::shared_ptr<ScratchSpace> scratch_;
};

}  // namespace megablock
