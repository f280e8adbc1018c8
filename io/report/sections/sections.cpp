// Writes the sections about tie points, image residuals and tiles.
#include "io/report/sections/sections.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "io/report/drawing/drawing.h"
#include "io/report/drawing/html.h"

namespace megablock::report {

namespace {

constexpr std::size_t kTilesListed = 60;

}  // namespace

std::string tie_points_section(const BlockResult& result, const Figures& f,
                               const std::function<void()>& after_reading) {
  if (f.reprojection.observations == 0)
    return section("tie-points", "Tie points", paragraph("No tie points.", "muted"));
  std::string charts =
      figure(draw(BarChart{f.track_length, "images that see a point", "points", 0, true, true}),
             fmt::format("Track length: {} in the mean.", fixed(f.reprojection.mean_track_length, 2))) +
      figure(draw(BarChart{f.intersection_deg, "largest angle between two rays [°]", "points"}),
             "Intersection angle.") +
      figure(draw(BarChart{f.observations_per_image, "observations", "images", 0, false}),
             "Observations per oriented image.");
  const auto fewer = [&](ImageIndex a, ImageIndex b) {
    return std::pair(f.observations[a], a) < std::pair(f.observations[b], b);
  };
  const std::vector<ImageIndex> weakest = first_images(result, 8, fewer, after_reading);
  Table table({"image with fewest", "observations"});
  for (const ImageIndex image : weakest) table.add({escape(result.block.name_of(image)), count(f.observations[image])});
  return section("tie-points", "Tie points",
                 "<div class=row>" + charts + "<div class=aside>" + table.html() + "</div></div>");
}

std::string residuals_section(const BlockResult& result, const Figures& f) {
  if (f.reprojection.observations == 0) return "";
  const double component_rms = f.reprojection.rms_px / std::sqrt(2.0);
  std::string body = figure(
      draw(BarChart{f.residual_px, "residual component [px]", "observations", f.reprojection.rms_px < 0.3 ? 2 : 1, true,
                    false, component_rms}),
      fmt::format(
          "Image residuals in x and y: {} px rms each axis; line: normal distribution of the same rms. Residuals "
          "beyond four times that are in the outermost bins.",
          fixed(component_rms, 3)));
  for (CameraIndex camera(0); result.block.cameras.contains(camera); ++camera.value) {
    if (f.fields[camera].observations == 0) continue;
    const FieldDrawing field = draw(f.fields[camera], result.block.cameras[camera]);
    body += figure(field.svg, "<b>" + escape(result.block.cameras[camera].name) + "</b>. " + field.caption);
  }
  return section("residuals", "Image residuals", "<div class=row>" + body + "</div>");
}

std::string tiles_section(const BlockResult& result, const Figures& f) {
  if (result.tiles.tile_count == 0) return "";
  const std::int32_t levels = result.tiles.tree.nodes.empty() ? 0 : result.tiles.tree.nodes.back().level;
  std::string body =
      paragraph(fmt::format("{} {} in a merge tree of {} {}; {} of {} oriented frames ({}) are separator frames. {} "
                            "weak links between tiles were "
                            "dropped.",
                            count(result.tiles.tile_count), result.tiles.tile_count == 1 ? "tile" : "tiles", levels + 1,
                            levels == 0 ? "level" : "levels", count(f.boundary_frames), count(f.oriented_frames),
                            percent(static_cast<double>(f.boundary_frames), static_cast<double>(f.oriented_frames)),
                            count(static_cast<std::int64_t>(result.tiles.dropped_links.size()))));
  Table tiles({"tile", "frames", "separator", "observations", "rms [px]"}, 0);
  const std::size_t listed = std::min(kTilesListed, f.tile_frames.size());
  for (std::size_t t = 0; t < listed; ++t)
    tiles.add({count(static_cast<std::int64_t>(t)), count(f.tile_frames[t]), count(f.tile_boundary[t]),
               count(f.tile_observations[t]), fixed(f.tile_rms_px[t], 3)});
  body += tiles.html("compact") + more(f.tile_frames.size(), listed);
  if (!result.seams.empty()) {
    Table seams({"joint", "verdict", "note", "T", "degrees of freedom", "limit"}, 3);
    std::vector<const SeamCheck*> order;
    for (const SeamCheck& seam : result.seams) order.push_back(&seam);
    const auto excess = [](const SeamCheck* s) {
      const double ratio = s->statistic / s->threshold;
      return s->degrees > 0 && std::isfinite(ratio) ? ratio : -1;
    };
    std::stable_sort(order.begin(), order.end(),
                     [&](const SeamCheck* a, const SeamCheck* b) { return excess(a) > excess(b); });
    for (std::size_t i = 0; i < std::min(kTilesListed, order.size()); ++i) {
      const bool alarm = alarms(*order[i]), tested = order[i]->degrees > 0;
      seams.add({count(order[i]->node),
                 alarm    ? "alarm"
                 : tested ? "agrees"
                          : "nothing shared",
                 escape(order[i]->note), significant(order[i]->statistic), count(order[i]->degrees),
                 significant(order[i]->threshold)},
                alarm ? "bad" : "");
    }
    body += "<h3>Seams</h3>" +
            paragraph(
                "T measures how much the two sides of a joint of the merge tree disagree about their common unknowns. "
                "It follows a χ² distribution if they agree. Worst first.",
                "muted") +
            seams.html() + more(order.size(), kTilesListed);
  }
  return section("tiles", "Tiles and seams", body);
}

}  // namespace megablock::report
