// Lists of different lengths (measurements of points, of lines, parameters of verticals) are stored one after the
// other, with a column of counts; begin_of() turns counts into offsets and checks them. Lines, verticals and frame
// measurements have a group only if the block has some, so the files of other blocks stay as they are.
#include "io/store/units/hdf5_block_observations.h"

#include "io/block/frame_measurements.h"
#include "io/store/hdf5/hdf5_tables.h"

namespace megablock {

void put_relative_poses(Hdf5Writer& file, const std::vector<RelativePose>& relatives) {
  file.group("relative_poses", "observed poses of one frame in another");
  file.vector("relative_poses/from", column(relatives, [](const RelativePose& r) { return r.from.value; }),
              {"", "row in frames"});
  file.vector("relative_poses/to", column(relatives, [](const RelativePose& r) { return r.to.value; }),
              {"", "row in frames"});
  write_poses(file, "relative_poses", column(relatives, [](const RelativePose& r) { return r.pose; }), "frame 'to'",
              "frame 'from'");
  file.vector("relative_poses/rotation_sigma",
              column(relatives, [](const RelativePose& r) { return r.rotation_sigma_rad; }), {"rad", ""});
  file.vector("relative_poses/position_sigma",
              column(relatives, [](const RelativePose& r) { return r.position_sigma_m; }), {"m", ""});
}

std::vector<RelativePose> get_relative_poses(const Hdf5Reader& file) {
  const std::vector<Pose> poses = read_poses(file, "relative_poses");
  const auto count = static_cast<std::int64_t>(poses.size());
  const auto from = file.vector<std::int64_t>("relative_poses/from", count);
  const auto to = file.vector<std::int64_t>("relative_poses/to", count);
  const auto rotation_sigma = file.vector<double>("relative_poses/rotation_sigma", count);
  const auto position_sigma = file.vector<double>("relative_poses/position_sigma", count);
  std::vector<RelativePose> relatives;
  relatives.reserve(poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i)
    relatives.push_back({FrameIndex(from[i]), FrameIndex(to[i]), poses[i], rotation_sigma[i], position_sigma[i]});
  return relatives;
}

void put_frame_measurements(Hdf5Writer& file, const Block& block) {
  if (block.frame_measurements.empty()) return;
  file.group("frame_measurements", "numbers measured between two frames, by type");
  for (const auto& [key, rows] : block.frame_measurements) {
    const std::string group = "frame_measurements/" + key;
    file.group(group, "one type");
    file.vector(group + "/from", column(rows, [](const FrameMeasurement& m) { return m.from.value; }),
                {"", "row in frames"});
    file.vector(group + "/to", column(rows, [](const FrameMeasurement& m) { return m.to.value; }),
                {"", "row in frames"});
    file.vector(group + "/value", column(rows, [](const FrameMeasurement& m) { return m.value; }),
                {"", "in the unit of the type"});
    file.vector(group + "/sigma", column(rows, [](const FrameMeasurement& m) { return m.sigma; }),
                {"", "in the unit of the type"});
  }
}

void get_frame_measurements(const Hdf5Reader& file, Block& block) {
  if (!file.has("frame_measurements")) return;
  for (const FrameMeasurementType& type : frame_measurement_types()) {
    const std::string group = std::string("frame_measurements/") + type.key;
    if (!file.has(group)) continue;
    const auto from = file.vector<std::int64_t>(group + "/from");
    const auto count = static_cast<std::int64_t>(from.size());
    const auto to = file.vector<std::int64_t>(group + "/to", count);
    const auto value = file.vector<double>(group + "/value", count);
    const auto sigma = file.vector<double>(group + "/sigma", count);
    std::vector<FrameMeasurement>& rows = block.frame_measurements[type.key];
    for (std::size_t i = 0; i < from.size(); ++i)
      rows.push_back({FrameIndex(from[i]), FrameIndex(to[i]), value[i], sigma[i]});
  }
}

void put_control(Hdf5Writer& file, const std::vector<ControlPoint>& points) {
  std::vector<ImageMeasurement> measurements;
  std::vector<double> pixels;
  for (const ControlPoint& point : points)
    for (const ImageMeasurement& m : point.measurements) {
      measurements.push_back(m);
      pixels.insert(pixels.end(), {m.pixel.x(), m.pixel.y()});
    }
  file.group("control", "control and check points");
  file.texts("control/name", column(points, [](const ControlPoint& p) { return p.name; }));
  file.vector("control/role", column(points, [](const ControlPoint& p) { return static_cast<std::uint8_t>(p.role); }),
              {"", "1: control point, 2: check point"});
  file.matrix("control/position", vectors3(points, [](const ControlPoint& p) { return p.position; }), 3,
              {"m", "given, ground frame; NaN in z: unknown height"});
  file.matrix("control/sigma", vectors3(points, [](const ControlPoint& p) { return p.sigma; }), 3, {"m", "given"});
  file.vector("control/measurements",
              column(points, [](const ControlPoint& p) { return static_cast<std::int32_t>(p.measurements.size()); }),
              {"", "number of image measurements: rows of the group 'control/measurement', in order"});
  file.group("control/measurement", "image measurements of the control and check points");
  file.vector("control/measurement/image",
              column(measurements, [](const ImageMeasurement& m) { return m.image.value; }), {"", "row in images"});
  file.matrix("control/measurement/pixel", pixels, 2, {"px", "x, y; pixel centres at +0.5"});
  file.vector("control/measurement/sigma", column(measurements, [](const ImageMeasurement& m) { return m.sigma_px; }),
              {"px", ""});
}

std::vector<ControlPoint> get_control(const Hdf5Reader& file) {
  const std::vector<std::string> names = file.texts("control/name");
  const auto count = static_cast<std::int64_t>(names.size());
  const auto roles = file.vector<std::uint8_t>("control/role", count);
  const auto positions = file.matrix<double>("control/position", 3, count);
  const auto sigmas = file.matrix<double>("control/sigma", 3, count);
  const auto images = file.vector<std::int64_t>("control/measurement/image");
  const auto rows = static_cast<std::int64_t>(images.size());
  const auto pixels = file.matrix<double>("control/measurement/pixel", 2, rows);
  const auto sigma_px = file.vector<double>("control/measurement/sigma", rows);
  const auto begin =
      begin_of(file, "control/measurements", file.vector<std::int64_t>("control/measurements", count), rows);
  std::vector<ControlPoint> points;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (roles[i] > static_cast<std::uint8_t>(PointRole::kCheck)) file.fail("control/role", "holds an unknown role");
    ControlPoint point{names[i], static_cast<PointRole>(roles[i]), vector3(positions, i), vector3(sigmas, i), {}};
    for (auto m = static_cast<std::size_t>(begin[i]); m < static_cast<std::size_t>(begin[i + 1]); ++m)
      point.measurements.push_back({ImageIndex(images[m]), {pixels[2 * m], pixels[2 * m + 1]}, sigma_px[m]});
    points.push_back(std::move(point));
  }
  return points;
}

