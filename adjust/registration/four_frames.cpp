// Forms the normal equations. With A_i the derivative of a residual by its point, B_i that by the pose of its frame (6
// numbers) and w_i its weight,
//
//     P = sum w A'A,   p = -sum w A'r,   K = sum w A'B (3 x 18)
//     N = sum w B'B - K' P^-1 K,   y = -sum w B'r - K' P^-1 p
//
// over the points, plus the equations of the pairs. The unknowns are the poses of B, C and D, six each; A is held,
// which is the datum. The pairs give the scale.
//
// Weights: 0 beyond the threshold t, and Cauchy's 1 / (1 + r^2 / (t/2)^2) within it.
#include "adjust/registration/four_frames.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <limits>

#include "geometry/numbers/angles.h"
#include "geometry/numbers/decompositions.h"

namespace megablock {

namespace {

// A held pair is a pair with sigmas far below those of any registration.
constexpr double kHeldRotation = 1e-9, kHeldPosition = 1e-7;  // sigmas of a held pair, rad and m
constexpr double kFarthestPoint = 500;                        // largest distance of a point from its frame, metres

double inverse_or(double sigma, double held) { return 1 / (sigma > 0 ? sigma : held); }

// The point nearest to the rays (geometry/intersection/triangulation.h, with equal weights), in the axes of A.
std::optional<Eigen::Vector3d> nearest_point(const FourFrameTrack& track, const std::array<Pose, 4>& poses,
                                             std::int32_t first, std::int32_t last) {
  // sum (I - d d') (X - o) = 0, over the rays from o in the direction d.
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  int count = 0;
  for (const FourFrameTrack::View& view : track.views) {
    if (view.frame < first || view.frame > last) continue;
    const RigRay ray = carried(view.ray, poses[static_cast<std::size_t>(view.frame)]);
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - ray.direction * ray.direction.transpose();
    normal += across;
    right += across * ray.origin;
    ++count;
  }
  const Eigen::Vector3d point = solve_symmetric3(normal, right);
  if (count < 2 || !point.allFinite() || point.norm() > kFarthestPoint) return std::nullopt;
  return point;
}

}  // namespace

// All poses become relative to A, which is the identity from now on: numbers stay small wherever the block lies.
FourFrames::FourFrames(const std::array<Pose, 4>& frames, const std::vector<FourFrameTrack>& tracks,
                       const PairRegistrationOptions& options)
    : tracks_(tracks),
      inverse_variance_(1 / (options.image_sigma_px * options.image_sigma_px)),
      pair_rotation_(inverse_or(options.pair_rotation_sigma_deg * kDegree, kHeldRotation)),
      pair_position_(inverse_or(options.pair_position_sigma_m, kHeldPosition)) {
  for (std::size_t f = 0; f < 4; ++f) poses_[f] = relative_to(frames[0], frames[f]);
  b_in_a_ = poses_[1];
  d_in_c_ = relative_to(poses_[2], poses_[3]);
}

void FourFrames::place_second_pair(const Pose& c) {
  poses_[2] = c;
  poses_[3] = {(d_in_c_.rotation * c.rotation).normalized(), c.centre + c.rotation.conjugate() * d_in_c_.centre};
}

double FourFrames::weight(double squared_px, double threshold_px) const {
  if (squared_px > threshold_px * threshold_px) return 0;
  return 1 / (1 + 4 * squared_px / (threshold_px * threshold_px));
}

std::optional<FourFrames::Intersection> FourFrames::intersect(const FourFrameTrack& track, std::int32_t first,
                                                              std::int32_t last, double scale_px) const {
  auto point = nearest_point(track, poses_, first, last);
  if (!point) return std::nullopt;
  constexpr int kIterations = 6;
  Eigen::Matrix3d normal;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    normal.setZero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (const FourFrameTrack::View& view : track.views) {
      if (view.frame < first || view.frame > last) continue;
      const Pose& pose = poses_[static_cast<std::size_t>(view.frame)];
      const auto r = ray_residual(view.ray, to_inside(pose, *point));
      if (!r) return std::nullopt;
      const Eigen::Matrix<double, 2, 3> by_point = r->by_point * pose.rotation.toRotationMatrix();
      // Cauchy's weight, so that one wrong ray does not carry the point away.
      const double w = 1 / (1 + r->pixels.squaredNorm() / (scale_px * scale_px));
      normal += w * by_point.transpose() * by_point;
      right -= w * by_point.transpose() * r->pixels;
    }
    const Eigen::Vector3d step = solve_symmetric3(normal, right);
    if (!step.allFinite()) return std::nullopt;
    *point += step;
    if (!(point->norm() < kFarthestPoint)) return std::nullopt;
    if (step.squaredNorm() < 1e-12 * point->squaredNorm()) break;
  }
  return Intersection{*point, (normal * inverse_variance_).inverse()};
}

