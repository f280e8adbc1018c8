// Writes the figures of the report as JSON, for programs.
//
// Lengths are in metres, image coordinates in pixels, angles in radians unless the key ends in _deg; vectors are east,
// north, up. Unknown numbers are null. A histogram has its lower limit, the width of a bin, and the counts.
#pragma once

#include <string>

#include "io/evaluation/figures.h"
#include "io/result/result.h"

namespace megablock::report {

// The text can be placed inside a <script> element.
std::string figures_json(const BlockResult& result, const Figures& figures);

}  // namespace megablock::report