void put_lines(Hdf5Writer& file, const std::vector<KnownLine>& lines) {
  if (lines.empty()) return;
  std::vector<KnownLine::Measurement> measurements;
  std::vector<double> ends;
  for (const KnownLine& line : lines)
    for (const KnownLine::Measurement& m : line.measurements) {
      measurements.push_back(m);
      ends.insert(ends.end(), {m.first.x(), m.first.y(), m.second.x(), m.second.y()});
    }
  file.group("lines", "straight lines of known direction");
  file.texts("lines/name", column(lines, [](const KnownLine& l) { return l.name; }));
  file.vector("lines/direction",
              column(lines, [](const KnownLine& l) { return static_cast<std::uint8_t>(l.direction); }),
              {"", "0: vertical, 1: horizontal"});
  file.vector("lines/measurements",
              column(lines, [](const KnownLine& l) { return static_cast<std::int32_t>(l.measurements.size()); }),
              {"", "number of image measurements: rows of the group 'lines/measurement', in order"});
  file.group("lines/measurement", "image measurements of the lines");
  file.vector("lines/measurement/image",
              column(measurements, [](const KnownLine::Measurement& m) { return m.image.value; }),
              {"", "row in images"});
  file.matrix("lines/measurement/ends", ends, 4, {"px", "x, y of two of its points; pixel centres at +0.5"});
  file.vector("lines/measurement/sigma",
              column(measurements, [](const KnownLine::Measurement& m) { return m.sigma_px; }),
              {"px", "of each end, across the line"});
}

