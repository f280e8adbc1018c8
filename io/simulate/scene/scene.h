// Gives the surfaces of a simulated scene, and says where wrong matches and roads are on them.
//
// Coordinates: the ground frame is x east, y north, z up, in metres. A rig and a camera have x right, y down, z ahead.
// A pose has the rotation R ground -> rig and the centre C in the ground, so that a point X has the rig coordinates R
// (X - C). Pixels count from the upper left corner of the image; the centre of its first pixel is (0.5, 0.5).
#pragma once

#include <limits>
#include <optional>

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

  // Where wrong matches that agree with one another locate the point: beside it (repeated facade), or where it moves
  // (vehicle).
  struct Mistake {
    Eigen::Vector3d offset = Eigen::Vector3d::Zero();    // metres
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  // metres per second
    Verdict verdict = Verdict::kRepeated;
  };
  // Empty if wrong matches lie anywhere in the image.
  virtual std::optional<Mistake> mistake(const SurfacePoint&, Random&) const { return std::nullopt; }
};

}  // namespace megablock
