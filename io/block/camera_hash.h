// Adds camera parameters to hashes.
#pragma once

#include <algorithm>

#include "geometry/camera/intrinsics.h"
#include "io/base/hash.h"

namespace megablock {

// Rare parameters count only where one of them is not zero: hashes of a camera without them are those of before the
// model had them, so that older jobs go on and digests stay.
inline void add_values_to_hash(Hasher& hasher, const Intrinsics& k) {
  const double* rare = k.begin() + count_without_rare(k.model());
  const bool any = std::any_of(rare, k.end(), [](double value) { return value != 0; });
  std::for_each(k.begin(), any ? k.end() : rare, [&](double value) { hasher.add(value); });
}

}  // namespace megablock
