// Holds the observations and unknowns of one tile. They are the input of the tile bundle adjustment (adjust/), of the
// condensed normal equations (merge/) and, with one tile for the whole block, of the monolithic reference.
//
// Residuals, each divided by its sigma (r is dimensionless; cost F = 1/2 sum rho(|r|^2)):
//   image            project(K, to_camera(frame, mount, X)) - measured                                   [2]
//   position         C + R' lever_arm - P                  (lever arm and R_prior corrected by the       [3]
//   attitude         Log(R R_prior')                        receiver, io/block/observed_poses.h)         [3]
//   relative pose    Log(R_to R_from' R_measured'), R_from (C_to - C_from) - T_measured                  [3 + 3]
//   point prior      X - X_0                               (control points)                              [3]
//   intrinsics prior k - k_0                               (per parameter with finite sigma)             [1 each]
//   mount prior      Log(R R_0'), C - C_0                                                                [6]
//   line             off the vertical, or the horizontal (line_terms.h)                                 [1]
//   vertical         direction of down in an image, expected - seen (vertical_terms.h)                   [2]
// Robust losses act on image residuals (all), position, control and attitude priors, relative poses, lines and
// verticals (each with an option of its own).
//
// Unknowns: frames (6, pose_update), free intrinsics (camera_free), free mounts (6), points (3). Every table is
// ascending by the index in the block; a local index is a row of its table.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "io/block/block.h"
#include "io/block/image_graph.h"
#include "io/block/tracks.h"

namespace megablock {

struct RobustLoss {
  // Cauchy's tail: Huber's loss up to 2c, and 3c^2 + 2c^2 log(s / 4c^2) beyond; Hampel's three parts are similar. It
  // leaves good observations as they are, so that their sigmas and chi-square stay true, and ignores gross errors.
  // Three good attitudes in a hundred have residuals between c and 2c. Under the logarithm they would approach the
  // optimum only by a constant factor per step, because the cost curves downwards there and a step must not use
  // negative curvature (merge/tile/tile_linearisation.h).
  enum class Kind : std::uint8_t { kNone, kHuber, kCauchy, kCauchyTail };
  Kind kind = Kind::kNone;
  double scale = 1;  // in sigmas: the corner c, or Cauchy's scale
  // rho(s) of the squared norm s, with first and second derivative: {rho, rho', rho''}, as ceres::LossFunction.
  std::array<double, 3> evaluate(double squared_norm) const {
    return squares(squared_norm) ? std::array<double, 3>{squared_norm, 1, 0} : evaluate_beyond(squared_norm);
  }
  // Whether rho(s) = s at this s, as for nearly every observation.
  bool squares(double s) const { return kind == Kind::kNone || (has_corner() && !(s > scale * scale)); }
  bool has_corner() const { return kind == Kind::kHuber || kind == Kind::kCauchyTail; }
  // The loss for a start that is far off. A loss that ignores gross errors would ignore good observations there;
  // Huber's loss pulls from any distance.
  RobustLoss from_afar() const {
    return kind == Kind::kCauchy || kind == Kind::kCauchyTail ? RobustLoss{Kind::kHuber, scale} : *this;
  }

 private:
  std::array<double, 3> evaluate_beyond(double squared_norm) const;
};

// Numbers the mounts of all rigs: the rig, and the mount within it.
struct MountId {
  RigIndex rig;
  std::int32_t mount = 0;
  friend auto operator<=>(const MountId&, const MountId&) = default;
};

struct TileImage {
  ImageIndex image;
  LocalFrame frame;
  LocalCamera camera;
  std::int32_t mount = -1;  // row of TileProblem::mounts
};

// A point of the tile: a track or a control point (an index into Block::control_points).
struct TilePoint {
  PointRole role = PointRole::kTie;
  std::int64_t index = -1;  // TrackIndex value or control point row
};

struct TileProblem {
  std::vector<FrameIndex> frames;
  std::vector<CameraIndex> cameras;
  std::vector<ParameterMask> camera_free;  // [cameras] intrinsic parameters that are unknowns
  std::vector<MountId> mounts;
  std::vector<std::uint8_t> mount_free;  // [mounts] 1: six unknowns
  // The centre of the first mount of the frame's or mount's rig, metres in rig axes. It is that of the state with which
  // the problem was made, and stays.
  std::vector<Eigen::Vector3d> reference_of_frame, reference_of_mount;  // [frames], [mounts]
  std::vector<TileImage> images;

