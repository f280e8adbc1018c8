#include "adjust/terms/terms.h"

#include <algorithm>
#include <cmath>

namespace megablock {

// Each of these functions is in the file of its type.
const ObservationType& position_observations();
const ObservationType& attitude_observations();
const ObservationType& line_observations();
const ObservationType& vertical_observations();
const ObservationType& relative_pose_observations();
const ObservationType& point_priors();
const ObservationType& intrinsic_priors();
const ObservationType& mount_priors();
const ObservationType& distance_observations();

namespace {

using Types = std::vector<const ObservationType*>;

const Types& table() {
  static const Types types{
      &position_observations(),       // of frames
      &attitude_observations(),       // of frames
      &line_observations(),           // known to be vertical or horizontal
      &vertical_observations(),       // the direction in which images see down
      &relative_pose_observations(),  // of two frames
      &point_priors(),                // of control points
      &intrinsic_priors(),            // of cameras
      &mount_priors(),                // of mounts
      &distance_observations(),       // of two frames
  };
  return types;
}

// Costs have always been summed in this order. The order decides the last bits of a sum, and another one would change
// the bits of results.
Types order_of_cost() {
  Types types = table();
  const auto relative = std::ranges::find(types, &relative_pose_observations());
  std::rotate(std::ranges::find(types, &line_observations()), relative, relative + 1);
  return types;
}

}  // namespace

std::span<const ObservationType* const> observation_types() { return table(); }

std::span<const ObservationType* const> observation_types_of_cost() {
  static const Types types = order_of_cost();
  return types;
}

bool SigmaScales::matter() const {
  // A factor within 2 % changes a weight by 4 % at most.
  constexpr double kSettled = 0.02;
  return std::any_of(of.begin(), of.end(), [](double scale) { return std::abs(scale - 1) > kSettled; });
}

}  // namespace megablock
