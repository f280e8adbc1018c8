// Gives panoramic.h its conditions and their normal equations. Internal to adjust/calibration/.
#pragma once

#include <limits>

#include "adjust/calibration/panoramic.h"

namespace megablock {

struct PanoramicState {
  Intrinsics camera;
  std::vector<Eigen::Quaterniond> rotations;  // [images] panorama -> camera
};

// Weak priors of the camera's parameters at their start values; a sigma of 0 means no prior.
struct PanoramicPrior {
  Intrinsics value;
  IntrinsicSigmas sigma{};
  double image_sigma_px = 0.5;  // converts the squares of the prior to pixels
};

class PanoramicSystem {
 public:
  // `linked` [images]: observations of other images take no part.
  PanoramicSystem(const PanoramicTracks& tracks, const std::vector<std::uint8_t>& linked, const PanoramicPrior& prior);

  // Linearises anew at the adjusted pixels of this state.
  void linearise_at(const PanoramicState& state);
  // Tests every observation again: of each track the worst one is left out until the rest agrees within `threshold_px`.
  // Uses the last linearisation. Returns the number of changes.
  std::int64_t screen(const PanoramicState& state, double threshold_px);

  // The sum of squares [px^2] with the priors; infinite where a pixel has no ray.
  double cost(const PanoramicState& state) const;
  // The lengths of the residuals of all linked rows, in their tracks as these are kept, or NaN.
  std::vector<Eigen::Vector2d> residuals(const PanoramicState& state) const;  // measured minus adjusted, px

  // The columns are the free parameters, then three for each linked image except the first.
  struct Normal {
    Eigen::MatrixXd matrix;
    Eigen::VectorXd gradient;
    double cost = std::numeric_limits<double>::infinity();
  };
  Normal normal(const PanoramicState& state, ParameterMask free) const;
  PanoramicState moved(const PanoramicState& state, ParameterMask free, const Eigen::VectorXd& step) const;

  std::int64_t kept_rows() const;
  std::int64_t kept_tracks() const;
  std::int64_t unknowns(ParameterMask free) const;
  Parallax parallax(const PanoramicState& state) const;

 private:
  struct Row {
    bool usable = false;  // whether the image is linked and the pixel has a ray
    bool kept = false;
    Eigen::Vector2d adjusted;  // pixel at which the conditions are linearised
    Eigen::Matrix2d whiten;    // B^-1
    Eigen::Vector2d offset;    // B (measured - adjusted)
  };
  using Plane = Eigen::Matrix<double, 3, 2>;

  std::int64_t track_count() const { return static_cast<std::int64_t>(tracks_.begin.size()) - 1; }
  std::vector<std::int64_t> kept_in(std::int64_t track) const;  // rows; empty when fewer than two
  void linearise_track(std::int64_t track, const PanoramicState& state);
  // y of a row; returns false where the pixel has no ray.
  bool ray_in_plane(std::int64_t row, const Plane& plane, const PanoramicState& state, Eigen::Vector2d& y) const;
  // e of some rows of a track about their own mean; returns false where a pixel has no ray.
  bool residuals_of(const std::vector<std::int64_t>& rows, std::int64_t track, const PanoramicState& state,
                    std::vector<Eigen::Vector2d>& e) const;
  bool add_track(std::int64_t track, const PanoramicState& state, const std::vector<int>& parameters,
                 Normal& normal) const;
  double prior_cost(const PanoramicState& state) const;

  const PanoramicTracks& tracks_;
  const std::vector<std::uint8_t>& linked_;
  PanoramicPrior prior_;
  std::vector<int> column_of_image_;  // after the parameters; -1: held or not linked
  std::int64_t rotation_columns_ = 0;
  std::vector<Row> rows_;
  std::vector<Plane> planes_;  // [tracks] tangent basis of the mean direction
};

}  // namespace megablock
