// Writes the section about the weaknesses of a block (gaps, thin ground, weak links), with a map and tables.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "io/report/drawing/drawing.h"
#include "io/report/drawing/html.h"
#include "io/report/drawing/plane.h"
#include "io/report/sections/sections.h"

namespace megablock::report {

namespace {

constexpr std::size_t kMostFootprints = 1500;  // footprints are drawn only up to this number
constexpr std::size_t kMostPlaces = 100000;
constexpr std::size_t kMostLines = 5000;  // largest number of links, gaps and proposals on the map
constexpr std::size_t kMostThinCells = 60000;
constexpr std::size_t kMostNumbers = 40;  // so many gaps have their number on the map
constexpr std::size_t kRowsListed = 30;   // largest number of rows of a table
constexpr std::array<const char*, 8> kPartColours = {"#4e79a7", "#f28e2b", "#59a14f", "#b07aa1",
                                                     "#76b7b2", "#d4a017", "#9c755f", "#ff7f9f"};

class DiagnosticsMap {
 public:
  DiagnosticsMap(const BlockResult& result, const BlockDiagnostics& d, const char* unit)
      : result_(result), d_(d), unit_(unit) {
    std::vector<Eigen::Vector2d> places;
    for (FrameIndex f(0); result.block.frames.contains(f); ++f.value)
      if (oriented(result, f)) places.emplace_back(result.state.frames[f].centre.head<2>());
    if (places.empty()) return;
    if (drawn_footprints())
      for (const auto& footprint : d.footprints)
        places.insert(places.end(), footprint.corners.begin(), footprint.corners.end());
    for (const auto& proposal : d.proposals) places.emplace_back(proposal.centre.head<2>());
    plane_ = plane_over(places);
    any_ = true;
  }

  std::string svg() const {
    if (!any_) return "";
    std::string body = coordinate_grid(plane_, unit_) + footprints() + thin_ground() + links() + frames() + gaps() +
                       proposals() + numbers() + scale_bar(plane_, unit_);
    if (result_.block.ground.georeferenced) body += north_arrow();
    return open_map(plane_, "Gaps and links of the block") + body + "</svg>";
  }

  std::string legend() const {
    std::string text = d_.part_frames.size() > 1
                           ? "<span class=key><i class=tilekey></i>frames, a colour for each part</span>"
                           : "<span class=key><i style=\"background:#4e79a7\"></i>frames</span>";
    const auto key = [&](bool there, const char* style, const std::string& words) {
      if (there) text += fmt::format("<span class=key><i class=swatch style=\"{}\"></i>{}</span>", style, words);
    };
    key(drawn_footprints(), "background:#4e79a722;border:1px solid #4e79a766", "footprint");
    key(!d_.thin_ground.empty(), "background:#b3261e55",
        fmt::format("ground seen by fewer than {} images", d_.requested.min_images));
    key(!d_.gaps.empty(), "height:0;border-radius:0;border-top:3px dashed #b3261e", "gap, with its number below");
    key(!d_.weak_links.empty(), "height:0;border-radius:0;border-top:2px dotted #b26a00", "weak link");
    key(!d_.single_links.empty(), "height:0;border-radius:0;border-top:3px solid #b26a00", "single link");
    key(!d_.proposals.empty(), "background:#fff;border:2px solid #2e7d4f;width:9px;height:9px;transform:rotate(45deg)",
        "proposed exposure");
    return "<p class=legend>" + text + "</p>";
  }

 private:
  bool drawn_footprints() const { return !d_.footprints.empty() && d_.footprints.size() <= kMostFootprints; }
  static std::string line(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return fmt::format("M{:.1f} {:.1f}L{:.1f} {:.1f}", a.x(), a.y(), b.x(), b.y());
  }
  Eigen::Vector2d at(FrameIndex frame) const { return plane_.at(result_.state.frames[frame].centre.head<2>()); }