void FourFrames::add_track(const FourFrameTrack& track, double threshold_px) {
  // Points are refined at the present poses before they are eliminated, so that hardly any residual is left in their
  // own equations.
  const auto intersection = intersect(track, 0, 3, 0.5 * threshold_px);
  if (!intersection) return;
  struct Row {
    int frame;
    double weight;
    Eigen::Vector2d residual;
    Eigen::Matrix<double, 2, 3> by_point;
    Eigen::Matrix<double, 2, 6> by_pose;
  };
  std::vector<Row> rows;
  bool pass[2] = {false, false};
  for (const FourFrameTrack::View& view : track.views) {
    const Pose& pose = poses_[static_cast<std::size_t>(view.frame)];
    const auto r = ray_residual(view.ray, to_inside(pose, intersection->point));
    const double w = r ? weight(r->pixels.squaredNorm(), threshold_px) : 0;
    if (w == 0) continue;
    pass[view.frame / 2] = true;
    rows.push_back({view.frame - 1, w * inverse_variance_, r->pixels, r->by_point * pose.rotation.toRotationMatrix(),
                    r->by_point * in_rig_by_pose(pose, intersection->point)});
  }
  // A point that only one pass keeps says nothing about the other. Two rays give the point and one number of the pose.
  if (!pass[0] || !pass[1] || rows.size() < 3) return;
  Eigen::Matrix3d points = Eigen::Matrix3d::Zero();
  Eigen::Vector3d points_right = Eigen::Vector3d::Zero();
  Eigen::Matrix<double, 3, 18> coupling = Eigen::Matrix<double, 3, 18>::Zero();
  for (const Row& row : rows) {
    points += row.weight * row.by_point.transpose() * row.by_point;
    points_right -= row.weight * row.by_point.transpose() * row.residual;
  }
  const Eigen::Matrix3d points_inverse = points.inverse();
  if (!points_inverse.allFinite()) return;
  for (const Row& row : rows) {
    ++kept_;
    squares_ += row.weight / inverse_variance_ * row.residual.squaredNorm();
    kept_residuals_.push_back(row.residual.norm());
    if (row.frame < 0) continue;  // A is held
    normal_.block<6, 6>(6 * row.frame, 6 * row.frame) += row.weight * row.by_pose.transpose() * row.by_pose;
    right_.segment<6>(6 * row.frame) -= row.weight * row.by_pose.transpose() * row.residual;
    coupling.middleCols<6>(6 * row.frame) += row.weight * row.by_point.transpose() * row.by_pose;
  }
  ++kept_tracks_;
  // The Schur complement of the point.
  normal_ -= coupling.transpose() * points_inverse * coupling;
  right_ -= coupling.transpose() * points_inverse * points_right;
}

