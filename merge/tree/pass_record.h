// What a rank has done of an upward pass, so that a run that was killed goes on in its middle: the update matrices of
// finished subtrees, and of all their nodes the factors, which lie in the rank's scratch directory anyway or are copied
// there (memory.h). Going on changes no bits: what is read back is what was computed.
//
// Records outlive the process, not the machine: nothing is forced to the disk, and one that an earlier start of the
// machine wrote, or another machine, does not count. Then the pass begins again.
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
  std::uint64_t state = 0;             // hash of what the pass starts from
  std::uint64_t pass = 0;              // of this and of the kind of the pass
  Bytes position;                      // of the global adjustment in that pass, as its owner writes it
  std::int64_t tiles = 0;              // in the finished subtrees
  std::vector<std::int64_t> subtrees;  // nodes whose subtree is finished, none within another's
  std::vector<std::int64_t> factors;   // nodes of the subtrees whose factors are in scratch
  std::vector<SeamReport> seams;       // of the nodes of the subtrees, where the pass checks seams
};

// The record of one rank in its scratch directory.
class PassRecordFiles {
 public:
  explicit PassRecordFiles(std::shared_ptr<ScratchSpace> scratch) : scratch_(std::move(scratch)) {}

  // A subtree's update matrix; before the record that names it. False: there is no room for it.
  bool write_update(std::int64_t node, const UpdateMatrix& update) const;
  // Throws StoreError.
  UpdateMatrix read_update(std::int64_t node) const;
  void remove_update(std::int64_t node) const;

  // Replaces the record as a whole. False: there is no room, or no start of a machine is to be told from another here.
  bool write(const PassRecord& record) const;
  // Nothing: there is none, it is of another start of the machine, files that it names are gone or have another size,
  // or all of these are more than the scratch's budget.
  std::optional<PassRecord> read() const;
  void remove() const;  // the record alone
  void remove_files_of(const PassRecord& record) const;
  // Removes all files of the scratch directory but those of this record; nothing: all.
  void keep_only(const std::optional<PassRecord>& record) const;

 private:
  std::vector<std::int64_t> sizes_of(const PassRecord& record) const;  // of its files; empty: one is not there

  std::shared_ptr<ScratchSpace> scratch_;
};

}  // namespace megablock
