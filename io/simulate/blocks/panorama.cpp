// Simulates a panorama: a camera turns about a point in or beside its projection centre, with points all around.
#include "io/simulate/blocks/panorama.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <numbers>

#include "geometry/camera/camera.h"

namespace megablock {

std::vector<Eigen::Quaterniond> panorama_rotations(double horizontal_rad, double vertical_rad, std::int64_t images,
                                                   double step) {
  constexpr std::int64_t kRows = 3;
  std::vector<Eigen::Quaterniond> rotations;
  for (std::int64_t row = 0; row < kRows; ++row) {
    const std::int64_t count = images / kRows + (row < images % kRows);
    const double pitch = static_cast<double>(row == 0 ? 0 : row == 1 ? 1 : -1) * 0.5 * vertical_rad;
    // A turn by `angle` about the vertical moves the image only by angle cos(pitch) on the sphere.
    const double angle = std::min(2 * std::numbers::pi / static_cast<double>(std::max<std::int64_t>(1, count)),
                                  step * horizontal_rad / std::cos(pitch));
    for (std::int64_t i = 0; i < count; ++i) {
      // Rows begin a third of a step apart, so that the seams of one row lie inside the images of the others.
      const double yaw = angle * (static_cast<double>(i) + static_cast<double>(row) / kRows);
      const Eigen::Vector3d ahead(std::cos(yaw) * std::cos(pitch), std::sin(yaw) * std::cos(pitch), std::sin(pitch));
      const Eigen::Vector3d right(std::sin(yaw), -std::cos(yaw), 0);
      Eigen::Matrix3d r;
      r << right.transpose(), ahead.cross(right).transpose(), ahead.transpose();
      rotations.push_back(Eigen::Quaterniond(r).normalized());
    }
  }
  return rotations;
}

std::vector<Eigen::Vector3d> geodesic_sphere(int times) {
  const double golden = std::numbers::phi;
  std::vector<Eigen::Vector3d> points;
  for (const double a : {-1.0, 1.0})
    for (const double b : {-golden, golden})
      for (int axis = 0; axis < 3; ++axis) {
        Eigen::Vector3d p = Eigen::Vector3d::Zero();
        p[axis] = a;
        p[(axis + 1) % 3] = b;
        points.push_back(p.normalized());
      }
  std::vector<std::array<int, 3>> faces;  // triples of neighbours
  // Neighbours have the cosine 1 / sqrt 5 = 0.447; the next vertices -0.447.
  const auto near = [&](int i, int j) { return points[i].dot(points[j]) > 0.4; };
  for (int i = 0; i < 12; ++i)
    for (int j = i + 1; j < 12; ++j)
      for (int k = j + 1; k < 12; ++k)
        if (near(i, j) && near(j, k) && near(i, k)) faces.push_back({i, j, k});
  for (int round = 0; round < times; ++round) {
    std::map<std::pair<int, int>, int> middles;
    const auto middle = [&](int i, int j) {
      // Two faces share an edge, and with it its middle.
      const auto [entry, added] = middles.try_emplace(std::minmax(i, j), static_cast<int>(points.size()));
      if (added) points.push_back((points[i] + points[j]).normalized());
      return entry->second;
    };
    std::vector<std::array<int, 3>> finer;
    for (const auto& [a, b, c] : faces) {
      const int ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {b, bc, ab}, {c, ca, bc}, {ab, bc, ca}});
    }
    faces = std::move(finer);
  }
  return points;
}

namespace {

// Points all around the camera. Every image that contains a point sees it.
class PanoramaScene : public Scene {
 public:
  PanoramaScene(const SimulationOptions& options, const Intrinsics& intrinsics)
      : options_(options), intrinsics_(intrinsics) {}

  // Returns a point at a random pixel of the frame's image.
  std::optional<SurfacePoint> sample(const Pose& frame, Random& random) const override {
    // One after the other, because C++ leaves open in which order it evaluates the arguments of a call.
    const double row = random.uniform(0, options_.image_height), column = random.uniform(0, options_.image_width);
    const Eigen::Vector2d pixel(column, row);
    const double distance = options_.panorama_radius_m * (1 + options_.depth_spread * random.uniform(-1, 1));
    const auto ray = viewing_ray(intrinsics_, pixel);
    if (!ray) return std::nullopt;
    const Eigen::Vector3d direction = frame.rotation.conjugate() * *ray;
    return SurfacePoint{distance * direction, -direction};
  }
  bool visible(const Eigen::Vector3d&, const SurfacePoint&) const override { return true; }
  double range_m() const override { return 3 * options_.panorama_radius_m; }
  bool along_passes() const override { return false; }

 private:
  SimulationOptions options_;
  Intrinsics intrinsics_;
};

}  // namespace

Layout make_panorama_layout(const SimulationOptions& options) {
  Layout layout;
  const CameraIndex camera = add_single_camera_rig(options, layout);
  const double across = 2 * std::atan(0.5 * options.image_width / options.focal_px),
               up = 2 * std::atan(0.5 * options.image_height / options.focal_px);
  double time_s = 0;
  for (const Eigen::Quaterniond& rotation : panorama_rotations(across, up, options.frames)) {
    const Eigen::Vector3d ahead = rotation.conjugate() * Eigen::Vector3d::UnitZ();
    add_simulated_frame(layout, {rotation, options.off_centre_m * ahead}, 0, time_s += 2);
  }
  layout.scene = std::make_unique<PanoramaScene>(options, layout.truth.cameras[camera]);
  return layout;
}

}  // namespace megablock
