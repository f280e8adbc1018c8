// Simulates control and check points, either spread over the block or in zones on pedestrian crossings.
#include "io/simulate/blocks/control.h"

#include <algorithm>
#include <cmath>

#include "io/base/error.h"

namespace megablock {

namespace {

// Simulates a control point with the stated sigma `control_sigma_m`, and its measurements, both with noise. The role is
// kControl.
ControlPoint measure_control(const SimulationOptions& options, const Eigen::Vector3d& truth,
                             const std::vector<SimulatedObservation>& seen, Random& random) {
  ControlPoint point;
  point.position = truth + options.control_sigma_m * random.normal3();
  point.sigma.setConstant(options.control_sigma_m);
  // A stated sigma must be positive, also if there is no noise.
  const double sigma_px = options.image_noise_px > 0 ? options.image_noise_px : 0.1;
  for (const SimulatedObservation& s : seen) {
    const double x = random.normal(), y = random.normal();
    point.measurements.push_back({s.image, s.pixel + options.image_noise_px * Eigen::Vector2d(x, y), sigma_px});
  }
  return point;
}

}  // namespace

// The places come from an additive recurrence over the extent of the block (Roberts' R2 sequence): the shares are the
// fractions of 0.5 + i / g and 0.5 + i / g^2, where g is the plastic number, the root of g^3 = g + 1. Every beginning
// of the sequence covers the extent evenly. Each place is then moved into the view of the nearest frame. Roles
// alternate in proportion to their numbers: point i is a control point while fewer than control_points (i + 1) / total
// were made.
void simulate_control(const SimulationOptions& options, const Observer& observer, Layout& layout) {
  const int total = options.control_points + options.check_points;
  if (total == 0) return;
  Eigen::Vector2d low = layout.truth.frames.front().centre.head<2>(), high = low;
  for (const Pose& pose : layout.truth.frames) {
    low = low.cwiseMin(pose.centre.head<2>());
    high = high.cwiseMax(pose.centre.head<2>());
  }
  int control = 0;
  for (int i = 0; i < total; ++i) {
    Random random(options.seed, Random::Purpose::kControl, static_cast<std::uint64_t>(i));
    const Eigen::Vector2d share(std::fmod(0.5 + 0.7548776662466927 * (i + 1), 1.0),
                                std::fmod(0.5 + 0.5698402909980532 * (i + 1), 1.0));
    const Eigen::Vector2d target = low + share.cwiseProduct(high - low);
    const auto distance = [&](const Pose& pose) { return (pose.centre.head<2>() - target).squaredNorm(); };
    const auto nearest = std::min_element(layout.truth.frames.begin(), layout.truth.frames.end(),
                                          [&](const Pose& a, const Pose& b) { return distance(a) < distance(b); });
    Eigen::Vector3d truth = Eigen::Vector3d::Zero();
    std::vector<SimulatedObservation> seen;
    // Three images are wanted. Two images of the last try are accepted.
    for (int tries = 0; tries < 1000 && seen.size() < 3; ++tries) {
      const auto surface = layout.scene->sample(*nearest, random);
      if (!surface) continue;
      truth = surface->position;
      seen = observer.observations_of(*surface);
    }
    if (seen.size() < 2) continue;
    const bool is_control =
        static_cast<std::int64_t>(control) * total < static_cast<std::int64_t>(options.control_points) * (i + 1);
    control += is_control;
    ControlPoint point = measure_control(options, truth, seen, random);
    point.role = is_control ? PointRole::kControl : PointRole::kCheck;
    point.name.append(is_control ? "control" : "check").append(std::to_string(i));
    layout.block.control_points.push_back(std::move(point));
    layout.control_truth.push_back(truth);
  }
}

namespace {

constexpr int kFewest = 8, kMost = 40;     // number of points of a zone
constexpr int kCheckEvery = 7;             // one of so many points of a zone is a check point
constexpr std::size_t kMeasurements = 12;  // largest number of measurements of a point
constexpr double kAround = 25;             // frames within so many metres belong to a crossing

// Chooses crossings with frames of at least two streets or drives around them. The next one is always far from those
// chosen before.
std::vector<Eigen::Vector2d> choose_zones(const SimulationOptions& options, const Layout& layout) {
  std::vector<Eigen::Vector2d> driven, zones;
  for (const Eigen::Vector2d& crossing : layout.crossings) {
    const auto near = std::count_if(layout.truth.frames.begin(), layout.truth.frames.end(), [&](const Pose& pose) {
      return (pose.centre.head<2>() - crossing).norm() < kAround;
    });
    // One street alone has 2 kAround of its way inside the circle. More means that a second street or drive is there.
    if (static_cast<double>(near) * options.frame_distance_m > 2 * kAround) driven.push_back(crossing);
  }
  if (std::ssize(driven) < options.control_zones)
    throw InputError("simulation: there are " + std::to_string(driven.size()) + " crossings for " +
                     std::to_string(options.control_zones) + " control zones; ask for fewer zones or for more frames");
  std::vector<double> distance(driven.size(), std::numeric_limits<double>::infinity());
  while (std::ssize(zones) < options.control_zones) {
    const auto farthest = std::max_element(distance.begin(), distance.end()) - distance.begin();
    zones.push_back(driven[static_cast<std::size_t>(farthest)]);
    for (std::size_t i = 0; i < driven.size(); ++i)
      distance[i] = std::min(distance[i], (driven[i] - zones.back()).norm());
  }
  return zones;
}

// A corner of a stripe of one of the four zebra crossings at a junction. The stripes are half a metre wide and three
// metres long.
Eigen::Vector2d stripe_corner(const Eigen::Vector2d& crossing, Random& random) {
  const double across = 0.5 * static_cast<double>(random.below(16)) - 3.75;
  const double along = random.uniform() < 0.5 ? 9.5 : 12.5;
  const Eigen::Vector2d corner(random.uniform() < 0.5 ? along : -along, across);
  return crossing + (random.uniform() < 0.5 ? corner : corner.reverse());
}

}  // namespace

void simulate_control_zones(const SimulationOptions& options, const Observer& observer, Layout& layout) {
  if (options.control_zones == 0) return;
  const std::vector<Eigen::Vector2d> zones = choose_zones(options, layout);
  for (std::size_t z = 0; z < zones.size(); ++z) {
    // Beyond the streams of simulate_control(), whose numbers are ints.
    Random random(options.seed, Random::Purpose::kControl, (1ULL << 32) + z);
    const auto wanted = kFewest + random.below(kMost - kFewest + 1);
    const bool held_out = static_cast<int>(z) == options.held_out_zone;
    std::int64_t made = 0;
    std::vector<Eigen::Vector2d> taken;
    for (std::int64_t tries = 0; made < wanted && tries < 40 * wanted; ++tries) {
      const Eigen::Vector2d place = stripe_corner(zones[z], random);
      if (std::find(taken.begin(), taken.end(), place) != taken.end()) continue;
      const auto surface = layout.scene->road(place);
      if (!surface) continue;
      std::vector<SimulatedObservation> seen = observer.observations_of(*surface);
      while (seen.size() > kMeasurements) seen.erase(seen.begin() + random.below(std::ssize(seen)));
      // The observations ascend by image. First and last in one frame means that all are, and the rig alone is a short
      // base.
      if (seen.size() < 3 ||
          layout.block.images[seen.front().image].frame == layout.block.images[seen.back().image].frame)
        continue;
      taken.push_back(place);
      ControlPoint point = measure_control(options, surface->position, seen, random);
      // A held-out zone changes the roles alone, so that two simulations differ in nothing else.
      point.role = held_out || made % kCheckEvery == kCheckEvery - 1 ? PointRole::kCheck : PointRole::kControl;
      point.name.append("zone").append(std::to_string(z)).append("_").append(std::to_string(made));
      layout.block.control_points.push_back(std::move(point));
      layout.control_truth.push_back(surface->position);
      ++made;
    }
  }
}

}  // namespace megablock
