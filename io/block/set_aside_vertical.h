// Holds the observed verticals that the orientation rejects, with the reason.
#pragma once

#include <cstdint>

#include "io/base/index.h"

namespace megablock {

// Whether a vertical is accepted, and if not, why.
enum class VerticalVerdict : std::uint8_t {
  kBelieved,
  kContradicted,   // most other verticals contradict it
  kNoConsensus,    // the verticals that it can be compared with do not agree
  kAgainstGround,  // positions or attitudes show that the direction it and others agree on is not down
  kAgainstPoses,   // like most other verticals of frames with given poses, it contradicts the vertical of these poses
};

struct SetAsideVertical {
  ImageIndex image;
  VerticalVerdict verdict = VerticalVerdict::kContradicted;
};

}  // namespace megablock
