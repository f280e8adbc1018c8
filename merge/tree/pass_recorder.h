// Keeps the record of the upward pass that a rank is in (merge/tree/pass_record.h), and finds that of a killed run.
//
// A record is due as soon as the work since the last one took the given time, and a second for every 20 MB that it will
// write, so that it costs some percent at most; and after every subtree once a graceful stop was asked for, as the pass
// may be longer than what is left to the process.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "merge/tile/condense.h"
#include "merge/tree/pass_record.h"

namespace megablock {

class PassRecorder {
 public:
  // Where the global adjustment stands: a hash of the state that passes start from and of who works on what, and what a
  // resumed run needs.
  struct Position {
    std::uint64_t state = 0;
    Bytes bytes;
  };
  // What of a pass decides its bits beside the state.
  struct Kind {
    Pass pass;
    bool seams = false, columns = false;
  };

  // `seconds` between records; 0: one after every subtree. `stop_requested`: whether the process is asked to stop.
  PassRecorder(
      std::shared_ptr<ScratchSpace> scratch, double seconds,
      std::function<bool()> stop_requested = [] { return false; });

  // The record that is there, of whatever pass.
  const std::optional<PassRecord>& found() const { return found_; }
  // Before anything is written to the scratch directory: nothing that an earlier run left there stays, but for that
  // record if it is of this state.
  void keep_found(std::uint64_t state);
  void set_position(std::function<Position()> position) { position_ = std::move(position); }

  // What has been done of the pass that begins now; an empty record if nothing.
  PassRecord begin(const Kind& kind);
  UpdateMatrix read_update(std::int64_t node) const { return files_.read_update(node); }

  // Whether enough was done for a record of so many bytes. `leaves`: the subtree's update matrix goes to another rank
  // or into a front of several, where it cannot be had later.
  bool due(std::int64_t bytes, bool leaves) const;
  // Update matrices of finished subtrees, which a record may name then; false: there is no room.
  bool write_updates(const std::map<std::int64_t, const UpdateMatrix*>& updates);
  // `record`: tiles, subtrees, factors, seams. Updates that it does not name are removed.
  void write(PassRecord record);
  void give_up() { given_up_ = true; }  // no further record of this pass

 private:
  PassRecordFiles files_;
  double seconds_;
  std::function<bool()> stop_requested_;
  std::function<Position()> position_;
  std::optional<PassRecord> found_;
  // Of the pass at hand.
  Position at_;
  std::uint64_t pass_ = 0;
  double begin_s_ = 0, last_s_ = 0;
  bool given_up_ = false;
  std::set<std::int64_t> written_;  // nodes whose update has a file
};

}  // namespace megablock
