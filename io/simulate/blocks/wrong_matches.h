// Wrong matches that agree with one another.
#pragma once

#include "io/simulate/scene/scene.h"

namespace megablock {

// A run of a track's observations that show another place than the point: a window further along a repeated facade, or
// a spot on a vehicle that drives by. At most half of the observations, so that the point keeps the majority.
struct WrongGroup {
  std::size_t begin = 0;                               // first observation of the run
  std::vector<std::optional<Eigen::Vector2d>> pixels;  // of the run; empty: the place is not in the image
  Verdict verdict = Verdict::kRepeated;
  double stray_share = 0;  // of the other observations: wrong anywhere in the image
};

// Groups take two thirds of outlier_share where the scene knows mistakes, stray observations the rest.
WrongGroup draw_wrong_group(const SimulationOptions& options, const Layout& layout, const Observer& observer,
                            const SurfacePoint& point, const std::vector<Sighting>& seen, Random& random);

}  // namespace megablock
