// Writes and reads the result of a job, in one file (result/block.h5). Exports, the report and `evaluate` read only
// this file.
//
// Covariances are those of the increments by which the adjustment moves the unknowns: a rotation R becomes R Exp(w), a
// centre C becomes C + d, with (w, d) in this order. For a frame w is about the axes of the ground, for a mount about
// those of the rig.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "io/block/block.h"
#include "io/block/image_graph.h"
#include "io/block/observation_statistics.h"
#include "io/block/observed_poses.h"
#include "io/block/tracks.h"

namespace megablock {

class TrackBatches;

struct FailedUnit {
  std::string stage, unit, reason;
};

struct StageStatistics {
  std::string name;
  double seconds = 0;       // duration of the stage by the wall clock
  double peak_rss_mib = 0;  // of the rank with the largest memory
  std::int64_t units = 0, failed = 0;
};

struct SeamCheck {
  std::int64_t node = -1;  // node of the merge tree
  double statistic = 0;    // T, chi-square distributed
  std::int64_t degrees = 0;
  double threshold = 0;
  std::string note;  // on an alarm: names the suspected tile
};

// One option of the job, written as in a project file.
struct OptionRecord {
  std::string name;  // "section.key"
  std::string value, default_value;
};

// The origin of the result. It contains no times, so that equal results are equal files.
struct Provenance {
  std::string project;     // name of the project file
  std::string program;     // "megablock 0.1.0"
  std::string arithmetic;  // level
  std::vector<OptionRecord> options;
};

// A connected part of the block whose datum the observations do not determine completely.
struct FreePart {
  FrameIndex frame;         // its first frame
  std::int32_t defect = 0;  // number of undetermined parameters; 7: place, direction and scale are arbitrary
};

// Figures of an image from the stages before the adjustment; -1 = unknown.
struct ImageRecord {
  std::int32_t width = -1, height = -1;  // of the decoded image, px
  std::int64_t features = -1;
  std::int64_t matched_images = -1;  // number of images with which it has verified matches
  std::int64_t matches = -1;         // number of matches with all of these images
};

// The tracks of a result, or one batch of them (io/result/track_batches.h).
struct TrackResults {
  TrackSet tracks;
  std::vector<Eigen::Vector3d> points;            // [tracks] ground frame, metres; NaN = not triangulated
  std::vector<TrackIndex> file_tracks;            // [tracks] or empty: the index in the file of the tile
  std::vector<TileIndex> file_tiles;              // [tracks] or empty: the tile that owns the track
  std::vector<Eigen::Matrix3d> point_covariance;  // [tracks] or empty
  std::vector<std::uint8_t> kept;                 // [observations]
  std::vector<float> residual_x, residual_y;      // [observations] adjusted minus measured, px
  // [observations] or empty: redundancy numbers along x and y (io/evaluation/reliability.h) in units of 1 / 255. 0 also
  // stands for an observation that takes no part.
  std::vector<std::uint8_t> redundancy_x, redundancy_y;

  // Appends the tracks [first, last) of `from`.
  void append(const TrackResults& from, std::size_t first, std::size_t last);
  // Removes all tracks, but keeps their memory for the next ones.
  void clear();
};

// A result. Depending on the function that returns it, it has all tracks in global order, a sample of them, or none.
struct BlockResult : TrackResults {
  Block block;
  BlockState state;
  Tiles tiles;
  IndexedVector<FrameIndex, std::uint8_t> boundary;  // 1 = touched by two or more tiles

  // Posterior covariances with the a-priori variance factor 1, unless sigma_scaled. Empty if they were not computed.
  using Matrix6 = Eigen::Matrix<double, 6, 6>;
  // Of the rotation increment (radians) and the centre (metres). Where the datum is free, they belong to inner
  // constraints over the poses of the part (docs/reference/methods.md, "Sigmas").
  IndexedVector<FrameIndex, Matrix6> frame_covariance;
  // The same after the best-fit similarity of all positions, as a comparison with given positions needs them. Empty
  // where the datum is not free; NaN or zero where such a fit does not exist.
  IndexedVector<FrameIndex, Matrix6> aligned_covariance;
  // The covariance of all poses together, in the same datum. Only for blocks of few frames, else empty.
  struct JointCovariance {
    std::vector<FrameIndex> frames;  // ascending
    Eigen::MatrixXd matrix;          // [6 frames x 6 frames]
  };
  JointCovariance joint_covariance;
  // Of the parameters of the camera model; zero for held ones.
  IndexedVector<CameraIndex, Eigen::MatrixXd> camera_covariance;
  // [rigs][mounts] of PoseIncrement: rotation increment about the rig's axes (radians), centre (metres); zero for held
  // mounts.
  IndexedVector<RigIndex, std::vector<Matrix6>> mount_covariance;

