// Records a sweep up, so that a killed run resumes in the middle of the sweep. The record holds the updates of finished
// subtrees. The factors of their nodes are in the scratch directory of the rank, or are copied there (memory.h). A
// resumed sweep has the same bits, because it reads the computed values back. The hash `sweep` covers the state and
// everything on which these values depend, so that values of another sweep are never mixed in.
//
// A record survives the process, but not a restart of the machine, because nothing is forced to the disk. A record of
// an earlier start of the machine or of another machine is ignored, and the sweep begins again.
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

struct SweepRecord {
  std::uint64_t state = 0;             // hash of the state at which the sweep linearises
  std::uint64_t sweep = 0;             // hash of this state and of the kind of the sweep
  Bytes position;                      // position of the global adjustment, as its owner writes it
  std::int64_t tiles = 0;              // number of tiles in the finished subtrees
  std::vector<std::int64_t> subtrees;  // top nodes of the finished subtrees; no subtree contains another
  std::vector<std::int64_t> factors;   // nodes of these subtrees whose factors are in scratch
  std::vector<SeamReport> seams;       // of the nodes of these subtrees, where the sweep checks seams
};

// The record of one rank in its scratch directory.
class SweepRecordFiles {
 public:
  explicit SweepRecordFiles(std::shared_ptr<ScratchSpace> scratch) : scratch_(std::move(scratch)) {}

  // Writes the update of a subtree. Call it before writing the record that names the subtree. Returns false when there
  // is no room.
  bool write_update(std::int64_t node, const UpdateMatrix& update) const;
  // Throws StoreError.
  UpdateMatrix read_update(std::int64_t node) const;
  void remove_update(std::int64_t node) const;

  // Replaces the whole record. Returns false when there is no room, or when the system does not tell when the machine
  // was started.
  bool write(const SweepRecord& record) const;
  // Returns nothing when there is no record or when it is of another start of the machine; also when files that it
  // names are missing, have another size, or exceed the budget of the scratch directory.
  std::optional<SweepRecord> read() const;
  void remove() const;  // the record alone
  void remove_files_of(const SweepRecord& record) const;
  // Removes all files of the scratch directory except those of this record.
  void keep_only(const std::optional<SweepRecord>& record) const;

 private:
  std::vector<std::int64_t> sizes_of(const SweepRecord& record) const;  // sizes of its files; empty when one is missing

  std::shared_ptr<ScratchSpace> scratch_;
};

}  // namespace megablock
