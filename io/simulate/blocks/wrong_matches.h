// Simulates wrong matches that agree with one another. A robust estimator must also withstand these, not only outliers
// at random places.
#pragma once

#include "io/simulate/blocks/observe.h"

namespace megablock {

// A run of observations of a track that show another place than its point: another window of a repeated facade, or a
// spot on a vehicle that drives by. It has at most half of the observations, so the majority shows the point.
struct WrongGroup {
  std::size_t begin = 0;                               // first observation of the run
  std::vector<std::optional<Eigen::Vector2d>> pixels;  // one per observation; empty: the place is not in the image
  Verdict verdict = Verdict::kRepeated;
  double stray_share = 0;  // probability of each other observation to be an outlier anywhere in the image
};

// If the scene has mistakes, groups get two thirds of outlier_share, and outliers at random places the rest.
WrongGroup draw_wrong_group(const SimulationOptions& options, const Layout& layout, const Observer& observer,
                            const SurfacePoint& point, const std::vector<SimulatedObservation>& seen, Random& random);

}  // namespace megablock
