#include "merge/plan/unknowns.h"

#include <algorithm>

#include "io/base/error.h"

namespace megablock {

std::int64_t total_dimension(const UnknownList& unknowns) {
  std::int64_t sum = 0;
  for (const Unknown& u : unknowns) sum += u.dimension;
  return sum;
}

std::vector<std::int64_t> row_offsets(const UnknownList& unknowns) {
  std::vector<std::int64_t> offsets(unknowns.size() + 1, 0);
  for (std::size_t i = 0; i < unknowns.size(); ++i) offsets[i + 1] = offsets[i] + unknowns[i].dimension;
  return offsets;
}

std::int64_t find_unknown(const UnknownList& ascending, const UnknownId& id) {
  const auto it = std::lower_bound(ascending.begin(), ascending.end(), id,
                                   [](const Unknown& u, const UnknownId& wanted) { return u.id < wanted; });
  return it == ascending.end() || it->id != id ? -1 : it - ascending.begin();
}

UnknownList unite(const std::vector<const UnknownList*>& lists) {
  UnknownList all;
  for (const UnknownList* list : lists) all.insert(all.end(), list->begin(), list->end());
  std::sort(all.begin(), all.end());
  all.erase(std::unique(all.begin(), all.end()), all.end());
  for (std::size_t i = 1; i < all.size(); ++i)
    if (all[i].id == all[i - 1].id)
      throw ComputeError(describe(all[i].id) + " has " + std::to_string(all[i - 1].dimension) +
                         " free parameters in one tile and " + std::to_string(all[i].dimension) + " in another");
  return all;
}

std::string describe(const UnknownId& id) {
  const std::string index = std::to_string(id.index);
  switch (id.kind) {
    case UnknownKind::kFrame:
      return "frame " + index;
    case UnknownKind::kCamera:
      return "camera " + index;
    case UnknownKind::kMount:
      return "mount " + std::to_string(id.part) + " of rig " + index;
  }
  return "unknown " + index;
}

}  // namespace megablock