  // Points (tracks ascending, then control points ascending) and their observations.
  std::vector<TilePoint> points;
  std::vector<std::int64_t> begin;    // [points + 1]
  std::vector<LocalImage> image;      // [observations]; -1 where the frame has no pose (never kept)
  std::vector<double> x, y;           // px
  std::vector<double> inverse_sigma;  // 1/px
  double image_sigma_px = 0.5;        // of the tie point observations, per axis (set_image_sigma)
  // 1 = takes part. Points with fewer than two kept observations and without a prior take no part at all.
  std::vector<std::uint8_t> kept;

  struct PositionTerm {
    LocalFrame frame;
    PositionPrior prior;
    std::int32_t receiver = -1, group = -1;  // rows of `mounts`; -1: none
  };
  struct AttitudeTerm {
    LocalFrame frame;
    AttitudePrior prior;
    std::int32_t receiver = -1;
  };
  struct RelativeTerm {
    LocalFrame from, to;
    Pose pose;
    double rotation_sigma_rad, position_sigma_m;
  };
  struct PointTerm {
    LocalPoint point;
    Eigen::Vector3d position, sigma;  // an axis of infinite sigma is free
  };
  struct IntrinsicTerm {
    LocalCamera camera;
    Intrinsics value;
    IntrinsicSigmas sigma;
  };
  struct MountTerm {
    std::int32_t mount;
    Pose value;
    double rotation_sigma_rad, position_sigma_m;
  };
  // A line known to be vertical or horizontal (line_terms.h); rays are in the axes of the rig.
  struct LineTerm {
    LocalFrame frame;
    LocalFrame other;  // of a horizontal line; invalid: the line is vertical
    Eigen::Vector3d middle = Eigen::Vector3d::Zero(), across = Eigen::Vector3d::Zero();
    Eigen::Vector3d other_normal = Eigen::Vector3d::Zero();
    Eigen::Vector3d up = Eigen::Vector3d::UnitZ();  // at the frame, ground axes
    double weight = 0;
    LocalFrame seen_by() const { return other.valid() ? other : frame; }
  };
  // The direction in which an image sees down (vertical_terms.h).
  struct VerticalTerm {
    LocalImage image;
    Eigen::Vector3d ground = -Eigen::Vector3d::UnitZ();  // down at the frame, ground axes
    Eigen::Vector3d seen = Eigen::Vector3d::UnitY();     // camera axes
    Eigen::Matrix<double, 2, 3> weight;                  // camera axes -> sigmas, across `seen`
    Eigen::VectorXd camera;      // parameters of the camera with which `seen` was found, or empty
    Eigen::Matrix2Xd by_camera;  // weight * d seen / d parameter
  };
  // A number between two frames, in the unit of its type (io/block/frame_measurements.h).
  struct MeasuredTerm {
    LocalFrame from, to;
    double value, sigma;
  };
  std::vector<PositionTerm> positions;
  std::vector<AttitudeTerm> attitudes;
  std::vector<RelativeTerm> relatives;
  std::vector<PointTerm> point_priors;
  std::vector<IntrinsicTerm> intrinsic_priors;
  std::vector<MountTerm> mount_priors;
  std::vector<LineTerm> lines;
  std::vector<VerticalTerm> verticals;
  std::map<std::string, std::vector<MeasuredTerm>> measured;  // by the key of their type
  // Gross errors, which take no part (adjust/checks/prior_test.h).
  std::vector<PositionTerm> positions_aside;
  std::vector<PointTerm> point_priors_aside;

  RobustLoss image_loss, position_loss, control_loss, attitude_loss, relative_loss, line_loss, vertical_loss;

