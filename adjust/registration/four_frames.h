// The system of a 2x2 registration: poses of four frames in the axes of the first, points, their normal equations.
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
  // Moves C; D keeps its place in C.
  void place_second_pair(const Pose& c);

  // Point of a track from the views of the frames first..last, with its covariance (m^2) in the axes of A.
  struct Intersection {
    Eigen::Vector3d point;
    Eigen::Matrix3d covariance;
  };
  std::optional<Intersection> intersect(const FourFrameTrack& track, std::int32_t first, std::int32_t last,
                                        double scale_px) const;

  // One iteration: points are refined, measurements beyond the threshold left out, poses stepped. False: singular.
  bool iterate(double threshold_px);

  // Lengths of all residuals at the present poses, points intersected anew; infinite where there is no point.
  std::vector<double> residuals() const;

  // After iterate(): measurements within its threshold, those residuals, and the covariance of C (right increment and
  // centre), scaled by the residuals' variance where that is above the stated one.
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
  double inverse_variance_;               // of a measurement, 1/px^2
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
