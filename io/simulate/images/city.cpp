// A ray is p(t) = origin + t direction with a unit direction, so t is the distance in metres. The nearest hit of
// terrain and boxes counts.
//
//     terrain   HeightGrid::intersect(): sphere tracing, then Newton
//     boxes     nearest_box(): walk over the cells of a grid in plan, slab test per box
//
// The colour is light (sun 0.5 max(0, n . s) unless a box shades it, plus 0.6 of sky) times the base colour of the
// surface times its texture. Nothing depends on the image except the footprint of the pixel, so the same spot looks the
// same in all images.
#include "io/simulate/images/city.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "io/simulate/images/same_facade.h"
#include "io/simulate/scene/four_sides.h"
#include "io/simulate/streets/street_grid.h"

namespace megablock {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kWindow = 1.7, kStorey = 3;  // metres, from one window to the next

// The kind of surfaces of a scene, and the distance (metres) at which the finest wave of the texture is three pixels
// long.
struct Surroundings {
  SimulationOptions::Scene scene;
  City::Kind kind;
  double sharp_m;
};

Surroundings surroundings(const SimulationOptions& options) {
  using Scene = SimulationOptions::Scene;
  for (const Surroundings& of : {Surroundings{Scene::kAerial, City::Kind::kTown, options.height_m},
                                 Surroundings{Scene::kCourtyard, City::Kind::kCourtyard, 12},
                                 Surroundings{Scene::kTower, City::Kind::kTower, 12}})
    if (of.scene == options.scene) return of;
  return {options.scene, City::Kind::kStreets, 8};
}

// Courtyards and towers stand on level ground.
Terrain terrain_of(const SimulationOptions& options, City::Kind kind) {
  if (kind == City::Kind::kStreets) return street_terrain(options);
  return Terrain(options.seed, kind == City::Kind::kTown ? options.terrain_relief_m : 0, options.height_m);
}

}  // namespace

void HeightGrid::measure() {
  highest_ = *std::max_element(heights_.begin(), heights_.end());
  for (std::int64_t r = 0; r < rows_; ++r)
    for (std::int64_t c = 0; c < columns_; ++c) {
      const auto k = static_cast<std::size_t>(r * columns_ + c);
      const double dx = c + 1 < columns_ ? heights_[k + 1] - heights_[k] : 0;
      const double dy = r + 1 < rows_ ? heights_[k + static_cast<std::size_t>(columns_)] - heights_[k] : 0;
      steepest_ = std::max(steepest_, std::abs(dx) + std::abs(dy));
    }
  steepest_ /= cell_m_;
}

Eigen::Vector3d HeightGrid::sample(double x, double y) const {
  const double u = std::clamp((x - low_.x()) / cell_m_, 0.0, static_cast<double>(columns_ - 1) - 1e-9);
  const double v = std::clamp((y - low_.y()) / cell_m_, 0.0, static_cast<double>(rows_ - 1) - 1e-9);
  const auto c = static_cast<std::int64_t>(u), r = static_cast<std::int64_t>(v);
  const double a = u - static_cast<double>(c), b = v - static_cast<double>(r);
  const double* row = heights_.data() + r * columns_ + c;
  const double* next = row + columns_;
  const double top = row[0] + a * (row[1] - row[0]), bottom = next[0] + a * (next[1] - next[0]);
  const double by_u = (1 - b) * (row[1] - row[0]) + b * (next[1] - next[0]);
  return {top + b * (bottom - top), by_u / cell_m_, (bottom - top) / cell_m_};
}

Eigen::Vector3d HeightGrid::normal(double x, double y) const {
  const Eigen::Vector3d s = sample(x, y);
  return Eigen::Vector3d(-s[1], -s[2], 1).normalized();
}

// Intersects a ray with the terrain. Far from the ground it takes steps that cannot go below it: the height of the ray
// above the ground decreases at most by the slope of the ray plus that of the steepest ground. Near the ground it uses
// Newton's method, except for grazing rays.
double HeightGrid::intersect(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double limit,
                             double guess) const {
  const double closing = -direction.z() + steepest_ * direction.head<2>().norm();
  if (closing <= 1e-6) return kInfinity;
  double t = 0;
  if (origin.z() > highest_) {
    if (direction.z() >= 0) return kInfinity;
    t = (highest_ - origin.z()) / direction.z();
  }
  // The ray falls at least twice as fast as the ground can rise.
  const bool steep = -direction.z() > 2 * (closing + direction.z());
  if (steep && guess > 0) t = guess;  // a steep ray meets the ground only once, so any start is safe
  for (int i = 0; i < 200 && t < limit; ++i) {
    const Eigen::Vector3d p = origin + t * direction;
    const Eigen::Vector3d ground = sample(p.x(), p.y());
    const double above = p.z() - ground[0];
    if (std::abs(above) < 1e-6 * t || (above < 0 && !steep)) return t;
    // Newton: the derivative of the height above the ground is dz - g . (dx, dy) with the gradient g. The other step is
    // the sphere-tracing bound: above / closing cannot go below the ground.
    t += steep ? above / (ground[1] * direction.x() + ground[2] * direction.y() - direction.z()) : above / closing;
  }
  return t < limit ? t : kInfinity;
}

