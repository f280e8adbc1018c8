// Finds the value of an option of the job that made a result.
#pragma once

#include <string>

#include "io/result/result.h"

namespace megablock {

// The value as text, such as "false"; empty if it is unknown.
inline std::string option_of(const BlockResult& result, const std::string& name) {
  for (const OptionRecord& option : result.provenance.options)
    if (option.name == name) return option.value;
  return "";
}

}  // namespace megablock
