#include "cluster/stages/result/result_files.h"

#include <algorithm>
#include <filesystem>
#include <functional>
#include <future>
#include <iterator>
#include <string>
#include <utility>

#include "cluster/outcome/diagnostics.h"
#include "cluster/outcome/result_figures.h"
#include "cluster/process/process_memory.h"
#include "io/report/report.h"
#include "io/store/job/events.h"

namespace megablock {

namespace {

// The columns of a batch of tracks have some hundred KiB each. In the heap they would be placed in ever different holes
// that the merge has left there, until all of these holes are in memory: 60 MiB on the first rank for a million images.
constexpr int kColumn = 1 << 17;  // bytes

// Reports the beginning of the gathering, when the tracks are first read.
class AnnouncedTracks final : public TrackBatches {
 public:
  AnnouncedTracks(const TrackBatches& tracks, std::function<void()> begin)
      : tracks_(tracks), begin_(std::move(begin)) {}
  std::int64_t track_count() const override { return tracks_.track_count(); }
  void visit(const Visit& visit) const override {
    begin_();
    tracks_.visit(visit);
  }

 private:
  const TrackBatches& tracks_;
  std::function<void()> begin_;
};

}  // namespace

void write_result_files(const JobStore& store, PagedTables& tables, std::uint64_t fingerprint, BlockResult result,
                        std::vector<PartTracks::File> parts, const DiagnosticsOptions& options) {
  std::filesystem::create_directories(store.path("result"));
  map_blocks_from(kColumn);
  tables.put(result.frame_covariance);
  tables.put(result.aligned_covariance);
  tables.put(result.empirical.frame_covariance);
  tables.put(result.empirical.aligned_covariance);
  const auto release = [&tables] { tables.release(); };
  const auto release_all = [&tables] {
    tables.release();
    return_freed_memory();
  };
  release_all();  // the parts from which the result was put together
  const PartTracks tracks(std::move(parts), result.sigma_scaled ? result.variance_factor : 1, release_all);
  const auto gather = [&] {
    BlockDiagnostics diagnostics = diagnose_result(result, tracks, options);
    release_all();  // links of frames
    return std::pair(std::move(diagnostics), Report(result, tracks, release_all));
  };
  // Gathering and writing each read all tracks, while the other ranks have nothing left to do, and run at the same
  // time. The gathering only starts when the tables at the beginning of the file are written, because it begins by
  // reading them too.
  std::future<std::pair<BlockDiagnostics, Report>> gathered;
  const AnnouncedTracks announced(tracks, [&] {
    release_all();
    gathered = std::async(std::launch::async, gather);
  });
  store.write(kResult, fingerprint, [&](const std::string& path) { write_result(path, result, announced, release); });
  auto [diagnostics, report] = gathered.get();
  release_all();
  ResultFigures figures{report.statistics(), report.remarks(result)};
  std::ranges::move(loose_part_remarks(diagnostics, result.block), std::back_inserter(figures.remarks));
  release_all();
  store.write_text(kResultFigures, to_json(figures, result));
  store.write_text(kDiagnostics, to_json(diagnostics, result.block));
  const ReportContext context{store.directory(), seconds_since_1970(), &diagnostics, release_all};
  store.write_text(kReportPage, std::move(report).html(std::move(result), context));
}

}  // namespace megablock
