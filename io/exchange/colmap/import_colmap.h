// What the two readers of COLMAP models share. Internal to io/.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "io/exchange/colmap/colmap_camera.h"
#include "io/exchange/model/imported_block.h"

namespace megablock {

// The camera model with this name in COLMAP. Ends with `fail` when it is none of colmap_camera_forms().
const ColmapCameraForm& colmap_camera_form(const std::string& name,
                                           const std::function<void(const std::string&)>& fail);

// Puts the parts of a model together: points, then cameras, then images with their observations.
class ColmapBuilder {
 public:
  // Throws InputError with the place in the file that is read now; to be set before anything is added.
  std::function<void(const std::string&)> fail;

  void add_point(std::int64_t id, const Eigen::Vector3d& position);
  void add_camera(std::int64_t id, const ColmapCameraForm& form, std::int64_t width, std::int64_t height,
                  const std::vector<double>& parameters);
  // q = (w, x, y, z) and t of X_cam = R X + t.
  void add_image(std::int64_t id, const std::array<double, 4>& q, const Eigen::Vector3d& translation,
                 std::int64_t camera, const std::string& name);
  // Of the image added last; point -1: none.
  void add_observation(double x, double y, std::int64_t point);

  ImportedBlock finish();

 private:
  struct Observation {
    std::int64_t point;
    ImageIndex image;
    double x, y;
  };
  void make_tracks();

  ImportedBlock imported_;
  std::map<std::int64_t, CameraIndex> cameras_;
  std::map<std::int64_t, Eigen::Vector3d> points_;
  std::vector<Observation> observations_;
};

ImportedBlock import_colmap_text(const std::string& folder);
ImportedBlock import_colmap_binary(const std::string& folder);

}  // namespace megablock
