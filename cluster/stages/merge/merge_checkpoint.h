// Checkpoints of the global adjustment: after each accepted iteration every rank writes its tiles, then rank 0 the
// state of the iteration, which makes the checkpoint valid. A run that was killed goes on from the last valid one with
// the same bits.
#pragma once

#include <optional>

#include "adjust/tile/sigma_scales.h"
#include "cluster/job/job.h"
#include "cluster/process/progress.h"
#include "merge/tree/global_adjustment.h"
#include "merge/tree/merge_tree_runner.h"
#include "merge/tree/pass_recorder.h"

namespace megablock {

struct MergePosition {
  std::int32_t round = 0;        // of screening
  std::int32_t tried_steps = 0;  // in the rounds before
  GlobalState global;
  SigmaScales scales;  // of the stated sigmas
};

class MergeCheckpoint {
 public:
  // `inputs`: fingerprint of everything the merge is computed from.
  MergeCheckpoint(Job& job, std::uint64_t inputs) : job_(job), inputs_(inputs) {}

  // Collective.
  void write(const MergePosition& position, TileStore& tiles, const BlockState& state);
  // The last valid position on disk; the same on every rank. Collective.
  std::optional<MergePosition> find();
  // State and points of the position found.
  BlockState state() const;
  void load_tile(RankTile& tile) const;
  // Deletes all checkpoints (the result is written). Rank 0.
  void clear();

  // Records of passes (pass_recorder.h): what they say of the position; and the furthest position from which a rank has
  // a record of a pass that begins at the state of `start`, the last checkpoint or the beginning. Forgets others.
  // Collective.
  PassRecorder::Position of_pass(const MergePosition& position) const;
  std::optional<MergePosition> find_pass(const MergePosition& start, PassRecorder& recorder);

 private:
  std::string folder(const MergePosition& position) const;
  std::uint64_t fingerprint(const std::string& folder) const;

  Job& job_;
  std::uint64_t inputs_;
  std::string current_;                  // folder of the last checkpoint written or found
  double last_s_ = monotonic_seconds();  // when it was written
};

}  // namespace megablock
