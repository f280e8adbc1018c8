// Simulates the Stereopolis block: a vehicle with a panoramic rig on a grid of streets, in several drives on several
// days.
//
// A drive goes over the streets along x in serpentines, then over those along y, and back to its beginning, and repeats
// this until it has its number of frames. Every second drive goes in the opposite direction; the third and fourth (and
// seventh, eighth, ...) drives have x and y exchanged. The second street along x may cross the second one along y on a
// bridge.
#include "io/simulate/blocks/stereopolis.h"

#include <algorithm>
#include <cmath>

#include "geometry/numbers/angles.h"
#include "io/simulate/blocks/vehicle.h"
#include "io/simulate/streets/bridge.h"
#include "io/simulate/streets/drive.h"
#include "io/simulate/streets/street_scene.h"

namespace megablock {

namespace {

constexpr double kSpeed = 8;                   // metres per second
constexpr double kDay = 86400, kBreak = 1800;  // seconds; kBreak lies between two drives of a day
constexpr double kRampGap = 15;                // from the end of a ramp to the next crossing, metres
constexpr std::int64_t kVisit = 25;            // after so many frames (a hundred metres), a visit of a place is over

class StereopolisScene : public StreetScene {
 public:
  StereopolisScene(const SimulationOptions& options, const std::optional<Bridge>& bridge)
      : StreetScene(options, street_terrain(options)), bridge_(bridge) {}

  // The height of the road for a vehicle that drives along x or along y.
  double road_height(const Eigen::Vector2d& place, bool along_x) const {
    const double z = ground(place.x(), place.y());
    return bridge_ && along_x && bridge_->carries(place.x(), place.y()) ? z + bridge_->rise(place.x()) : z;
  }

  std::optional<SurfacePoint> sample(const Pose& frame, Random& random) const override {
    // Where the ramp is two metres high, its walls have their full height and hide the ground. Below, half of the
    // points are on the bridge.
    const double rise = rise_under(frame.centre);
    if (rise > 0 && (rise > 2 || random.uniform() < 0.5)) return sample_bridge(frame, random);
    auto point = StreetScene::sample(frame, random);
    if (point && point->normal.z() > 0.5)
      point->position.z() = road_height(point->position.head<2>(), direction_at(frame.centre) == 0);
    return point;
  }

  bool visible(const Eigen::Vector3d& eye, const SurfacePoint& point) const override {
    if (!StreetScene::visible(eye, point)) return false;
    if (!bridge_) return true;
    const Eigen::Vector2d off = (eye.head<2>() - bridge_->centre()).cwiseAbs();
    if (off.x() > bridge_->half_length() + range_m() || off.y() > Bridge::kHalfWidth + range_m()) return true;
    return !bridge_->hides(above_ground(eye), above_ground(point.position));
  }

  std::optional<SurfacePoint> road(const Eigen::Vector2d& place) const override {
    return SurfacePoint{{place.x(), place.y(), ground(place.x(), place.y())}, Eigen::Vector3d::UnitZ()};
  }

  std::int64_t visit_frames() const override { return kVisit; }

  // Windows repeat along facades. On the road, other vehicles drive along the street in both directions.
  std::optional<Mistake> mistake(const SurfacePoint& point, Random& random) const override {
    Mistake mistake;
    const double sense = random.uniform() < 0.5 ? -1 : 1, size = random.uniform();
    if (std::abs(point.normal.z()) < 0.5) {
      constexpr double kWindow = 3;  // metres
      const Eigen::Vector3d along(-point.normal.y(), point.normal.x(), 0);
      // One to three windows further: 3, 6 or 9 m.
      mistake.offset = sense * kWindow * std::ceil(3 * size + 1e-9) * along;
    } else {
      mistake.verdict = Verdict::kVehicle;
      // A spot on a vehicle, a metre above the road, at 3 to 12 m/s.
      mistake.offset.z() = 1;
      mistake.velocity[direction_at(point.position)] = sense * (3 + 9 * size);
    }
    return mistake;
  }

 private:
  Eigen::Vector3d above_ground(const Eigen::Vector3d& p) const { return {p.x(), p.y(), p.z() - ground(p.x(), p.y())}; }
  // The height of the bridge deck below a frame; 0 if it is not on the bridge.
  double rise_under(const Eigen::Vector3d& eye) const {
    if (!bridge_ || !bridge_->carries(eye.x(), eye.y())) return 0;
    const double rise = bridge_->rise(eye.x());
    return above_ground(eye).z() > rise ? rise : 0;
  }
  // A random point on the deck or on a wall of the bridge.
  std::optional<SurfacePoint> sample_bridge(const Pose& frame, Random& random) const {
    const double x = frame.centre.x() + random.uniform(-0.6, 0.6) * range_m();
    const double side = random.uniform(-1, 1), up = random.uniform();
    const bool wall = random.uniform() < 0.6;
    if (std::abs(x - bridge_->centre().x()) > bridge_->half_length()) return std::nullopt;
    SurfacePoint point;
    const double off = wall ? (side < 0 ? -1 : 1) : 0.9 * side;
    point.position << x, bridge_->centre().y() + off * Bridge::kHalfWidth * (1 - 1e-9), 0;
    point.position.z() = ground(x, point.position.y()) + bridge_->rise(x) + (wall ? up * bridge_->wall(x) : 0);
    point.normal = wall ? Eigen::Vector3d(0, -off, 0) : Eigen::Vector3d::UnitZ();
    return point;
  }

