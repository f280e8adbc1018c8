#include "io/block/observation_statistics.h"

namespace megablock {

void ObservationTable::add(const ObservationTable& other) {
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    // `scale` is one number per kind for the whole block. It is set once, and not summed.
    kinds[k].count += other.kinds[k].count;
    kinds[k].weighted_squares += other.kinds[k].weighted_squares;
    kinds[k].redundancy += other.kinds[k].redundancy;
  }
}

}  // namespace megablock
