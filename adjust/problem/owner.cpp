// The candidates are sorted by depth, the deepest first, and then by tile. Runs of equal depth and tile are then the
// observations of one tile in frames of that depth. Only the runs of the greatest depth compete. The result does not
// depend on the order of the observations.
#include "adjust/problem/owner.h"

#include <algorithm>

namespace megablock {

std::int64_t owner_part(std::vector<OwnerCandidate>& frames) {
  // As an unsigned number, -1 ("none") is the greatest depth.
  std::sort(frames.begin(), frames.end(), [](const OwnerCandidate& a, const OwnerCandidate& b) {
    const auto first = static_cast<std::uint32_t>(a.depth), second = static_cast<std::uint32_t>(b.depth);
    return first != second ? first > second : a.part < b.part;
  });
  std::int64_t best = -1;
  std::ptrdiff_t most = 0;
  for (auto run = frames.begin(); run != frames.end() && run->depth == frames.front().depth;) {
    auto next = run;
    while (next != frames.end() && next->part == run->part && next->depth == run->depth) ++next;
    // Strictly more: of equal runs the first one, which has the lower number, stays.
    if (next - run > most) {
      most = next - run;
      best = run->part;
    }
    run = next;
  }
  return best;
}

}  // namespace megablock