  std::string footprints() const {
    if (!drawn_footprints()) return "";
    std::string path;
    for (const auto& footprint : d_.footprints) {
      for (std::size_t k = 0; k < 4; ++k) {
        const Eigen::Vector2d p = plane_.at(footprint.corners[k]);
        path += fmt::format("{}{:.1f} {:.1f}", k == 0 ? "M" : "L", p.x(), p.y());
      }
      path += "z";
    }
    return "<path class=foot-print d=\"" + path + "\"/>";
  }

  std::string thin_ground() const {
    std::string path;
    std::size_t drawn = 0;
    const double side = d_.cell_m * plane_.scale;
    for (const auto& ground : d_.thin_ground)
      for (const Eigen::Vector2d& cell : ground.cells) {
        if (++drawn > kMostThinCells) break;
        const Eigen::Vector2d p = plane_.at(cell);
        path +=
            fmt::format("M{:.1f} {:.1f}h{:.1f}v{:.1f}h{:.1f}z", p.x() - side / 2, p.y() - side / 2, side, side, -side);
      }
    return "<path class=thin d=\"" + path + "\"/>";
  }

  std::string links() const {
    const auto path = [&](const std::vector<BlockDiagnostics::Link>& all) {
      std::string lines;
      for (std::size_t i = 0; i < std::min(kMostLines, all.size()); ++i) lines += line(at(all[i].a), at(all[i].b));
      return lines;
    };
    return "<path class=weak d=\"" + path(d_.weak_links) + "\"/><path class=single d=\"" + path(d_.single_links) +
           "\"/>";
  }

  std::string frames() const {
    std::array<std::string, kPartColours.size()> dots;
    const std::size_t n = result_.block.frames.size(), step = 1 + n / kMostPlaces;
    const double size = n > 20000 ? 2 : n > 3000 ? 3 : n > 500 ? 5 : 7;
    for (FrameIndex f(0); result_.block.frames.contains(f); f.value += static_cast<std::int64_t>(step)) {
      if (!oriented(result_, f)) continue;
      const std::int32_t part = d_.part_of_frame.contains(f) ? std::max(0, d_.part_of_frame[f]) : 0;
      const Eigen::Vector2d p = at(f);
      dots[static_cast<std::size_t>(part) % dots.size()] += fmt::format("M{:.1f} {:.1f}h0", p.x(), p.y());
    }
    std::string svg;
    for (std::size_t k = 0; k < dots.size(); ++k)
      if (!dots[k].empty())
        svg += fmt::format("<path class=dots stroke=\"{}\" stroke-width={} d=\"{}\"/>", kPartColours[k], size, dots[k]);
    return svg;
  }

  std::string gaps() const {
    std::string lines;
    for (std::size_t i = 0; i < std::min(kMostLines, d_.gaps.size()); ++i)
      lines += line(plane_.at(d_.gaps[i].from), plane_.at(d_.gaps[i].to));
    return "<path class=gap d=\"" + lines + "\"/>";
  }

  std::string proposals() const {
    std::string path;
    for (std::size_t i = 0; i < std::min(kMostLines, d_.proposals.size()); ++i) {
      const Eigen::Vector2d p = plane_.at(d_.proposals[i].centre.head<2>());
      path += fmt::format("M{:.1f} {:.1f}l6 6l-6 6l-6-6z", p.x(), p.y() - 6);
    }
    return "<path class=proposal d=\"" + path + "\"/>";
  }

  // Draws the numbers of the gaps. A number is placed beside the middle of its gap; it is left out where it would cover
  // another number.
  std::string numbers() const {
    std::string svg;
    std::vector<Eigen::Vector2d> taken;
    for (std::size_t i = 0; i < std::min(kMostNumbers, d_.gaps.size()); ++i) {
      const Eigen::Vector2d a = plane_.at(d_.gaps[i].from), b = plane_.at(d_.gaps[i].to);
      Eigen::Vector2d way = b - a;
      way = way.isZero() ? Eigen::Vector2d(1, 0) : Eigen::Vector2d(way.normalized());
      // Beside the line, perpendicular to it.
      Eigen::Vector2d p = (a + b) / 2 + 20 * Eigen::Vector2d(way.y(), -way.x());
      if (!plane_.shows(p)) p = (a + b) / 2;
      if (std::any_of(taken.begin(), taken.end(),
                      [&](const Eigen::Vector2d& other) { return (other - p).norm() < 24; }))
        continue;
      taken.push_back(p);
      svg += fmt::format(
          "<g class=number><circle cx={0:.1f} cy={1:.1f} r=11 /><text x={0:.1f} y={2:.1f} "
          "text-anchor=middle>{3}</text></g>",
          p.x(), p.y(), p.y() + 4.5, i + 1);
    }
    return svg;
  }

