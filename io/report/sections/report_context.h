// Holds the inputs of the report that are not part of the result.
#pragma once

#include <functional>
#include <limits>
#include <string>

#include "io/block/block_diagnostics.h"

namespace megablock {

// Facts about the job that the page prints and that the result does not contain. Results contain neither times nor
// places, so that equal results are equal files.
struct ReportContext {
  std::string job;                                               // directory
  double computed_s = std::numeric_limits<double>::quiet_NaN();  // time when the result was written, since 1970
  const BlockDiagnostics* diagnostics = nullptr;                 // null: not diagnosed
  // Called after a section is written, and at intervals while a section reads large tables. Tables of the result that
  // are mapped from a file may then leave memory.
  std::function<void()> after_reading = [] {};
};

}  // namespace megablock
