// Observed verticals that orientation does not believe, with the reason.
#pragma once

#include <cstdint>

#include "io/base/index.h"

namespace megablock {

// Whether a vertical is believed, and if not, why.
enum class VerticalVerdict : std::uint8_t {
  kBelieved,
  kContradicted,   // most others contradict it
  kNoConsensus,    // those it can be compared with agree on no direction
  kAgainstGround,  // what it and others take for down is not, by the positions or attitudes
  kAgainstPoses,   // as most others with given poses, it shows another direction than theirs of down
};

struct SetAsideVertical {
  ImageIndex image;
  VerticalVerdict verdict = VerticalVerdict::kContradicted;
};

}  // namespace megablock