  const BlockResult& result_;
  const BlockDiagnostics& d_;
  const char* unit_;  // of lengths
  Plane plane_;
  bool any_ = false;
};

class DiagnosticsText {
 public:
  DiagnosticsText(const BlockResult& result, const BlockDiagnostics& d, const std::string& unit)
      : result_(result), d_(d), unit_(unit) {}

  std::string summary() const {
    std::string list;
    const auto item = [&](bool bad, const std::string& text) {
      list += fmt::format("<li class={}>{}</li>\n", bad ? "look" : "good", text);
    };
    std::int64_t exposures = 0, lines = 0;
    for (const auto& gap : d_.gaps) (gap.line ? lines : exposures) += gap.missing;
    if (!d_.aerial)
      item(!d_.gaps.empty(), d_.gaps.empty() ? "No pass is interrupted."
                                             : fmt::format("Passes are interrupted at {} {}.", count_of(d_.gaps),
                                                           d_.gaps.size() == 1 ? "place" : "places"));
    else if (d_.gaps.empty())
      item(false, d_.lines > 0 ? "No exposure and no flight line is missing." : "The images do not form flight lines.");
    else
      item(true,
           fmt::format("About {} {} missing in flight lines, and {} whole {}.", count(exposures),
                       exposures == 1 ? "exposure is" : "exposures are", count(lines), lines == 1 ? "line" : "lines"));
    if (d_.aerial) ground_and_pairs(item);
    if (!d_.links_known) return "<ul class=assessment>\n" + list + "</ul>\n";
    if (d_.part_frames.size() < 2)
      item(false, fmt::format("Links of at least {} tie points connect all frames.", d_.requested.min_link_points));
    else
      item(true, fmt::format("{} parts have no link of {} tie points between them; the largest has {} of {} frames.",
                             count_of(d_.part_frames), d_.requested.min_link_points, count(d_.part_frames[0]),
                             count(frames())));
    if (!d_.single_links.empty())
      item(true,
           fmt::format("{} single {} {} parts of the block together.", count_of(d_.single_links),
                       d_.single_links.size() == 1 ? "link" : "links", d_.single_links.size() == 1 ? "holds" : "hold"));
    if (!d_.loose_parts.empty())
      item(true, fmt::format("The rest of the block does not determine the size of {} {}.", count_of(d_.loose_parts),
                             d_.loose_parts.size() == 1 ? "part" : "parts"));
    return "<ul class=assessment>\n" + list + "</ul>\n";
  }

  std::string scope() const {
    if (!d_.aerial)
      return paragraph(
          "Most images look sideways, or the vertical is unknown. Therefore only interruptions of passes and weak "
          "links "
          "are searched; footprints, bases, flight lines and proposals need images that look down.",
          "muted");
    return paragraph(
        fmt::format(
            "{} flight {}; {} {unit} between exposures, {} {unit} between lines, {} {unit} above ground (medians). "
            "<code>diagnostics.json</code> lists everything outside the required limits.",
            count(d_.lines), d_.lines == 1 ? "line" : "lines", significant(d_.usual_step_m),
            significant(d_.line_distance_m), significant(d_.height_m), fmt::arg("unit", unit_)),
        "muted");
  }

  std::string tables() const {
    return gaps() + ground() + pairs() + links("Weak links between parts", d_.weak_links, false) +
           links("Single links", d_.single_links, true) + loose_parts();
  }