  std::int64_t point_count() const { return static_cast<std::int64_t>(points.size()); }
  std::int64_t observation_count() const { return static_cast<std::int64_t>(image.size()); }
  // Whether a point takes part: it needs two or more kept observations, or one and a prior.
  bool active(std::int64_t point) const;
};

// The inverse sigma of one parameter of a camera's prior; 0 where the parameter is held or free without prior.
inline double intrinsic_prior_weight(const TileProblem::IntrinsicTerm& term, int parameter) {
  const double sigma = term.sigma[static_cast<std::size_t>(parameter)];
  return sigma > 0 ? 1 / sigma : 0;
}

// The values of the tile's unknowns; rows are those of the problem's tables.
struct TileState {
  std::vector<Pose> frames;
  std::vector<Intrinsics> cameras;
  std::vector<Pose> mounts;
  std::vector<Eigen::Vector3d> points;
};

// The part of a block's observations that an adjustment takes, for a split test (half.h).
enum class Half : std::int32_t { kNone = 0, kTiePoints1 = 1, kTiePoints2 = 2, kImages1 = 3, kImages2 = 4 };
struct HalfChoice {
  Half half = Half::kNone;
  std::int64_t division = 0;  // number of the division: each divides the observations in another way
};

// A loss acts on the length of a residual of n numbers. Of good observations, the share beyond 3 sigmas is 0.3 % for
// one number (lines), 1.1 % for two (images, verticals) and 2.9 % for three (positions, control, attitudes). With the
// corner at three sigmas, nearly all good observations therefore keep the weight 1. docs/developer/decisions.md tells
// why attitudes have Cauchy's tail ("Sigmas"), positions and control too ("A wrong position or control point"), and
// verticals Cauchy's loss ("Verticals").
struct ObservationOptions {
  double image_sigma_px = 0.5;  // a-priori sigma of a tie point observation per axis, px
  RobustLoss image_loss{RobustLoss::Kind::kHuber, 3.0};
  RobustLoss position_loss{RobustLoss::Kind::kCauchyTail, 3.0};
  RobustLoss control_loss{RobustLoss::Kind::kCauchyTail, 3.0};  // of the coordinates of control points
  RobustLoss attitude_loss{RobustLoss::Kind::kCauchyTail, 3.0};
  RobustLoss relative_loss{RobustLoss::Kind::kNone, 1.0};
  RobustLoss line_loss{RobustLoss::Kind::kHuber, 3.0};
  RobustLoss vertical_loss{RobustLoss::Kind::kCauchy, 3.0};
  bool use_position_priors = true;
  bool use_attitude_priors = true;
  HalfChoice half;     // no option of the project file
  void check() const;  // throws InputError
};

// The tile that owns a track, a relative pose or a line (owner.h; docs/developer/decisions.md, "Whose a point is"). A
// track belongs to a tile by its images; the result is invalid where none lies in a tile. A relative pose or a line
// belongs to a tile by its frames; the result is invalid unless both lie in tiles.
TileIndex owner_tile(const Block& block, const Tiles& tiles, const ImageIndex* begin, const ImageIndex* end);
TileIndex owner_tile(const Tiles& tiles, FrameIndex first, FrameIndex second);

// The whole block as one tile.
Tiles single_tile(const Block& block);

// The frame row of an active point's first kept observation; -1 without one. All observations of a point are in one
// part of the tile, so it tells the part of the point.
std::int64_t frame_of_point(const TileProblem& problem, std::int64_t point);

// Whether a held mount and one in a lower row of its rig are at different places. They then give the scale of the
// ground.
bool rig_gives_scale(const TileProblem& problem, const TileState& state, std::size_t mount);

// The values for the problem's tables from the block's. `points` has one for each row of problem.points.
TileState make_tile_state(const TileProblem& problem, const BlockState& state, std::vector<Eigen::Vector3d> points);
// Writes frames, cameras and mounts of the tile back into the block's state.
void store_tile_state(const TileProblem& problem, const TileState& tile, BlockState& state);

}  // namespace megablock