// Adds the relative poses of the pairs. With the increments R Exp(w), Log(R_D R_C' R_DC') changes by R_DC R_C (w_D -
// w_C), and R_C (C_D - C_C) by -R_C [C_D - C_C]x w_C + R_C (dC_D - dC_C).
void FourFrames::add_pairs() {
  for (int pair = 0; pair < 2; ++pair) {
    const Pose &from = poses_[static_cast<std::size_t>(2 * pair)], &to = poses_[static_cast<std::size_t>(2 * pair + 1)];
    const Pose& known = pair == 0 ? b_in_a_ : d_in_c_;
    const Eigen::Matrix3d r_from = from.rotation.toRotationMatrix();
    const Pose now = relative_to(from, to);
    PoseIncrement residual;
    residual << pair_rotation_ * rotation_log<double>(now.rotation * known.rotation.conjugate()),
        pair_position_ * (now.centre - known.centre);
    Eigen::Matrix<double, 6, 12> jacobian = Eigen::Matrix<double, 6, 12>::Zero();
    const Eigen::Matrix3d turn = pair_rotation_ * known.rotation.toRotationMatrix() * r_from;
    jacobian.block<3, 3>(0, 0) = -turn;
    jacobian.block<3, 3>(0, 6) = turn;
    jacobian.block<3, 3>(3, 0) = -pair_position_ * r_from * skew<double>(to.centre - from.centre);
    jacobian.block<3, 3>(3, 3) = -pair_position_ * r_from;
    jacobian.block<3, 3>(3, 9) = pair_position_ * r_from;
    if (pair == 0) {  // A is held: only the columns of B exist
      normal_.topLeftCorner<6, 6>() += jacobian.rightCols<6>().transpose() * jacobian.rightCols<6>();
      right_.head<6>() -= jacobian.rightCols<6>().transpose() * residual;
    } else {
      normal_.bottomRightCorner<12, 12>() += jacobian.transpose() * jacobian;
      right_.tail<12>() -= jacobian.transpose() * residual;
    }
  }
}

bool FourFrames::iterate(double threshold_px) {
  normal_.setZero();
  right_.setZero();
  kept_ = kept_tracks_ = 0;
  squares_ = 0;
  kept_residuals_.clear();
  for (const FourFrameTrack& track : tracks_) add_track(track, threshold_px);
  add_pairs();
  if (kept_tracks_ < 3) return false;
  const Vector18 step = solve_symmetric(normal_, right_);
  if (!step.allFinite() || step.norm() > 100) return false;
  for (std::size_t f = 1; f < 4; ++f)
    poses_[f] = pose_update(poses_[f], step.segment<6>(6 * (static_cast<Eigen::Index>(f) - 1)));
  return true;
}

// A scale of 1 000 px weighs all rays alike: start and result are compared with the same points.
std::vector<double> FourFrames::residuals() const {
  std::vector<double> lengths;
  for (const FourFrameTrack& track : tracks_) {
    const auto intersection = intersect(track, 0, 3, 1e3);
    for (const FourFrameTrack::View& view : track.views) {
      const auto r =
          intersection
              ? ray_residual(view.ray, to_inside(poses_[static_cast<std::size_t>(view.frame)], intersection->point))
              : std::nullopt;
      lengths.push_back(r ? r->pixels.norm() : std::numeric_limits<double>::infinity());
    }
  }
  return lengths;
}

std::optional<FourFrames::Matrix6> FourFrames::covariance() const {
  // The normal equations are those of the last iteration, with its threshold and weights.
  const Eigen::LDLT<Eigen::MatrixXd> factor(normal_);
  if (factor.info() != Eigen::Success || !factor.isPositive()) return std::nullopt;
  const Matrix18 inverse = factor.solve(Matrix18::Identity());
  // B and D are nearly given by their pairs: only the six unknowns of C count.
  const double freedom = 2.0 * kept_ - 3.0 * kept_tracks_ - 6;
  const double variance = freedom > 0 ? squares_ * inverse_variance_ / freedom : 1;
  Matrix6 covariance = inverse.block<6, 6>(6, 6) * std::max(1.0, variance);
  if (!covariance.allFinite() || !(covariance.diagonal().array() > 0).all()) return std::nullopt;
  return covariance;
}

}  // namespace megablock
