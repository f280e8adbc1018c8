#include "merge/tree/sweep_recorder.h"

#include <algorithm>
#include <utility>

#include "io/base/hash.h"
#include "merge/tree/stopwatch.h"

namespace megablock {

namespace {

constexpr double kBytesPerSecond = 20e6;

std::uint64_t hash_of(std::uint64_t state, const SweepRecorder::Kind& kind) {
  Hasher hasher;
  hasher.add(state).add(kind.sweep.lambda).add(kind.sweep.curvature).add(kind.seams).add(kind.columns);
  return hasher.value();
}

}  // namespace

SweepRecorder::SweepRecorder(std::shared_ptr<ScratchSpace> scratch, double seconds,
                             std::function<bool()> stop_requested)
    : files_(std::move(scratch)),
      seconds_(seconds),
      stop_requested_(std::move(stop_requested)),
      found_(files_.read()) {}

void SweepRecorder::keep_found(std::uint64_t state) {
  if (found_ && found_->state != state) found_.reset();
  files_.keep_only(found_);
}

SweepRecord SweepRecorder::begin(const Kind& kind) {
  at_ = position_();
  sweep_ = hash_of(at_.state, kind);
  begin_s_ = last_s_ = clock_seconds();
  given_up_ = false;
  // A record serves one sweep at most: the one with the same state, damping, right-hand sides and seam checks. It is
  // the first sweep of a resumed run, or none.
  const std::optional<SweepRecord> found = std::exchange(found_, std::nullopt);
  if (found && found->sweep == sweep_) {
    written_.insert(found->subtrees.begin(), found->subtrees.end());
    return *found;
  }
  files_.remove();  // before the files that it names are overwritten
  if (found) files_.remove_files_of(*found);
  for (const std::int64_t node : written_) files_.remove_update(node);
  written_.clear();
  return {};
}

bool SweepRecorder::due(std::int64_t bytes, bool leaves) const {
  if (given_up_) return false;
  if (seconds_ <= 0 || stop_requested_()) return true;
  // An update that leaves this rank's own subtrees cannot be recorded later. Here the time since the beginning of the
  // sweep decides.
  const double worked = clock_seconds() - (leaves ? begin_s_ : last_s_);
  return worked >= std::max(seconds_, static_cast<double>(bytes) / kBytesPerSecond);
}

bool SweepRecorder::write_updates(const std::map<std::int64_t, const UpdateMatrix*>& updates) {
  for (const auto& [node, update] : updates) {
    if (written_.contains(node)) continue;
    if (!files_.write_update(node, *update)) return false;
    written_.insert(node);
  }
  return true;
}

void SweepRecorder::write(SweepRecord record) {
  record.state = at_.state;
  record.sweep = sweep_;
  record.position = at_.bytes;
  if (!files_.write(record)) return give_up();
  // They are removed only now, because the former record named them until it was replaced.
  std::erase_if(written_, [&](std::int64_t node) {
    if (std::ranges::binary_search(record.subtrees, node)) return false;
    files_.remove_update(node);
    return true;
  });
  last_s_ = clock_seconds();
}

}  // namespace megablock
