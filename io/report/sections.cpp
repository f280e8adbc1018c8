// Headline, assessment, map, tie points, residuals, tiles, failures, stages.
#include "io/report/sections.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "io/report/drawing.h"
#include "io/report/html.h"

namespace megablock::report {

namespace {

constexpr std::size_t kListed = 100;  // rows of a list before "and N more"
constexpr std::size_t kTilesListed = 60;

std::string card(const std::string& value, const std::string& name, const std::string& note = "") {
  return "<div class=card><b>" + value + "</b><span>" + name + "</span>" +
         (note.empty() ? "" : "<small>" + note + "</small>") + "</div>\n";
}

std::string item(const char* state, const std::string& text) {
  return fmt::format("<li class={}>{}</li>\n", state, text);
}

std::string more(std::size_t all, std::size_t listed) {
  return all > listed ? paragraph("… and " + count(static_cast<std::int64_t>(all - listed)) + " more.", "muted") : "";
}

std::int64_t alarms(const BlockResult& result) {
  return std::count_if(result.seams.begin(), result.seams.end(),
                       [](const SeamCheck& seam) { return seam.statistic > seam.threshold; });
}

}  // namespace

std::string headline(const BlockResult& result, const Figures& f) {
  const ReprojectionStatistics& r = f.reprojection;
  const auto images = static_cast<std::int64_t>(result.block.images.size());
  const bool measured = r.observations > 0;
  double seconds = 0, peak = 0;
  for (const StageStatistics& stage : result.stages) {
    seconds += stage.seconds;
    peak = std::max(peak, stage.peak_rss_mib);
  }
  std::string cards = card(count(r.oriented_images) + "<i> of " + count(images) + "</i>", "images oriented",
                           images == r.oriented_images ? "" : count(images - r.oriented_images) + " not oriented");
  cards += card(count(r.points), "tie points",
                measured ? "seen in " + fixed(r.mean_track_length, 2) + " images on average" : "");
  cards += card(count(r.observations), "observations",
                f.all_observations > 0 ? percent(static_cast<double>(f.all_observations - r.observations),
                                                 static_cast<double>(f.all_observations)) +
                                             " rejected"
                                       : "");
  cards += card(measured ? fixed(r.mean_px, 3) + "<i> px</i>" : kMissing, "mean residual",
                measured ? "rms " + fixed(r.rms_px, 3) + " px" : "");
  cards += card(result.degrees_of_freedom > 0 ? fixed(std::sqrt(std::max(0.0, result.variance_factor)), 3) : kMissing,
                "σ₀ a posteriori",
                result.degrees_of_freedom > 0 ? "variance factor " + significant(result.variance_factor) + ", " +
                                                    count(result.degrees_of_freedom) + " degrees of freedom, " +
                                                    fixed(result.image_sigma_px, 3) + " px per tie point measurement"
                                              : "");
  if (std::isfinite(f.ground_resolution_m)) {
    const LengthUnit unit = length_unit(f.ground_resolution_m);
    cards += card(significant(f.ground_resolution_m * unit.factor) + "<i> " + unit.name + "</i>",
                  "per pixel in object space", "median");
  }
  cards += card(count(result.tiles.tile_count), result.tiles.tile_count == 1 ? "tile" : "tiles",
                count(f.boundary_frames) + " boundary frames");
  cards += card(count(result.global_iterations), "global iterations",
                result.global_iterations > 0 ? "Newton decrement " + significant(result.newton_decrement, 2) : "");
  if (seconds > 0) cards += card(duration(seconds), "all stages", "peak memory " + memory(peak) + " a rank");
  return "<div class=cards>" + cards + "</div>\n";
}

std::string assessment(const BlockResult& result, const Figures& f) {
  std::string list;
  const auto images = static_cast<std::int64_t>(result.block.images.size());
  const std::int64_t lost = images - f.reprojection.oriented_images;
  if (images == 0)
    list += item("look", "The block has no images.");
  else if (lost == 0)
    list += item("good", "All images are oriented.");
  else
    list += item("look", fmt::format("{} of {} images {} not oriented: see <a href=\"#failures\">below</a>.",
                                     count(lost), count(images), lost == 1 ? "is" : "are"));
  if (f.components > 1)
    list += item("look", fmt::format("The block falls into {} sets of images without a link between them.",
                                     count(f.components)));
  if (!result.seams.empty()) {
    const std::int64_t n = alarms(result);
    list += n == 0 ? item("good", fmt::format("No seam: the tiles agree at all {} joints of the merge tree.",
                                              count(static_cast<std::int64_t>(result.seams.size()))))
                   : item("bad", fmt::format("{} of {} joints of the merge tree raise an alarm: see <a href=\"#tiles\">"
                                             "tiles</a>.",
                                             count(n), count(static_cast<std::int64_t>(result.seams.size()))));
  }
  if (result.degrees_of_freedom > 0) {
    const double s0 = std::sqrt(std::max(0.0, result.variance_factor));
    if (s0 > 1.5)
      list += item("look", "Residuals are " + fixed(s0, 1) + " times what the stated sigmas let expect.");
    else if (s0 < 0.5)
      list += item("look", "Residuals are much smaller than the stated sigmas let expect (σ₀ " + fixed(s0, 2) + ").");
    else
      list += item("good", "Residuals agree with the stated sigmas (σ₀ " + fixed(s0, 2) + ").");
  }
  if (!result.gauge.empty()) list += item("plain", "Datum: " + escape(result.gauge) + ".");
  for (const std::string& note : result.notes) list += item("look", escape(note));
  return "<ul class=assessment>\n" + list + "</ul>\n";
}

std::string map_section(const BlockResult& result, const Figures& figures) {
  const std::string drawing = draw_map(result, figures);
  const bool empty = drawing.find("<svg") == std::string::npos;
  if (empty) return section("map-section", "Map", drawing);
  const std::string controls =
      "<p class=controls><label><input type=checkbox data-layer=points checked> tie points</label>"
      "<label><input type=checkbox data-layer=boundary checked> boundary frames</label>"
      "<label><input type=checkbox data-layer=links> links</label>"
      "<button type=button id=whole>whole block</button>"
      "<span class=muted>wheel or pinch to enlarge, drag to move</span></p>";
  const GroundFrame& ground = result.block.ground;
  const std::string caption =
      ground.georeferenced ? fmt::format("Local ground frame (east, north, up) about {}°, {}°, {} m; inputs in {}.",
                                         fixed(ground.latitude_deg, 6), fixed(ground.longitude_deg, 6),
                                         fixed(ground.height_m, 1), escape(ground.crs))
                           : "Local frame without georeference; seen from +z.";
  return section("map-section", "Map", map_legend(result, figures) + controls + figure(drawing, caption));
}

std::string tie_points_section(const BlockResult& result, const Figures& f) {
  if (f.reprojection.observations == 0)
    return section("tie-points", "Tie points", paragraph("No tie points.", "muted"));
  std::string charts =
      figure(draw(BarChart{f.track_length, "images that see a point", "points", 0, true, true}),
             fmt::format("Track length: {} in the mean.", fixed(f.reprojection.mean_track_length, 2))) +
      figure(draw(BarChart{f.intersection_deg, "largest angle between two rays [°]", "points"}),
             "Intersection angle.") +
      figure(draw(BarChart{f.observations_per_image, "observations", "images", 0, false}),
             "Observations per oriented image.");
  std::vector<ImageIndex> weakest;
  for (ImageIndex image(0); result.block.images.contains(image); ++image.value)
    if (oriented(result, result.block.images[image].frame)) weakest.push_back(image);
  const std::size_t listed = std::min<std::size_t>(8, weakest.size());
  std::partial_sort(
      weakest.begin(), weakest.begin() + static_cast<std::ptrdiff_t>(listed), weakest.end(),
      [&](ImageIndex a, ImageIndex b) { return std::pair(f.observations[a], a) < std::pair(f.observations[b], b); });
  Table table({"image with fewest", "observations"});
  for (std::size_t i = 0; i < listed; ++i)
    table.add({escape(result.block.images[weakest[i]].name), count(f.observations[weakest[i]])});
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
      paragraph(fmt::format("{} {} in a merge tree of {} {}; {} of {} oriented frames ({}) are boundary frames. {} "
                            "weak links between tiles were "
                            "dropped.",
                            count(result.tiles.tile_count), result.tiles.tile_count == 1 ? "tile" : "tiles", levels + 1,
                            levels == 0 ? "level" : "levels", count(f.boundary_frames), count(f.oriented_frames),
                            percent(static_cast<double>(f.boundary_frames), static_cast<double>(f.oriented_frames)),
                            count(static_cast<std::int64_t>(result.tiles.dropped_links.size()))));
  Table tiles({"tile", "frames", "boundary", "observations", "rms [px]"}, 0);
  const std::size_t listed = std::min(kTilesListed, f.tile_frames.size());
  for (std::size_t t = 0; t < listed; ++t)
    tiles.add({count(static_cast<std::int64_t>(t)), count(f.tile_frames[t]), count(f.tile_boundary[t]),
               count(f.tile_observations[t]), fixed(f.tile_rms_px[t], 3)});
  body += tiles.html("compact") + more(f.tile_frames.size(), listed);
  if (!result.seams.empty()) {
    Table seams({"joint", "verdict", "note", "T", "degrees of freedom", "limit"}, 3);
    std::vector<const SeamCheck*> order;
    for (const SeamCheck& seam : result.seams) order.push_back(&seam);
    std::stable_sort(order.begin(), order.end(), [](const SeamCheck* a, const SeamCheck* b) {
      return a->statistic * b->threshold > b->statistic * a->threshold;
    });
    for (std::size_t i = 0; i < std::min(kTilesListed, order.size()); ++i) {
      const bool alarm = order[i]->statistic > order[i]->threshold;
      seams.add({count(order[i]->node), alarm ? "alarm" : "agrees", escape(order[i]->note),
                 significant(order[i]->statistic), count(order[i]->degrees), significant(order[i]->threshold)},
                alarm ? "bad" : "");
    }
    body += "<h3>Seams</h3>" +
            paragraph(
                "T measures how far the two sides of a joint of the merge tree disagree about what they share; it "
                "follows a χ² distribution when they do not. Worst first.",
                "muted") +
            seams.html() + more(order.size(), kTilesListed);
  }
  return section("tiles", "Tiles and seams", body);
}

std::string failures_section(const BlockResult& result, const Figures& f) {
  if (result.failures.empty() && f.not_oriented.empty()) return "";
  std::string body;
  if (!result.failures.empty()) {
    Table table({"stage", "unit", "reason"}, 3);
    for (std::size_t i = 0; i < std::min(kListed, result.failures.size()); ++i)
      table.add({escape(result.failures[i].stage), escape(result.failures[i].unit), escape(result.failures[i].reason)});
    body += table.html() + more(result.failures.size(), kListed);
  }
  if (!f.not_oriented.empty()) {
    std::string names;
    for (std::size_t i = 0; i < std::min(kListed, f.not_oriented.size()); ++i)
      names += (i ? ", " : "") + escape(result.block.images[f.not_oriented[i]].name);
    body += "<h3>Images not oriented (" + count(static_cast<std::int64_t>(f.not_oriented.size())) + ")</h3>" +
            paragraph(names, "names") + more(f.not_oriented.size(), kListed);
  }
  return section("failures", "What failed", body);
}

std::string stages_section(const BlockResult& result) {
  if (result.stages.empty()) return "";
  double longest = 0, total = 0;
  for (const StageStatistics& stage : result.stages) {
    if (std::isfinite(stage.seconds)) total += stage.seconds;
    longest = std::max(longest, stage.seconds);
  }
  Table table({"stage", "", "time", "peak memory", "units", "failed"}, 2);
  for (const StageStatistics& stage : result.stages) {
    const double share = longest > 0 && stage.seconds > 0 ? 100 * stage.seconds / longest : 0;
    table.add({escape(stage.name), fmt::format("<span class=time style=\"width:{:.1f}%\"></span>", share),
               duration(stage.seconds), memory(stage.peak_rss_mib), count(stage.units),
               stage.failed ? "<b>" + count(stage.failed) + "</b>" : "0"});
  }
  table.add({"sum", "", duration(total), "", "", ""}, "sum");
  return section("stages", "Time and memory",
                 table.html("stages") + paragraph("Wall clock of each stage; memory of the largest rank.", "muted"));
}

}  // namespace megablock::report