City::City(const SimulationOptions& options, const Layout& layout)
    : options_(options),
      kind_(surroundings(options).kind),
      level_(kind_ != Kind::kTown),
      range_m_(level_ ? 60 : layout.scene->range_m()),
      intrinsics_(layout.truth.cameras.front()),
      texture_(options.seed, 3 * surroundings(options).sharp_m / options.focal_px) {
  low_ = high_ = layout.truth.frames.front().centre.head<2>();
  for (const Pose& pose : layout.truth.frames) {
    low_ = low_.cwiseMin(pose.centre.head<2>());
    high_ = high_.cwiseMax(pose.centre.head<2>());
  }
  const Eigen::Vector2d margin = Eigen::Vector2d::Constant(level_ ? 100 : range_m_);
  low_ -= margin;
  high_ += margin;
  const Terrain terrain = terrain_of(options, kind_);
  ground_ = HeightGrid(low_, high_, level_ ? 4 : 0.01 * options.height_m,
                       [&](double x, double y) { return terrain.height(x, y); });
  switch (kind_) {
    case Kind::kTown:
      build_town();
      break;
    case Kind::kStreets:
      build_streets();
      break;
    case Kind::kCourtyard:
      build_courtyard();
      break;
    case Kind::kTower:
      build_tower();
      break;
  }
  sort_boxes();
}

void City::add_box(const Eigen::Vector2d& low, const Eigen::Vector2d& high, double height) {
  double lowest = kInfinity, highest = -kInfinity;
  for (const double x : {low.x(), high.x()})
    for (const double y : {low.y(), high.y()}) {
      lowest = std::min(lowest, ground_.height(x, y));
      highest = std::max(highest, ground_.height(x, y));
    }
  // From a metre below the lowest corner, so that no gap opens over sloping ground.
  boxes_.push_back({{low.x(), low.y(), lowest - 1}, {high.x(), high.y(), highest + height}});
}

void City::build_town() {
  // All lengths of the town are shares of the flying height, so that images look alike at any height. Two of three lots
  // have a house.
  const double lot = 0.3 * options_.height_m;
  for (auto i = static_cast<std::int64_t>(std::floor(low_.x() / lot)); static_cast<double>(i) * lot < high_.x(); ++i)
    for (auto j = static_cast<std::int64_t>(std::floor(low_.y() / lot)); static_cast<double>(j) * lot < high_.y();
         ++j) {
      Random random(options_.seed, Random::Purpose::kImage,
                    mix_bits(static_cast<std::uint64_t>(i)) + static_cast<std::uint64_t>(j));
      const bool built = random.uniform() < 0.65;
      // One after the other, because C++ leaves open in which order it evaluates the arguments of a call.
      const double depth = random.uniform(0.35, 0.65), width = random.uniform(0.35, 0.65);
      const double up = random.uniform(0.1, 0.9), along = random.uniform(0.1, 0.9);
      const Eigen::Vector2d size(width, depth), place(along, up);
      const double height = options_.height_m * random.uniform(0.04, 0.18);
      if (!built) continue;
      const Eigen::Vector2d corner = Eigen::Vector2d(static_cast<double>(i), static_cast<double>(j)) +
                                     place.cwiseProduct(Eigen::Vector2d::Ones() - size);
      add_box(lot * corner, lot * (corner + size), height);
    }
}

