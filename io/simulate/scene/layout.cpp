#include "io/simulate/scene/layout.h"

#include <iomanip>
#include <limits>
#include <sstream>

#include "io/simulate/scene/published_cameras.h"

namespace megablock {

namespace {

std::string frame_name(std::int64_t index) {
  std::ostringstream name;
  name << 'f' << std::setw(6) << std::setfill('0') << index;
  return name.str();
}

}  // namespace

CameraIndex add_simulated_camera(const SimulationOptions& options, Layout& layout) {
  const CameraIndex index = layout.block.cameras.next_index();
  Random random(options.seed, Random::Purpose::kCamera, static_cast<std::uint64_t>(index.value));
  Camera camera;
  camera.name.append("camera").append(std::to_string(index.value));
  camera.width = options.image_width;
  camera.height = options.image_height;
  camera.focal_known = true;
  const CameraModel model = find_model(options.camera_model).value();
  camera.intrinsics = start_intrinsics(model, options.focal_px, options.image_width, options.image_height);

  Intrinsics truth = camera.intrinsics;
  // Only the initial value changes, not the truth.
  if (!is_fixed(model, kFocal)) camera.intrinsics[kFocal] *= options.start_focal;
  const IntrinsicSigmas weak = weak_sigmas(truth, 0.01 * options.focal_px, options.image_width);
  const auto estimated = [&](int parameter) { return weak[static_cast<std::size_t>(parameter)] > 0; };
  if (options.calibrate) {
    // Errors of up to 0.3 % of the focal length. Each parameter that the model fixes keeps its value.
    if (estimated(kFocal)) truth[kFocal] *= 1 + 0.003 * random.uniform(-1, 1);
    if (estimated(kPrincipalX)) truth[kPrincipalX] += 0.003 * options.focal_px * random.uniform(-1, 1);
    truth[kPrincipalY] += 0.003 * options.focal_px * random.uniform(-1, 1);
  }
  if (options.distortion && model != CameraModel()) {
    constexpr double kShare = 0.15;  // errors of the true camera, as a share of the weak prior sigmas
    // The weak sigmas have the unit and size that each parameter needs, so one share serves all models.
    for (int p = kPrincipalY + 1; p < truth.size(); ++p)
      truth[p] += kShare * weak[static_cast<std::size_t>(p)] * random.uniform(-1, 1);
  } else if (options.distortion) {
    truth[kRadial1] = random.uniform(-0.04, -0.02);
    truth[kRadial2] = random.uniform(0.005, 0.012);
    truth[kDecentring1] = random.uniform(-4e-4, 4e-4);
    truth[kDecentring2] = random.uniform(-4e-4, 4e-4);
  }
  if (options.affinity > 0)
    for (const int p : {kAffinity, kSkew}) truth[p] = options.affinity * options.focal_px * random.uniform(-1, 1);
  if (options.published_camera > 0)
    truth = published_cameras()[static_cast<std::size_t>(options.published_camera - 1)].truth;
  if (options.calibrate) {
    constexpr double kFree = std::numeric_limits<double>::infinity();
    // The true Brown camera has no k3, so k3 is held at zero.
    const double rare = options.affinity > 0 ? kFree : 0;
    if (model == CameraModel())
      camera.prior_sigma = {kFree, kFree, kFree, kFree, kFree, 0, kFree, kFree, rare, rare};
    else
      camera.prior_sigma = weak;
  } else {
    camera.intrinsics = truth;
  }
  camera.readout_s = options.start_readout * options.readout_ms / 1000;
  layout.readout_s = options.readout_ms / 1000;
  layout.block.cameras.push_back(camera);
  layout.truth.cameras.push_back(truth);
  return index;
}

CameraIndex add_single_camera_rig(const SimulationOptions& options, Layout& layout) {
  const CameraIndex camera = add_simulated_camera(options, layout);
  Rig rig;
  rig.name = "rig0";
  rig.mounts.push_back({camera, Pose(), 0, 0});
  layout.block.rigs.push_back(rig);
  layout.truth.mounts.push_back({Pose()});
  return camera;
}

void add_simulated_frame(Layout& layout, const Pose& pose, std::int64_t pass, double time_s,
                         const std::optional<Motion>& motion) {
  const FrameIndex index = layout.block.frames.next_index();
  const RigIndex rig(0);
  const std::size_t cameras = layout.block.rigs[rig].mounts.size();
  Frame frame;
  frame.name = frame_name(index.value);
  frame.rig = rig;
  frame.pass = pass;
  // Seconds since 1970: the block was taken in September 2020. A plausible time is needed for EXIF.
  frame.time_s = 1.6e9 + time_s;
  for (std::size_t m = 0; m < cameras; ++m) {
    std::string name = frame.name;
    if (!layout.image_suffixes.empty())
      name.append(layout.image_suffixes[m]);
    else if (cameras > 1)
      name.append("_c").append(std::to_string(m));
    layout.block.add_image(name.append(".jpg"), {index, static_cast<int>(m), 0});
  }
  if (cameras == 1) frame.name += ".jpg";  // the frame of a single image has the name of this image
  layout.block.frames.push_back(std::move(frame));
  layout.truth.frames.push_back(pose);
  if (motion) layout.motions.push_back(*motion);
  layout.truth.oriented.push_back(1);
}

}  // namespace megablock