  std::string chart() const {
    std::vector<double> values;
    for (const auto& pair : d_.pairs)
      if (std::isfinite(pair.base_to_height)) values.push_back(pair.base_to_height);
    if (values.empty()) return "";
    const Spread middle = spread(values);
    Histogram h;
    h.width = step_below(std::max(1e-3, 2 * middle.median) / 20);
    // Twice the median, so that the typical values fill the left half, and further if the required limit lies near.
    const double top = std::max(2 * middle.median, std::min(d_.requested.max_base_to_height, 3 * middle.median));
    h.bins.assign(static_cast<std::size_t>(std::clamp(std::ceil(top / h.width), 8.0, 80.0)), 0);
    for (const double value : values) h.add(value);
    return figure(draw(BarChart{h, "base / height", "pairs",
                                h.width < 0.01  ? 3
                                : h.width < 0.1 ? 2
                                                : 1,
                                true}),
                  fmt::format("Base to height of {} {}; required: {} to {}.", count_of(values),
                              d_.lines > 0 ? "successive exposures" : "linked pairs",
                              fmt::format("{:g}", d_.requested.min_base_to_height),
                              fmt::format("{:g}", d_.requested.max_base_to_height)));
  }

 private:
  template <typename Rows>
  static std::string count_of(const Rows& rows) {
    return count(static_cast<std::int64_t>(rows.size()));
  }
  std::int64_t frames() const {
    std::int64_t sum = 0;
    for (const std::int64_t part : d_.part_frames) sum += part;
    return sum;
  }
  std::string area_text(double m2) const {
    if (unit_ != "m") return significant(m2) + " " + unit_ + "²";
    return m2 >= 1e6   ? significant(m2 / 1e6) + " km²"
           : m2 >= 1e4 ? significant(m2 / 1e4) + " ha"
                       : significant(m2) + " m²";
  }
  std::string name(FrameIndex frame) const { return escape(result_.block.frames[frame].name); }

  template <typename Item>
  void ground_and_pairs(Item&& item) const {
    double area = 0;
    for (const auto& ground : d_.thin_ground) area += ground.area_m2;
    if (d_.footprints.empty())
      item(true, "No footprint could be calculated, because heights above ground or attitudes are unknown.");
    else if (d_.thin_ground.empty())
      item(false, fmt::format("By their footprints, at least {} images see all ground between the images.",
                              d_.requested.min_images));
    else
      item(true, fmt::format("{} of ground between the images, in {} {}, are seen by fewer than {} images.",
                             area_text(area), count_of(d_.thin_ground), d_.thin_ground.size() == 1 ? "piece" : "pieces",
                             d_.requested.min_images));
    std::int64_t bases = 0, overlaps = 0;
    for (const auto& pair : d_.pairs) {
      bases += d_.base_is_outside(pair);
      overlaps += d_.overlap_is_missing(pair);
    }
    if (d_.pairs.empty()) return;
    item(bases > 0, fmt::format("{} of {} bases are outside {} to {} of the height.", count(bases), count_of(d_.pairs),
                                fmt::format("{:g}", d_.requested.min_base_to_height),
                                fmt::format("{:g}", d_.requested.max_base_to_height)));
    item(overlaps > 0, fmt::format("{} of {} pairs overlap by less than {} %.", count(overlaps), count_of(d_.pairs),
                                   fixed(100 * d_.requested.min_overlap, 0)));
    if (!d_.proposals.empty())
      item(true, fmt::format("{} {} proposed to close the gaps.", count_of(d_.proposals),
                             d_.proposals.size() == 1 ? "exposure is" : "exposures are"));
  }

  std::string gaps() const {
    if (d_.gaps.empty()) return "";
    Table table({"gap", "between", "and", "missing", "distance [" + unit_ + "]"}, 3);
    for (std::size_t i = 0; i < std::min(kRowsListed, d_.gaps.size()); ++i) {
      const auto& gap = d_.gaps[i];
      table.add({count(static_cast<std::int64_t>(i) + 1), name(gap.before), name(gap.after),
                 count(gap.missing) + (gap.line    ? gap.missing == 1 ? " line beside these" : " lines beside these"
                                       : d_.aerial ? gap.missing == 1 ? " exposure" : " exposures"
                                       : gap.missing == 1 ? " frame"
                                                          : " frames"),
                 significant(gap.distance_m)});
    }
    return "<h3>Gaps</h3>" + table.html("small") + more(d_.gaps.size(), kRowsListed);
  }

