#include "partition/views/cones.h"

#include <cmath>
#include <numbers>

#include "geometry/camera/camera.h"
#include "partition/views/views.h"

namespace megablock {

namespace {

constexpr int kColumns = 5, kRows = 3;                 // grid of sample directions
constexpr double kDistances[] = {0.13, 0.25, 0.5, 1};  // distances of sample points, as shares of the range
// Radians; from two directions farther apart, a point looks too different to be matched.
constexpr double kWidestAngle = 60 * std::numbers::pi / 180;

std::optional<Pose> known_pose(const Frame& frame) {
  if (frame.given_pose) return frame.given_pose;
  if (!frame.position_prior || !frame.attitude_prior) return std::nullopt;
  const Eigen::Quaterniond& rotation = frame.attitude_prior->rotation_cw;
  return Pose{rotation, frame.position_prior->position - rotation.conjugate() * frame.position_prior->lever_arm};
}

}  // namespace

ViewingCones::ViewingCones(const Block& block, double range_m) : range_m_(range_m) {
  for (const Camera& camera : block.cameras) {
    Shape shape;
    shape.wide = sees_sideways(camera.intrinsics.model());
    shape.cosine = std::cos(half_opening(camera));
    const double f = camera.intrinsics[kFocal];
    const Eigen::Vector2d principal(camera.intrinsics[kPrincipalX], camera.intrinsics[kPrincipalY]);
    shape.low = -principal / f;
    shape.high = (Eigen::Vector2d(camera.width, camera.height) - principal) / f;
    for (int r = 0; r < kRows; ++r)
      for (int c = 0; c < kColumns; ++c) {
        const Eigen::Vector2d pixel(camera.width * (c + 0.5) / kColumns, camera.height * (r + 0.5) / kRows);
        if (const auto ray = viewing_ray(camera.intrinsics, pixel))
          for (const double share : kDistances) shape.samples.push_back(share * range_m * *ray);
      }
    shapes_.push_back(std::move(shape));
  }
  for (ImageIndex i(0); block.images.contains(i); ++i.value) {
    const FrameIndex frame = block.images[i].frame;
    const auto pose = known_pose(block.frames[frame]);
    if (block.rig_of(frame).cameras().size() > 1 && pose)
      cones_.push_back({true, camera_pose(*pose, block.mount_of(i).pose), block.camera_of(i)});
    else
      cones_.push_back({});
  }
}

bool ViewingCones::sees(const Cone& cone, const Eigen::Vector3d& point) const {
  const Eigen::Vector3d inside = to_inside(cone.camera, point);
  const Shape& shape = shapes_[cone.of];
  if (inside.squaredNorm() > range_m_ * range_m_) return false;
  if (shape.wide) return inside.z() >= shape.cosine * inside.norm();
  if (inside.z() <= 0) return false;
  const Eigen::Vector2d p = inside.head<2>() / inside.z();
  return (p.array() >= shape.low.array()).all() && (p.array() <= shape.high.array()).all();
}

double ViewingCones::seen_share(const Cone& from, const Cone& by) const {
  const std::vector<Eigen::Vector3d>& samples = shapes_[from.of].samples;
  const Eigen::Matrix3d to_ground = from.camera.rotation.toRotationMatrix().transpose();
  double sum = 0;
  for (const Eigen::Vector3d& sample : samples) {
    const Eigen::Vector3d sight = to_ground * sample, point = from.camera.centre + sight;
    if (!sees(by, point)) continue;
    const Eigen::Vector3d other = point - by.camera.centre;
    const double angle = std::atan2(sight.cross(other).norm(), sight.dot(other));
    sum += std::max(0.0, 1 - angle / kWidestAngle);
  }
  return samples.empty() ? 0 : sum / static_cast<double>(samples.size());
}

double ViewingCones::overlap(ImageIndex a, ImageIndex b) const {
  if (!has(a) || !has(b)) return 0;
  return 0.5 * (seen_share(cones_[a], cones_[b]) + seen_share(cones_[b], cones_[a]));
}

}  // namespace megablock
