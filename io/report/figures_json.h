// The figures of the report as JSON, for programs.
#pragma once

#include <string>

#include "io/evaluation/figures.h"
#include "io/result/result.h"

namespace megablock::report {

// Safe inside <script>.
std::string figures_json(const BlockResult& result, const Figures& figures);

}  // namespace megablock::report
