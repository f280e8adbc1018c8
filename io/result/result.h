// The result of a job: everything that exports, the report and `evaluate` read. One file, result/block.h5.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "io/block/block.h"
#include "io/block/image_graph.h"
#include "io/block/observation_statistics.h"
#include "io/block/tracks.h"

namespace megablock {

class TrackBatches;

struct FailedUnit {
  std::string stage, unit, reason;
};

struct StageStatistics {
  std::string name;
  double seconds = 0;       // wall clock of the stage
  double peak_rss_mib = 0;  // largest of the ranks
  std::int64_t units = 0, failed = 0;
};

struct SeamCheck {
  std::int64_t node = -1;  // of the merge tree
  double statistic = 0;    // T, chi-square distributed
  std::int64_t degrees = 0;
  double threshold = 0;
  std::string note;  // names the suspected tile on alarm
};

// One option of the job, as a project file would say it.
struct OptionRecord {
  std::string name;  // "section.key"
  std::string value, default_value;
};

// What made the result. No times: equal results are equal files.
struct Provenance {
  std::string project;     // name of the project file
  std::string program;     // "megablock 0.1.0"
  std::string arithmetic;  // level
  std::vector<OptionRecord> options;
};

// A connected part of the block whose place nothing fixes completely.
struct FreePart {
  FrameIndex frame;         // its first one
  std::int32_t defect = 0;  // of its datum: 7 = place, direction and scale are its own
};

// What the stages before the adjustment made of an image; -1 = not known.
struct ImageRecord {
  std::int32_t width = -1, height = -1;  // of the decoded image, px
  std::int64_t features = -1;
  std::int64_t matched_images = -1;  // with verified matches
  std::int64_t matches = -1;         // in all of these pairs
};

// What is known of tracks: of all of a result, or of one batch of them (io/result/track_batches.h).
struct TrackResults {
  TrackSet tracks;                                // point NaN = not triangulated
  std::vector<Eigen::Vector3d> points;            // [tracks]
  std::vector<TrackIndex> file_tracks;            // [tracks] or empty: their indices in the file of their tile
  std::vector<TileIndex> file_tiles;              // [tracks] or empty: that tile
  std::vector<Eigen::Matrix3d> point_covariance;  // [tracks] or empty
  std::vector<std::uint8_t> kept;                 // [observations]
  std::vector<float> residual_x, residual_y;      // [observations] adjusted minus measured, px
  // [observations] or empty: redundancy numbers along x and y (io/evaluation/reliability.h) in 1 / 255; 0: takes no
  // part.
  std::vector<std::uint8_t> redundancy_x, redundancy_y;

  // Rows [first, last) of another one's tracks.
  void append(const TrackResults& from, std::size_t first, std::size_t last);
  // No tracks; their memory stays for the next ones.
  void clear();
};

// Its own tracks are those of all tiles in global order, a sample of them, or none: as the function says that gives it.
struct BlockResult : TrackResults {
  Block block;
  BlockState state;
  Tiles tiles;
  IndexedVector<FrameIndex, std::uint8_t> boundary;  // 1 = touched by two or more tiles

  // Posterior covariances, a-priori variance factor 1 unless scaled. Empty when not computed.
  using Matrix6 = Eigen::Matrix<double, 6, 6>;
  IndexedVector<FrameIndex, Matrix6> frame_covariance;  // (rotation increment rad, centre m)
  // Of the model's parameters; held ones: zero.
  IndexedVector<CameraIndex, Eigen::MatrixXd> camera_covariance;
  // [rigs][mounts] of PoseIncrement (rotation increment about the rig's axes rad, centre m); held ones: zero.
  IndexedVector<RigIndex, std::vector<Matrix6>> mount_covariance;

  struct ControlResult {
    Eigen::Vector3d adjusted;  // ground frame; NaN = not seen by two oriented images
    Eigen::Matrix3d covariance;
    std::vector<Eigen::Vector2d> residual_px;  // per measurement; NaN = image not oriented
    std::vector<std::uint8_t> kept = {};       // per measurement: takes part in the adjustment; empty: not known
    bool takes_part(std::size_t measurement) const {
      return residual_px[measurement].allFinite() && (kept.empty() || kept[measurement]);
    }
    bool takes_part() const;  // some measurement does: else the position says nothing of the block
  };
  std::vector<ControlResult> control;  // in block order

  // Figures (status --json).
  double variance_factor = 1;  // a-posteriori, = chi2_per_dof
  double chi2 = 0;
  std::int64_t degrees_of_freedom = 0;
  double image_sigma_px = 0;           // of tie point observations per axis, as adjusted with (stated or estimated)
  ObservationTable observation_table;  // by kind: count, weighted squares, redundancy; empty: not known
  bool sigma_scaled = false;           // covariances are multiplied by variance_factor
  int global_iterations = 0;
  double newton_decrement = 0;
  double decrement_limit = 0;  // at which the block counts as adjusted; 0: not known
  std::vector<FreePart> free_parts;
  IndexedVector<ImageIndex, ImageRecord> image_records;  // empty when the job did not start from images
  Provenance provenance;
  std::string gauge;  // "fixed by priors" or "free, inner constraints over N frames" ...
  std::vector<SeamCheck> seams;
  std::vector<FailedUnit> failures;  // images and units, with reasons
  std::vector<StageStatistics> stages;
  std::vector<std::string> notes;  // warnings for the report, one line each
  std::string digest;              // see result_digest()
};

void write_result(const std::string& path, const BlockResult& result);
// With these tracks instead of the result's own; fills in its digest. `after_table` is called behind every table that
// is written, before the tracks and after them.
class TrackBatches;
void write_result(const std::string& path, BlockResult& result, const TrackBatches& tracks,
                  std::function<void()> after_table = {});
BlockResult read_result(const std::string& path);
// Without tracks: these batch by batch as StoredTracks (io/result/track_batches.h).
BlockResult read_result_without_tracks(const std::string& path);
std::string read_result_digest(const std::string& path);

// Hash of the exact bits of every pose, camera, point and kept observation in global order; independent of file layout,
// tiles' files and ranks.
std::string result_digest(const BlockResult& result);

// Means over kept observations of triangulated points: Euclidean residual length, and its root mean square.
struct ReprojectionStatistics {
  std::int64_t oriented_images = 0, points = 0, observations = 0;
  double mean_px = 0, rms_px = 0, mean_track_length = 0;
};
ReprojectionStatistics reprojection_statistics(const BlockResult& result);
ReprojectionStatistics reprojection_statistics(const BlockResult& result, const TrackBatches& tracks);

}  // namespace megablock
