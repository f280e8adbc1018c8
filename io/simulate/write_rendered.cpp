// A simulated block as pictures with the project files around them. Every image is a frame of its own there: the truth
// names images and gives the poses of the single cameras.
#include <filesystem>
#include <fstream>
#include <iomanip>

#include "io/control_file.h"
#include "io/crs.h"
#include "io/error.h"
#include "io/pose_csv.h"
#include "io/simulate/image_file.h"
#include "io/simulate/render.h"
#include "io/unit_files.h"

namespace megablock {

namespace {

namespace fs = std::filesystem;

Layout make_city_layout(const SimulationOptions& options) {
  const bool street = options.scene == SimulationOptions::Scene::kStreet;
  Layout layout = street ? make_street_layout(options) : make_aerial_layout(options);
  layout.block.ground = {true, 48.85, 2.35, 100, "EPSG:4979"};
  layout.scene = std::make_unique<City>(options, layout);
  return layout;
}

Pose image_pose(const Layout& layout, ImageIndex image) {
  const Image& entry = layout.block.images[image];
  const RigIndex rig = layout.block.frames[entry.frame].rig;
  return camera_pose(layout.truth.frames[entry.frame], layout.truth.mounts[rig][static_cast<std::size_t>(entry.mount)]);
}

// The position an image's header states: its own projection centre with the error of the frame's prior.
std::optional<Geodetic> stated_position(const Layout& layout, const Block& with_priors, ImageIndex image,
                                        const Georeference& georeference) {
  const FrameIndex frame = with_priors.images[image].frame;
  const auto& prior = with_priors.frames[frame].position_prior;
  if (!prior) return std::nullopt;
  const Pose& pose = layout.truth.frames[frame];
  const Eigen::Vector3d antenna = pose.centre + pose.rotation.conjugate() * prior->lever_arm;
  return georeference.to_geodetic(image_pose(layout, image).centre + prior->position - antenna);
}

void write_images(const SimulationOptions& options, const Layout& layout, const Block& with_priors,
                  const fs::path& folder) {
  const auto& city = dynamic_cast<const City&>(*layout.scene);
  const Georeference georeference(layout.block.ground);
  // Camera by camera: a table of rays is large.
  for (std::size_t c = 0; c < layout.block.cameras.size(); ++c) {
    const CameraIndex camera(static_cast<std::int64_t>(c));
    const RayTable rays(layout.block.cameras[camera], layout.truth.cameras[camera]);
    for (std::size_t i = 0; i < layout.block.images.size(); ++i) {
      const ImageIndex image(static_cast<std::int64_t>(i));
      if (layout.block.camera_of(image) != camera) continue;
      const std::uint64_t seed = Random(options.seed, Random::Purpose::kImage, i).next();
      const cv::Mat picture =
          render_image(city, rays, image_pose(layout, image), layout.truth.cameras[camera][kFocal], seed);
      SimulatedExif exif;
      exif.model = "Simulated " + layout.block.cameras[camera].name;
      exif.focal_px = layout.block.cameras[camera].intrinsics[kFocal];
      exif.time_s = layout.block.frames[layout.block.images[image].frame].time_s;
      exif.position = stated_position(layout, with_priors, image, georeference);
      exif.position_sigma_m = options.gps_sigma_m;
      write_jpeg((folder / layout.block.images[image].name).string(), picture, exif);
    }
  }
}

// Poses of the images, as frames of their own.
void write_truth(const Layout& layout, const fs::path& folder) {
  PoseTable table;
  table.ground = layout.block.ground;
  BlockState state;
  state.cameras = layout.truth.cameras;
  for (std::size_t c = 0; c < state.cameras.size(); ++c) state.mounts.push_back({Pose()});
  for (std::size_t i = 0; i < layout.block.images.size(); ++i) {
    const ImageIndex image(static_cast<std::int64_t>(i));
    table.names.push_back(layout.block.images[image].name);
    table.poses.push_back(image_pose(layout, image));
    table.passes.push_back(layout.block.frames[layout.block.images[image].frame].pass);
    state.frames.push_back(table.poses.back());
    state.oriented.push_back(1);
  }
  write_pose_csv((folder / "truth.csv").string(), table);
  write_state((folder / "truth.h5").string(), state);
}

// The control points (without the check points) in the form that other programs read: longitude, latitude, ellipsoidal
// height, then column and row counted from the centre of the first pixel.
void write_gcp_list(const Block& block, const fs::path& path) {
  const Georeference georeference(block.ground);
  std::ofstream stream(path);
  stream << "WGS84\n" << std::fixed;
  for (const ControlPoint& point : block.control_points) {
    if (point.role != PointRole::kControl) continue;
    const Geodetic place = georeference.to_geodetic(point.position);
    for (const ImageMeasurement& m : point.measurements)
      stream << std::setprecision(10) << place.longitude_deg << ' ' << place.latitude_deg << ' ' << std::setprecision(5)
             << place.height_m << ' ' << std::setprecision(4) << m.pixel.x() - 0.5 << ' ' << m.pixel.y() - 0.5 << ' '
             << block.images[m.image].name << ' ' << point.name << '\n';
  }
  stream.close();
  if (!stream) throw InputError(path.string() + ": cannot be written");
}

void write_cameras(const SimulationOptions& options, const Layout& layout, std::ostream& yaml) {
  if (options.calibrate) return;  // the headers of the images say enough
  yaml << "cameras:\n  grouping: " << (layout.block.cameras.size() > 1 ? "exif" : "one") << '\n';
  for (std::size_t c = 0; c < layout.block.cameras.size(); ++c) {
    const Camera& camera = layout.block.cameras[CameraIndex(static_cast<std::int64_t>(c))];
    const Intrinsics& k = camera.intrinsics;
    std::ostringstream focal_mm;
    focal_mm << std::fixed << std::setprecision(2) << k[kFocal] * 10 / std::max(camera.width, camera.height);
    if (layout.block.cameras.size() > 1)
      yaml << "  \"Megablock Simulated " << camera.name << ' ' << camera.width << 'x' << camera.height << ' '
           << focal_mm.str() << "mm\":\n";
    else
      yaml << "  default:\n";
    yaml << "    focal_px: " << k[kFocal] << "\n    principal_point_px: [" << k[kPrincipalX] << ", " << k[kPrincipalY]
         << "]\n    distortion: {k1: " << k[kRadial1] << ", k2: " << k[kRadial2] << ", k3: " << k[kRadial3]
         << ", p1: " << k[kDecentring1] << ", p2: " << k[kDecentring2] << "}\n    calibrate: false\n";
  }
}

void write_project(const SimulationOptions& options, const Layout& layout, bool with_control, const fs::path& path) {
  const GroundFrame& ground = layout.block.ground;
  std::ofstream yaml(path);
  yaml << std::setprecision(12) << "# A rendered block; the truth is in truth.csv (poses) and truth.h5.\n"
       << "images: images\n"
       << "origin: [" << ground.latitude_deg << ", " << ground.longitude_deg << ", " << ground.height_m << "]\n";
  if (options.gps_sigma_m > 0)
    yaml << "gps:\n  sigma_horizontal_m: " << options.gps_sigma_m << "\n  sigma_vertical_m: " << options.gps_sigma_m
         << '\n';
  if (with_control) yaml << "control: control.csv\n";
  write_cameras(options, layout, yaml);
  yaml.close();
  if (!yaml) throw InputError(path.string() + ": cannot be written");
}

}  // namespace

void write_rendered_block(const SimulationOptions& options, const std::string& folder) {
  options.check();
  const fs::path root(folder);
  std::error_code error;
  fs::create_directories(root / "images", error);
  if (error) throw InputError(folder + ": cannot be created: " + error.message());
  const Layout layout = make_city_layout(options);
  SimulatedBlock simulated;
  simulated.block = layout.block;
  simulated.truth = layout.truth;
  simulate_control(options, layout, simulated);
  simulate_priors(options, simulated);
  write_images(options, layout, simulated.block, root / "images");
  write_truth(layout, root);
  const bool with_control = !simulated.block.control_points.empty();
  if (with_control) {
    write_control_csv((root / "control.csv").string(), simulated.block);
    write_gcp_list(simulated.block, root / "gcp_list.txt");
  }
  write_project(options, layout, with_control, root / "block.yaml");
}

}  // namespace megablock
