// The figures the report prints and draws, gathered in a few passes over the result's tracks.
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

// What a pass goes through before it says so (`after_reading` of ReportContext): rows of the table of images, or
// tracks, whose images lie all over it.
inline constexpr std::int64_t kImagesAtATime = 1 << 16, kTracksAtATime = 1 << 13;

// Equal bins from `low`; what lies outside goes to the first or last bin.
struct Histogram {
  double low = 0, width = 1;
  std::vector<std::int64_t> bins;
  void add(double value);
  std::int64_t total() const;
};

// Middle, 95 % and largest of some values; unknown without values.
struct Spread {
  double median = kUnknown, p95 = kUnknown, largest = kUnknown;
};
Spread spread(std::vector<double> values);

using megablock::ResidualField;

struct PositionResidual {
  FrameIndex frame;
  Eigen::Vector3d difference;  // adjusted antenna minus GNSS, east north up, metres
  Eigen::Vector3d sigma;       // stated
};

struct AttitudeResidual {
  FrameIndex frame;
  Eigen::Vector3d difference;  // adjusted after observed attitude: rotation about the rig's x, y, z, radians
  Eigen::Vector3d sigma;       // stated
};

struct PointResidual {
  std::size_t point;           // in block.control_points
  Eigen::Vector3d difference;  // adjusted minus given, metres; NaN where unknown
  // Of the difference: of a check point sqrt(adjusted + given variance), of a control point, which took part,
  // sqrt(given - adjusted variance). NaN where unknown.
  Eigen::Vector3d sigma = Eigen::Vector3d::Constant(kUnknown);
  double ratio = kUnknown;   // largest |difference| / sigma of the axes
  int images = 0;            // with a measurement that takes part
  double rms_px = kUnknown;  // of these; of all measurements when none takes part
};

// An image measurement of a control or check point.
struct MeasurementResidual {
  std::size_t point, measurement;  // in block.control_points
  Eigen::Vector2d residual;        // px, adjusted minus measured
  double ratio;                    // larger component / stated sigma
};

// Reliability of the tie point observations (io/evaluation/reliability.h): each axis of an image is an observation.
struct TestedMeasurement {
  TrackIndex track;  // of the result
  ImageIndex image;
  bool vertical = false;  // the image's y
  double residual = 0;    // px
  double redundancy = 0;  // 0 to 1
  double normalised = 0;  // w
};
struct Reliability {
  static constexpr double kPoorRedundancy = 0.1;
  // Below it |w| is not listed: redundancy numbers are stored in 1 / 255, so that |w| would be off by 5 % and more.
  static constexpr double kListedRedundancy = 0.02;
  std::int64_t tested = 0;          // with redundancy
  std::int64_t unchecked = 0;       // kept, but no other observation checks them
  std::int64_t poorly_checked = 0;  // redundancy below kPoorRedundancy
  std::int64_t beyond_normal = 0;   // |w| above Baarda's critical value
  std::int64_t beyond_tau = 0;      // |tau| above Pope's
  double normal_limit = kUnknown, tau_limit = kUnknown;
  std::vector<TestedMeasurement> largest;  // |w|, largest first
  Spread detectable_px;                    // smallest detectable errors
  double worst_external = kUnknown;        // largest external reliability of the tested, sigmas
};

// Tie point observations whose residuals are near the limit of screening, kept or not: whether they take part hangs on
// what else does.
struct NearLimit {
  static constexpr double kNear = 0.1;  // of the limit, to both sides
  std::int64_t tested = 0, near = 0;
  double expected = 0;  // share that normally distributed errors of the sigma leave there, at most
  double share() const { return tested > 0 ? static_cast<double>(near) / static_cast<double>(tested) : 0; }
};

// What hangs together by kept observations and relative poses.
struct BlockPart {
  std::int64_t frames = 0, images = 0;  // oriented
  int defect = 0;                       // of its datum
  // Its place in the ground frame is observed; else place, direction or more are its own.
  bool placed() const { return defect < 3; }
};

struct Figures {
  ReprojectionStatistics reprojection;
  std::int64_t frames = 0, oriented_frames = 0, boundary_frames = 0, components = 0;
  std::int64_t all_observations = 0;  // of triangulated points, rejected ones included
  Histogram track_length, intersection_deg, residual_px, observations_per_image;
  IndexedVector<ImageIndex, std::int32_t> observations;      // kept, per image
  IndexedVector<CameraIndex, ResidualField> fields;          // kept residuals over the sensors
  IndexedVector<CameraIndex, std::int64_t> camera_images;    // oriented
  double ground_resolution_m = kUnknown;                     // median of distance over focal length
  std::vector<PositionResidual> positions;                   // frames with GNSS and pose, block order
  std::vector<PointResidual> points;                         // control and check points seen
  std::vector<MeasurementResidual> measurements;             // of these, worst first
  std::vector<AttitudeResidual> attitudes;                   // frames with observed attitude and pose, block order
  IndexedVector<ImageIndex, double> image_squares;           // sum of squared kept residuals, px^2
  IndexedVector<ImageIndex, std::int32_t> measured;          // observations in tracks, rejected ones included
  Reliability reliability;                                   // tested = 0: redundancy numbers are not known
  NearLimit near_limit;                                      // tested = 0: no limit is known, or the datum is not free
  std::vector<BlockPart> parts;                              // largest first
  IndexedVector<FrameIndex, std::int32_t> part_of_frame;     // row of parts; -1: not oriented
  Spread sigma_east, sigma_north, sigma_up, sigma_rotation;  // frames; metres, radians (largest of the three axes)
  Spread point_sigma_horizontal, point_sigma_up;
  std::vector<std::int64_t> tile_frames, tile_boundary, tile_observations;
  std::vector<double> tile_rms_px;
  std::vector<ImageIndex> not_oriented;
};

Figures figures_of(const BlockResult& result);
// `after_reading` as in ReportContext.
Figures figures_of(
    const BlockResult& result, const TrackBatches& tracks, const std::function<void()>& after_reading = [] {});

bool oriented(const BlockResult& result, FrameIndex frame);

// Fills in near_limit.
void find_near_limit(const BlockResult& result, const TrackBatches& tracks, Figures& figures);

// Fills in positions and attitudes.
void find_prior_residuals(const BlockResult& result, Figures& figures);

// The first `count` oriented images in an order, without a list of all. `after_reading` as in ReportContext.
using ImageOrder = std::function<bool(ImageIndex, ImageIndex)>;
std::vector<ImageIndex> first_images(const BlockResult& result, std::size_t count, const ImageOrder& before,
                                     const std::function<void()>& after_reading);

double image_rms(const Figures& figures, ImageIndex image);  // px; unknown without observations
Pose image_pose(const BlockResult& result, ImageIndex image);

// Root mean square of the components, each over its finite values; unknown without any.
Eigen::Vector3d root_mean_square(const std::vector<Eigen::Vector3d>& values);

}  // namespace megablock::report
