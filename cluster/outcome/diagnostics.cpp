#include "cluster/outcome/diagnostics.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "cluster/job/job_so_far.h"
#include "partition/diagnostics/block_diagnostics.h"
#include "partition/links/link_weights.h"

namespace megablock {

namespace {

// Gathers from tracks the links of frames and, where they are needed, the heights of the points that images see.
class TieGatherer {
 public:
  TieGatherer(const Block& block, bool with_heights) : block_(block) {
    if (with_heights) heights_.resize(block.images.size());
  }

  // `kept` and `points` may be empty: then all observations count, and no points.
  void add(const TrackSet& tracks, const std::vector<std::uint8_t>& kept, const std::vector<Eigen::Vector3d>& points) {
    for (std::size_t t = 0; t < tracks.id.size(); ++t) {
      frames_.clear();
      for (auto o = static_cast<std::size_t>(tracks.begin[t]); o < static_cast<std::size_t>(tracks.begin[t + 1]); ++o) {
        if (!kept.empty() && !kept[o]) continue;
        const ImageIndex image = tracks.image[o];
        frames_.push_back(block_.images[image].frame);
        if (heights_.empty() || t >= points.size() || !std::isfinite(points[t].z())) continue;
        heights_[image].sum += points[t].z();
        ++heights_[image].count;
      }
      std::sort(frames_.begin(), frames_.end());
      frames_.erase(std::unique(frames_.begin(), frames_.end()), frames_.end());
      for (std::size_t i = 0; i < frames_.size(); ++i)
        for (std::size_t j = i + 1; j < frames_.size(); ++j) gathered_.links.add(frames_[i], frames_[j], 1);
    }
  }

  TieEvidence take() {
    for (const Heights& seen : heights_)
      gathered_.ground_height.push_back(seen.count > 0 ? seen.sum / static_cast<double>(seen.count)
                                                       : std::numeric_limits<double>::quiet_NaN());
    return std::move(gathered_);
  }

 private:
  struct Heights {  // heights of points
    double sum = 0;
    std::int64_t count = 0;
  };
  const Block& block_;
  TieEvidence gathered_;
  IndexedVector<ImageIndex, Heights> heights_;
  std::vector<FrameIndex> frames_;  // the frames of one track
};

}  // namespace

BlockDiagnostics diagnose_result(const BlockResult& result, const TrackBatches& tracks,
                                 const DiagnosticsOptions& options) {
  const auto gather = [&](bool with_heights) {
    TieGatherer gatherer(result.block, with_heights);
    tracks.visit([&](const TrackResults& batch) { gatherer.add(batch.tracks, batch.kept, batch.points); });
    return gatherer.take();
  };
  return diagnose(result.block, result.state, gather, options);
}

JobDiagnostics diagnose_job(const JobStore& store) {
  const DiagnosticsOptions options = options_of_job(store).diagnostics;
  if (store.seal(kResult)) {
    const std::string path = store.verified_path(kResult);
    const BlockResult result = read_result_without_tracks(path);
    return {result.block, diagnose_result(result, StoredTracks(path), options), "the result"};
  }
  const JobSoFar job = read_job_so_far(store);
  const auto gather = [&](bool with_heights) {
    TieGatherer gatherer(job.block, with_heights);
    visit_tracks(store, [&](const TrackSet& tracks) { gatherer.add(tracks, {}, {}); });
    return gatherer.take();
  };
  return {job.block, diagnose(job.block, job.state, gather, options), job.source};
}

}  // namespace megablock
