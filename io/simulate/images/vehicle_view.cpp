#include "io/simulate/images/vehicle_view.h"

#include <limits>

#include "io/simulate/images/render.h"

namespace megablock {

namespace {

struct Part {
  Box box;  // rig axes: x right, y down, z ahead; metres
  Eigen::Vector3f colour;
  float texture;  // share of the colour
};

std::vector<Part> parts() {
  return {{{{-0.75, 0.36, -1.5}, {0.75, 0.5, 1.5}}, {205, 205, 210}, 0.08f},  // roof
          {{{-0.55, 0.16, -1.3}, {-0.2, 0.36, -0.95}}, {90, 95, 110}, 0.4f},  // dome
          {{{0.42, -0.8, -0.95}, {0.47, 0.36, -0.9}}, {60, 60, 60}, 0.0f},    // mast
          {{{-1.15, 0.08, -0.1}, {-0.9, 0.28, 0.08}}, {170, 60, 50}, 0.3f}};  // scanner
}

}  // namespace

VehicleView::VehicleView(const SimulationOptions& options, const RayTable& rays, const Pose& mount)
    : rows_(rays.rows()), columns_(rays.columns()) {
  surface_.assign(at(rows_, 0), -1);
  const std::vector<Part> all = parts();
  const Eigen::Matrix3d to_rig = mount.rotation.toRotationMatrix().transpose();
  const double pixel_angle = 1 / options.focal_px;
  const Texture texture(options.seed, 3 * pixel_angle);  // the finest wave is three pixels long at a distance of 1 m
  for (int row = 0; row < rows_; ++row)
    for (int column = 0; column < columns_; ++column) {
      const Eigen::Vector2d ray = rays.at(row, column).cast<double>();
      const Eigen::Vector3d direction = (to_rig * ray.homogeneous()).normalized();
      const Eigen::Vector3d inverse = direction.cwiseInverse();
      double nearest = std::numeric_limits<double>::infinity();
      Surface surface{};
      for (std::size_t k = 0; k < all.size(); ++k) {
        double distance = 0;
        int axis = 0;
        if (!enter(all[k].box, mount.centre, inverse, distance, axis) || distance >= nearest) continue;
        nearest = distance;
        const Eigen::Vector3d p = mount.centre + distance * direction;
        // A ray towards -axis enters through the face whose normal is +axis.
        surface.face = 2 * axis + (direction[axis] < 0 ? 1 : 0);
        const auto number = static_cast<std::uint32_t>(100 + 8 * k) + static_cast<std::uint32_t>(surface.face);
        const float detail = texture.detail(p[(axis + 1) % 3], p[(axis + 2) % 3], number, distance * pixel_angle);
        surface.colour = std::max(0.1f, 1 + all[k].texture * detail) * all[k].colour;
      }
      if (!std::isfinite(nearest)) continue;
      surface_[at(row, column)] = static_cast<std::int32_t>(surfaces_.size());
      surfaces_.push_back(surface);
    }
}

VehicleView::Light VehicleView::light_at(const City& city, const Pose& rig) {
  Light light;
  for (int face = 0; face < 6; ++face) {
    const Eigen::Vector3d normal = (face % 2 == 1 ? 1 : -1) * Eigen::Vector3d::Unit(face / 2);
    light[static_cast<std::size_t>(face)] = city.light(rig.centre, rig.rotation.conjugate() * normal);
  }
  return light;
}

cv::Mat VehicleView::mask() const {
  cv::Mat mask(rows_ / 2, columns_ / 2, CV_8UC1);
  for (int r = 0; r < mask.rows; ++r)
    for (int c = 0; c < mask.cols; ++c) {
      const int covered =
          covers(2 * r, 2 * c) + covers(2 * r, 2 * c + 1) + covers(2 * r + 1, 2 * c) + covers(2 * r + 1, 2 * c + 1);
      mask.at<unsigned char>(r, c) = covered > 2 ? 0 : 255;
    }
  return mask;
}

}  // namespace megablock
