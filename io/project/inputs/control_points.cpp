// Adds the control points of a table to the block: finds their images, and converts image coordinates to pixels
// and positions to the ground frame.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <set>
#include <utility>

#include "io/base/error.h"
#include "io/block/held_priors.h"
#include "io/project/inputs/control_file.h"
#include "io/project/inputs/geographic_fault.h"
#include "io/project/inputs/image_lookup.h"

namespace megablock {

namespace {

// Collects the measurements in images that the block does not have, for one warning about all of them.
class AbsentImages {
 public:
  void add(const ControlTable::Measurement& m) {
    if (measurements_++ == 0) first_ = &m;
    if (std::find(names_.begin(), names_.end(), m.image) == names_.end()) names_.push_back(m.image);
  }

  // Throws InputError if no measurement of the table is in an image of the block: the list belongs to other images.
  void report(std::int64_t used, std::vector<std::string>& warnings) const {
    if (names_.empty()) return;
    constexpr std::size_t kNamed = 5;
    std::string list;
    for (std::size_t i = 0; i < std::min(kNamed, names_.size()); ++i) list += (i ? ", '" : "'") + names_[i] + "'";
    if (names_.size() > kNamed) list += " and " + std::to_string(names_.size() - kNamed) + " more";
    if (used == 0)
      throw InputError(first_->where + ": the block has none of the images in which the points are measured (" + list +
                       "); give the list that belongs to these images, or correct the names");
    warnings.push_back(first_->where + ": " + std::to_string(measurements_) +
                       (measurements_ == 1 ? " measurement is" : " measurements are") +
                       " not used, because the block has no image " + list + "; correct the name or delete the line");
  }

 private:
  const ControlTable::Measurement* first_ = nullptr;
  std::int64_t measurements_ = 0;
  std::vector<std::string> names_;
};

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

InputError refusal(const ControlTable::Point& point, const CrsToWgs84& crs, const Eigen::Vector3d& xyz,
                   const InputError& error) {
  const std::string fault = geographic_fault(crs, xyz);
  return InputError(point.where + ": point '" + point.name + "': " + (fault.empty() ? error.what() : fault));
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
      throw refusal(point, *crs_, xyz, error);
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
      throw refusal(point, crs, xyz, error);
    }
    if (flat) positions.back().height_m = point.coordinates.z();
  }
  return positions;
}

void add_control(const ControlTable& table, const std::vector<std::string>& left_out, Block& block,
                 std::vector<std::string>& warnings) {
  const ToGround to_ground(table, block.ground);
  const ImageLookup images(block, left_out);
  AbsentImages absent;
  std::int64_t used = 0;
  for (const ControlTable::Point& entry : table.points) {
    ControlPoint point;
    point.name = entry.name;
    point.role = entry.role;
    point.position = to_ground(entry);
    point.sigma = entry.sigma;
    if (std::isnan(entry.coordinates.z())) point.sigma.z() = kUnknownHeightSigma;
    std::set<ImageIndex> seen;
    for (const ControlTable::Measurement& m : entry.measurements) {
      const ImageLookup::Found found = images.find(m.image);
      if (found.kind == ImageLookup::Kind::kLeftOut) {
        ++used;  // the list belongs to these images
        warnings.push_back(m.where + ": the measurement of point '" + entry.name + "' is not used, because image '" +
                           m.image + "' was left out of the block");
        continue;
      }
      if (found.kind == ImageLookup::Kind::kAbsent) {
        absent.add(m);
        continue;
      }
      if (found.kind == ImageLookup::Kind::kAmbiguous)
        throw InputError(m.where + ": point '" + entry.name + "' is measured in image '" + m.image +
                         "', and several images of the block have this name; write it with its folder");
      if (!seen.insert(found.image).second)
        throw InputError(m.where + ": point '" + entry.name + "' is measured twice in image '" + m.image +
                         "'; delete one of the measurements");
      ++used;
      const Camera& camera = block.cameras[block.camera_of(found.image)];
      const Eigen::Vector2d pixel = pixel_of(m, table.pixels, camera);
      check_pixel(m, pixel, camera);
      point.measurements.push_back({found.image, pixel, m.sigma_px});
    }
    block.control_points.push_back(std::move(point));
  }
  absent.report(used, warnings);
  warnings.insert(warnings.end(), table.warnings.begin(), table.warnings.end());
}

std::vector<std::optional<Eigen::Vector3d>> exchanged_places(const ControlTable& table, const Block& block) {
  const ToGround to_ground(table, block.ground);
  std::vector<std::optional<Eigen::Vector3d>> places;
  for (ControlTable::Point point : table.points) {
    std::swap(point.coordinates.x(), point.coordinates.y());
    try {
      places.emplace_back(to_ground(point));
    } catch (const InputError&) {
      places.emplace_back();
    }
  }
  return places;
}

}  // namespace megablock
