// The inside of the simulator: the frames of a simulated block and the surfaces that they see.
#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/simulate/scene/random.h"
#include "io/simulate/scene/simulated_block.h"
#include "io/simulate/scene/simulation_options.h"

namespace megablock {

struct SurfacePoint {
  Eigen::Vector3d position;
  Eigen::Vector3d normal;  // unit, towards the side from which the surface is seen
};

// Surfaces of a scene. Points are sampled frame by frame, so that the cost is linear in the number of frames.
class Scene {
 public:
  virtual ~Scene() = default;
  // A random surface point near the frame; it need not be in one of its images. Empty: this draw failed.
  virtual std::optional<SurfacePoint> sample(const Pose& frame, Random& random) const = 0;
  // Not hidden, not too far, not seen too flat (frustum apart).
  virtual bool visible(const Eigen::Vector3d& eye, const SurfacePoint& point) const = 0;
  // A point is never seen by frames farther than this from it in plan, metres.
  virtual double range_m() const = 0;
  // Street: neighbours in time share tracks. Aerial: any image that holds the point.
  virtual bool along_passes() const = 0;
  // Frames of one pass that are farther apart than this visit a place anew.
  virtual std::int64_t visit_frames() const { return std::numeric_limits<std::int64_t>::max(); }

  // The road at a place in plan; empty where there is none.
  virtual std::optional<SurfacePoint> road(const Eigen::Vector2d&) const { return std::nullopt; }

  // What wrong matches that agree with one another take for the point: a place beside it (repeated facade), or one that
  // moves (vehicle).
  struct Mistake {
    Eigen::Vector3d offset = Eigen::Vector3d::Zero();    // metres
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  // metres per second
    Verdict verdict = Verdict::kRepeated;
  };
  // Empty: wrong matches lie anywhere in the image.
  virtual std::optional<Mistake> mistake(const SurfacePoint&, Random&) const { return std::nullopt; }
};

// Frames, rigs and images with their true poses; neither priors nor observations. Images of a frame follow one another:
// image = frame * cameras + mount.
struct Layout {
  Block block;  // cameras as the job is told
  BlockState truth;
  std::unique_ptr<Scene> scene;
  std::vector<Eigen::Vector3d> control_truth;  // positions [block.control_points]
  std::vector<std::string> image_suffixes;     // [mounts] of image names; empty: "_c0", "_c1" ..., one camera: none
  std::vector<Eigen::Vector2d> crossings;      // of driven streets, where zones of control may be
};

// That of options.scene.
Layout make_layout(const SimulationOptions& options);
Layout make_aerial_layout(const SimulationOptions& options);
Layout make_street_layout(const SimulationOptions& options);
Layout make_stereopolis_layout(const SimulationOptions& options);
Layout make_target_field_layout(const SimulationOptions& options);
Layout make_panorama_layout(const SimulationOptions& options);

// Adds a camera: nominal in the block, true in the state (SimulationOptions::distortion, calibrate).
CameraIndex add_simulated_camera(const SimulationOptions& options, Layout& layout);
// Makes the only rig of the block, of one such camera, which it returns.
CameraIndex add_single_camera_rig(const SimulationOptions& options, Layout& layout);
// Adds a frame with one image per mount of the (only) rig.
void add_simulated_frame(Layout& layout, const Pose& pose, std::int64_t pass, double time_s);

struct Sighting {
  ImageIndex image;
  Eigen::Vector2d pixel;  // without noise
};

// Finds the images that see a point.
class Observer {
 public:
  // Only places at least `margin_px` inside the image count as seen.
  Observer(const Layout& layout, double margin_px);
  // Ascending by image.
  std::vector<Sighting> sightings(const SurfacePoint& point) const;
  // Where a place appears in an image, whatever stands in between; empty: not inside.
  std::optional<Eigen::Vector2d> pixel_of(ImageIndex image, const Eigen::Vector3d& place) const;

 private:
  struct View {
    Eigen::Matrix3d rotation;  // ground to camera
    Eigen::Vector3d centre;
    std::int64_t camera = 0;
  };
  void look(std::int64_t frame, const SurfacePoint& point, std::vector<Sighting>& seen) const;

  const Layout& layout_;
  double margin_px_;
  std::vector<View> views_;               // [images]
  std::vector<std::uint8_t> all_around_;  // [cameras] 1: sees beyond 90 degrees, so that the next does not count
  std::vector<double> max_radius_sq_;     // [cameras] of normalised coordinates inside the image
  // Frames by square cells in plan, cells row by row: frames of cell c are rows [cell_begin_[c], cell_begin_[c + 1]).
  Eigen::Vector2d origin_;
  double cell_m_ = 1;
  std::int64_t columns_ = 1, rows_ = 1;
  std::vector<std::int64_t> cell_begin_, cell_frames_;
};

// Parts of simulate_block. Control goes to layout.block and layout.control_truth.
void simulate_tracks(const SimulationOptions& options, const Layout& layout, const Observer& observer,
                     const TrackSink& sink, std::int64_t batch_observations);
// The tracks [first, last) of `from`.
void append_tracks(SimulatedTracks& to, const SimulatedTracks& from, std::size_t first, std::size_t last);
void simulate_control(const SimulationOptions& options, const Observer& observer, Layout& layout);
void simulate_control_zones(const SimulationOptions& options, const Observer& observer, Layout& layout);
// Priors, given poses and relative poses: of the trajectory (Stereopolis), or with true sigmas (the others).
void simulate_given(const SimulationOptions& options, SimulatedBlock& simulated);
void simulate_priors(const SimulationOptions& options, SimulatedBlock& simulated);
// Margin of the images in which nothing is measured: the noise must not carry a measurement outside.
inline double image_margin(const SimulationOptions& options) { return 2 + 5 * options.image_noise_px; }
// Relative pose of two frames with the sigmas and the noise of the options.
RelativePose measure_relative(const SimulationOptions& options, const BlockState& truth, FrameIndex from, FrameIndex to,
                              Random& random);
// A control or check point of stated sigma `control_sigma_m` and its measurements, with noise; the role is kControl.
ControlPoint measure_control(const SimulationOptions& options, const Eigen::Vector3d& truth,
                             const std::vector<Sighting>& seen, Random& random);

}  // namespace megablock
