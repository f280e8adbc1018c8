// Writes the record of a sweep up while the sweep runs (sweep_record.h), and finds the record of a killed run.
//
// A record is due when the work since the last one took the given time, and also a second for every 20 MB of the new
// record. Records therefore cost a few percent of the time at most. When a graceful stop is requested, a record is due
// after every subtree, because the sweep may take longer than the process has left.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "merge/tile/condense.h"
#include "merge/tree/sweep_record.h"

namespace megablock {

// One object serves all sweeps of a run. Records go to the scratch directory of the rank and are no message between
// ranks: every rank resumes from its own.
class SweepRecorder {
 public:
  // The position of the global adjustment: a hash of the state at which sweeps linearise and of the distribution of
  // tiles to ranks, and the data that a resumed run needs.
  struct Position {
    std::uint64_t state = 0;
    Bytes bytes;
  };
  // The properties of a sweep, besides the state, on which its bits depend.
  struct Kind {
    Sweep sweep;
    bool seams = false;
    std::int32_t columns = 0;  // a DatumColumns
  };

  // `seconds`: time between two records; 0: a record after every subtree. `stop_requested` says whether the process is
  // asked to stop.
  SweepRecorder(
      std::shared_ptr<ScratchSpace> scratch, double seconds,
      std::function<bool()> stop_requested = [] { return false; });

  // The record of a killed run, of any sweep.
  const std::optional<SweepRecord>& found() const { return found_; }
  // Call it before anything is written to the scratch directory. It removes everything that an earlier run left there
  // except the record, if that is of this state.
  void keep_found(std::uint64_t state);
  void set_position(std::function<Position()> position) { position_ = std::move(position); }

  // Begins a sweep. Returns the finished part of the same sweep of a killed run, or an empty record.
  SweepRecord begin(const Kind& kind);
  UpdateMatrix read_update(std::int64_t node) const { return files_.read_update(node); }

  // Whether a record of so many bytes is due. `leaves`: the update of the subtree goes to another rank or into a front
  // of several ranks, and cannot be read from there later.
  bool due(std::int64_t bytes, bool leaves) const;
  // Writes the updates of finished subtrees, so that a record can name them. Returns false when there is no room.
  bool write_updates(const std::map<std::int64_t, const UpdateMatrix*>& updates);
  // Writes `record` with its tiles, subtrees, factors and seams. Removes the updates that it does not name.
  void write(SweepRecord record);
  void give_up() { given_up_ = true; }  // no further record of this sweep

 private:
  SweepRecordFiles files_;
  double seconds_;
  std::function<bool()> stop_requested_;
  std::function<Position()> position_;
  std::optional<SweepRecord> found_;
  // These two belong to the present sweep.
  Position at_;
  std::uint64_t sweep_ = 0;
  double begin_s_ = 0, last_s_ = 0;
  bool given_up_ = false;
  std::set<std::int64_t> written_;  // nodes whose update has a file
};

}  // namespace megablock
