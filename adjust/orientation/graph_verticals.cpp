#include "adjust/orientation/graph_verticals.h"

#include <algorithm>
#include <cmath>

#include "adjust/terms/vertical_terms.h"
#include "geometry/numbers/angles.h"
#include "io/project/inputs/verticals.h"

namespace megablock {

std::vector<KnownVertical> known_verticals(const Block& block, const OrientationGraph& graph,
                                           const OrientationValues& values) {
  const GroundVertical ground(block.ground);
  std::vector<KnownVertical> verticals;
  for (const auto& image : graph.images) {
    if (image.vertical == nullptr) continue;
    const auto& frame = graph.frames[static_cast<std::size_t>(image.frame)];
    const auto camera = static_cast<std::size_t>(image.camera);
    const AxisDirection down =
        whole_error(*image.vertical, block.cameras[graph.cameras[camera]], values.cameras[camera]);
    verticals.push_back({image.frame, image.mount.rotation.conjugate() * down.direction,
                         ground.down(frame.position ? frame.position->position : Eigen::Vector3d::Zero()),
                         std::max(1e-4, std::sqrt(down.covariance.trace() / 2))});
  }
  return verticals;
}

SeenVerticals seen_verticals(const Block& block, const OrientationGraph& graph, const OrientationValues& values) {
  SeenVerticals result;
  for (std::size_t i = 0; i < graph.images.size(); ++i) {
    const auto& image = graph.images[i];
    if (image.vertical == nullptr) continue;
    const auto c = static_cast<std::size_t>(image.camera);
    const Camera& camera = block.cameras[graph.cameras[c]];
    const Eigen::Matrix3d to_frame = image.mount.rotation.conjugate().toRotationMatrix();
    result.seen.push_back({image.frame, image.camera,
                           to_frame * whole_error(*image.vertical, camera, values.cameras[c]).direction,
                           to_frame * image.vertical->covariance * to_frame.transpose(),
                           to_frame * camera_error(*image.vertical, camera)});
    result.images.push_back(i);
  }
  return result;
}

std::optional<AxisDirection> known_down(const Block& block, const OrientationGraph& graph,
                                        const OrientationValues& values, GroundAngles angles) {
  const Eigen::Vector3d down = GroundVertical(block.ground).down(Eigen::Vector3d::Zero());
  if (angles != GroundAngles::kAll) return down_by_positions(graph, values, down);
  constexpr double kMounting = 2 * kDegree;  // of the attitude sensors relative to the cameras
  double variance = 0, count = 0;
  for (const auto& frame : graph.frames) {
    if (!frame.given && !frame.attitude) continue;
    // The mean of n attitudes has their mean variance over n. The mounting is the same for all of them, and is not
    // averaged out.
    if (!frame.given) variance += frame.attitude->sigma_rad.squaredNorm();
    ++count;
  }
  return AxisDirection{down, (kMounting * kMounting + variance / count) * Eigen::Matrix3d::Identity()};
}

}  // namespace megablock
