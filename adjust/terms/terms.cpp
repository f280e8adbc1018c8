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

PositionScale SigmaScales::of_positions(RigIndex group) const {
  for (const PositionScale& scale : of_groups())
    if (scale.group == group) return scale;
  return {group, (*this)[ObservationKind::kPositionHorizontal], (*this)[ObservationKind::kPositionHeight]};
}

bool SigmaScales::has_place_for(RigIndex group) const {
  const auto is = [group](const PositionScale& scale) { return scale.group == group; };
  return group_count < std::ssize(groups) || std::any_of(groups.begin(), groups.begin() + group_count, is);
}

void SigmaScales::set_positions(const PositionScale& scale) {
  const auto end = groups.begin() + group_count;
  const auto place = std::lower_bound(groups.begin(), end, scale.group,
                                      [](const PositionScale& s, RigIndex group) { return s.group < group; });
  if (place != end && place->group == scale.group) {
    *place = scale;
  } else if (end != groups.end()) {
    std::move_backward(place, end, end + 1);
    *place = scale;
    ++group_count;
  }
}

void SigmaScales::multiply(const SigmaScales& change) {
  // Before the factors of the kind change, which hold for a group that has none of its own yet.
  for (const PositionScale& by : change.of_groups()) {
    const PositionScale now = of_positions(by.group);
    set_positions({by.group, now.horizontal * by.horizontal, now.height * by.height});
  }
  for (std::size_t k = 0; k < kObservationKinds; ++k) of[k] *= change.of[k];
}

bool SigmaScales::differ_by(double factor) const {
  const auto differs = [factor](double scale) { return scale > factor || scale < 1 / factor; };
  const auto group_differs = [&](const PositionScale& s) { return differs(s.horizontal) || differs(s.height); };
  return std::any_of(of.begin(), of.end(), differs) ||
         std::any_of(groups.begin(), groups.begin() + group_count, group_differs);
}

}  // namespace megablock
