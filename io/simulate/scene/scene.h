// Gives the common parts of all simulated scenes: the frames of a block, the surfaces that they see, and the functions
// that simulate observations.
//
// Coordinates: the ground frame is x east, y north, z up, in metres. A rig and a camera have x right, y down, z ahead.
// A pose has the rotation R ground -> rig and the centre C in the ground, so that a point X has the rig coordinates R
// (X - C). Pixels count from the upper left corner of the image; the centre of its first pixel is (0.5, 0.5).
//
// Truth and job differ only in the parameters that the job estimates: the true cameras, mounts and poses are in
// `truth`, and the observations are computed from them. The block holds the initial values and the priors.
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

// The surfaces of a scene. Points are sampled frame by frame, so that the time is linear in the number of frames.
class Scene {
 public:
  virtual ~Scene() = default;
  // A random surface point near the frame, not necessarily inside its images. Empty if this draw failed.
  virtual std::optional<SurfacePoint> sample(const Pose& frame, Random& random) const = 0;
  // Whether a point is neither hidden, nor too far away, nor seen at too flat an angle. The frustum is not tested.
  // The angle between surface and line of sight matters because no matcher finds a point again that one image sees
  // almost along its surface.
  virtual bool visible(const Eigen::Vector3d& eye, const SurfacePoint& point) const = 0;
  // No frame sees a point that is farther away from it in plan, metres.
  virtual double range_m() const = 0;
  // True (streets): frames that are neighbours in time share tracks. False (aerial): all images with the point do.
  virtual bool along_passes() const = 0;
  // Frames of one pass that are farther apart than this are different visits of a place.
  virtual std::int64_t visit_frames() const { return std::numeric_limits<std::int64_t>::max(); }

  // The road surface at a place in plan. Empty where there is no road.
  virtual std::optional<SurfacePoint> road(const Eigen::Vector2d&) const { return std::nullopt; }

  // The place that wrong matches which agree with one another show instead of the point: a place beside it (repeated
  // facade), or one that moves (vehicle).
  struct Mistake {
    Eigen::Vector3d offset = Eigen::Vector3d::Zero();    // metres
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  // metres per second
    Verdict verdict = Verdict::kRepeated;
  };
  // Empty if wrong matches lie anywhere in the image.
  virtual std::optional<Mistake> mistake(const SurfacePoint&, Random&) const { return std::nullopt; }
};

// The frames, rigs and images of a block with their true poses, without priors and observations. The images of a frame
// follow one another: image = frame * cameras + mount.
struct Layout {
  Block block;  // cameras have the values that the job will get
  BlockState truth;
  std::unique_ptr<Scene> scene;
  std::vector<Eigen::Vector3d> control_truth;  // positions [block.control_points]
  std::vector<std::string> image_suffixes;     // [mounts] ends of image names; empty: "_c0", ..., none for one camera
  std::vector<Eigen::Vector2d> crossings;      // of streets with frames; zones of control may be there
};

// Makes the layout of options.scene. The options must have passed check().
Layout make_layout(const SimulationOptions& options);
Layout make_aerial_layout(const SimulationOptions& options);
Layout make_street_layout(const SimulationOptions& options);
Layout make_stereopolis_layout(const SimulationOptions& options);
Layout make_target_field_layout(const SimulationOptions& options);
Layout make_panorama_layout(const SimulationOptions& options);

// Adds a camera with its nominal values in the block and its true values in the state (SimulationOptions::distortion,
// calibrate).
CameraIndex add_simulated_camera(const SimulationOptions& options, Layout& layout);
// Adds such a camera and the only rig of the block, which has this one camera. Returns the camera.
CameraIndex add_single_camera_rig(const SimulationOptions& options, Layout& layout);
// Adds a frame with one image for each mount of the only rig.
void add_simulated_frame(Layout& layout, const Pose& pose, std::int64_t pass, double time_s);

struct Sighting {
  ImageIndex image;
  Eigen::Vector2d pixel;  // without noise
};

// Finds the images that see a point.
class Observer {
 public:
  // A place counts as seen only if it is at least `margin_px` inside the image.
  Observer(const Layout& layout, double margin_px);
  // The images that see a point, ascending.
  std::vector<Sighting> sightings(const SurfacePoint& point) const;
  // The pixel of a place in an image, even if something hides it. Empty if it is outside the image.
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
  std::vector<std::uint8_t> all_around_;  // [cameras] 1: sees beyond 90 degrees, so max_radius_sq_ does not apply
  std::vector<double> max_radius_sq_;     // [cameras] of normalised coordinates inside the image
  // The frames by square cells in plan, cells row by row. Those of cell c are the rows [cell_begin_[c], cell_begin_[c +
  // 1]).
  Eigen::Vector2d origin_;
  double cell_m_ = 1;
  std::int64_t columns_ = 1, rows_ = 1;
  std::vector<std::int64_t> cell_begin_, cell_frames_;
};

// Parts of simulate_block(). Control points are added to layout.block and layout.control_truth.
void simulate_tracks(const SimulationOptions& options, const Layout& layout, const Observer& observer,
                     const TrackSink& sink, std::int64_t batch_observations);
// Appends the tracks [first, last) of `from`.
void append_tracks(SimulatedTracks& to, const SimulatedTracks& from, std::size_t first, std::size_t last);
void simulate_control(const SimulationOptions& options, const Observer& observer, Layout& layout);
void simulate_control_zones(const SimulationOptions& options, const Observer& observer, Layout& layout);
// Simulates priors, given poses and relative poses: from a trajectory (Stereopolis), or with true sigmas (other
// scenes).
void simulate_given(const SimulationOptions& options, SimulatedBlock& simulated);
void simulate_priors(const SimulationOptions& options, SimulatedBlock& simulated);
// Width of the margin of images without observations. The noise must not move an observation outside the image: five
// sigmas, and two pixels beside them.
inline double image_margin(const SimulationOptions& options) { return 2 + 5 * options.image_noise_px; }
// Simulates the relative pose of two frames with the sigmas and the noise of the options.
RelativePose measure_relative(const SimulationOptions& options, const BlockState& truth, FrameIndex from, FrameIndex to,
                              Random& random);
// Simulates a control point with the stated sigma `control_sigma_m`, and its measurements, both with noise. The role is
// kControl.
ControlPoint measure_control(const SimulationOptions& options, const Eigen::Vector3d& truth,
                             const std::vector<Sighting>& seen, Random& random);

}  // namespace megablock
