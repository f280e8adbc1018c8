// Warns of places that are too far from the images to be right (coordinates were exchanged, or belong to another
// coordinate system), and of rolling shutters that cannot be corrected.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "geometry/numbers/median.h"
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

}  // namespace

void warn_of_distant_places(Project& project) {
  warn_of_distant_poses(project);
  std::vector<double> x, y, z;
  for (const Frame& frame : project.block.frames) {
    if (!frame.position_prior) continue;
    x.push_back(frame.position_prior->position.x());
    y.push_back(frame.position_prior->position.y());
    z.push_back(frame.position_prior->position.z());
  }
  if (x.empty()) return;
  const Eigen::Vector3d images(median(x), median(y), median(z));
  double extent = kFar_m;
  for (std::size_t i = 0; i < x.size(); ++i)
    // A tenth of the block's size, so that large blocks may have their origin outside.
    extent = std::max(extent, 0.1 * (Eigen::Vector3d(x[i], y[i], z[i]) - images).norm());
  const std::string remedy = "; check whether latitude and longitude are exchanged, and check the coordinate system";
  if (images.norm() > extent)
    project.warnings.push_back("the origin lies " + kilometres(images.norm()) + " from the images" + remedy);
  for (const ControlPoint& point : project.block.control_points) {
    const double distance = (point.position - images).head<2>().norm();
    if (distance > extent)
      project.warnings.push_back("control point '" + point.name + "' lies " + kilometres(distance) +
                                 " from the images" + remedy);
  }
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
