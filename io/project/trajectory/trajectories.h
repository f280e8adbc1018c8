// Holds the poses of frames that the section `trajectory` of the project file names, and makes observations, start
// values and relative poses of them. Internal to io/.
//
// A trajectory observes the position P of a reference point (antenna, inertial unit, camera) and the attitude R of the
// axes of the rig (io/block/observed_poses.h):
//
//     P = C + R' l,    start: C = P - R' l,    with l the lever arm in the axes of the rig.
//
// Relative poses of successive frames i, j of a pass follow from R and C,
//
//     R_ij = R_j R_i',   T_ij = R_i (C_j - C_i),
//
// because what drifts slowly is common to both. With the distance d between them and the time t, the drift model states
//
//     sigma_T^2 = sigma_position^2 + d (sigma_position_per_sqrt_m)^2,
//     sigma_R^2 = sigma_rotation^2 + t (sigma_rotation_per_sqrt_s)^2:
//
// white noise of each pose, and random walks of odometer and gyroscopes.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "io/block/block.h"
#include "io/block/crs.h"
#include "io/project/positions/position_table.h"

namespace megablock {

// The sigmas of relative poses that are made of a trajectory.
struct DriftModel {
  double sigma_position_m = 0.005, sigma_position_per_sqrt_m = 0;
  double sigma_rotation_deg = 0.01, sigma_rotation_deg_per_sqrt_s = 0;
  double max_gap_m = 50, max_gap_s = 60;  // successive frames farther apart get no relative pose
};

struct TrajectorySource : TableSource {
  std::string times;  // file with the times of frames; empty: those of the headers
  std::optional<std::int64_t> pass;
  std::optional<Eigen::Vector3d> lever_arm;               // metres, axes of the rig
  std::optional<double> sigma_tilt, sigma_heading;        // degrees, in place of those of the file
  bool start = true, positions = true, attitudes = true;  // what the poses serve for
  std::optional<DriftModel> relative;
};

class Trajectories {
 public:
  struct ObservedPose {
    FrameIndex frame;
    std::size_t source = 0;
    std::optional<Geodetic> geodetic;  // nothing: `local`, in the block's own frame
    Eigen::Vector3d local = Eigen::Vector3d::Zero();
    std::optional<Eigen::Quaterniond> rotation;     // to the rig from east, north, up at `geodetic`, or from the block
    Eigen::Vector2d sigma_m{kNoNumber, kNoNumber};  // horizontal, vertical; NaN: the position is no observation
    Eigen::Vector2d sigma_deg{kNoNumber, kNoNumber};  // tilt, heading; NaN: the attitude is no observation
    std::optional<std::int64_t> pass;
    double time_s = kNoNumber;
  };

  std::vector<TrajectorySource> sources;
  std::vector<ObservedPose> poses;  // source by source, frames ascending

  bool empty() const { return poses.empty(); }
  std::vector<Geodetic> places() const;

  // Replace the priors of the frames that have a pose. `sigmas` (metres; tilt and heading in degrees) go before those
  // of the trajectory. Throw InputError if the block's ground frame has no place on earth, but the poses have.
  void set_positions(const std::optional<double>& sigma_horizontal, const std::optional<double>& sigma_vertical,
                     const Eigen::Vector3d& lever_arm, Block& block) const;
  void set_attitudes(const std::optional<double>& sigma_deg, Block& block) const;
  // Sets start values, passes, times (where all frames have one) and relative poses. The block's own relative poses
  // give way to those. `lever_arm`: where a source has none.
  void set_starts(const Eigen::Vector3d& lever_arm, Block& block) const;
};

// Writes the priors of frames as a trajectory of named rows in the block's own frame, so that the same numbers come
// back. A frame without a prior gets its given pose as a start value.
void write_trajectory_csv(const std::string& path, const Block& block);

// The sigmas about the axes of the rig (radians), of tilt and heading (radians) about those of the ground. The
// correlations are dropped, because a prior has three sigmas.
Eigen::Vector3d attitude_sigmas(const Eigen::Quaterniond& rotation, double tilt, double heading);

}  // namespace megablock
