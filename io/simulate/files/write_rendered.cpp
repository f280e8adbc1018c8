// Renders the images of a simulated block and writes the project files for them.
#include "io/simulate/files/write_rendered.h"

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>

#include "io/base/error.h"
#include "io/base/file_error.h"
#include "io/block/crs.h"
#include "io/images/image_codec.h"
#include "io/project/inputs/control_file.h"
#include "io/project/inputs/pose_csv.h"
#include "io/project/project.h"
#include "io/simulate/blocks/control.h"
#include "io/simulate/blocks/simulate.h"
#include "io/simulate/files/project_text.h"
#include "io/simulate/images/jpeg_writer.h"
#include "io/simulate/images/render.h"
#include "io/store/units/state_file.h"

namespace megablock {

namespace {

namespace fs = std::filesystem;

bool is_stereopolis(const SimulationOptions& options) {
  return options.scene == SimulationOptions::Scene::kStereopolis;
}

Layout make_city_layout(const SimulationOptions& options) {
  Layout layout = make_layout(options);
  layout.block.ground = {true, 48.85, 2.35, 100, "EPSG:4979"};
  // The rendered surfaces replace those of the layout, so that control points lie on what the images show.
  layout.scene = std::make_unique<City>(options, layout);
  return layout;
}

Pose image_pose(const Layout& layout, ImageIndex image) {
  const Image& entry = layout.block.images[image];
  const RigIndex rig = layout.block.frames[entry.frame].rig;
  return camera_pose(layout.truth.frames[entry.frame], layout.truth.mounts[rig][static_cast<std::size_t>(entry.mount)]);
}

// The name that the program will give to a camera because of the headers of its images.
std::string name_by_headers(const Camera& camera) {
  std::ostringstream name;
  // The name is make, model, size and focal length, as for any image (image_scan.h). The sensor is 10 mm wide
  // (image_file.cpp).
  name << "Megablock Simulated " << camera.name << ' ' << camera.width << 'x' << camera.height << ' ' << std::fixed
       << std::setprecision(2) << camera.intrinsics[kFocal] * 10 / std::max(camera.width, camera.height) << "mm";
  return name.str();
}

// The vehicle as it appears in the images of a camera. The mount is found in the rig that has this camera.
std::optional<VehicleView> vehicle_seen(const SimulationOptions& options, const Layout& layout, CameraIndex camera,
                                        const RayTable& rays) {
  if (!options.vehicle) return std::nullopt;
  const std::vector<Mount>& mounts = layout.block.rigs.front().mounts;
  const auto mount = std::find_if(mounts.begin(), mounts.end(), [&](const Mount& m) { return m.camera == camera; });
  return VehicleView(options, rays, layout.truth.mounts.front()[static_cast<std::size_t>(mount - mounts.begin())]);
}

void write_mask(const VehicleView& vehicle, const fs::path& folder, const Camera& camera) {
  fs::create_directories(folder);
  write_image_file((folder / mask_file_name(name_by_headers(camera))).string(), vehicle.mask());
}

void write_images(const SimulationOptions& options, const Layout& layout, const Block& with_priors,
                  const fs::path& folder) {
  const auto& city = dynamic_cast<const City&>(*layout.scene);
  const Georeference georeference(layout.block.ground);
  // The images are rendered camera by camera, because a table of rays is large.
  for (std::size_t c = 0; c < layout.block.cameras.size(); ++c) {
    const CameraIndex camera(static_cast<std::int64_t>(c));
    const RayTable rays(layout.block.cameras[camera], layout.truth.cameras[camera]);
    const std::optional<VehicleView> vehicle = vehicle_seen(options, layout, camera, rays);
    if (vehicle) write_mask(*vehicle, folder.parent_path() / "truth_masks", layout.block.cameras[camera]);
    for (std::size_t i = 0; i < layout.block.images.size(); ++i) {
      const ImageIndex image(static_cast<std::int64_t>(i));
      if (layout.block.camera_of(image) != camera) continue;
      // Sensor noise of its own for each image, the same however many images are rendered.
      const std::uint64_t seed = Random(options.seed, Random::Purpose::kImage, i).next();
      const Pose& rig = layout.truth.frames[layout.block.images[image].frame];
      const SeenVehicle seen{vehicle ? &*vehicle : nullptr, VehicleView::light_at(city, rig)};
      const cv::Mat rendered =
          render_image(city, rays, image_pose(layout, image), layout.truth.cameras[camera][kFocal], seed, seen);
      SimulatedExif exif;
      exif.model = "Simulated " + layout.block.cameras[camera].name;
      exif.focal_px = layout.block.cameras[camera].intrinsics[kFocal];
      exif.time_s = layout.block.frames[layout.block.images[image].frame].time_s;
      const auto& prior = with_priors.frames[with_priors.images[image].frame].position_prior;
      if (prior) exif.position = georeference.to_geodetic(prior->position);  // position of the antenna
      exif.position_sigma_m = options.gps_sigma_m;
      write_jpeg((folder / layout.block.name_of(image)).string(), rendered, exif);
    }
  }
}

bool has_rig(const Block& block) { return block.rigs.front().mounts.size() > 1; }

// Writes OpenSfM's files of a rig: the rig cameras (X_camera = R X_rig + t), and the images of each exposure.
void write_rig(const Block& block, const fs::path& root) {
  nlohmann::ordered_json cameras, assignments;
  for (const Mount& mount : block.rigs.front().mounts) {
    const Eigen::Vector3d rotation = rotation_log<double>(mount.pose.rotation);
    // X_camera = R (X_rig - C) = R X_rig + t, so t = -R C.
    const Eigen::Vector3d translation = -(mount.pose.rotation * mount.pose.centre);
    cameras[block.cameras[mount.camera].name] = {{"rotation", {rotation.x(), rotation.y(), rotation.z()}},
                                                 {"translation", {translation.x(), translation.y(), translation.z()}}};
  }
  for (std::size_t i = 0; i < block.images.size(); ++i) {
    const ImageIndex image(static_cast<std::int64_t>(i));
    assignments[block.frames[block.images[image].frame].name].push_back(
        {block.name_of(image), block.cameras[block.camera_of(image)].name});
  }
  write_text((root / "rig_cameras.json").string(), cameras.dump(2) + "\n");
  write_text((root / "rig_assignments.json").string(), assignments.dump(2) + "\n");
}

// Writes the control points (without the check points) in the form that other programs read: longitude, latitude,
// ellipsoidal height, then column and row, which count from the centre of the first pixel.
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
             << block.name_of(m.image) << ' ' << point.name << '\n';
  }
  stream.close();
  if (!stream) throw_file_error(path.string(), "written", errno);
}

