// Builds a block from a COLMAP model, for the readers of text and binary files. Internal to io/.
//
// COLMAP's conventions are ours (export_colmap.h): X_cam = R X + t with x right, y down, z ahead, so the centre is C =
// -R' t; pixel centres are at +0.5. The points come first, because an observation that names a missing point is an
// error.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "io/exchange/colmap/colmap_camera.h"
#include "io/exchange/model/imported_block.h"

namespace megablock {

// The camera model with this name in COLMAP. Calls `fail`, which throws, for a name that colmap_camera_forms() does not
// have.
const ColmapCameraForm& colmap_camera_form(const std::string& name,
                                           const std::function<void(const std::string&)>& fail);

// Assembles a model from its parts, which must come in this order: points, cameras, images with their observations.
class ColmapBuilder {
 public:
  // Throws InputError with the present place in the file. It must be set before anything is added.
  std::function<void(const std::string&)> fail;

  void add_point(std::int64_t id, const Eigen::Vector3d& position);
  void add_camera(std::int64_t id, const ColmapCameraForm& form, std::int64_t width, std::int64_t height,
                  const std::vector<double>& parameters);
  // Adds an image with q = (w, x, y, z) and t of X_cam = R X + t.
  void add_image(std::int64_t id, const std::array<double, 4>& q, const Eigen::Vector3d& translation,
                 std::int64_t camera, const std::string& name);
  // Adds an observation in the last image; point -1 stands for none.
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
