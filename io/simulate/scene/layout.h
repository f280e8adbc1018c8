// Builds the frames, rigs and images of a simulated block, with the true values beside those that the job gets.
//
// Truth and job differ only in the parameters that the job estimates: the true cameras, mounts and poses are in
// `truth`, and the observations are computed from them. The block holds the initial values and the priors.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "geometry/camera/rolling_shutter.h"
#include "io/simulate/scene/scene.h"

namespace megablock {

// The frames, rigs and images of a block with their true poses, without priors and observations. The images of a frame
// follow one another: image = frame * cameras + mount.
struct Layout {
  Block block;  // cameras have the values that the job will get
  BlockState truth;
  std::unique_ptr<Scene> scene;
  std::vector<Eigen::Vector3d> control_truth;  // positions [block.control_points]
  std::vector<std::string> image_suffixes;     // [mounts] ends of image names; empty: "_c0", ..., none for one camera
  std::vector<Eigen::Vector2d> crossings;      // of streets with frames; zones of control may be there
  // Of rolling shutters: the true readout time, and the true motions [frames]; 0 and empty without.
  double readout_s = 0;
  std::vector<Motion> motions;
};

// Adds a camera with its nominal values in the block and its true values in the state (SimulationOptions::distortion,
// calibrate).
CameraIndex add_simulated_camera(const SimulationOptions& options, Layout& layout);
// Adds such a camera and the only rig of the block, which has this one camera. Returns the camera.
CameraIndex add_single_camera_rig(const SimulationOptions& options, Layout& layout);
// Adds a frame with one image for each mount of the only rig. Its motion is for rolling shutters only.
void add_simulated_frame(Layout& layout, const Pose& pose, std::int64_t pass, double time_s,
                         const std::optional<Motion>& motion = {});

}  // namespace megablock
