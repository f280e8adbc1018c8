// Gathers the figures that the report prints and draws. The tracks of a large result do not fit into memory, so all
// figures are gathered in a few loops over their batches.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <limits>
#include <vector>

#include "io/block/residual_field.h"
#include "io/result/result.h"
#include "io/result/track_batches.h"

namespace megablock::report {

inline constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

// Number of images, or of tracks, that are read between two calls of `after_reading` (ReportContext). The images of
// tracks are spread over the whole table of images, so their number is smaller.
inline constexpr std::int64_t kImagesAtATime = 1 << 16, kTracksAtATime = 1 << 13;

// Equal bins that begin at `low`. Values outside count in the first or last bin.
struct Histogram {
  double low = 0, width = 1;
  std::vector<std::int64_t> bins;
  void add(double value);
  std::int64_t total() const;
};

// Median, 95 % quantile and largest of some values; unknown without values.
struct Spread {
  double median = kUnknown, p95 = kUnknown, largest = kUnknown;
};
// Quantiles are values of the sample, without interpolation: the one at rank floor(share (n - 1)).
Spread spread(std::vector<double> values);

using megablock::ResidualField;

struct PositionResidual {
  FrameIndex frame;
  Eigen::Vector3d difference;  // adjusted minus observed position of the antenna; east, north, up; metres
  Eigen::Vector3d sigma;       // of the observation, as the adjustment used it (used_sigmas.h)
};

struct AttitudeResidual {
  FrameIndex frame;
  Eigen::Vector3d difference;  // rotation from the observed to the adjusted attitude about the rig's axes, radians
  Eigen::Vector3d sigma;       // stated, of the observation
};

struct PointResidual {
  std::size_t point;           // row of block.control_points
  Eigen::Vector3d difference;  // adjusted minus given position, metres; NaN where unknown
  // Sigma of the difference: sqrt(adjusted + given variance) for a check point, sqrt(given - adjusted variance) for a
  // control point, whose given position took part. NaN where unknown.
  Eigen::Vector3d sigma = Eigen::Vector3d::Constant(kUnknown);
  double ratio = kUnknown;   // largest |difference| / sigma of the three axes
  int images = 0;            // number of images with a measurement that takes part
  double rms_px = kUnknown;  // of the residuals of these measurements, or of all if none takes part
};

// An image measurement of a control or check point.
struct MeasurementResidual {
  std::size_t point, measurement;  // row of block.control_points, and of its measurements
  Eigen::Vector2d residual;        // px, adjusted minus measured
  double ratio;                    // larger component / stated sigma
};

// Reliability of the tie point observations (io/evaluation/reliability.h). Each of the two image coordinates is tested
// as one observation.
struct TestedMeasurement {
  TrackIndex track;  // index in the result
  ImageIndex image;
  bool vertical = false;  // true: y of the image; false: x
  double residual = 0;    // px
  double redundancy = 0;  // 0 to 1
  double normalised = 0;  // w
};
struct Reliability {
  static constexpr double kPoorRedundancy = 0.1;
  // Observations with less redundancy are not listed. Redundancy numbers are stored in units of 1 / 255, so their |w|
  // would be wrong by 5 % or more.
  static constexpr double kListedRedundancy = 0.02;
  std::int64_t tested = 0;          // number of kept observations with redundancy
  std::int64_t unchecked = 0;       // number of kept observations that no other observation checks
  std::int64_t poorly_checked = 0;  // redundancy below kPoorRedundancy
  std::int64_t beyond_normal = 0;   // |w| above Baarda's critical value
  std::int64_t beyond_tau = 0;      // |tau| above Pope's critical value
  double normal_limit = kUnknown, tau_limit = kUnknown;
  std::vector<TestedMeasurement> largest;  // the observations with the largest |w|, largest first
  Spread detectable_px;                    // smallest detectable errors
  double worst_external = kUnknown;        // largest external reliability of the tested observations, sigmas
};

// Tie point observations whose residuals are near the limit of screening, kept or rejected. Small changes of the other
// observations decide whether these take part.
struct NearLimit {
  static constexpr double kNear = 0.1;  // distance from the limit, as a share of it, to both sides
  // Sigmas. A wider limit keeps everything but gross errors, and no normal error comes near it.
  static constexpr double kWidest = 10;
  std::int64_t tested = 0, near = 0;
  // The length of a residual with normal x and y of sigma s exceeds k s with probability exp(-k^2 / 2) (Rayleigh). With
  // the limit at k sigmas, the band holds exp(-(0.9 k)^2 / 2) - exp(-(1.1 k)^2 / 2). Residuals have less than the
  // sigma of their observations, so this is an upper bound.
  double expected = 0;  // largest share of normally distributed errors with this sigma that lies there
  double share() const { return tested > 0 ? static_cast<double>(near) / static_cast<double>(tested) : 0; }
};

// A part of the block that kept observations and relative poses connect.
struct BlockPart {
  std::int64_t frames = 0, images = 0;  // oriented ones
  int defect = 0;                       // number of datum parameters that no observation determines
  // Whether observations determine its place in the ground frame; otherwise at least its place or direction is
  // arbitrary.
  bool placed() const { return defect < 3; }
  // Whether observations determine its scale. Nothing does where place or direction and the scale are free (four), and
  // where all seven are.
  bool scaled() const { return defect != 4 && defect < 7; }
};

struct Figures {
  ReprojectionStatistics reprojection;
  std::int64_t frames = 0, oriented_frames = 0, boundary_frames = 0, components = 0;
  std::int64_t all_observations = 0;  // of triangulated points, including rejected ones
  Histogram track_length, intersection_deg, residual_px, observations_per_image;
  IndexedVector<ImageIndex, std::int32_t> observations;      // number of kept observations
  IndexedVector<CameraIndex, ResidualField> fields;          // kept residuals over the sensors
  IndexedVector<CameraIndex, std::int64_t> camera_images;    // number of oriented images
  double ground_resolution_m = kUnknown;                     // median of distance over focal length
  std::vector<PositionResidual> positions;                   // frames with GNSS and pose, in block order
  std::vector<PointResidual> points;                         // control and check points that images see
  std::vector<MeasurementResidual> measurements;             // those of control and check points, worst first
  std::vector<AttitudeResidual> attitudes;                   // frames with observed attitude and pose, in block order
  IndexedVector<ImageIndex, double> image_squares;           // sum of squared kept residuals, px^2
  IndexedVector<ImageIndex, std::int32_t> measured;          // number of observations in tracks, with rejected ones
  Reliability reliability;                                   // tested = 0: redundancy numbers are unknown
  NearLimit near_limit;                                      // tested = 0: nothing depends on it (figures.cpp)
  std::vector<BlockPart> parts;                              // largest first
  IndexedVector<FrameIndex, std::int32_t> part_of_frame;     // row of parts; -1: not oriented
  Spread sigma_east, sigma_north, sigma_up, sigma_rotation;  // frames; metres, radians (largest of the three axes)
  Spread point_sigma_horizontal, point_sigma_up;
  std::vector<std::int64_t> tile_frames, tile_boundary, tile_observations;
  std::vector<double> tile_rms_px;
  std::vector<ImageIndex> not_oriented;
};

// `after_reading` is that of ReportContext, here and below.
Figures figures_of(const BlockResult& result);
Figures figures_of(
    const BlockResult& result, const TrackBatches& tracks, const std::function<void()>& after_reading = [] {});

bool oriented(const BlockResult& result, FrameIndex frame);

// Fills in near_limit.
void find_near_limit(const BlockResult& result, const TrackBatches& tracks, Figures& figures);

// Fills in positions and attitudes.
void find_prior_residuals(const BlockResult& result, Figures& figures);

// The first `count` oriented images in the given order. No list of all images is made.
using ImageOrder = std::function<bool(ImageIndex, ImageIndex)>;
std::vector<ImageIndex> first_images(const BlockResult& result, std::size_t count, const ImageOrder& before,
                                     const std::function<void()>& after_reading);

double image_rms(const Figures& figures, ImageIndex image);  // px; unknown without observations
Pose image_pose(const BlockResult& result, ImageIndex image);

// Root mean square of each component over its finite values; unknown without any.
Eigen::Vector3d root_mean_square(const std::vector<Eigen::Vector3d>& values);

}  // namespace megablock::report
