// How an option of the job was set that made a result.
#pragma once

#include <string>

#include "io/result/result.h"

namespace megablock {

// Its text, such as "false"; empty when it is not known.
inline std::string option_of(const BlockResult& result, const std::string& name) {
  for (const OptionRecord& option : result.provenance.options)
    if (option.name == name) return option.value;
  return "";
}

}  // namespace megablock
