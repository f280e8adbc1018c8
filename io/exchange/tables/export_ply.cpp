// Writes points and projection centres as PLY.
#include "io/exchange/model/export_view.h"
#include "io/exchange/tables/export_tables.h"
#include "io/text/text_writer.h"

namespace megablock {

namespace {

void write_vertex(TextWriter& writer, const Eigen::Vector3d& p, std::uint8_t r, std::uint8_t g, std::uint8_t b) {
  for (const double v : {p.x(), p.y(), p.z()}) writer.bytes(v);
  for (const std::uint8_t c : {r, g, b}) writer.bytes(c);
}

}  // namespace

void export_ply(const BlockResult& result, const std::string& path) {
  const ExportView view = make_export_view(result);
  TextWriter writer(path);
  writer.print("ply\nformat binary_little_endian 1.0\n");
  const GroundFrame& ground = result.block.ground;
  if (ground.georeferenced)
    writer.print("comment east, north, up in metres about latitude {} longitude {} height {} (WGS84)\n",
                 ground.latitude_deg, ground.longitude_deg, ground.height_m);
  else
    writer.print("comment local frame, not georeferenced\n");
  writer.print("comment {} points (grey), then {} projection centres (red)\n", view.track_count(), view.image_count());
  writer.print("element vertex {}\n", view.track_count() + view.image_count());
  // Coordinates may be kilometres with millimetres behind them: a float has too few digits.
  writer.print("property double x\nproperty double y\nproperty double z\n");
  writer.print("property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n");
  for (std::int64_t t = 0; t < view.track_count(); ++t) write_vertex(writer, view.point(t), 128, 128, 128);
  for (std::int64_t i = 0; i < view.image_count(); ++i) write_vertex(writer, view.pose(i).centre, 255, 0, 0);
  writer.close();
}

}  // namespace megablock
