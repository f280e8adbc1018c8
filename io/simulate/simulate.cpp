#include "io/simulate/simulate.h"

#include <cmath>
#include <iomanip>
#include <limits>
#include <sstream>

#include "io/error.h"
#include "io/simulate/scene.h"

namespace megablock {

namespace {

void require(bool condition, const std::string& message) {
  if (!condition) throw InputError("simulation: " + message);
}

std::string frame_name(std::int64_t index) {
  std::ostringstream name;
  name << 'f' << std::setw(6) << std::setfill('0') << index;
  return name.str();
}

}  // namespace

void SimulationOptions::check() const {
  require(frames >= 2, "frames must be at least 2");
  require(forward_overlap >= 0.3 && forward_overlap < 0.99, "forward_overlap must lie in [0.3, 0.99)");
  require(side_overlap >= 0 && side_overlap < 0.99, "side_overlap must lie in [0, 0.99)");
  require(height_m > 0, "height_m must be positive");
  require(terrain_relief_m >= 0 && terrain_relief_m <= height_m, "terrain_relief_m must lie in [0, height_m]");
  require(street_spacing_m >= 40, "street_spacing_m must be at least 40");
  require(frame_distance_m > 0 && frame_distance_m <= 15, "frame_distance_m must lie in (0, 15]");
  require(rig_cameras >= 1 && rig_cameras <= 16, "rig_cameras must lie in [1, 16]");
  require(points_per_frame >= 10, "points_per_frame must be at least 10");
  require(mean_track >= 2 && mean_track <= 30, "mean_track must lie in [2, 30]");
  require(image_noise_px >= 0 && image_noise_px < 50, "image_noise_px must lie in [0, 50)");
  require(outlier_share >= 0 && outlier_share < 1, "outlier_share must lie in [0, 1)");
  require(gps_share >= 0 && gps_share <= 1, "gps_share must lie in [0, 1]");
  require(std::isfinite(gps_sigma_m) && std::isfinite(attitude_sigma_deg), "sigmas of priors must be finite");
  require(relative_position_sigma_m <= 0 || relative_rotation_sigma_deg > 0,
          "relative_rotation_sigma_deg must be positive with relative_position_sigma_m");
  require(control_points >= 0 && check_points >= 0, "control_points and check_points must not be negative");
  require(control_sigma_m > 0, "control_sigma_m must be positive");
  require(image_width >= 64 && image_height >= 64, "images must have at least 64 x 64 pixels");
  require(focal_px >= 0.3 * std::max(image_width, image_height), "focal_px must be at least 0.3 of the larger side");
}

CameraIndex add_simulated_camera(const SimulationOptions& options, Layout& layout) {
  const CameraIndex index = layout.block.cameras.next_index();
  Random random(options.seed, Random::Purpose::kCamera, static_cast<std::uint64_t>(index.value));
  Camera camera;
  camera.name.append("camera").append(std::to_string(index.value));
  camera.width = options.image_width;
  camera.height = options.image_height;
  camera.focal_known = true;
  camera.intrinsics = {options.focal_px, options.image_width / 2.0, options.image_height / 2.0, 0, 0, 0, 0, 0};

  Intrinsics truth = camera.intrinsics;
  if (options.calibrate) {
    truth[kFocal] *= 1 + 0.003 * random.uniform(-1, 1);
    truth[kPrincipalX] += 0.003 * options.focal_px * random.uniform(-1, 1);
    truth[kPrincipalY] += 0.003 * options.focal_px * random.uniform(-1, 1);
  }
  if (options.distortion) {
    truth[kRadial1] = random.uniform(-0.04, -0.02);
    truth[kRadial2] = random.uniform(0.005, 0.012);
    truth[kDecentring1] = random.uniform(-4e-4, 4e-4);
    truth[kDecentring2] = random.uniform(-4e-4, 4e-4);
  }
  if (options.calibrate) {
    std::fill_n(camera.prior_sigma.begin(), camera.intrinsics.size(), std::numeric_limits<double>::infinity());
    camera.prior_sigma[kRadial3] = 0;
  } else {
    camera.intrinsics = truth;
  }
  layout.block.cameras.push_back(camera);
  layout.truth.cameras.push_back(truth);
  return index;
}

void add_simulated_frame(Layout& layout, const Pose& pose, std::int64_t pass, double time_s) {
  const FrameIndex index = layout.block.frames.next_index();
  const RigIndex rig(0);
  const std::size_t cameras = layout.block.rigs[rig].mounts.size();
  Frame frame;
  frame.name = frame_name(index.value);
  frame.rig = rig;
  frame.pass = pass;
  frame.time_s = 1.6e9 + time_s;
  for (std::size_t m = 0; m < cameras; ++m) {
    Image image;
    image.name = frame.name;
    if (cameras > 1) image.name.append("_c").append(std::to_string(m));
    image.name.append(".jpg");
    image.frame = index;
    image.mount = static_cast<int>(m);
    layout.block.images.push_back(std::move(image));
  }
  if (cameras == 1) frame.name += ".jpg";  // a single photo's frame carries the name of its image
  layout.block.frames.push_back(std::move(frame));
  layout.truth.frames.push_back(pose);
  layout.truth.oriented.push_back(1);
}

SimulatedBlock simulate_block(const SimulationOptions& options, const TrackSink& sink,
                              std::int64_t batch_observations) {
  options.check();
  const bool aerial = options.scene == SimulationOptions::Scene::kAerial;
  Layout layout = aerial ? make_aerial_layout(options) : make_street_layout(options);
  layout.block.ground.georeferenced = options.gps_sigma_m > 0 || options.control_points > 0;
  if (layout.block.ground.georeferenced) layout.block.ground = {true, 48.85, 2.35, 100, "EPSG:4326"};

  SimulatedBlock simulated;
  simulated.tracks.begin = {0};
  simulated.block = layout.block;
  simulated.truth = layout.truth;
  simulate_tracks(options, layout, sink, batch_observations);
  simulate_control(options, layout, simulated);
  simulate_priors(options, simulated);
  check(simulated.block);
  return simulated;
}

SimulatedBlock simulate_block(const SimulationOptions& options) {
  SimulatedTracks all;
  all.tracks.begin = {0};
  const auto append = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
  SimulatedBlock simulated = simulate_block(options, [&](const SimulatedTracks& batch) {
    const std::int64_t before = all.tracks.observation_count();
    for (std::size_t t = 1; t < batch.tracks.begin.size(); ++t)
      all.tracks.begin.push_back(before + batch.tracks.begin[t]);
    append(all.tracks.id, batch.tracks.id);
    append(all.tracks.image, batch.tracks.image);
    append(all.tracks.x, batch.tracks.x);
    append(all.tracks.y, batch.tracks.y);
    append(all.tracks.feature, batch.tracks.feature);
    append(all.points, batch.points);
    append(all.outlier, batch.outlier);
  });
  static_cast<SimulatedTracks&>(simulated) = std::move(all);
  return simulated;
}

}  // namespace megablock
