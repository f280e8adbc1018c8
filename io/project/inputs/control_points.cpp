// Adds the control points of a table to the block: finds their images by name, and converts image coordinates to pixels
// and positions to the ground frame.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>

#include "io/base/error.h"
#include "io/block/held_priors.h"
#include "io/project/inputs/control_file.h"

namespace megablock {

namespace {

// The images by their name, and also by its last part where that is unique: control files often leave folders out.
std::map<std::string, ImageIndex> images_by_name(const Block& block) {
  std::map<std::string, ImageIndex> by_name, by_last;
  for (std::size_t i = 0; i < block.images.size(); ++i) {
    const ImageIndex image(static_cast<std::int64_t>(i));
    const std::string& name = block.name_of(image);
    by_name.emplace(name, image);
    const auto [found, inserted] = by_last.emplace(name.substr(name.find_last_of('/') + 1), image);
    if (!inserted) found->second = ImageIndex();
  }
  for (const auto& [name, image] : by_last)
    if (image.valid()) by_name.emplace(name, image);
  return by_name;
}

Eigen::Vector2d pixel_of(const ControlTable::Measurement& m, ControlTable::Pixels pixels, const Camera& camera) {
  const Eigen::Vector2d size(camera.width, camera.height);
  if (pixels == ControlTable::Pixels::kCentresAtInteger) return m.position + Eigen::Vector2d(0.5, 0.5);
  if (pixels == ControlTable::Pixels::kNormalised) return m.position * size.maxCoeff() + size / 2;
  return m.position;
}

void check_pixel(const ControlTable::Measurement& m, const Eigen::Vector2d& pixel, const Camera& camera) {
  if (pixel.minCoeff() >= 0 && pixel.x() <= camera.width && pixel.y() <= camera.height) return;
  char text[96];
  std::snprintf(text, sizeof text, "(%.1f, %.1f) lies outside", pixel.x(), pixel.y());
  throw InputError(m.where + ": the measurement " + text + " image '" + m.image + "' (" + std::to_string(camera.width) +
                   " x " + std::to_string(camera.height) + " pixels); correct its image coordinates");
}

CrsToWgs84 crs_of(const ControlTable& table) {
  try {
    return CrsToWgs84(table.crs);
  } catch (const InputError& error) {
    throw InputError(table.crs_where + ": " + error.what());
  }
}

// Transforms coordinates from the system of the file into the ground frame of the block.
class ToGround {
 public:
  ToGround(const ControlTable& table, const GroundFrame& ground) : ground_(ground) {
    if (table.crs == "local") return;
    crs_.emplace(crs_of(table));
    if (!ground.georeferenced)
      throw InputError((table.points.empty() ? "control" : table.points[0].where) + ": control in '" + table.crs +
                       "' needs a georeferenced block; add 'origin' to the project file");
    reference_.emplace(ground);
  }

  Eigen::Vector3d operator()(const ControlTable::Point& point) const {
    Eigen::Vector3d xyz = point.coordinates;
    // An unknown height starts at the origin's. Its sigma, kUnknownHeightSigma, leaves it free.
    if (std::isnan(xyz.z())) xyz.z() = crs_ ? ground_.height_m : 0;
    if (!crs_) return xyz;
    try {
      return reference_->to_local(crs_->to_wgs84(xyz));
    } catch (const InputError& error) {
      throw InputError(point.where + ": point '" + point.name + "': " + error.what());
    }
  }

 private:
  GroundFrame ground_;
  std::optional<CrsToWgs84> crs_;
  std::optional<Georeference> reference_;
};

}  // namespace

std::vector<Geodetic> geodetic_positions(const ControlTable& table) {
  std::vector<Geodetic> positions;
  if (table.crs == "local") return positions;
  const CrsToWgs84 crs = crs_of(table);
  for (const ControlTable::Point& point : table.points) {
    Eigen::Vector3d xyz = point.coordinates;
    const bool flat = std::isnan(xyz.z());
    if (flat) xyz.z() = 0;
    try {
      positions.push_back(crs.to_wgs84(xyz));
    } catch (const InputError& error) {
      throw InputError(point.where + ": point '" + point.name + "': " + error.what());
    }
    if (flat) positions.back().height_m = point.coordinates.z();
  }
  return positions;
}

void add_control(const ControlTable& table, const std::vector<std::string>& left_out, Block& block,
                 std::vector<std::string>& warnings) {
  const ToGround to_ground(table, block.ground);
  const std::map<std::string, ImageIndex> images = images_by_name(block);
  const std::set<std::string> known_bad(left_out.begin(), left_out.end());
  for (const ControlTable::Point& entry : table.points) {
    ControlPoint point;
    point.name = entry.name;
    point.role = entry.role;
    point.position = to_ground(entry);
    point.sigma = entry.sigma;
    if (std::isnan(entry.coordinates.z())) point.sigma.z() = kUnknownHeightSigma;
    std::set<ImageIndex> seen;
    for (const ControlTable::Measurement& m : entry.measurements) {
      if (known_bad.contains(m.image)) {
        warnings.push_back(m.where + ": the measurement of point '" + entry.name + "' is not used, because image '" +
                           m.image + "' was left out of the block");
        continue;
      }
      const auto found = images.find(m.image);
      if (found == images.end())
        throw InputError(m.where + ": point '" + entry.name + "' is measured in image '" + m.image +
                         "', which the block does not have; correct the name or delete the measurement");
      if (!seen.insert(found->second).second)
        throw InputError(m.where + ": point '" + entry.name + "' is measured twice in image '" + m.image +
                         "'; delete one of the measurements");
      const Camera& camera = block.cameras[block.camera_of(found->second)];
      const Eigen::Vector2d pixel = pixel_of(m, table.pixels, camera);
      check_pixel(m, pixel, camera);
      point.measurements.push_back({found->second, pixel, m.sigma_px});
    }
    block.control_points.push_back(std::move(point));
  }
  warnings.insert(warnings.end(), table.warnings.begin(), table.warnings.end());
}

}  // namespace megablock
