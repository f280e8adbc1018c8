// Writes the sections about failed images and units, about time and memory, and about the origin of the result.
#include <fmt/chrono.h>
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "io/report/drawing/html.h"
#include "io/report/sections/sections.h"
#include "io/text/counted.h"

namespace megablock::report {

namespace {

constexpr std::size_t kListedFailures = 200;  // largest number of listed failures

std::string known(std::int64_t value) { return value < 0 ? kMissing : count(value); }

// The known figures of a failed image: size, features, images matched with, matches, observations.
std::vector<std::string> image_cells(const BlockResult& result, const Figures& f, ImageIndex image) {
  const Camera& camera = result.block.cameras[result.block.camera_of(image)];
  const ImageRecord record = result.image_records.contains(image) ? result.image_records[image] : ImageRecord{};
  const bool decoded = record.width > 0;
  const std::string size = decoded            ? fmt::format("{} × {}", record.width, record.height)
                           : camera.width > 0 ? fmt::format("{} × {}", camera.width, camera.height)
                                              : kMissing;
  return {size, known(record.features), known(record.matched_images), known(record.matches),
          count(f.measured.contains(image) ? f.measured[image] : 0)};
}

void add_failure(Table& table, const FailedUnit& failure, std::vector<std::string> image) {
  std::vector<std::string> cells = {escape(failure.unit), escape(failure.stage), escape(failure.reason)};
  image.resize(5, kMissing);
  cells.insert(cells.end(), image.begin(), image.end());
  table.add(std::move(cells));
}

}  // namespace

std::string failures_section(const BlockResult& result, const Figures& f) {
  if (result.failures.empty() && f.not_oriented.empty()) return "";
  std::map<std::string, ImageIndex> by_name;
  for (ImageIndex image(0); result.block.images.contains(image); ++image.value)
    by_name.emplace(result.block.name_of(image), image);
  Table table(
      {"image or unit", "stage", "reason", "size [px]", "features", "images matched", "matches", "observations"}, 3);
  std::size_t all = 0;
  std::map<std::string, bool> told;
  for (const FailedUnit& failure : result.failures) {
    const auto image = by_name.find(failure.unit);
    told[failure.unit] = true;
    if (++all <= kListedFailures)
      add_failure(table, failure,
                  image == by_name.end() ? std::vector<std::string>{} : image_cells(result, f, image->second));
  }
  for (const ImageIndex image : f.not_oriented) {
    const std::string& name = result.block.name_of(image);
    if (told.contains(name)) continue;
    if (++all <= kListedFailures) add_failure(table, {"", name, "not oriented"}, image_cells(result, f, image));
  }
  const std::string lost =
      f.not_oriented.empty()
          ? ""
          : paragraph(fmt::format("{} {} not oriented. Observations: all in tracks, kept or rejected.",
                                  count(static_cast<std::int64_t>(f.not_oriented.size())),
                                  f.not_oriented.size() == 1 ? "image is" : "images are"));
  return section("failures", "What failed", lost + table.html("sortable") + more(all, kListedFailures));
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

namespace {

std::string options_tables(const std::vector<OptionRecord>& options) {
  Table changed({"option", "value", "default"}, 3), all({"option", "value", "default"}, 3);
  for (const OptionRecord& option : options) {
    const bool differs = option.value != option.default_value;
    const std::vector<std::string> cells = {"<code>" + escape(option.name) + "</code>", escape(option.value),
                                            escape(option.default_value)};
    if (differs) changed.add(cells);
    all.add(cells, differs ? "sum" : "");
  }
  const std::string summary = changed.empty() ? paragraph("All options have their defaults.")
                                              : "<h3>Options that are not the default</h3>" + changed.html("compact");
  return summary + details("All options in force", all.html("compact"));
}

}  // namespace

std::string time_text(double since_1970_s) {
  if (!std::isfinite(since_1970_s)) return "";
  return fmt::format("{:%Y-%m-%d %H:%M} UTC", fmt::gmtime(static_cast<std::time_t>(since_1970_s)));
}

std::string provenance_section(const BlockResult& result, const ReportContext& context) {
  const Provenance& provenance = result.provenance;
  Table table({"", ""}, 2);
  const auto add = [&](const char* name, const std::string& value) {
    if (!value.empty()) table.add({name, value});
  };
  add("job", escape(context.job));
  add("project file", escape(provenance.project));
  add("computed", time_text(context.computed_s));
  add("program", escape(provenance.program));
  add("arithmetic level", escape(provenance.arithmetic));
  add("datum", escape(result.gauge));
  if (result.global_iterations > 0)
    add("convergence",
        fmt::format("Newton decrement {} after {}{}", significant(result.newton_decrement, 2),
                    counted(result.global_iterations, "iteration"),
                    result.decrement_limit > 0 ? ", limit " + significant(result.decrement_limit, 2) : ""));
  add("digest", result.digest.empty() ? "" : "<code>" + escape(result.digest) + "</code>");
  if (table.empty() && provenance.options.empty()) return "";
  std::string body = table.empty() ? "" : table.html("compact plain");
  if (!provenance.options.empty()) body += options_tables(provenance.options);
  return section("provenance", "How it was computed", body);
}

}  // namespace megablock::report