void City::build_streets() {
  const double spacing = options_.street_spacing_m;
  // A house per kHouse metres on both sides of each street, 10 m deep, with the distance of facade_distance(): the same
  // facades as those of the tie points.
  for (const int along : {0, 1}) {
    const int across = 1 - along;
    for (std::int64_t axis = nearest_axis(low_[across], spacing); axis <= nearest_axis(high_[across], spacing); ++axis)
      for (auto house = static_cast<std::int64_t>(std::floor(low_[along] / kHouse));
           static_cast<double>(house) * kHouse < high_[along]; ++house) {
        const double start = static_cast<double>(house) * kHouse, end = start + kHouse;
        // The row of houses ends at the crossing street.
        const double crossing = spacing * static_cast<double>(nearest_axis(start + 0.5 * kHouse, spacing));
        constexpr double kClear = kFacade + kFacadeDepth;
        const double first = end > crossing ? std::max(start, crossing + kClear) : start;
        const double last = start < crossing ? std::min(end, crossing - kClear) : end;
        if (last - first < 3) continue;
        for (const int side : {-1, 1}) {
          Random random(options_.seed, Random::Purpose::kImage,
                        mix_bits(static_cast<std::uint64_t>(house * 4 + along * 2 + (side > 0))) +
                            static_cast<std::uint64_t>(axis));
          const double centre = static_cast<double>(axis) * spacing;
          const double front = facade_distance(options_.seed, along == 0, axis, side, start + 0.5 * kHouse);
          Eigen::Vector2d low, high;
          low[along] = first;
          high[along] = last;
          low[across] = centre + (side > 0 ? front : -front - 10);
          high[across] = low[across] + 10;
          add_box(low, high, random.uniform(6, 14));
        }
      }
  }
}

void City::build_courtyard() {
  constexpr double kHalf = kCourtSide / 2, kDeep = 8, kHigh = 10;
  // Four wings. Those in the south and north reach over the ends of the others.
  for (const int side : {-1, 1}) {
    const double near = side > 0 ? kHalf : -kHalf - kDeep;
    add_box({-kHalf - kDeep, near}, {kHalf + kDeep, near + kDeep}, kHigh);
    add_box({near, -kHalf}, {near + kDeep, kHalf}, kHigh);
  }
}

void City::build_tower() {
  constexpr double kHalf = kTowerSide / 2;
  add_box({-kHalf, -kHalf}, {kHalf, kHalf}, 13);
}

void City::sort_boxes() {
  // About one box per cell.
  cell_m_ = level_ ? kHouse : 0.3 * options_.height_m;
  columns_ = static_cast<std::int64_t>((high_.x() - low_.x()) / cell_m_) + 1;
  rows_ = static_cast<std::int64_t>((high_.y() - low_.y()) / cell_m_) + 1;
  std::vector<std::vector<std::int64_t>> cells(static_cast<std::size_t>(columns_ * rows_));
  const auto clamp_cell = [&](double x, std::int64_t count) {
    return std::clamp<std::int64_t>(static_cast<std::int64_t>(std::floor(x / cell_m_)), 0, count - 1);
  };
  for (std::int64_t b = 0; b < std::ssize(boxes_); ++b) {
    const Box& box = boxes_[static_cast<std::size_t>(b)];
    highest_box_ = std::max(highest_box_, box.high.z());
    for (auto r = clamp_cell(box.low.y() - low_.y(), rows_); r <= clamp_cell(box.high.y() - low_.y(), rows_); ++r)
      for (auto c = clamp_cell(box.low.x() - low_.x(), columns_); c <= clamp_cell(box.high.x() - low_.x(), columns_);
           ++c)
        cells[static_cast<std::size_t>(r * columns_ + c)].push_back(b);
  }
  cell_begin_.push_back(0);
  for (const auto& cell : cells) {
    cell_boxes_.insert(cell_boxes_.end(), cell.begin(), cell.end());
    cell_begin_.push_back(std::ssize(cell_boxes_));
  }
}

bool enter(const Box& box, const Eigen::Vector3d& origin, const Eigen::Vector3d& inverse, double& distance, int& axis) {
  double first = 0, last = kInfinity;
  int face = -1;
  for (int k = 0; k < 3; ++k) {
    const double a = (box.low[k] - origin[k]) * inverse[k], b = (box.high[k] - origin[k]) * inverse[k];
    // The ray is inside the slab of axis k for t in [min(a, b), max(a, b)], and inside the box where all three overlap.
    // The last slab that it enters gives the face.
    const double near = std::min(a, b);
    if (near > first) {
      first = near;
      face = k;
    }
    last = std::min(last, std::max(a, b));
  }
  if (face < 0 || first > last) return false;
  distance = first;
  axis = face;
  return true;
}

