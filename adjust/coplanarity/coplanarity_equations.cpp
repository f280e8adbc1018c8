#include "adjust/coplanarity/coplanarity_equations.h"

#include <cmath>

namespace megablock {

namespace {

Eigen::Vector3d base_of(const CoplanarityNetwork& network, std::size_t a, std::size_t b) {
  return network.centres[static_cast<std::size_t>(network.camera[b])] -
         network.centres[static_cast<std::size_t>(network.camera[a])];
}

}  // namespace

FreeColumns::FreeColumns(const CoplanarityNetwork& network) {
  const auto take = [this](std::size_t size, const std::vector<std::uint8_t>& held) {
    std::vector<std::int64_t> columns(size);
    for (std::size_t i = 0; i < size; ++i) columns[i] = !held.empty() && held[i] ? -1 : count++;
    return columns;
  };
  angle = take(3 * network.centres.size(), network.angles_held);
  angles = count;
  image = take(2 * network.image.size(), network.images_held);
}

std::int64_t pair_count(const CoplanarityNetwork& network) {
  std::int64_t rows = 0;
  for (std::size_t j = 0; j + 1 < network.begin.size(); ++j) {
    const std::int64_t views = network.begin[j + 1] - network.begin[j];
    rows += views * (views - 1) / 2;
  }
  return rows;
}

CoplanarityDeterminant determinant(const CoplanarityNetwork& network, std::size_t a, std::size_t b) {
  return coplanarity_determinant(base_of(network, a, b), network.focal_px,
                                 network.angles[static_cast<std::size_t>(network.camera[a])], network.image[a],
                                 network.angles[static_cast<std::size_t>(network.camera[b])], network.image[b]);
}

double scale_of_determinant(const CoplanarityNetwork& network, std::size_t a, std::size_t b) {
  const auto length = [&](std::size_t o) { return std::hypot(1.0, network.image[o].norm() / network.focal_px); };
  return base_of(network, a, b).norm() * length(a) * length(b);
}

}  // namespace megablock