// Writes "    distortion: {k1: -0.03, ...}", a line with all parameters after the principal point.
void write_distortion(const Intrinsics& k, std::ostream& yaml) {
  const char* separator = "    distortion: {";
  for (int p = kPrincipalY + 1; p < k.size(); ++p) {
    if (is_fixed(k.model(), p)) continue;
    yaml << separator << parameter_name(k.model(), p) << ": " << k[p];
    separator = ", ";
  }
  if (*separator == ',') yaml << "}\n";
}

void write_cameras(const SimulationOptions& options, const Block& block, std::ostream& yaml) {
  const bool brown = options.camera_model == model_name(CameraModel());
  // The headers of the images are sufficient, unless there is a calibration to start from or to hold.
  if (options.calibrate && !is_stereopolis(options)) {
    if (!brown) yaml << "cameras:\n  default: {model: " << options.camera_model << "}\n";
    if (options.affinity > 0) yaml << "cameras:\n  default: {calibrate: [usual, b1, b2]}\n";
    return;
  }
  yaml << "cameras:\n  grouping: " << (block.cameras.size() > 1 ? "exif" : "one") << '\n';
  for (std::size_t c = 0; c < block.cameras.size(); ++c) {
    const Camera& camera = block.cameras[CameraIndex(static_cast<std::int64_t>(c))];
    const Intrinsics& k = camera.intrinsics;
    if (block.cameras.size() > 1)
      yaml << "  \"" << name_by_headers(camera) << "\":\n";
    else
      yaml << "  default:\n";
    if (!brown) yaml << "    model: " << options.camera_model << '\n';
    if (!is_fixed(k.model(), kFocal)) yaml << "    focal_px: " << k[kFocal] << '\n';
    yaml << "    principal_point_px: [" << k[kPrincipalX] << ", " << k[kPrincipalY] << "]\n";
    write_distortion(k, yaml);
    yaml << "    calibrate: " << (options.calibrate ? "true" : "false") << '\n';
  }
}

