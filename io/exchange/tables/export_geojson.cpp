// Writes the footprints of the images as GeoJSON.
#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "geometry/numbers/median.h"
#include "io/block/crs.h"
#include "io/exchange/model/export_view.h"
#include "io/exchange/tables/export_tables.h"
#include "io/text/text_writer.h"

namespace megablock {

namespace {

using Json = nlohmann::json;

// For each image the median height of the points that it sees; NaN if it sees none.
std::vector<double> ground_heights(const ExportView& view) {
  const ObservationsByImage by_image = observations_by_image(view);
  const std::vector<std::int64_t> track = track_of_observation(view);
  std::vector<double> heights(view.images.size(), std::numeric_limits<double>::quiet_NaN());
  std::vector<double> seen;
  for (std::size_t i = 0; i < view.images.size(); ++i) {
    seen.clear();
    for (auto k = by_image.begin[i]; k < by_image.begin[i + 1]; ++k) {
      const auto position = static_cast<std::size_t>(by_image.observation[static_cast<std::size_t>(k)]);
      seen.push_back(view.point(track[position]).z());
    }
    if (!seen.empty()) heights[i] = median(seen);
  }
  return heights;
}

// The corners of the image on the plane z = height, anticlockwise from above. Empty if the ray of a corner does not
// meet the plane, or meets it farther away than 10 times the height above it; such a footprint would be useless.
std::vector<Eigen::Vector3d> footprint(const Camera& camera, const Intrinsics& k, const Pose& pose, double height) {
  const double above = pose.centre.z() - height;
  if (!(above > 0)) return {};
  const double w = camera.width, h = camera.height;
  std::vector<Eigen::Vector3d> corners;
  for (const Eigen::Vector2d& pixel : {Eigen::Vector2d(0, 0), {0, h}, {w, h}, {w, 0}}) {
    const auto ray = viewing_ray(k, pixel);
    if (!ray) return {};
    // X = C + t R' ray. On the plane t = above / -direction.z, which exceeds 10 heights for |direction.z| < 0.1.
    const Eigen::Vector3d direction = pose.rotation.conjugate() * *ray;
    if (direction.z() > -0.1) return {};
    corners.push_back(pose.centre + direction * (above / -direction.z()));
  }
  return corners;
}

Json coordinates(const Georeference& georeference, const Eigen::Vector3d& p, bool with_height) {
  const Geodetic position = georeference.to_geodetic(p);
  const auto rounded = [](double value, double scale) { return std::round(value * scale) / scale; };
  Json result = {rounded(position.longitude_deg, 1e9), rounded(position.latitude_deg, 1e9)};  // 0.1 mm
  if (with_height) result.push_back(rounded(position.height_m, 1e3));
  return result;
}

}  // namespace

void export_geojson(const BlockResult& result, const std::string& path) {
  if (!result.block.ground.georeferenced)
    throw InputError("the block is not georeferenced; GeoJSON needs WGS84 coordinates, export csv or ply instead");
  const Georeference georeference(result.block.ground);
  const ExportView view = make_export_view(result);
  const std::vector<double> heights = ground_heights(view);
  TextWriter writer(path);
  writer.print("{{\"type\": \"FeatureCollection\", \"features\": [\n");
  for (std::int64_t i = 0; i < view.image_count(); ++i) {
    const Image& image = view.image(i);
    const Pose pose = view.pose(i);
    const auto corners = footprint(result.block.cameras[view.camera_index(i)], view.intrinsics(i), pose,
                                   heights[static_cast<std::size_t>(i)]);
    Json geometry = {{"type", "Point"}, {"coordinates", coordinates(georeference, pose.centre, true)}};
    if (!corners.empty()) {
      Json ring = Json::array();
      for (const Eigen::Vector3d& corner : corners) ring.push_back(coordinates(georeference, corner, false));
      ring.push_back(ring.front());
      geometry = {{"type", "Polygon"}, {"coordinates", Json::array({ring})}};
    }
    Json properties = {{"image", view.image_name(i)},
                       {"frame", result.block.frames[image.frame].name},
                       {"centre", coordinates(georeference, pose.centre, true)}};
    if (result.tiles.tile_of_frame.contains(image.frame))
      properties["tile"] = result.tiles.tile_of_frame[image.frame].value;
    if (result.boundary.contains(image.frame)) properties["boundary"] = result.boundary[image.frame] != 0;
    const Json feature = {{"type", "Feature"}, {"properties", properties}, {"geometry", geometry}};
    writer.print("{}{}\n", feature.dump(-1, ' ', false, Json::error_handler_t::replace),
                 i + 1 < view.image_count() ? "," : "");
  }
  writer.print("]}}\n");
  writer.close();
}

}  // namespace megablock
