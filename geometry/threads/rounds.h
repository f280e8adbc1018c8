// Runs work that comes in rounds on all threads of the process. The tiles of a block are such rounds: each is prepared,
// worked on in independent parts, and finished; rounds are finished in order.
//
// When the last parts of a round run, or while one thread finishes it, the other threads would be idle. They begin the
// next round instead. They are never more than one round ahead, so at most two rounds are in memory.
//
// As in workers.h, the results do not depend on the number of threads, bit for bit, provided that every part writes to
// its own place.
#pragma once

#include <cstdint>
#include <functional>

namespace megablock {

struct Rounds {
  std::int64_t count = 0;
  std::function<std::int64_t(std::int64_t round)> prepare;  // prepares a round and returns the number of its parts
  // Works on one part; called from many threads at once.
  std::function<void(std::int64_t round, std::int64_t part)> visit;
  std::function<void(std::int64_t round)> finish;  // called once all parts are done, in order, by one thread at a time
  std::function<bool(std::int64_t round)> ahead;   // whether the round may begin before the previous one is finished
};

// Runs all rounds. If a call throws, no further round is finished and the exception is rethrown: that of the first
// round that failed, and in it that of the lowest part. All rounds before it have been finished.
void visit_in_rounds(const Rounds& rounds);

}  // namespace megablock