std::string project_text(const SimulationOptions& options, const Block& block) {
  const GroundFrame& ground = block.ground;
  const bool has_poses =
      std::ranges::any_of(block.frames, [](const Frame& frame) { return frame.given_pose.has_value(); });
  std::ostringstream yaml;
  yaml << std::setprecision(12) << "# A rendered block; the truth is in truth.csv (poses) and truth.h5.\n"
       << "images: images\n"
       << "origin: [" << ground.latitude_deg << ", " << ground.longitude_deg << ", " << ground.height_m << "]\n";
  if (options.gps_sigma_m > 0) {
    yaml << "gps:\n  sigma_horizontal_m: " << options.gps_sigma_m << "\n  sigma_vertical_m: " << options.gps_sigma_m
         << '\n';
    for (const Frame& frame : block.frames) {
      if (!frame.position_prior) continue;
      const Eigen::Vector3d& arm = frame.position_prior->lever_arm;
      if (!arm.isZero()) yaml << "  lever_arm_m: [" << arm.x() << ", " << arm.y() << ", " << arm.z() << "]\n";
      break;
    }
  }
  if (has_rig(block)) {
    const Mount& mount = block.rigs.front().mounts.back();
    yaml << "rigs:\n  cameras: rig_cameras.json\n  assignments: rig_assignments.json\n"
         << "  sigma_position_m: " << mount.position_sigma_m << (mount.held() ? "  # held" : "")
         << "\n  sigma_rotation_deg: " << mount.rotation_sigma_rad * 180 / std::numbers::pi << '\n';
  }
  if (!block.control_points.empty()) yaml << "control: control.csv\n";
  if (has_poses && is_stereopolis(options))
    yaml << "poses: poses.csv  # the trajectory\n"
         << "# trajectory: {file: trajectory.csv, use: [positions, attitudes]}  # the same as observations\n"
         << (block.relative_poses.empty() ? "" : "# relative_poses: relative_poses.csv  # odometer and gyroscopes\n");
  else if (has_poses)
    yaml << "# poses: poses.csv  # approximate poses; without them the images are oriented first\n";
  write_cameras(options, block, yaml);
  yaml << '\n';
  return yaml.str();
}

}  // namespace

void write_rendered_block(const SimulationOptions& asked, const std::string& folder, EditedProject edited) {
  asked.check();
  if (asked.scene == SimulationOptions::Scene::kTargetField)
    throw InputError("simulation: the target field is made of tie points only; leave out --rendered");
  SimulationOptions options = asked;
  options.bridge = false;  // the renderer cannot draw bridges
  const fs::path root(folder);
  make_folder((root / "images").string());
  Layout layout = make_city_layout(options);
  {
    const Observer observer(layout, image_margin(options));
    simulate_control_zones(options, observer, layout);
    simulate_control(options, observer, layout);
  }
  SimulatedBlock simulated;
  simulated.block = layout.block;
  simulated.truth = layout.truth;
  simulate_given(options, simulated);
  const std::string project = project_text(options, simulated.block);
  refuse_edited_project(folder, project, edited);
  write_images(options, layout, simulated.block, root / "images");
  write_pose_csv((root / "truth.csv").string(), pose_table(simulated.block, simulated.truth));
  write_state((root / "truth.h5").string(), simulated.truth);
  if (has_rig(simulated.block)) write_rig(simulated.block, root);
  write_pose_files(simulated.block, folder);
  if (!simulated.block.control_points.empty()) {
    write_control_csv((root / "control.csv").string(), simulated.block);
    write_gcp_list(simulated.block, root / "gcp_list.txt");
  }
  write_text((root / "block.yaml").string(), project);
}

}  // namespace megablock
