// The parts of the report, in the order of the page. Each is empty when there is nothing to say.
#pragma once

#include <string>

#include "io/report/figures.h"

namespace megablock::report {

std::string headline(const BlockResult& result, const Figures& figures);
std::string assessment(const BlockResult& result, const Figures& figures);  // what is well and what needs a look
std::string map_section(const BlockResult& result, const Figures& figures);
std::string tie_points_section(const BlockResult& result, const Figures& figures);
std::string residuals_section(const BlockResult& result, const Figures& figures);
std::string positions_section(const BlockResult& result, const Figures& figures);
std::string control_section(const BlockResult& result, const Figures& figures);
std::string cameras_section(const BlockResult& result, const Figures& figures);
std::string accuracy_section(const BlockResult& result, const Figures& figures);
std::string tiles_section(const BlockResult& result, const Figures& figures);
std::string failures_section(const BlockResult& result, const Figures& figures);
std::string stages_section(const BlockResult& result);
std::string figures_json(const BlockResult& result, const Figures& figures);  // safe inside <script>

}  // namespace megablock::report
