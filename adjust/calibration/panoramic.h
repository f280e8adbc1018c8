// Calibrates a camera that is turned about its own projection centre. It needs no ground points, no targets and no
// lengths (Cannelle 2013, 2.3).
//
// Observations. The unit ray of pixel m of image i, rotated to the panorama frame, is r_i = R_i' ray(k, m). Homologous
// pixels of images i and j give the condition r_i - r_j = 0 (eq. 6 of the thesis). The unknowns are the parameters k of
// the camera and a rotation R_i per image (panorama -> camera); the first rotation is held.
//
// Weights. Pixels carry noise sigma per axis, and rays B_i B_i' sigma^2, with B_i = dr_i/dm in a tangent basis T of the
// track's mean direction. A track of n images has n(n-1)/2 pairs that share their noise. With W_i = (B_i B_i')^-1, W =
// sum W_i and y_i = T'r_i, the pairs weighted by W_i W^-1 W_j are
//
//     sum_(i<j) (y_i - y_j)' W_i W^-1 W_j (y_i - y_j) = sum_i |B_i^-1 (y_i - mu)|^2,    mu = W^-1 sum W_i y_i,
//
// which for n = 2 is the pair with the covariance of its difference. The residual of an observation in pixels is
// therefore e_i = B_i^-1 (y_i - mu), and the sum of its squares over sigma^2 is chi-square distributed.
//
// Solution. The method is an iterated Gauss-Helmert adjustment. The conditions are linearised at the adjusted pixels
// m_i - e_i of the last round. (At the measured pixels a longer focal length would shrink the noise along with the
// rays, and would be preferred.) Weights and tangent bases are held within a round, in which Levenberg-Marquardt
// iterations run. Observations beyond max_residual_sigmas, in sigmas from the median of the residuals, are left out and
// tested again in every round.
//
// Start. The focal length is the given one times 2^-1 to 2^1, the value with which pairs of images agree best when each
// pair has a rotation of its own. The rotations of the pairs are then averaged (rotation_averaging.h). First the
// rotations alone are adjusted, then the focal length and the first radial term with them, then everything. Loose
// priors (loose_sigmas.h) hold the parameters that the images do not determine.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "adjust/calibration/residual_structure.h"
#include "geometry/camera/camera.h"

namespace megablock {

struct PanoramicOptions {
  double image_sigma_px = 0.5;     // stated noise per axis, against which the chi-square test compares the residuals
  double max_residual_sigmas = 5;  // larger residuals, in sigmas estimated from their median, are left out
  int min_common = 8;              // homologous points two images need to be linked
  double parallax_deviations = 6;  // a warning of different centres is given from this value on (Parallax::deviations)
  double chi2_probability = 1e-3;  // a warning is given when larger residuals are less likely than this
  // A warning is given when noise makes as much structure over the sensor with a smaller probability.
  double structure_probability = 1e-3;
  void check() const;  // throws InputError
};

// Homologous pixels: track t is rows [begin[t], begin[t+1]), and its images are distinct.
struct PanoramicTracks {
  std::vector<std::string> images;     // names
  std::vector<std::int64_t> begin{0};  // [tracks + 1]
  std::vector<int> image;              // [rows]
  std::vector<Eigen::Vector2d> pixel;  // [rows]
};

// Tells whether the projection centre lies beside the axis about which the camera is turned. If it is at `s` in camera
// axes, it is at R_i's in the panorama frame. Rays to points at different distances are then displaced along (I -
// dd')(R_i' - R_mean')s by different amounts. The test takes the s for which the residuals across these lines are
// smallest. When all points are at the same distance, the displacement is a function of the pixel. The parameters of
// the camera absorb it then, and nothing can show it.
struct Parallax {
  double along = 0.5;  // share of the residuals' squares along the lines, weighted by their covariance; for noise: 0.5
  double deviations = 0;  // standard deviations by which the part across the lines is smaller than that of noise
};

struct PanoramicResult {
  Intrinsics camera;
  ParameterMask free = 0;                     // estimated parameters
  std::vector<std::uint8_t> linked;           // [images] 1: takes part
  std::vector<Eigen::Quaterniond> rotations;  // [images] panorama -> camera
  // The covariance of all parameters of the model (held ones zero), scaled by the estimated noise.
  Eigen::MatrixXd covariance;
  double start_rms_px = 0, rms_px = 0;  // lengths of the kept residuals; start: only rotations adjusted
  double sigma_px = 0;                  // estimated noise per axis: square root of squares / degrees of freedom
  std::int64_t observations = 0, rejected = 0, tracks = 0, degrees_of_freedom = 0;
  double chi2 = 0, chi2_probability = 1;  // squares over image_sigma_px^2; probability of larger ones
  Parallax parallax;
  ResidualStructure structure;             // over the sensor
  std::vector<Eigen::Vector2d> residuals;  // [rows] adjusted minus measured, px; NaN: takes no part
  std::vector<std::string> warnings;       // one line each
  double sigma(int parameter) const { return std::sqrt(covariance(parameter, parameter)); }
};

// `start`: its focal length must be right to a factor of two; the other values and the model are those that the
// estimation starts from. `held`: parameters that stay (those fixed by the model are held anyway). width, height: of
// the images, px. Throws InputError when images are not linked by enough homologous points, or when there are fewer
// conditions than unknowns; ComputeError when focal length, principal point or distortion cannot be determined, or when
// the result is not better than its start.
PanoramicResult calibrate_panoramic(const PanoramicTracks& tracks, const Intrinsics& start, int width, int height,
                                    const PanoramicOptions& options = {}, ParameterMask held = 0);

}  // namespace megablock
