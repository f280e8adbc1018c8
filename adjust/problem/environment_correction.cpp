// Takes refraction and the curvature of the earth out of measured pixels. The formulas are in
// geometry/camera/environment.h; this file finds the two numbers that they need for every observation.
//
// The correction turns the ray of a pixel in its vertical plane. It depends on h_C, the height of the camera above sea
// level, and on h_X, that of the point: refraction on both heights, curvature on h_C - h_X. In a topocentric ground
// frame with its origin at the height h_0, heights are those above a sphere,
//
//     h(X) = |X - M| - R,   M = (0, 0, -(R + h_0)),   down(X) = (M - X) / |M - X|,
//
// with R the radius of the earth (kEarthRadiusM). In the flat frame of a map projection they are h(X) = z and down =
// -z. The corrections are small and smooth, so that heights and attitudes of start values suffice.
#include "adjust/problem/environment_correction.h"

#include <algorithm>
#include <limits>
#include <string>

#include "geometry/camera/environment.h"
#include "geometry/numbers/median.h"
#include "geometry/transform/pose.h"
#include "io/base/error.h"

namespace megablock {

namespace {

// Heights and verticals at places of the ground frame. The flat frame is that of a block with earth_curvature: its z is
// the height already. A frame without georeference has no height of its origin; its sphere touches z = 0.
class Level {
 public:
  Level(const EnvironmentOptions& options, const GroundFrame& ground)
      : flat_(options.earth_curvature), centre_(0, 0, -kEarthRadiusM - (ground.georeferenced ? ground.height_m : 0)) {}
  double height(const Eigen::Vector3d& place) const {
    return flat_ ? place.z() : (place - centre_).norm() - kEarthRadiusM;
  }
  Eigen::Vector3d down(const Eigen::Vector3d& place) const {
    return flat_ ? Eigen::Vector3d(0, 0, -1) : (centre_ - place).normalized();
  }

 private:
  bool flat_;
  Eigen::Vector3d centre_;  // of the earth
};

// The heights of the points, metres. Unknown ones get the median of the known ones, or NaN when none is known. The
// pixel of a NaN height is not finite, and correct_measurements() leaves it as measured.
std::vector<double> point_heights(const Level& level, const std::vector<Eigen::Vector3d>& points) {
  std::vector<double> heights, known;
  for (const Eigen::Vector3d& point : points) {
    heights.push_back(point.allFinite() ? level.height(point) : std::numeric_limits<double>::quiet_NaN());
    if (point.allFinite()) known.push_back(heights.back());
  }
  if (known.empty()) return heights;
  const double middle = median(std::move(known));
  for (double& height : heights)
    if (!std::isfinite(height)) height = middle;
  return heights;
}

std::string key_of(const EnvironmentOptions& options) {
  return std::string("environment.") + (options.refraction ? "refraction" : "earth_curvature");
}

}  // namespace

void check_environment(const EnvironmentOptions& options, const Block& block) {
  if (options.earth_curvature && block.ground.georeferenced)
    throw InputError(
        "environment.earth_curvature: the block is georeferenced, and its frame (east, north, up about the origin) is "
        "not curved; leave the option out");
  // A free frame may have any tilt and unit, so that it has neither a vertical nor heights.
  const bool placed = std::any_of(block.frames.begin(), block.frames.end(),
                                  [](const Frame& frame) { return frame.position_prior || frame.given_pose; }) ||
                      std::any_of(block.control_points.begin(), block.control_points.end(),
                                  [](const ControlPoint& point) { return point.role == PointRole::kControl; });
  if (options.any() && !placed)
    throw InputError(key_of(options) +
                     ": the block has neither positions nor control points, so that its vertical and its heights are "
                     "not known; give positions or control points, or leave the option out");
  if (options.any() && !block.lines.empty())
    throw InputError(key_of(options) +
                     ": measurements of lines of known direction are not corrected; leave out the lines or the option");
}

void refuse_environment(const EnvironmentOptions& options, const std::string& command) {
  if (options.any())
    throw InputError(key_of(options) + ": '" + command +
                     "' takes measurements as they are; leave the option out of the project file for it");
}

void correct_measurements(const EnvironmentOptions& options, const GroundFrame& ground, const TileState& at,
                          TileProblem& problem) {
  if (!options.any()) return;
  const Level level(options, ground);
  const std::vector<double> heights = point_heights(level, at.points);
  for (std::int64_t p = 0; p < problem.point_count(); ++p) {
    const bool tie = problem.points[p].role == PointRole::kTie;
    for (std::int64_t o = problem.begin[p]; o < problem.begin[p + 1]; ++o) {
      if (!problem.image[o].valid()) continue;
      const TileImage& image = problem.images[problem.image[o].value];
      const Pose camera = camera_pose(at.frames[image.frame.value], at.mounts[image.mount]);
      const double height = level.height(camera.centre);
      const EnvironmentEffect effect{options.refraction ? refraction_constant(height, heights[p]) : 0,
                                     options.earth_curvature ? curvature_constant(height - heights[p]) : 0};
      // The ray that is corrected is the measured one, so that the correction does not depend on how well the pose
      // fits.
      const Eigen::Vector2d pixel =
          geometric_pixel(effect, at.cameras[image.camera.value], {problem.x[o], problem.y[o]},
                          camera.rotation * level.down(camera.centre));
      if (!pixel.allFinite()) continue;
      problem.x[o] = tie ? from_fixed_pixel(to_fixed_pixel(pixel.x())) : pixel.x();
      problem.y[o] = tie ? from_fixed_pixel(to_fixed_pixel(pixel.y())) : pixel.y();
    }
  }
}

}  // namespace megablock
