#include "io/project/trajectory/trajectories.h"

#include <algorithm>
#include <cmath>

#include "geometry/numbers/angles.h"
#include "geometry/transform/pose.h"
#include "geometry/transform/rotation.h"
#include "io/base/error.h"
#include "io/text/csv_row.h"
#include "io/text/text_writer.h"

namespace megablock {

namespace {

using ObservedPose = Trajectories::ObservedPose;

// Turns observed poses into the ground frame of a block.
class IntoGround {
 public:
  explicit IntoGround(const Block& block) {
    if (block.ground.georeferenced) reference_.emplace(block.ground);
  }

  Eigen::Vector3d position(const ObservedPose& pose) const {
    return pose.geodetic ? reference().to_local(*pose.geodetic) : pose.local;
  }
  Eigen::Quaterniond rotation(const ObservedPose& pose) const {
    if (!pose.geodetic) return *pose.rotation;
    return (*pose.rotation * reference().own_from_block(*pose.geodetic)).normalized();
  }

 private:
  const Georeference& reference() const {
    if (!reference_)
      throw InputError(
          "trajectory: its poses have a place on earth, but the block has none; add 'origin' to the project file");
    return *reference_;
  }
  std::optional<Georeference> reference_;
};

// Adds the relative poses of successive frames of one source and one pass.
class RelativesOfPass {
 public:
  RelativesOfPass(const DriftModel& model, Block& block) : model_(model), block_(block) {}

  void add(const ObservedPose& pose, const Pose& rig) {
    if (before_) link(pose, rig);
    before_ = &pose;
    rig_before_ = rig;
  }

 private:
  void link(const ObservedPose& pose, const Pose& rig) {
    const double distance = (rig.centre - rig_before_.centre).norm();
    const double elapsed = std::abs(pose.time_s - before_->time_s), seconds = std::isnan(elapsed) ? 0 : elapsed;
    if (distance > model_.max_gap_m || seconds > model_.max_gap_s) return;
    RelativePose relative;
    relative.from = before_->frame;
    relative.to = pose.frame;
    relative.pose = relative_to(rig_before_, rig);
    relative.position_sigma_m =
        std::hypot(model_.sigma_position_m, model_.sigma_position_per_sqrt_m * std::sqrt(distance));
    relative.rotation_sigma_rad =
        kDegree * std::hypot(model_.sigma_rotation_deg, model_.sigma_rotation_deg_per_sqrt_s * std::sqrt(seconds));
    block_.relative_poses.push_back(relative);
  }

  const DriftModel& model_;
  Block& block_;
  const ObservedPose* before_ = nullptr;
  Pose rig_before_;
};

}  // namespace

Eigen::Vector3d attitude_sigmas(const Eigen::Quaterniond& rotation, double tilt, double heading) {
  if (tilt == heading) return Eigen::Vector3d::Constant(tilt);
  // R D R' is the covariance in axes of the rig.
  const Eigen::Matrix3d r = rotation.toRotationMatrix();
  const Eigen::Vector3d variance(tilt * tilt, tilt * tilt, heading * heading);
  return (r * variance.asDiagonal() * r.transpose()).diagonal().cwiseSqrt();
}

std::vector<Geodetic> Trajectories::places() const {
  std::vector<Geodetic> result;
  for (const ObservedPose& pose : poses)
    if (pose.geodetic) result.push_back(*pose.geodetic);
  return result;
}

void Trajectories::set_positions(const std::optional<double>& sigma_horizontal,
                                 const std::optional<double>& sigma_vertical, const Eigen::Vector3d& lever_arm,
                                 Block& block) const {
  const IntoGround into(block);
  for (const ObservedPose& pose : poses) {
    const TrajectorySource& source = sources[pose.source];
    if (!source.positions) continue;
    auto& prior = block.frames[pose.frame].position_prior;
    prior.reset();
    if (!pose.sigma_m.allFinite()) continue;
    const double horizontal = sigma_horizontal.value_or(pose.sigma_m.x());
    prior = PositionPrior{into.position(pose),
                          {horizontal, horizontal, sigma_vertical.value_or(pose.sigma_m.y())},
                          source.lever_arm.value_or(lever_arm)};
  }
}

void Trajectories::set_attitudes(const std::optional<double>& sigma_deg, Block& block) const {
  const IntoGround into(block);
  for (const ObservedPose& pose : poses) {
    if (!sources[pose.source].attitudes || !pose.rotation) continue;
    auto& prior = block.frames[pose.frame].attitude_prior;
    prior.reset();
    if (!pose.sigma_deg.allFinite()) continue;
    const Eigen::Quaterniond rotation = into.rotation(pose);
    prior = AttitudePrior{rotation, attitude_sigmas(rotation, kDegree * sigma_deg.value_or(pose.sigma_deg.x()),
                                                    kDegree * sigma_deg.value_or(pose.sigma_deg.y()))};
  }
}

void Trajectories::set_starts(const Eigen::Vector3d& lever_arm, Block& block) const {
  const IntoGround into(block);
  if (std::ranges::any_of(sources, [](const TrajectorySource& source) { return source.relative.has_value(); }))
    block.relative_poses.clear();
  // Times of headers and of a path have different origins; those of a block are of one clock.
  const bool timed = poses.size() == block.frames.size() &&
                     std::ranges::none_of(poses, [](const ObservedPose& pose) { return std::isnan(pose.time_s); });
  std::optional<RelativesOfPass> relatives;
  const ObservedPose* before = nullptr;
  for (const ObservedPose& pose : poses) {
    const TrajectorySource& source = sources[pose.source];
    Frame& frame = block.frames[pose.frame];
    if (pose.pass) frame.pass = *pose.pass;
    if (timed) frame.time_s = pose.time_s;
    if (!pose.rotation) continue;
    const Eigen::Quaterniond rotation = into.rotation(pose);
    const Pose rig{rotation, into.position(pose) - rotation.conjugate() * source.lever_arm.value_or(lever_arm)};
    if (source.start) frame.given_pose = rig;
    if (!source.relative) continue;
    if (!before || before->source != pose.source || before->pass != pose.pass)
      relatives.emplace(*source.relative, block);
    relatives->add(pose, rig);
    before = &pose;
  }
}

void write_trajectory_csv(const std::string& path, const Block& block) {
  TextWriter writer(path);
  writer.print("# crs: local\nname,pass,qw,qx,qy,qz,x,y,z,sigma_horizontal_m,sigma_vertical_m,sigma_rotation_deg\n");
  for (const Frame& frame : block.frames) {
    const auto& position = frame.position_prior;
    const auto& attitude = frame.attitude_prior;
    const auto& start = frame.given_pose;
    if (!position && !start) continue;
    const Eigen::Vector3d place = position ? position->position : start->centre;
    writer.print("{},{}", csv_field(frame.name), frame.pass);
    if (attitude || start) {
      const Eigen::Quaterniond q = attitude ? attitude->rotation_cw : start->rotation;
      writer.print(",{},{},{},{}", q.w(), q.x(), q.y(), q.z());
    } else {
      writer.print(",,,,");
    }
    writer.print(",{},{},{}", place.x(), place.y(), place.z());
    writer.print(",{},{}", position ? fmt::format("{}", position->sigma.x()) : "",
                 position ? fmt::format("{}", position->sigma.z()) : "");
    // 15 digits, so that the factor between the units leaves no rounding behind.
    writer.print(",{}\n", attitude ? fmt::format("{:.15g}", attitude->sigma_rad.x() / kDegree) : "");
  }
  writer.close();
}

}  // namespace megablock
