// The datum of the block: what its observations leave undetermined, fixed by inner constraints, never silently.
//
// Without priors or control a connected component is determined up to a similarity (7), or a rigid motion (6) when held
// mounts give the scale; positions on one straight line leave one rotation. The directions are the generators of the
// similarity group, one matrix N per unknown (translation, rotation about the component's centroid, scale).
//
// Detection: pivots of the lambda = 0 pass (front.h); the held scalars are a minimal datum. The S-transformation
// (Baarda 1973) x - N (N'WN)^-1 N'W x moves steps and covariances to inner constraints over the component's frames.
#pragma once

#include <string>
#include <vector>

#include "merge/front.h"

namespace megablock {

struct GaugeReport {
  std::int64_t defect = 0;               // scalar unknowns held as a datum
  std::int64_t undetermined = 0;         // scalar unknowns held because nothing observes them
  std::string text = "fixed by priors";  // for the report
};
GaugeReport judge_gauge(const SubtreeSums& root);

}  // namespace megablock
