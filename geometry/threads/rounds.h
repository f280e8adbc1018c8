// The threads of the process at work on what comes in rounds, as tiles do: a round is made ready, worked on in parts
// and finished, and rounds are finished in their order. Threads that one round leaves without work, when its last parts
// run or while it is finished, begin the next: they are never more than one round ahead, so that two are in memory at
// most. As in workers.h no bit depends on the number of threads.
#pragma once

#include <cstdint>
#include <functional>

namespace megablock {

struct Rounds {
  std::int64_t count = 0;
  std::function<std::int64_t(std::int64_t round)> prepare;           // the number of its parts
  std::function<void(std::int64_t round, std::int64_t part)> visit;  // any number at once
  std::function<void(std::int64_t round)> finish;                    // one at a time, in order, all parts visited
  std::function<bool(std::int64_t round)> ahead;                     // whether it may begin before the one before ends
};

// Calls them on all threads. An error ends all: that of the first round that has one, in it that of the lowest part;
// the round is not finished, those before it are.
void visit_in_rounds(const Rounds& rounds);

}  // namespace megablock
