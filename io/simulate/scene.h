// Inside of the simulator: where frames stand and which surfaces they see.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "io/simulate/random.h"
#include "io/simulate/simulate.h"

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
};

// Frames, rigs and images with their true poses; neither priors nor observations. Images of a frame follow one another:
// image = frame * cameras + mount.
struct Layout {
  Block block;  // cameras as the job is told
  BlockState truth;
  std::unique_ptr<Scene> scene;
};

Layout make_aerial_layout(const SimulationOptions& options);
Layout make_street_layout(const SimulationOptions& options);

// Adds a camera: nominal in the block, true in the state (SimulationOptions::distortion, calibrate).
CameraIndex add_simulated_camera(const SimulationOptions& options, Layout& layout);
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

 private:
  struct View {
    Eigen::Matrix3d rotation;  // ground to camera
    Eigen::Vector3d centre;
    std::int64_t camera = 0;
  };
  void look(std::int64_t frame, const SurfacePoint& point, std::vector<Sighting>& seen) const;

  const Layout& layout_;
  double margin_px_;
  std::vector<View> views_;            // [images]
  std::vector<double> max_radius_sq_;  // [cameras] of normalised coordinates inside the image
  // Frames by square cells in plan, cells row by row: frames of cell c are rows [cell_begin_[c], cell_begin_[c + 1]).
  Eigen::Vector2d origin_;
  double cell_m_ = 1;
  std::int64_t columns_ = 1, rows_ = 1;
  std::vector<std::int64_t> cell_begin_, cell_frames_;
};

// Parts of simulate_block.
void simulate_tracks(const SimulationOptions& options, const Layout& layout, const TrackSink& sink,
                     std::int64_t batch_observations);
void simulate_control(const SimulationOptions& options, const Layout& layout, SimulatedBlock& simulated);
void simulate_priors(const SimulationOptions& options, SimulatedBlock& simulated);

}  // namespace megablock
