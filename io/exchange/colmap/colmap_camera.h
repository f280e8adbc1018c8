// Translates the cameras of COLMAP's files by the table of camera models. Internal to io/.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "io/block/block.h"

namespace megablock {

// One of COLMAP's camera models with the model of the same projection.
struct ColmapCameraForm {
  int number;        // in binary files
  std::string name;  // in text files
  CameraModelKind kind;
  std::vector<std::string> parameters;  // in the order of the files
};
// All that the table of camera models names, in the order of their numbers.
const std::vector<ColmapCameraForm>& colmap_camera_forms();

struct ColmapCamera {
  const ColmapCameraForm* form;
  std::vector<double> parameters;
};
// The first of COLMAP's models that holds all parameters which are not zero, except for a skew, which none of them has.
// Throws InputError, which names the camera, if COLMAP has none for the camera's model.
ColmapCamera to_colmap(const std::string& camera, const Intrinsics& k);
// The pixel that a camera without the skew b2 would have measured of the same ray: u - b2 y' with y' = (v - cy) / f.
Eigen::Vector2d without_skew(const Intrinsics& k, const Eigen::Vector2d& pixel);

// The camera of a form and its parameters. `refusal`, empty where it is possible, says why it is not.
struct CameraFromColmap {
  Intrinsics intrinsics;
  std::string refusal;
};
CameraFromColmap from_colmap(const ColmapCameraForm& form, const std::vector<double>& parameters);

}  // namespace megablock
