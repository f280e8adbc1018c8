#include "io/exchange/colmap/export_colmap.h"

#include <cmath>
#include <filesystem>

#include "io/exchange/colmap/colmap_camera.h"
#include "io/exchange/model/export_view.h"
#include "io/text/text_writer.h"

namespace megablock {

namespace fs = std::filesystem;

namespace {

constexpr int kGrey = 128;

// Mean length of the residuals of a point, pixels. It is calculated anew from the values that the files contain.
double point_error(const ExportView& view, std::int64_t t) {
  double sum = 0;
  const std::int64_t begin = view.begin[static_cast<std::size_t>(t)], end = view.begin[static_cast<std::size_t>(t) + 1];
  for (std::int64_t k = begin; k < end; ++k) {
    const std::int64_t o = view.observations[static_cast<std::size_t>(k)], i = view.image_of(o);
    sum += reprojection(view.intrinsics(i), to_inside(view.pose(i), view.point(t)), view.pixel(o)).norm();
  }
  return sum / static_cast<double>(end - begin);
}

// Ids follow from the block, not from the rows of the export: they stay the same if other images or points are
// exported.
std::int64_t image_id(const ExportView& view, std::int64_t i) {
  return view.images[static_cast<std::size_t>(i)].value + 1;
}
std::int64_t point_id(const ExportView& view, std::int64_t t) {
  const auto row = static_cast<std::size_t>(view.tracks[static_cast<std::size_t>(t)]);
  return view.result.tracks.id[row].value + 1;
}

// Passes all parts of a model to a writer, in the order of the files. There is one writer for text and one for binary
// files.
template <typename Writer>
void write_model(const BlockResult& result, Writer& writer) {
  const ExportView view = make_export_view(result);
  const ObservationsByImage by_image = observations_by_image(view);
  const std::vector<std::int64_t> track = track_of_observation(view);

  writer.begin_cameras(result.block.cameras.size());
  for (std::size_t c = 0; c < result.block.cameras.size(); ++c) {
    const CameraIndex index(static_cast<std::int64_t>(c));
    writer.camera(index.value + 1, result.block.cameras[index],
                  to_colmap(result.block.cameras[index].name, result.state.cameras[index]));
  }
  writer.begin_images(view.image_count(), view.observations.size());
  for (std::int64_t i = 0; i < view.image_count(); ++i) {
    const Pose pose = view.pose(i);
    const Eigen::Vector3d translation = -(pose.rotation * pose.centre);
    const std::int64_t begin = by_image.begin[static_cast<std::size_t>(i)];
    const std::int64_t end = by_image.begin[static_cast<std::size_t>(i) + 1];
    writer.image(image_id(view, i), pose.rotation, translation, view.camera_index(i).value + 1, view.image_name(i),
                 end - begin);
    for (std::int64_t k = begin; k < end; ++k) {
      const auto position = static_cast<std::size_t>(by_image.observation[static_cast<std::size_t>(k)]);
      writer.observation(without_skew(view.intrinsics(i), view.pixel(view.observations[position])),
                         point_id(view, track[position]), k == begin);
    }
    writer.end_image();
  }
  writer.begin_points(view.track_count(), view.observations.size());
  for (std::int64_t t = 0; t < view.track_count(); ++t) {
    const std::int64_t begin = view.begin[static_cast<std::size_t>(t)];
    const std::int64_t end = view.begin[static_cast<std::size_t>(t) + 1];
    writer.point(point_id(view, t), view.point(t), point_error(view, t), end - begin);
    for (std::int64_t k = begin; k < end; ++k)
      // POINT2D_IDX is the row of the observation in the list of its image, counted from 0.
      writer.track_element(image_id(view, view.image_of(view.observations[static_cast<std::size_t>(k)])),
                           by_image.rank[static_cast<std::size_t>(k)]);
    writer.end_point();
  }
  writer.close();
}

class ColmapText {
 public:
  explicit ColmapText(const fs::path& folder)
      : cameras_((folder / "cameras.txt").string()),
        images_((folder / "images.txt").string()),
        points_((folder / "points3D.txt").string()) {}