// Visits the cells that the ray crosses in plan (Amanatides and Woo 1987).
std::int64_t City::nearest_box(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double limit,
                               double& distance, int& axis) const {
  const Eigen::Vector3d inverse = direction.cwiseInverse();
  double t = 0;
  if (origin.z() > highest_box_) {
    if (direction.z() >= 0) return -1;
    t = (highest_box_ - origin.z()) * inverse.z();
  }
  // Find the distances at which the ray enters and leaves the extent.
  for (int k = 0; k < 2; ++k) {
    const double a = (low_[k] - origin[k]) * inverse[k], b = (high_[k] - origin[k]) * inverse[k];
    t = std::max(t, std::min(a, b));
    limit = std::min(limit, std::max(a, b));
  }
  if (t >= limit) return -1;
  const Eigen::Vector2d place = ((origin + t * direction).head<2>() - low_) / cell_m_;
  std::int64_t c = std::clamp<std::int64_t>(static_cast<std::int64_t>(place.x()), 0, columns_ - 1);
  std::int64_t r = std::clamp<std::int64_t>(static_cast<std::int64_t>(place.y()), 0, rows_ - 1);
  const std::int64_t step_c = direction.x() > 0 ? 1 : -1, step_r = direction.y() > 0 ? 1 : -1;
  // t at which the ray leaves its cell by a side across x or y; delta_c, delta_r: t from one such side to the next.
  double next_c = (low_.x() + static_cast<double>(c + (step_c > 0)) * cell_m_ - origin.x()) * inverse.x();
  double next_r = (low_.y() + static_cast<double>(r + (step_r > 0)) * cell_m_ - origin.y()) * inverse.y();
  const double delta_c = std::abs(cell_m_ * inverse.x()), delta_r = std::abs(cell_m_ * inverse.y());
  std::int64_t found = -1;
  distance = limit;
  while (t < distance && c >= 0 && c < columns_ && r >= 0 && r < rows_) {
    const auto cell = static_cast<std::size_t>(r * columns_ + c);
    for (std::int64_t k = cell_begin_[cell]; k < cell_begin_[cell + 1]; ++k) {
      const std::int64_t box = cell_boxes_[static_cast<std::size_t>(k)];
      double at = 0;
      int face = 0;
      if (!enter(boxes_[static_cast<std::size_t>(box)], origin, inverse, at, face) || at >= distance) continue;
      distance = at;
      axis = face;
      found = box;
    }
    if (next_c < next_r) {
      t = next_c;
      next_c += delta_c;
      c += step_c;
    } else {
      t = next_r;
      next_r += delta_r;
      r += step_r;
    }
  }
  return found;
}

City::Hit City::cast(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double ground_guess) const {
  constexpr double kHorizon = 2000;  // metres
  Hit hit;
  hit.distance = ground_.intersect(origin, direction, kHorizon, ground_guess);
  if (hit.distance < kInfinity) hit.object = kGround;
  double distance = 0;
  int axis = 0;
  const std::int64_t box = nearest_box(origin, direction, std::min(hit.distance, kHorizon), distance, axis);
  if (box >= 0) {
    hit.distance = distance;
    hit.object = box;
    hit.normal.setZero();
    hit.normal[axis] = direction[axis] > 0 ? -1 : 1;
  }
  if (hit.object == kSky) return hit;
  hit.point = origin + hit.distance * direction;
  if (hit.object == kGround) hit.normal = ground_.normal(hit.point.x(), hit.point.y());
  return hit;
}

Eigen::Vector3f City::colour(const Hit& hit, const Eigen::Vector3d& direction, double pixel_angle) const {
  if (hit.object == kSky) return {190, 205, 225};
  const Eigen::Vector3d& p = hit.point;
  const double facing = std::max(0.1, -hit.normal.dot(direction));
  // The pixel covers d a across and d a / cos along the surface. Their geometric mean counts.
  const double footprint = hit.distance * pixel_angle / std::sqrt(facing);
  const bool four_sides = kind_ == Kind::kCourtyard || kind_ == Kind::kTower;
  Eigen::Vector3f base;
  if (hit.object == kGround)
    base = ground_colour(hit, footprint);
  else if (four_sides && hit.normal.z() < 0.5)
    base = same_facade_colour(texture_, {along_facade(hit.normal, p), p.z(), facade_side(hit.normal), footprint},
                              options_.own_detail);
  else
    base = house_colour(hit, footprint);
  return light(p, hit.normal) * base;
}

Eigen::Vector3f City::ground_colour(const Hit& hit, double footprint) const {
  const Eigen::Vector3d& p = hit.point;
  // The ground has large patches of grass and soil, with roads where nothing is built.
  const double patch = level_ ? 7 : 0.12 * options_.height_m;
  const float kind = Texture::cell(p.x() + 0.3 * p.y(), p.y() - 0.3 * p.x(), patch, 11);
  Eigen::Vector3f base = kind < 0.3f   ? Eigen::Vector3f(104, 112, 72)
                         : kind < 0.6f ? Eigen::Vector3f(128, 122, 94)
                         : kind < 0.8f ? Eigen::Vector3f(112, 104, 92)
                                       : Eigen::Vector3f(118, 116, 112);
  if (level_) base = Eigen::Vector3f(112, 110, 108) + 0.15f * (base - Eigen::Vector3f(110, 110, 100));
  // The paving of courtyards and about towers is smooth.
  const float contrast = kind_ == Kind::kCourtyard || kind_ == Kind::kTower ? 0.12f : 0.5f;
  const float detail = texture_.detail(p.x(), p.y(), 1, footprint);
  return base * std::max(0.1f, 1 + contrast * detail);
}

