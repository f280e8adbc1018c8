#include "io/simulate/scene/relative_measurement.h"

#include "geometry/numbers/angles.h"

namespace megablock {

RelativePose measure_relative(const SimulationOptions& options, const BlockState& truth, FrameIndex from, FrameIndex to,
                              Random& random) {
  const Pose &a = truth.frames[from], &b = truth.frames[to];
  RelativePose relative;
  relative.from = from;
  relative.to = to;
  relative.rotation_sigma_rad = kDegree * options.relative_rotation_sigma_deg;
  relative.position_sigma_m = options.relative_position_sigma_m;
  const Eigen::Vector3d turn = relative.rotation_sigma_rad * random.normal3();
  relative.pose.rotation = (rotation_exp<double>(turn) * b.rotation * a.rotation.conjugate()).normalized();
  relative.pose.centre = to_inside(a, b.centre) + relative.position_sigma_m * random.normal3();
  return relative;
}

}  // namespace megablock