  void begin_cameras(std::size_t count) {
    cameras_.print("# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n# Number of cameras: {}\n", count);
  }
  void camera(std::int64_t id, const Camera& camera, const ColmapCamera& model) {
    cameras_.print("{} {} {} {}", id, model.form->name, camera.width, camera.height);
    for (const double p : model.parameters) cameras_.print(" {}", p);
    cameras_.print("\n");
  }
  void begin_images(std::int64_t count, std::size_t observations) {
    images_.print(
        "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then POINTS2D[] as X Y POINT3D_ID\n"
        "# Number of images: {}, observations: {}\n",
        count, observations);
  }
  void image(std::int64_t id, const Eigen::Quaterniond& q, const Eigen::Vector3d& t, std::int64_t camera,
             const std::string& name, std::int64_t) {
    images_.print("{} {} {} {} {} {} {} {} {} {}\n", id, q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z(), camera, name);
  }
  void observation(const Eigen::Vector2d& pixel, std::int64_t point, bool first) {
    images_.print("{}{} {} {}", first ? "" : " ", pixel.x(), pixel.y(), point);
  }
  void end_image() { images_.print("\n"); }
  void begin_points(std::int64_t count, std::size_t observations) {
    points_.print(
        "# POINT3D_ID X Y Z R G B ERROR TRACK[] as IMAGE_ID POINT2D_IDX\n"
        "# Number of points: {}, observations: {}\n",
        count, observations);
  }
  void point(std::int64_t id, const Eigen::Vector3d& p, double error, std::int64_t) {
    points_.print("{} {} {} {} {} {} {} {}", id, p.x(), p.y(), p.z(), kGrey, kGrey, kGrey, error);
  }
  void track_element(std::int64_t image, std::int64_t index) { points_.print(" {} {}", image, index); }
  void end_point() { points_.print("\n"); }
  void close() {
    cameras_.close();
    images_.close();
    points_.close();
  }

 private:
  TextWriter cameras_, images_, points_;
};

class ColmapBinary {
 public:
  explicit ColmapBinary(const fs::path& folder)
      : cameras_((folder / "cameras.bin").string()),
        images_((folder / "images.bin").string()),
        points_((folder / "points3D.bin").string()) {}

  void begin_cameras(std::size_t count) { cameras_.bytes(static_cast<std::uint64_t>(count)); }
  void camera(std::int64_t id, const Camera& camera, const ColmapCamera& model) {
    cameras_.bytes(static_cast<std::uint32_t>(id));
    cameras_.bytes(static_cast<std::int32_t>(model.form->number));
    cameras_.bytes(static_cast<std::uint64_t>(camera.width));
    cameras_.bytes(static_cast<std::uint64_t>(camera.height));
    for (const double p : model.parameters) cameras_.bytes(p);
  }
  void begin_images(std::int64_t count, std::size_t) { images_.bytes(static_cast<std::uint64_t>(count)); }
  void image(std::int64_t id, const Eigen::Quaterniond& q, const Eigen::Vector3d& t, std::int64_t camera,
             const std::string& name, std::int64_t observations) {
    images_.bytes(static_cast<std::uint32_t>(id));
    for (const double v : {q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z()}) images_.bytes(v);
    images_.bytes(static_cast<std::uint32_t>(camera));
    for (const char c : name) images_.bytes(c);
    images_.bytes('\0');
    images_.bytes(static_cast<std::uint64_t>(observations));
  }
  void observation(const Eigen::Vector2d& pixel, std::int64_t point, bool) {
    images_.bytes(pixel.x());
    images_.bytes(pixel.y());
    images_.bytes(static_cast<std::uint64_t>(point));
  }
  void end_image() {}
  void begin_points(std::int64_t count, std::size_t) { points_.bytes(static_cast<std::uint64_t>(count)); }
  void point(std::int64_t id, const Eigen::Vector3d& p, double error, std::int64_t length) {
    points_.bytes(static_cast<std::uint64_t>(id));
    for (const double v : {p.x(), p.y(), p.z()}) points_.bytes(v);
    for (int c = 0; c < 3; ++c) points_.bytes(static_cast<std::uint8_t>(kGrey));
    points_.bytes(error);
    points_.bytes(static_cast<std::uint64_t>(length));
  }
  void track_element(std::int64_t image, std::int64_t index) {
    points_.bytes(static_cast<std::uint32_t>(image));
    points_.bytes(static_cast<std::uint32_t>(index));
  }
  void end_point() {}
  void close() {
    cameras_.close();
    images_.close();
    points_.close();
  }

 private:
  TextWriter cameras_, images_, points_;
};

}  // namespace

void export_colmap_text(const BlockResult& result, const std::string& folder) {
  ColmapText writer(folder);
  write_model(result, writer);
}

void export_colmap_binary(const BlockResult& result, const std::string& folder) {
  ColmapBinary writer(folder);
  write_model(result, writer);
}

}  // namespace megablock
