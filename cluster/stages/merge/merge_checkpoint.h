// Writes and finds checkpoints of the global adjustment. After each accepted iteration every rank writes its tiles, and
// then rank 0 writes the state of the iteration, which makes the checkpoint valid. A killed run resumes at the last
// valid checkpoint, with the same bits.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "adjust/checks/prior_test.h"
#include "adjust/tile/sigma_scales.h"
#include "cluster/job/job.h"
#include "cluster/process/progress.h"
#include "io/store/job/events.h"
#include "merge/tree/global_adjustment.h"
#include "merge/tree/merge_tree_runner.h"
#include "merge/tree/sweep_recorder.h"

namespace megablock {

// The verdicts on observations that seemed wrong, in a list of fixed length, as a marker holds it.
struct StoredVerdicts {
  struct Verdict {
    PriorId prior;
    std::int64_t aside = 0;  // 1: set aside; 0: taken back
  };
  std::int64_t count = 0;
  std::array<Verdict, 32> verdicts{};
  PriorVerdicts get() const;
  // Stores a change as far as there is room, and returns what was stored.
  PriorVerdicts store(const PriorVerdicts& change);
};

struct MergePosition {
  std::int32_t round = 0;        // number of the round of screening
  std::int32_t tried_steps = 0;  // in earlier adjustments
  GlobalState global;
  SigmaScales scales;            // factors of the stated sigmas
  std::int32_t rounds_afar = 0;  // ended adjustments with losses that pull from any distance (prior_scales.h)
  std::int32_t near = 0;         // 1: the losses are those of the options
  // Round in which the block last began again: to seek gross errors or without them, or with sigmas of other factors.
  std::int64_t first_round = 0;
  enum Seeking : std::int64_t { kNotSought, kSought, kNoneFound };
  std::int64_t gross_errors = kNotSought;  // kSought: the block begins from afar to find them
  StoredVerdicts verdicts;
};

class MergeCheckpoint {
 public:
  // `inputs` is the fingerprint of everything from which the merge is computed.
  MergeCheckpoint(const Job& job, EventLog& events, std::uint64_t inputs)
      : job_(job), events_(events), inputs_(inputs) {}

  // Collective.
  void write(const MergePosition& position, TileStore& tiles, const BlockState& state);
  // Collective. The last valid position on disk, the same on every rank.
  std::optional<MergePosition> find();
  // The state and the points of the position that was found.
  BlockState state() const;
  void load_tile(RankTile& tile) const;
  // Deletes all checkpoints, when the result is written. Rank 0 calls it.
  void clear();

  // For records of sweeps (sweep_recorder.h). of_sweep(): the position in the form that a record holds. find_sweep() is
  // collective: it gives the furthest position of all ranks' records of a sweep from the state of `start`, which is the
  // last checkpoint or the beginning. Other records are dropped.
  SweepRecorder::Position of_sweep(const MergePosition& position) const;
  std::optional<MergePosition> find_sweep(const MergePosition& start, SweepRecorder& recorder);

 private:
  std::string folder(const MergePosition& position) const;
  std::uint64_t fingerprint(const std::string& folder) const;

  const Job& job_;
  EventLog& events_;
  std::uint64_t inputs_;
  std::string current_;                  // folder of the last checkpoint written or found
  double last_s_ = monotonic_seconds();  // when it was written
};

}  // namespace megablock
