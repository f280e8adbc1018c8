// The inputs of the report that are not part of the result.
#pragma once

#include <functional>
#include <limits>
#include <string>

#include "io/block/block_diagnostics.h"

namespace megablock {

// What the page says that is not in the result, whose bits tell no time and no place.
struct ReportContext {
  std::string job;                                               // directory
  double computed_s = std::numeric_limits<double>::quiet_NaN();  // when the result was written, since 1970
  const BlockDiagnostics* diagnostics = nullptr;                 // null: not looked for
  // Called when a section is written, and behind what a section has gone through: tables of the result that lie in a
  // file may leave memory.
  std::function<void()> after_reading = [] {};
};

}  // namespace megablock
