// Writes the figures of the report as JSON, for programs.
#pragma once

#include <string>

#include "io/evaluation/figures.h"
#include "io/result/result.h"

namespace megablock::report {

// The text can be placed inside a <script> element.
std::string figures_json(const BlockResult& result, const Figures& figures);

}  // namespace megablock::report
