#include "io/report.h"

#include <fmt/format.h>

#include "io/report/figures.h"
#include "io/report/html.h"
#include "io/report/page.h"
#include "io/report/sections.h"

namespace megablock {

std::string report_html(const BlockResult& result) {
  using namespace report;
  const Figures figures = figures_of(result);
  std::string body = headline(result, figures) + assessment(result, figures) + map_section(result, figures) +
                     tie_points_section(result, figures) + residuals_section(result, figures) +
                     positions_section(result, figures) + control_section(result, figures) +
                     cameras_section(result, figures) + accuracy_section(result, figures) +
                     tiles_section(result, figures) + failures_section(result, figures) + stages_section(result);
  const std::string digest = result.digest.empty() ? "" : " &middot; digest <code>" + escape(result.digest) + "</code>";
  const std::string subtitle =
      fmt::format("{} images, {} frames, {} {}{}", count(static_cast<std::int64_t>(result.block.images.size())),
                  count(figures.frames), count(static_cast<std::int64_t>(result.block.cameras.size())),
                  result.block.cameras.size() == 1 ? "camera" : "cameras", digest);
  return page("Block report", subtitle, body, figures_json(result, figures));
}

}  // namespace megablock