  std::optional<Bridge> bridge_;
};

// The closed route over a grid of streets, and the corner at the end of the second street along y.
struct Route {
  Drive drive;
  std::size_t bridge_done;
  double bridge_x;
};

Route make_route(std::int64_t streets, double spacing) {
  std::vector<Eigen::Vector2d> corners = drive_corners(streets, spacing);
  const double far = static_cast<double>(streets - 1) * spacing;
  const bool even = streets % 2 == 0;
  if (even) corners.insert(corners.end(), {{0, far}, {0, 0}});  // with an odd number, the route is closed already
  // The streets along x have the corners 0 to 2 n - 1, so the second street along y ends at corner 2 n + 3. The bridge
  // is on the second street along x, and the second street along y goes below it: after it, the drive has been at both.
  return {Drive(std::move(corners)), static_cast<std::size_t>(2 * streets + 3), even ? spacing : far - spacing};
}

std::vector<Eigen::Vector2d> exchanged(std::vector<Eigen::Vector2d> corners) {
  for (Eigen::Vector2d& corner : corners) corner = corner.reverse().eval();
  return corners;
}

// The number of frames of a drive.
std::int64_t frames_of_drive(const SimulationOptions& options, int drive) {
  return options.frames / options.drives + (drive < options.frames % options.drives ? 1 : 0);
}

// Chooses the number of streets: the largest grid on which a drive still crosses the bridge. If no drive is long enough
// for a bridge, the smallest grid that is longer than a drive.
std::int64_t choose_streets(const SimulationOptions& options, bool& bridge) {
  const double length = options.frame_distance_m * static_cast<double>(frames_of_drive(options, options.drives - 1));
  std::int64_t streets = 2;
  if (options.bridge) {
    const auto crosses = [&](std::int64_t n) {
      const Route route = make_route(n, options.street_spacing_m);
      return route.drive.length_to(route.bridge_done) <= length;
    };
    while (crosses(streets + 1)) ++streets;
  }
  bridge = streets >= 3;
  if (!bridge)
    while (make_route(streets, options.street_spacing_m).drive.length() < length) ++streets;
  return streets;
}

void add_drive(const SimulationOptions& options, const StereopolisScene& scene, const Drive& way, int drive,
               double start_s, Layout& layout) {
  const std::int64_t frames = frames_of_drive(options, drive);
  const auto wrap = [&](double s) { return s - way.length() * std::floor(s / way.length()); };
  for (std::int64_t i = 0; i < frames; ++i) {
    const auto index = static_cast<std::uint64_t>(layout.block.frames.size());
    Random random(options.seed, Random::Purpose::kFrame, index);
    // Frames are up to a tenth of their distance off.
    double s = options.frame_distance_m * (static_cast<double>(i) + random.uniform(-0.1, 0.1));
    // The same way from its end to its beginning, half a distance off, so that frames of two drives do not coincide.
    if (drive % 2 == 1) s = options.frame_distance_m * (static_cast<double>(frames) - 0.5) - s;
    const double turn = drive % 2 == 1 ? -1 : 1;
    const Eigen::Vector2d forward = turn * (way.at(wrap(s + 5)) - way.at(wrap(s - 5))).normalized();
    const Eigen::Vector2d right(forward.y(), -forward.x());
    const Eigen::Vector2d place = way.at(wrap(s)) + (kLane + 0.1 * random.normal()) * right;
    const bool along_x = std::abs(forward.x()) > std::abs(forward.y());
    const double height = scene.road_height(place, along_x);
    // The nose follows the road: the difference of height over four metres.
    const double slope =
        0.25 * (scene.road_height(place + 2 * forward, along_x) - scene.road_height(place - 2 * forward, along_x));
    Pose pose;
    pose.centre << place, height + kRigHeight + 0.02 * random.normal();
    const Eigen::Vector3d shake = kDegree * Eigen::Vector3d(0.5, 0.5, 1).cwiseProduct(random.normal3());
    const Eigen::Vector3d nose_up(-std::atan(slope), 0, 0);
    pose.rotation = (rotation_exp<double>(nose_up) * rotation_update(level_rotation(forward), shake)).normalized();
    add_simulated_frame(layout, pose, drive, start_s + static_cast<double>(i) * options.frame_distance_m / kSpeed);
  }
}

}  // namespace

Layout make_stereopolis_layout(const SimulationOptions& options) {
  Layout layout;
  add_vehicle(options, layout);
  bool with_bridge = false;
  const std::int64_t streets = choose_streets(options, with_bridge);
  const double spacing = options.street_spacing_m;
  const Route route = make_route(streets, spacing);
  std::optional<Bridge> bridge;
  // The ramps end kRampGap before the neighbouring crossings, so that these are level.
  if (with_bridge) bridge.emplace(Eigen::Vector2d(route.bridge_x, spacing), spacing - kRampGap);
  for (std::int64_t j = 0; j < streets; ++j)
    for (std::int64_t i = 0; i < streets; ++i) {
      const Eigen::Vector2d crossing = spacing * Eigen::Vector2d(static_cast<double>(i), static_cast<double>(j));
      // Control points stand on the ground, and the crossing with the bridge has two levels.
      if (!bridge || crossing != bridge->centre()) layout.crossings.push_back(crossing);
    }

  auto scene = std::make_unique<StereopolisScene>(options, bridge);
  const Drive turned(exchanged(route.drive.corners()));
  double start = 0;
  for (int drive = 0; drive < options.drives; ++drive) {
    const int day = drive * options.days / options.drives;
    // A drive begins after the break, and not before its day.
    start = std::max(start, day * kDay);
    add_drive(options, *scene, drive % 4 < 2 ? route.drive : turned, drive, start, layout);
    start += static_cast<double>(frames_of_drive(options, drive)) * options.frame_distance_m / kSpeed + kBreak;
  }
  layout.scene = std::move(scene);
  return layout;
}

}  // namespace megablock
