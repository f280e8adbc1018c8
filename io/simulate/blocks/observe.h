// Finds the images that see a place.
#pragma once

#include <optional>
#include <vector>

#include "io/simulate/scene/layout.h"

namespace megablock {

// Width of the margin of images without observations. The noise must not move an observation outside the image: five
// sigmas, and two pixels beside them.
inline double image_margin(const SimulationOptions& options) { return 2 + 5 * options.image_noise_px; }

struct SimulatedObservation {
  ImageIndex image;
  Eigen::Vector2d pixel;  // without noise
};

class Observer {
 public:
  // A place counts as seen only if it is at least `margin_px` inside the image.
  Observer(const Layout& layout, double margin_px);
  // The images that see a point, ascending.
  std::vector<SimulatedObservation> observations_of(const SurfacePoint& point) const;
  // The pixel of a place in an image, even if something hides it. Empty if it is outside the image. A camera with a
  // rolling shutter sees the place from where it is when it reads that row.
  std::optional<Eigen::Vector2d> pixel_of(ImageIndex image, const Eigen::Vector3d& place) const;

 private:
  struct View {
    Eigen::Matrix3d rotation;  // ground to camera
    Eigen::Vector3d centre;
    std::int64_t camera = 0;
  };
  Eigen::Vector2d rolling_pixel(ImageIndex image, const Eigen::Vector3d& place) const;
  void look(std::int64_t frame, const SurfacePoint& point, std::vector<SimulatedObservation>& seen) const;

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

}  // namespace megablock
