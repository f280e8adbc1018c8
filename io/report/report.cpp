#include "io/report/report.h"

#include <fmt/core.h>

#include <algorithm>
#include <filesystem>

#include "io/block/track_rows.h"
#include "io/evaluation/figures.h"
#include "io/evaluation/remarks/remarks.h"
#include "io/report/drawing/html.h"
#include "io/report/drawing/page.h"
#include "io/report/figures_json.h"
#include "io/report/sections/sections.h"

namespace megablock {

namespace {

// The line below the title: the size of the block, its project, and the time and program of the computation.
std::string subtitle_of(const BlockResult& result, const report::Figures& figures, const ReportContext& context) {
  using namespace report;
  std::string text =
      fmt::format("{} images, {} frames, {} {}", count(static_cast<std::int64_t>(result.block.images.size())),
                  count(figures.frames), count(static_cast<std::int64_t>(result.block.cameras.size())),
                  result.block.cameras.size() == 1 ? "camera" : "cameras");
  const auto add = [&](const std::string& part) {
    if (!part.empty()) text += " &middot; " + part;
  };
  add(escape(result.provenance.project));
  add(time_text(context.computed_s));
  add(escape(result.provenance.program));
  if (!result.digest.empty()) add("digest <code>" + escape(result.digest) + "</code>");
  return text;
}

std::string name_of(const std::string& job);

// The name of the block in the title: that of its project file, unless this has the usual name "block"; else that of
// its image folder; else that of the job directory.
std::string title_of(const BlockResult& result, const std::string& job) {
  const std::string project = std::filesystem::path(result.provenance.project).stem().string();
  if (!project.empty() && project != "block") return project;
  if (std::string name = name_of(result.block.image_folder); !name.empty()) return name;
  return name_of(job);
}

// The name of the job directory, which may be given as "job/" or ".".
std::string name_of(const std::string& job) {
  if (job.empty()) return "";
  const std::filesystem::path path = std::filesystem::absolute(job).lexically_normal();
  return path.has_filename() ? path.filename().string() : path.parent_path().filename().string();
}

}  // namespace

namespace {

std::string page_of(const BlockResult& result, const report::Figures& figures, const ReportContext& context) {
  using namespace report;
  std::string body;
  const auto add = [&](const std::string& section) {
    body += section;
    context.after_reading();
  };
  add(headline(result, figures));
  add(assessment(result, figures, context.diagnostics));
  add(map_section(result, figures, context.after_reading));
  add(coverage_section(result, figures, context.after_reading));
  add(tie_points_section(result, figures, context.after_reading));
  add(residuals_section(result, figures));
  if (context.diagnostics) add(diagnostics_section(result, figures, *context.diagnostics));
  add(images_section(result, figures, context.after_reading));
  add(observations_section(result, figures));
  add(positions_section(result, figures));
  add(attitudes_section(result, figures));
  add(control_section(result, figures));
  add(cameras_section(result, figures));
  add(accuracy_section(result, figures, context.after_reading));
  add(tiles_section(result, figures));
  add(failures_section(result, figures));
  add(stages_section(result));
  add(provenance_section(result, context));
  const std::string name = title_of(result, context.job);
  return page(name.empty() ? "Block report" : "Block report: " + escape(name), subtitle_of(result, figures, context),
              body, figures_json(result, figures));
}

}  // namespace

std::string report_html(const BlockResult& result, const ReportContext& context) {
  return page_of(result, report::figures_of(result), context);
}

struct Report::Gathered {
  report::Figures figures;
  TrackResults drawn;  // a sample of the points, with the images that see them and the flags of kept observations
};

namespace {

TrackResults drawn_of(const TrackBatches& tracks) {
  constexpr std::int64_t kDrawn = 200000;  // largest number of tracks
  TrackResults drawn;
  drawn.tracks.begin.push_back(0);
  visit_sample(tracks, kDrawn, [&](const TrackResults& batch, std::size_t row) {
    drawn.points.push_back(batch.points[row]);
    drawn.tracks.id.push_back(batch.tracks.id[row]);
    const std::int64_t first = batch.tracks.begin[row], last = batch.tracks.begin[row + 1];
    append_rows(batch.tracks.image, first, last, drawn.tracks.image);
    append_rows(batch.kept, first, last, drawn.kept);
    drawn.tracks.begin.push_back(static_cast<std::int64_t>(drawn.tracks.image.size()));
  });
  return drawn;
}

}  // namespace

Report::Report(const BlockResult& result, const TrackBatches& tracks, const std::function<void()>& after_reading) {
  gathered_.reset(new Gathered{report::figures_of(result, tracks, after_reading), drawn_of(tracks)});
}

Report::~Report() = default;
Report::Report(Report&&) noexcept = default;

const ReprojectionStatistics& Report::statistics() const { return gathered_->figures.reprojection; }

std::vector<std::string> Report::remarks(const BlockResult& result) const {
  return megablock::remarks(result, gathered_->figures);
}

std::string Report::html(BlockResult result, const ReportContext& context) && {
  // The maps see the sample as if it were the tracks of the result.
  static_cast<TrackResults&>(result) = std::move(gathered_->drawn);
  std::string page = page_of(result, gathered_->figures, context);
  // The figures leave memory before the result is destroyed, because its destructor touches all frames once more.
  gathered_.reset();
  static_cast<TrackResults&>(result) = {};
  context.after_reading();
  return page;
}

std::string report_html(BlockResult result, const TrackBatches& tracks, const ReportContext& context) {
  Report report(result, tracks);
  return std::move(report).html(std::move(result), context);
}

}  // namespace megablock