Eigen::Vector3f City::house_colour(const Hit& hit, double footprint) const {
  const Eigen::Vector3d& p = hit.point;
  const std::uint32_t number = static_cast<std::uint32_t>(hit.object + 2) * 4;
  // Random numbers of the house, not of the place on it.
  const float tone = Texture::cell(0.5, 0.5, 1, number), hue = Texture::cell(1.5, 0.5, 1, number);
  Eigen::Vector3f base(120 + 60 * tone, 105 + 50 * tone + 20 * hue, 90 + 60 * tone * hue + 20);
  float detail = 0;
  if (hit.normal.z() > 0.5) {
    base = 0.8f * base + Eigen::Vector3f(30 * hue, 5, 0);
    detail = texture_.detail(p.x(), p.y(), number, footprint);
  } else {
    const int across = std::abs(hit.normal.x()) > 0.5 ? 0 : 1;
    double along = p[1 - across], up = p.z();
    const std::uint32_t wall = number + static_cast<std::uint32_t>(1 + across) + (hit.normal[across] > 0 ? 7 : 0);
    if (Texture::cell(2.5, 0.5, 1, number) < options_.repeated_facades) {
      // The same two windows repeat, each with its own traces of weather.
      detail = 0.2f * texture_.detail(along, up, wall + 3, footprint);
      along -= 2 * kWindow * std::floor(along / (2 * kWindow));
      up -= kStorey * std::floor(up / kStorey);
      detail += 0.9f * texture_.detail(along, up, wall, footprint);
    } else {
      detail = texture_.detail(along, up, wall, footprint);
    }
    // The windows have different brightness.
    const double u = along / kWindow - std::floor(along / kWindow), v = up / kStorey - std::floor(up / kStorey);
    if (u > 0.3 && u < 0.85 && v > 0.25 && v < 0.8)
      base *= 0.3f + 0.7f * Texture::cell(along, up * kWindow / kStorey, kWindow, wall);
  }
  return base * std::max(0.1f, 1 + 0.5f * detail);
}

float City::light(const Eigen::Vector3d& point, const Eigen::Vector3d& normal) const {
  const Eigen::Vector3d sun = Eigen::Vector3d(-0.45, -0.6, 0.8).normalized();
  double sunlight = std::max(0.0, normal.dot(sun));
  double distance = 0;
  int axis = 0;
  // The start is lifted off the surface, so that a surface does not shade itself.
  if (sunlight > 0 && nearest_box(point + 1e-4 * normal, sun, 500, distance, axis) >= 0) sunlight = 0;
  return 0.6f + 0.5f * static_cast<float>(sunlight);
}

std::optional<SurfacePoint> City::sample(const Pose& frame, Random& random) const {
  Eigen::Vector3d direction;
  if (level_) {
    const double azimuth = random.uniform(0, 2 * std::numbers::pi), slope = random.uniform(-0.6, 0.3);
    // Streets are seen all around: from 31 degrees down to 17 degrees up.
    direction = Eigen::Vector3d(std::cos(azimuth), std::sin(azimuth), slope).normalized();
  } else {
    const auto ray =
        viewing_ray(intrinsics_, {random.uniform(0, options_.image_width), random.uniform(0, options_.image_height)});
    if (!ray) return std::nullopt;
    direction = frame.rotation.conjugate() * *ray;
  }
  const Hit hit = cast(frame.centre, direction);
  if (hit.object == kSky || hit.distance > (level_ ? 40 : 10 * options_.height_m)) return std::nullopt;
  return SurfacePoint{hit.point, hit.normal};
}

bool City::visible(const Eigen::Vector3d& eye, const SurfacePoint& point) const {
  const Eigen::Vector3d sight = point.position - eye;
  const double distance = sight.norm();
  if (-sight.dot(point.normal) < 0.12 * distance) return false;
  if (level_ && distance > range_m_) return false;
  // The tolerance is for the point itself, which lies on a surface with rounding errors.
  return cast(eye, sight / distance).distance > distance - 1e-3 * (1 + distance);
}

}  // namespace megablock
