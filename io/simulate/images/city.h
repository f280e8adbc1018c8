// Gives the surfaces of the rendered scenes (terrain with boxes on it), their intersections with rays, and their
// colours.
// Internal to io/: it is not installed.
#pragma once

#include "io/simulate/images/texture.h"
#include "io/simulate/scene/layout.h"
#include "io/simulate/scene/terrain.h"

namespace megablock {

struct Box {
  Eigen::Vector3d low, high;  // metres, sides parallel to the axes
};

// Whether a ray from outside enters the box (slab test). If so, sets the distance and the axis of the face through
// which it enters. `inverse` has the inverses of the components of the direction.
bool enter(const Box& box, const Eigen::Vector3d& origin, const Eigen::Vector3d& inverse, double& distance, int& axis);

// The terrain of a rendered scene: heights on a square lattice with bilinear interpolation.
class HeightGrid {
 public:
  HeightGrid() = default;
  // Samples `height(x, y)` over the rectangle. Outside it, the heights of the border continue.
  template <typename Height>
  HeightGrid(const Eigen::Vector2d& low, const Eigen::Vector2d& high, double cell_m, const Height& height)
      : low_(low), cell_m_(cell_m) {
    columns_ = static_cast<std::int64_t>((high.x() - low.x()) / cell_m) + 2;
    rows_ = static_cast<std::int64_t>((high.y() - low.y()) / cell_m) + 2;
    for (std::int64_t r = 0; r < rows_; ++r)
      for (std::int64_t c = 0; c < columns_; ++c)
        heights_.push_back(
            height(low.x() + static_cast<double>(c) * cell_m, low.y() + static_cast<double>(r) * cell_m));
    measure();
  }
  double height(double x, double y) const { return sample(x, y)[0]; }
  Eigen::Vector3d normal(double x, double y) const;
  // Distance along the ray (unit direction) to the surface; infinity beyond `limit`. `guess` is the distance of a
  // neighbouring ray.
  double intersect(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double limit, double guess) const;

 private:
  void measure();
  // Height and its derivatives by x and y.
  Eigen::Vector3d sample(double x, double y) const;

  Eigen::Vector2d low_ = Eigen::Vector2d::Zero();
  double cell_m_ = 1;
  std::int64_t columns_ = 0, rows_ = 0;
  std::vector<double> heights_;  // [rows * columns]
  double highest_ = 0, steepest_ = 0;
};

class City : public Scene {
 public:
  static constexpr std::int64_t kSky = -2, kGround = -1;
  struct Hit {
    double distance = 0;         // along the unit direction
    std::int64_t object = kSky;  // kSky, kGround or a box
    Eigen::Vector3d point = Eigen::Vector3d::Zero(), normal = Eigen::Vector3d::UnitZ();
  };

  // Which surfaces a scene has (kKinds in city.cpp).
  enum class Kind { kTown, kStreets, kCourtyard, kTower };

  City(const SimulationOptions& options, const Layout& layout);

  // `ground_guess` is the distance at which a neighbouring ray met the ground; 0 = unknown.
  Hit cast(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double ground_guess = 0) const;
  // Red, green, blue, 0 to 255. `pixel_angle` is the angle of a pixel, radians.
  Eigen::Vector3f colour(const Hit& hit, const Eigen::Vector3d& direction, double pixel_angle) const;
  // The light on a surface: sunlight from the south-west, with shadows of the boxes, and skylight.
  float light(const Eigen::Vector3d& point, const Eigen::Vector3d& normal) const;

  std::optional<SurfacePoint> sample(const Pose& frame, Random& random) const override;
  bool visible(const Eigen::Vector3d& eye, const SurfacePoint& point) const override;
  std::optional<SurfacePoint> road(const Eigen::Vector2d& place) const override {
    return SurfacePoint{{place.x(), place.y(), ground_.height(place.x(), place.y())}, Eigen::Vector3d::UnitZ()};
  }
  double range_m() const override { return range_m_; }
  bool along_passes() const override { return kind_ == Kind::kStreets; }

  const std::vector<Box>& boxes() const { return boxes_; }
  const HeightGrid& ground() const { return ground_; }

 private:
  void build_town();     // blocks of houses on a lattice
  void build_streets();  // houses along the streets of the street scene
  void build_courtyard();
  void build_tower();
  Eigen::Vector3f ground_colour(const Hit& hit, double footprint) const;
  Eigen::Vector3f house_colour(const Hit& hit, double footprint) const;
  void add_box(const Eigen::Vector2d& low, const Eigen::Vector2d& high, double height);
  void sort_boxes();
  // Finds the nearest box before `limit`. Returns its number (-1: none), its distance and the axis of the face.
  std::int64_t nearest_box(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double limit,
                           double& distance, int& axis) const;

  SimulationOptions options_;
  Kind kind_;
  bool level_;  // the cameras look along the ground, not down on it
  double range_m_;
  Intrinsics intrinsics_;
  Eigen::Vector2d low_, high_;  // extent in plan
  HeightGrid ground_;
  Texture texture_;
  std::vector<Box> boxes_;
  double highest_box_ = 0;
  // The boxes by square cells in plan. Those that touch cell c are the rows [cell_begin_[c], cell_begin_[c + 1]).
  double cell_m_ = 1;
  std::int64_t columns_ = 0, rows_ = 0;
  std::vector<std::int64_t> cell_begin_, cell_boxes_;
};

}  // namespace megablock