std::vector<KnownLine> get_lines(const Hdf5Reader& file) {
  if (!file.has("lines")) return {};
  const std::vector<std::string> names = file.texts("lines/name");
  const auto count = static_cast<std::int64_t>(names.size());
  const auto directions = file.vector<std::uint8_t>("lines/direction", count);
  const auto images = file.vector<std::int64_t>("lines/measurement/image");
  const auto rows = static_cast<std::int64_t>(images.size());
  const auto ends = file.matrix<double>("lines/measurement/ends", 4, rows);
  const auto sigmas = file.vector<double>("lines/measurement/sigma", rows);
  const auto begin = begin_of(file, "lines/measurements", file.vector<std::int64_t>("lines/measurements", count), rows);
  std::vector<KnownLine> lines;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (directions[i] > static_cast<std::uint8_t>(KnownLine::Direction::kHorizontal))
      file.fail("lines/direction", "holds an unknown direction");
    KnownLine line{names[i], static_cast<KnownLine::Direction>(directions[i]), {}};
    for (auto m = static_cast<std::size_t>(begin[i]); m < static_cast<std::size_t>(begin[i + 1]); ++m)
      line.measurements.push_back(
          {ImageIndex(images[m]), {ends[4 * m], ends[4 * m + 1]}, {ends[4 * m + 2], ends[4 * m + 3]}, sigmas[m]});
    lines.push_back(std::move(line));
  }
  return lines;
}

void put_verticals(Hdf5Writer& file, const std::vector<SeenVertical>& verticals) {
  if (verticals.empty()) return;
  std::vector<double> covariances, values, derivatives;
  for (const SeenVertical& v : verticals) {
    const Eigen::Matrix3d& c = v.covariance;
    // The upper triangle by rows; the matrix is symmetric.
    covariances.insert(covariances.end(), {c(0, 0), c(0, 1), c(0, 2), c(1, 1), c(1, 2), c(2, 2)});
    values.insert(values.end(), v.camera.begin(), v.camera.end());
    derivatives.insert(derivatives.end(), v.by_camera.data(), v.by_camera.data() + v.by_camera.size());
  }
  file.group("verticals", "where images see down");
  file.vector("verticals/image", column(verticals, [](const SeenVertical& v) { return v.image.value; }),
              {"", "row in images, ascending"});
  file.matrix("verticals/down", vectors3(verticals, [](const SeenVertical& v) { return v.down; }), 3,
              {"", "unit vector in camera axes"});
  file.matrix("verticals/covariance", covariances, 6,
              {"rad^2", "of 'down' by measuring alone: xx, xy, xz, yy, yz, zz; of rank two"});
  file.vector("verticals/parameters",
              column(verticals, [](const SeenVertical& v) { return static_cast<std::int32_t>(v.camera.size()); }),
              {"", "of the camera that 'down' depends on: rows of the group 'verticals/camera', in order; 0: none"});
  file.group("verticals/camera", "the parameters of the camera that verticals were found with");
  file.vector("verticals/camera/value", values, {"", "in the unit of the parameter"});
  file.matrix("verticals/camera/derivative", derivatives, 3, {"", "of 'down' by the parameter"});
}

std::vector<SeenVertical> get_verticals(const Hdf5Reader& file) {
  if (!file.has("verticals")) return {};
  const auto images = file.vector<std::int64_t>("verticals/image");
  const auto count = static_cast<std::int64_t>(images.size());
  const auto downs = file.matrix<double>("verticals/down", 3, count);
  const auto covariances = file.matrix<double>("verticals/covariance", 6, count);
  const auto values = file.vector<double>("verticals/camera/value");
  const auto rows = static_cast<std::int64_t>(values.size());
  const auto derivatives = file.matrix<double>("verticals/camera/derivative", 3, rows);
  const auto begin =
      begin_of(file, "verticals/parameters", file.vector<std::int64_t>("verticals/parameters", count), rows);
  std::vector<SeenVertical> verticals;
  for (std::size_t i = 0; i < images.size(); ++i) {
    const double* c = &covariances[6 * i];
    SeenVertical v;
    v.image = ImageIndex(images[i]);
    v.down = vector3(downs, i);
    v.covariance << c[0], c[1], c[2], c[1], c[3], c[4], c[2], c[4], c[5];
    const auto first = static_cast<std::size_t>(begin[i]);
    const auto parameters = static_cast<Eigen::Index>(begin[i + 1] - begin[i]);
    v.camera = Eigen::Map<const Eigen::VectorXd>(values.data() + first, parameters);
    v.by_camera = Eigen::Map<const Eigen::Matrix3Xd>(derivatives.data() + 3 * first, 3, parameters);
    verticals.push_back(std::move(v));
  }
  return verticals;
}

}  // namespace megablock