  struct ControlResult {
    Eigen::Vector3d adjusted;  // ground frame, metres; NaN = fewer than two oriented images see the point
    Eigen::Matrix3d covariance;
    std::vector<Eigen::Vector2d> residual_px;  // [measurements] NaN = the image is not oriented
    std::vector<std::uint8_t> kept = {};       // [measurements] 1 = takes part in the adjustment; empty: unknown
    bool takes_part(std::size_t measurement) const {
      return residual_px[measurement].allFinite() && (kept.empty() || kept[measurement]);
    }
    bool takes_part() const;  // whether any measurement does; otherwise the position does not depend on the block
  };
  std::vector<ControlResult> control;  // in block order
  // Gross errors that the adjustment has set aside (adjust/checks/prior_test.h), ascending.
  std::vector<FrameIndex> positions_aside;
  std::vector<std::int64_t> control_aside;  // rows of `control`

  // The empirical covariances of the same unknowns, which residuals show (docs/reference/methods.md, "Sigmas"); those
  // above are the formal ones. Never multiplied by the variance factor. Empty if they were not computed.
  struct Empirical {
    IndexedVector<FrameIndex, Matrix6> frame_covariance, aligned_covariance;
    JointCovariance joint_covariance;
    IndexedVector<CameraIndex, Eigen::MatrixXd> camera_covariance;
    IndexedVector<RigIndex, std::vector<Matrix6>> mount_covariance;
    std::vector<Eigen::Matrix3d> control;  // [control]
  } empirical;

  // Figures, which `status --json` prints.
  // chi2 = sum of squared weighted residuals, with the weights of the robust loss; variance_factor = chi2 /
  // degrees_of_freedom, the square of sigma naught.
  double variance_factor = 1;  // a posteriori; = chi2_per_dof
  double chi2 = 0;
  std::int64_t degrees_of_freedom = 0;
  double image_sigma_px = 0;                   // of a tie point observation per axis, as used in the adjustment
  ObservationTable observation_table;          // by kind: count, weighted squares, redundancy; empty: unknown
  std::vector<PositionScale> position_scales;  // of groups that have factors of their own, ascending
  bool sigma_scaled = false;                   // true: covariances are multiplied by variance_factor
  int global_iterations = 0;
  double newton_decrement = 0;
  double decrement_limit = 0;  // the adjustment has converged if the decrement is not above it; 0: unknown
  std::vector<FreePart> free_parts;
  IndexedVector<ImageIndex, ImageRecord> image_records;  // empty if the job did not start from images
  Provenance provenance;
  std::string gauge;  // the datum in words: "fixed by priors", "free, inner constraints over N frames", ...
  std::vector<SeamCheck> seams;
  std::vector<FailedUnit> failures;  // images and units, with reasons
  std::vector<StageStatistics> stages;
  std::vector<std::string> notes;  // warnings for the report, one line each
  std::string digest;              // see result_digest()
};

// Writers throw as Hdf5Writer does, and ComputeError for columns of different length. Readers throw StoreError.
void write_result(const std::string& path, const BlockResult& result);
// Writes a result with these tracks instead of its own, and sets its digest. `after_table` is called after every table
// before and after the tracks is written.
class TrackBatches;
void write_result(const std::string& path, BlockResult& result, const TrackBatches& tracks,
                  std::function<void()> after_table = {});
BlockResult read_result(const std::string& path);
// Reads everything except the tracks. StoredTracks (io/result/track_batches.h) reads these in batches.
BlockResult read_result_without_tracks(const std::string& path);
std::string read_result_digest(const std::string& path);

// Hash of the exact bits of all poses, cameras, points and kept observations in global order. It does not depend on the
// layout of files, on the files of tiles, and on the number of ranks. In this order enter
//
//   number of frames; per frame: whether it is oriented, then quaternion (w, x, y, z) and centre if it is
//   number of cameras; the parameters of each in the order of its model
//   number of rigs; per rig: number of mounts, pose of each
//   number of tracks; per track, by ascending index: index, whether it has a position, position,
//                     (image, x, y) of its kept observations
//
// Numbers before lists keep two different results from giving the same sequence. Everything else follows from these
// numbers (residuals, covariances) or is a record (times, notes), so it does not enter. Equal digests therefore mean:
// the same result, bit by bit.
std::string result_digest(const BlockResult& result);

// Mean and root mean square of the lengths of residuals (not per axis: for normal residuals the rms per axis is rms_px
// / sqrt 2), over the kept observations of triangulated points.
struct ReprojectionStatistics {
  std::int64_t oriented_images = 0, points = 0, observations = 0;
  double mean_px = 0, rms_px = 0, mean_track_length = 0;
};
ReprojectionStatistics reprojection_statistics(const BlockResult& result);
ReprojectionStatistics reprojection_statistics(const BlockResult& result, const TrackBatches& tracks);

}  // namespace megablock
