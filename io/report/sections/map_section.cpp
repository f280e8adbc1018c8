// Writes the sections with maps. Each part of the block whose place no observation determines has a map of its own,
// because its place on a common map would be arbitrary.
#include <fmt/core.h>

#include "io/report/drawing/drawing.h"
#include "io/report/drawing/html.h"
#include "io/report/sections/sections.h"

namespace megablock::report {

namespace {

constexpr std::size_t kMostMaps = 6;  // largest number of maps of free parts
constexpr int kAllFree = 7;           // parameters of place, direction and scale

// The frames that one map shows.
struct MapSubject {
  FrameSelection selected;
  const char* unit;
  bool placed;
  std::int32_t part;  // number of the free part; -1: all placed frames
};

FrameSelection in_part(const Figures& f, std::int32_t part) {
  return [&f, part](FrameIndex frame) { return f.part_of_frame[frame] == part; };
}

// One map of the placed frames and of those without a pose, then one of each free part.
std::vector<MapSubject> subjects_of(const Figures& f) {
  const auto placed = [&f](FrameIndex frame) {
    const std::int32_t part = f.part_of_frame[frame];
    return part < 0 || f.parts[static_cast<std::size_t>(part)].placed();
  };
  std::vector<MapSubject> subjects;
  bool any_placed = f.parts.empty();
  for (const BlockPart& part : f.parts) any_placed = any_placed || part.placed();
  // Frames without a pose are on the first map too, at their GNSS positions.
  if (any_placed) subjects.push_back({placed, "m", true, -1});
  for (std::size_t p = 0; p < f.parts.size(); ++p)
    if (!f.parts[p].placed())
      subjects.push_back({in_part(f, static_cast<std::int32_t>(p)), f.parts[p].scaled() ? "m" : "units", false,
                          static_cast<std::int32_t>(p)});
  return subjects;
}

std::string ground_caption(const GroundFrame& ground) {
  return ground.georeferenced ? fmt::format("Local ground frame (east, north, up) about {}°, {}°, {} m; inputs in {}.",
                                            fixed(ground.latitude_deg, 6), fixed(ground.longitude_deg, 6),
                                            fixed(ground.height_m, 1), escape(ground.crs))
                              : "Local frame without georeference; seen from +z.";
}

std::string caption_of(const BlockResult& result, const Figures& f, const MapSubject& subject) {
  if (subject.placed) return ground_caption(result.block.ground);
  const BlockPart& part = f.parts[static_cast<std::size_t>(subject.part)];
  return fmt::format(
      "{}{} images. Its datum is free (defect {}): {} arbitrary{}.",
      f.parts.size() > 1 ? "<b>Part " + count(subject.part + 1) + ".</b> " : "", count(part.images), part.defect,
      part.defect >= kAllFree ? "place, direction and scale are" : "part of its place, direction and scale is",
      f.parts.size() > 1 ? ", also relative to the other parts" : "");
}

std::string map_controls() {
  return "<p class=controls><label><input type=checkbox data-layer=points checked> tie points</label>"
         "<label><input type=checkbox data-layer=boundary checked> separator frames</label>"
         "<label><input type=checkbox data-layer=links> links</label>"
         "<button type=button id=whole>whole block</button>"
         "<span class=muted>wheel or pinch to enlarge, drag to move</span></p>";
}

}  // namespace

const char* ground_unit(const Figures& f) { return f.parts.empty() || f.parts.front().scaled() ? "m" : "units"; }

std::string map_section(const BlockResult& result, const Figures& f, const std::function<void()>& after_reading) {
  std::string body;
  std::size_t drawn = 0, left_out = 0;
  for (const MapSubject& subject : subjects_of(f)) {
    if (drawn >= kMostMaps + 1) {
      ++left_out;
      continue;
    }
    const std::string drawing = draw_map(result, subject.selected, subject.unit, subject.placed, after_reading);
    if (drawing.find("<svg") == std::string::npos) continue;
    body += figure(drawing, caption_of(result, f, subject));
    ++drawn;
  }
  if (drawn == 0) return section("map-section", "Map", paragraph("No image has a position.", "muted"));
  if (left_out > 0) body += paragraph("… and " + count(static_cast<std::int64_t>(left_out)) + " more parts.", "muted");
  return section("map-section", drawn > 1 ? "Maps" : "Map", map_legend(result, f) + map_controls() + body);
}

std::string coverage_section(const BlockResult& result, const Figures& f, const std::function<void()>& after_reading) {
  if (f.reprojection.observations == 0) return "";
  const std::vector<MapSubject> subjects = subjects_of(f);
  if (subjects.empty()) return "";
  const MapSubject& subject = subjects.front();
  const std::string drawing = draw_coverage(result, subject.selected, subject.unit, after_reading);
  if (drawing.empty()) return "";
  std::string caption =
      "Coverage: number of images with kept observations of the tie points in each cell. Points that only "
      "two images see are hardly checked.";
  if (subjects.size() > 1) caption += " Only the part on the first map is shown.";
  return section("coverage", "Coverage", coverage_legend() + figure(drawing, caption));
}

std::string ellipses_figure(const BlockResult& result, const Figures& f, const std::function<void()>& after_reading) {
  const std::vector<MapSubject> subjects = subjects_of(f);
  if (subjects.empty()) return "";
  const FieldDrawing drawing = draw_ellipses(result, subjects.front().selected, subjects.front().unit, after_reading);
  if (drawing.svg.empty()) return "";
  return figure(drawing.svg,
                drawing.caption + (subjects.size() > 1 ? " Only the part on the first map is shown." : ""));
}

}  // namespace megablock::report
