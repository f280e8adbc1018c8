// Refuses control points and warns of other places that are too far from the images to be right (coordinates were
// exchanged, or belong to another coordinate system), and warns of rolling shutters that cannot be corrected.
#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "geometry/numbers/median.h"
#include "io/base/error.h"
#include "io/block/observed_poses.h"
#include "io/project/project_sections.h"

namespace megablock {

namespace {

constexpr double kFar_m = 50e3;

std::string kilometres(double metres) { return std::to_string(std::lround(metres / 1000)) + " km"; }

// Warns of given poses that are far from the observed positions of the same frames. From start values that are some
// hundred metres off, the adjustment still reaches the optimum. From farther away, a block of several tiles may fail
// and then seem to have no datum, because the robust loss gives hardly any weight to positions with residuals of
// thousands of sigmas. Poses that were integrated and have drifted are nearer than this limit.
void warn_of_distant_poses(Project& project) {
  constexpr double kFarOff_m = 300, kFarOffSigmas = 30;
  std::vector<double> distances, sigmas;
  for (const Frame& frame : project.block.frames) {
    if (!frame.position_prior || !frame.given_pose) continue;
    // Large for an unknown height or shift.
    const Eigen::Array3d sigma = loosened(*frame.position_prior, project.block, frame.rig).sigma.array();
    const Eigen::Array3d off = difference(*frame.given_pose, *frame.position_prior).array();
    // A coordinate with a sigma of hundreds of metres says nothing; it does not count.
    distances.push_back((sigma < kFarOff_m).select(off, 0).matrix().norm());
    sigmas.push_back(sigma.minCoeff());
  }
  if (distances.empty()) return;
  const double distance = median(distances);
  if (!(distance > std::max(kFarOff_m, kFarOffSigmas * median(sigmas)))) return;
  project.warnings.push_back(
      "given poses lie " + std::to_string(std::lround(distance)) + " m (median) from the positions of the same " +
      std::to_string(distances.size()) +
      " frames, which is too far for good start values; check that both are in the same coordinate system (origin, "
      "axes, zone), and correct the poses or leave out 'poses' if the block has images");
}

// The place of the images, and how far they reach from it.
struct Extent {
  Eigen::Vector3d centre;
  double radius_m = 0;
  double distance(const Eigen::Vector3d& place) const { return (place - centre).head<2>().norm(); }
};

// Nothing without positions.
std::optional<Extent> extent_of_images(const Block& block) {
  std::vector<double> x, y, z;
  for (const Frame& frame : block.frames) {
    if (!frame.position_prior) continue;
    x.push_back(frame.position_prior->position.x());
    y.push_back(frame.position_prior->position.y());
    z.push_back(frame.position_prior->position.z());
  }
  if (x.empty()) return std::nullopt;
  Extent extent{{median(x), median(y), median(z)}};
  for (std::size_t i = 0; i < x.size(); ++i)
    extent.radius_m = std::max(extent.radius_m, (Eigen::Vector3d(x[i], y[i], z[i]) - extent.centre).norm());
  return extent;
}

// The points that are farther from the images than a limit.
struct FarPoints {
  std::vector<std::size_t> at;  // among the control points of the block
  std::vector<double> distances;
};

FarPoints far_points(const Block& block, const Extent& extent, double limit_m) {
  FarPoints far;
  for (std::size_t p = 0; p < block.control_points.size(); ++p) {
    const double distance = extent.distance(block.control_points[p].position);
    if (distance <= limit_m) continue;
    far.at.push_back(p);
    far.distances.push_back(distance);
  }
  return far;
}

// "3 of 4 control points ('a', 'b', ...) lie 6468 km (median) from the images".
std::string text_of(const FarPoints& far, const Block& block) {
  constexpr std::size_t kNamed = 3;
  std::string names;
  for (std::size_t f = 0; f < std::min(kNamed, far.at.size()); ++f)
    names += (f ? ", '" : "'") + block.control_points[far.at[f]].name + "'";
  if (far.at.size() > kNamed) names += ", ...";
  return std::to_string(far.at.size()) + " of " + std::to_string(block.control_points.size()) + " control points (" +
         names + ") lie " + kilometres(median(far.distances)) + (far.at.size() > 1 ? " (median)" : "") +
         " from the images";
}

// What to do about far points of a table. Exchanged coordinates are tried.
std::string remedy_for(const FarPoints& far, const ControlTable& control, const Extent& extent, double limit_m,
                       const Block& block) {
  const std::size_t first = block.control_points.size() - control.points.size();
  const auto exchanged = exchanged_places(control, block);
  const bool near_then = std::ranges::all_of(far.at, [&](std::size_t p) {
    return p >= first && exchanged[p - first] && extent.distance(*exchanged[p - first]) <= limit_m;
  });
  if (near_then)
    return "with x and y (longitude and latitude, or easting and northing) exchanged they would lie near the images; "
           "exchange these columns, or those of the positions of the images if they are the wrong ones";
  if (control.crs == "local")
    return "the coordinates of the file are local and count from the origin of the block; name their system "
           "('# crs: EPSG:...' in the first line), or correct 'origin'";
  return "its coordinates are probably in another coordinate reference system than '" + control.crs +
         "'; correct the system or the coordinates, or take the file out if it belongs to other images";
}

// A few points that are far off move a block that hangs on them, and all of them move any block.
void check_control(const std::optional<ControlTable>& control, const Extent& extent, Project& project) {
  const Block& block = project.block;
  const double limit_m = std::max(kFar_m, 10 * extent.radius_m);
  const FarPoints far = far_points(block, extent, limit_m);
  const std::string check = "check whether latitude and longitude are exchanged, and check the coordinate system";
  if (!far.at.empty()) {
    const bool of_table = control && far.at.back() >= block.control_points.size() - control->points.size();
    const std::string file = of_table ? control->path : project.file;
    throw InputError(file + ": " + text_of(far, block) + "; " +
                     (of_table ? remedy_for(far, *control, extent, limit_m, block) : check));
  }
  const FarPoints distant = far_points(block, extent, std::max(kFar_m, 0.1 * extent.radius_m));
  if (!distant.at.empty()) project.warnings.push_back(text_of(distant, block) + "; " + check);
}

}  // namespace

void check_distant_places(const std::optional<ControlTable>& control, Project& project) {
  warn_of_distant_poses(project);
  const std::optional<Extent> extent = extent_of_images(project.block);
  if (!extent) return;
  // A tenth of the block's size, so that large blocks may have their origin outside.
  if (extent->centre.norm() > std::max(kFar_m, 0.1 * extent->radius_m))
    project.warnings.push_back("the origin lies " + kilometres(extent->centre.norm()) +
                               " from the images; check whether latitude and longitude are exchanged, and check the "
                               "coordinate system");
  check_control(control, *extent, project);
}

void warn_of_unknown_motion(Project& project) {
  const Block& block = project.block;
  IndexedVector<CameraIndex, std::uint8_t> timed(block.cameras.size(), std::uint8_t{0});
  for (const Frame& frame : block.frames)
    for (const Mount& mount : block.rigs[frame.rig].cameras())
      if (std::isfinite(frame.time_s)) timed[mount.camera] = 1;
  for (CameraIndex c(0); block.cameras.contains(c); ++c.value) {
    const Camera& camera = block.cameras[c];
    // Nobody asked for what a table of cameras says; the stage that asks the images tells what became of it.
    const bool asked_for = (camera.readout_s != 0) != camera.estimate_readout;
    if (timed[c] || !asked_for) continue;
    project.warnings.push_back("camera '" + camera.name +
                               "' has a rolling shutter (readout_ms), but its images have no times; their motion is "
                               "not known and is not corrected; take images with DateTimeOriginal in their EXIF, or "
                               "set readout_ms: 0");
  }
}

}  // namespace megablock