  std::string loose_parts() const {
    if (d_.loose_parts.empty()) return "";
    const auto names = [&](const std::vector<FrameIndex>& frames) {
      constexpr std::size_t kNamed = 3;
      std::string text;
      for (std::size_t i = 0; i < std::min(kNamed, frames.size()); ++i) text += (i > 0 ? ", " : "") + name(frames[i]);
      return text + (frames.size() > kNamed ? ", …" : "");
    };
    Table table({"frames of the part", "joints", "frames", "tie points of the best link past the joints"}, 2);
    for (std::size_t i = 0; i < std::min(kRowsListed, d_.loose_parts.size()); ++i) {
      const auto& part = d_.loose_parts[i];
      table.add({names(part.frames), names(part.joints), count_of(part.frames), count(part.points)});
    }
    return details("Parts of unknown size", table.html("small") + more(d_.loose_parts.size(), kRowsListed));
  }

  std::string ground() const {
    if (d_.thin_ground.empty()) return "";
    Table table({"ground seen by too few images: centre E", "N", "area [" + unit_ + "²]"}, 0);
    std::vector<const BlockDiagnostics::ThinGround*> order;
    for (const auto& ground : d_.thin_ground) order.push_back(&ground);
    std::stable_sort(order.begin(), order.end(), [](auto* a, auto* b) { return a->area_m2 > b->area_m2; });
    for (std::size_t i = 0; i < std::min(kRowsListed, order.size()); ++i)
      table.add({fixed(order[i]->centre.x(), 1), fixed(order[i]->centre.y(), 1), significant(order[i]->area_m2)});
    return details("Ground seen by too few images", table.html("small") + more(order.size(), kRowsListed));
  }

  std::string pairs() const {
    Table table({"image", "and", "base [" + unit_ + "]", "base / height", "overlap"}, 2);
    std::size_t all = 0;
    for (const auto& pair : d_.pairs) {
      if (!d_.base_is_outside(pair) && !d_.overlap_is_missing(pair)) continue;
      if (++all > kRowsListed) continue;
      const auto marked = [](bool bad, const std::string& text) { return bad ? "<b>" + text + "</b>" : text; };
      table.add({name(pair.a), name(pair.b), significant(pair.base_m),
                 marked(d_.base_is_outside(pair), fixed(pair.base_to_height, 3)),
                 marked(d_.overlap_is_missing(pair),
                        std::isfinite(pair.overlap) ? fixed(100 * pair.overlap, 0) + " %" : kMissing)});
    }
    return all == 0 ? ""
                    : details("Pairs with a base or an overlap outside the required limits",
                              table.html("small") + more(all, kRowsListed));
  }

  std::string links(const std::string& title, const std::vector<BlockDiagnostics::Link>& all, bool single) const {
    if (all.empty()) return "";
    Table table({"frame", "and", "tie points", single ? "frames on the smaller side" : ""}, 2);
    for (std::size_t i = 0; i < std::min(kRowsListed, all.size()); ++i)
      table.add({name(all[i].a), name(all[i].b), count(all[i].points), single ? count(all[i].frames) : ""});
    return details(title, table.html("small") + more(all.size(), kRowsListed));
  }

  const BlockResult& result_;
  const BlockDiagnostics& d_;
  const std::string unit_;  // of lengths
};

}  // namespace

std::string diagnostics_section(const BlockResult& result, const Figures& f, const BlockDiagnostics& d) {
  const DiagnosticsText text(result, d, ground_unit(f));
  const DiagnosticsMap map(result, d, ground_unit(f));
  const std::string drawing = map.svg();
  std::string body = text.summary() + text.scope();
  if (!drawing.empty()) body += map.legend() + figure(drawing, "");
  const std::string chart = text.chart();
  if (!chart.empty()) body += "<div class=row>" + chart + "</div>";
  return section("diagnostics", "Gaps and links", body + text.tables());
}

}  // namespace megablock::report
