#include "io/simulate/blocks/wrong_matches.h"

#include <algorithm>
#include <cmath>

namespace megablock {

// Of n observations a group has m, with m uniform in 1 .. n/2 and the mean (1 + n/2) / 2. A group is drawn with the
// probability p = group_share n / mean, so that the expected number of outliers is group_share n.
WrongGroup draw_wrong_group(const SimulationOptions& options, const Layout& layout, const Observer& observer,
                            const SurfacePoint& point, const std::vector<SimulatedObservation>& seen, Random& random) {
  WrongGroup group;
  group.stray_share = options.outlier_share;
  if (options.outlier_share == 0) return group;
  const auto mistake = layout.scene->mistake(point, random);
  if (!mistake) return group;
  const double group_share = options.outlier_share * 2 / 3, n = static_cast<double>(seen.size());
  // This is a share of the observations outside of groups, so that both kinds add up to outlier_share.
  group.stray_share = (options.outlier_share - group_share) / (1 - group_share);
  const auto most = static_cast<std::int64_t>(seen.size() / 2);
  const double mean = 0.5 * static_cast<double>(1 + most);
  const bool drawn = random.uniform() < group_share * n / mean;
  // Both are drawn in any case, so that another positive outlier_share leaves the later draws as they are.
  const std::int64_t length = 1 + random.below(most);
  const std::int64_t begin = random.below(std::ssize(seen) - length + 1);
  if (!drawn) return group;
  group.begin = static_cast<std::size_t>(begin);
  group.verdict = mistake->verdict;
  const auto time_of = [&](const SimulatedObservation& s) {
    return layout.block.frames[layout.block.images[s.image].frame].time_s;
  };
  for (std::int64_t i = begin; i < begin + length; ++i) {
    const SimulatedObservation& s = seen[static_cast<std::size_t>(i)];
    const double elapsed = time_of(s) - time_of(seen[group.begin]);
    // Half a second of the way lies between the point and the vehicle in the first observation, so that this one is
    // wrong too. After ten seconds a vehicle is out of sight; the observation is then an outlier anywhere.
    const Eigen::Vector3d place = point.position + mistake->offset + mistake->velocity * (0.5 + elapsed);
    auto pixel = std::abs(elapsed) < 10 ? observer.pixel_of(s.image, place) : std::nullopt;
    // If the wrong place is on the line of sight, its pixel is too near the right one to be an outlier.
    if (pixel && (*pixel - s.pixel).norm() < 5 + 6 * options.image_noise_px) pixel.reset();
    group.pixels.push_back(pixel);
  }
  return group;
}

}  // namespace megablock
