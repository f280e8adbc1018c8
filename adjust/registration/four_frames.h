// Gives the normal equations of a 2x2 registration. The unknowns are the poses of four frames in the axes of the first
// one, and the points.
#pragma once

#include <optional>

#include "adjust/registration/pair_registration.h"

namespace megablock {

class FourFrames {
 public:
  using Matrix6 = Eigen::Matrix<double, 6, 6>;

  FourFrames(const std::array<Pose, 4>& frames, const std::vector<FourFrameTrack>& tracks,
             const PairRegistrationOptions& options);

  const Pose& pose(std::size_t frame) const { return poses_[frame]; }
  // Moves C; D keeps its pose relative to C.
  void place_second_pair(const Pose& c);

  // The point of a track, intersected from the frames first to last, with its covariance (m^2) in the axes of A.
  struct Intersection {
    Eigen::Vector3d point;
    Eigen::Matrix3d covariance;
  };
  std::optional<Intersection> intersect(const FourFrameTrack& track, std::int32_t first, std::int32_t last,
                                        double scale_px) const;

  // Runs one iteration: refines the points, leaves out observations beyond the threshold, and steps the poses. Returns
  // false when the system is singular.
  bool iterate(double threshold_px);

  // The lengths of all residuals at the present poses, with points intersected anew; infinite where there is no point.
  std::vector<double> residuals() const;

  // After iterate(): the number of observations within its threshold, their residuals, and the covariance of C (right
  // increment and centre). The covariance is scaled by the variance of the residuals where that exceeds the stated one.
  std::int32_t kept() const { return kept_; }
  const std::vector<double>& kept_residuals() const { return kept_residuals_; }
  std::optional<Matrix6> covariance() const;

 private:
  using Matrix18 = Eigen::Matrix<double, 18, 18>;
  using Vector18 = Eigen::Matrix<double, 18, 1>;
  void add_track(const FourFrameTrack& track, double threshold_px);
  void add_pairs();
  double weight(double squared_px, double threshold_px) const;

  const std::vector<FourFrameTrack>& tracks_;
  double inverse_variance_;               // of an observation, 1/px^2
  double pair_rotation_, pair_position_;  // inverse sigmas
  std::array<Pose, 4> poses_;             // axes of A -> frame
  Pose b_in_a_, d_in_c_;                  // trusted
  Matrix18 normal_ = Matrix18::Zero();
  Vector18 right_ = Vector18::Zero();
  std::int32_t kept_ = 0, kept_tracks_ = 0;
  double squares_ = 0;  // of the kept residuals, px^2
  std::vector<double> kept_residuals_;
};

}  // namespace megablock
