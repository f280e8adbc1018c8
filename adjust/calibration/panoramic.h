// Self-calibration of a camera that is turned about its own projection centre: no ground points, no targets, no lengths
// (Cannelle 2013, 2.3).
//
// Observations. The unit ray of pixel m of image i, rotated to the panorama frame, is r_i = R_i' ray(k, m). Homologous
// pixels of images i and j give the condition r_i - r_j = 0 (eq. 6 of the thesis). Unknowns: the parameters k of the
// camera and a rotation R_i per image (panorama -> camera), the first one held.
//
// Weights. Pixels carry noise sigma per axis, rays B_i B_i' sigma^2, with B_i = dr_i/dm in a tangent basis T of the
// track's mean direction. A track of n images has n(n-1)/2 pairs that share their noise; with W_i = (B_i B_i')^-1,
// W = sum W_i and y_i = T'r_i, the pairs weighted by W_i W^-1 W_j are
//
//     sum_(i<j) (y_i - y_j)' W_i W^-1 W_j (y_i - y_j) = sum_i |B_i^-1 (y_i - mu)|^2,    mu = W^-1 sum W_i y_i,
//
// which for n = 2 is the pair with the covariance of its difference. So e_i = B_i^-1 (y_i - mu) is the residual of a
// measurement in pixels, and the sum of its squares over sigma^2 is chi-square distributed.
//
// Solution. Iterated Gauss-Helmert: conditions are linearised at the adjusted pixels m_i - e_i of the last round (at
// the measured ones a longer focal length would shrink noise along with rays and be preferred), weights and tangent
// bases held within a round; Levenberg-Marquardt inside. Measurements beyond max_residual_sigmas of the residuals' own
// median are left out and re-tested in every round.
//
// Start. Focal length: of the given one times 2^-1 to 2^1, that with which pairs of images agree best under rotations
// of their own; rotations of pairs are then averaged (rotation_averaging.h). Rotations alone, then focal length and
// first radial term, then everything; loose priors (loose_sigmas.h) hold what the images do not determine.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "adjust/calibration/residual_structure.h"
#include "geometry/camera/camera.h"

namespace megablock {

struct PanoramicOptions {
  double image_sigma_px = 0.5;          // stated noise per axis: what the chi-square test holds the residuals against
  double max_residual_sigmas = 5;       // residuals beyond, in sigmas estimated from their median, are left out
  int min_common = 8;                   // homologous points two images need to be linked
  double parallax_deviations = 6;       // warn of different centres from here on (Parallax::deviations)
  double chi2_probability = 1e-3;       // warn when larger residuals are less likely than this
  double structure_probability = 1e-3;  // warn when structure over the sensor is less likely to be noise than this
  void check() const;                   // throws InputError
};

// Homologous pixels: track t is rows [begin[t], begin[t+1]), its images distinct.
struct PanoramicTracks {
  std::vector<std::string> images;     // names
  std::vector<std::int64_t> begin{0};  // [tracks + 1]
  std::vector<int> image;              // [rows]
  std::vector<Eigen::Vector2d> pixel;  // [rows]
};

// Whether the residuals are those of a camera whose projection centre lies beside the axis it is turned about: at
// `s` in camera axes it stands at R_i's, and rays to points at different distances are displaced along
// (I - dd')(R_i' - R_mean')s, by different amounts. Of all s that is tried for which the residuals across these lines
// are smallest. At one distance for all points the displacement is a function of the pixel, which the camera's
// parameters absorb: then nothing shows, and nothing can.
struct Parallax {
  double along = 0.5;     // share of the residuals' squares along the lines, weighted by their covariance; noise: 0.5
  double deviations = 0;  // standard deviations by which the part across is smaller than noise makes it
};

struct PanoramicResult {
  Intrinsics camera;
  ParameterMask free = 0;                     // estimated parameters
  std::vector<std::uint8_t> linked;           // [images] 1: takes part
  std::vector<Eigen::Quaterniond> rotations;  // [images] panorama -> camera
  // Of all parameters of the model (held ones zero), scaled by the estimated noise.
  Eigen::MatrixXd covariance;
  double start_rms_px = 0, rms_px = 0;  // lengths of the residuals of what is kept; start: only rotations adjusted
  double sigma_px = 0;                  // estimated noise per axis: root of squares / degrees of freedom
  std::int64_t observations = 0, rejected = 0, tracks = 0, degrees_of_freedom = 0;
  double chi2 = 0, chi2_probability = 1;  // squares over image_sigma_px^2; probability of larger ones
  Parallax parallax;
  ResidualStructure structure;             // over the sensor
  std::vector<Eigen::Vector2d> residuals;  // [rows] adjusted minus measured, px; NaN: takes no part
  std::vector<std::string> warnings;       // one line each
  double sigma(int parameter) const { return std::sqrt(covariance(parameter, parameter)); }
};

// `start`: focal length to a factor of two; the rest, its model included, as it is to be estimated from.
// `held`: parameters that stay (those that are fixed by the model are held anyway). width, height: of the images, px.
// Throws InputError when images are not linked by enough homologous points or the points are fewer than the unknowns,
// ComputeError when focal length, principal point or distortion cannot be determined, or when the result is not better
// than its start.
PanoramicResult calibrate_panoramic(const PanoramicTracks& tracks, const Intrinsics& start, int width, int height,
                                    const PanoramicOptions& options = {}, ParameterMask held = 0);

}  // namespace megablock
