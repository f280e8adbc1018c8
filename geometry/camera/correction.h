// Camera models that correct the measured pixel m, from the distorted to the undistorted position (Cannelle 2013,
// section 2.2):
//
//     m + d(m) = (cx + f X/Z, cy + f Y/Z)                                                                      (1)
//
// Radial corrections have their own centre of symmetry s = (sx, sy). With q = m - s, r = |q|, d = q g(r):
//     ign-radial     g = a r^2 + b r^4 + c r^6           (pixels: the correction's length is a r^3 + b r^5 + c r^7)
//     odd-radial-N   g = sum_i k_i (r/f)^(2i)            (length r^3, r^5, ... at r in focal lengths; i = 1 to N)
//     even-radial-N  g = sum_i k_i (r/f)^(2i - 1)        (length r^2, r^4, ...)
// Additive corrections are functions over the image scaled to [-1, 1]: x = 2 m_x / width - 1, y = 2 m_y / height - 1.
// Each component of d is a sum of coefficients (pixels) times
//     polynomial-N   x^i y^j,          1 <= i + j <= N
//     legendre-N     P_i(x) P_j(y),    1 <= i + j <= N
//     fourier-N      cos or sin of pi/2 (i x + j y),  0 <= i <= N, |j| <= N, i > 0 or j > 0   (period: two images)
// Terms that other unknowns of a camera can replace are left out of the polynomials: the constant (cx, cy); x and y in
// the component of the rows (f and a turn about the axis, once the component of the columns has both); xy in both
// components (to first order a tilt with a shift of the principal point). Beyond 1.1 times the image the correction is
// constant.
//
// The projection solves (1) by Newton's method, to rounding, starting from the pixel without distortion. It fails where
// the correction folds the image, that is where the determinant or the trace of the Jacobian is not positive. The
// derivatives follow from the implicit function theorem: with J = I + d'(m) and the right side P of (1), dm = J^-1
// (dP - d_p dp).
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <vector>

#include "geometry/camera/intrinsics.h"

namespace megablock {

constexpr bool is_radial(const CameraModel& model) {
  return model.kind == CameraModelKind::kIgnRadial || model.kind == CameraModelKind::kOddRadial ||
         model.kind == CameraModelKind::kEvenRadial;
}
constexpr bool is_additive(const CameraModel& model) {
  return model.kind == CameraModelKind::kPolynomial || model.kind == CameraModelKind::kLegendre ||
         model.kind == CameraModelKind::kFourier;
}
// Whether the model is one of those in this file.
constexpr bool corrects_pixels(const CameraModel& model) { return is_radial(model) || is_additive(model); }

// One function of an additive correction.
struct CorrectionTerm {
  int component;      // component: 0 columns, 1 rows
  int i, j;           // powers, degrees or frequencies in x and y
  bool sine = false;  // in a Fourier series: sine instead of cosine
};
// The functions of a model, in the order of its parameters from kCorrectionTerms on.
const std::vector<CorrectionTerm>& correction_term_list(const CameraModel& model);

inline constexpr double kCorrectedExtent = 1.1;  // of x and y above; beyond it the correction is constant

// The correction d(m). A template for automatic differentiation; parameters and pixel may have different types.
template <typename Scalar, typename Parameter>
Eigen::Matrix<Scalar, 2, 1> correction(const CameraModel& model, const Parameter* k,
                                       const Eigen::Matrix<Scalar, 2, 1>& pixel);

// d(m) with its derivatives by the pixel and by the parameters (zero for fixed ones).
struct Correction {
  Eigen::Vector2d value;
  Eigen::Matrix2d by_pixel;
  Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::ColMajor, 2, kMaxIntrinsics> by_parameters;
};
Correction correction_with_jacobian(const Intrinsics& k, const Eigen::Vector2d& pixel);
// The same without the derivatives by the parameters, which stay empty.
Correction correction_at(const Intrinsics& k, const Eigen::Vector2d& pixel);

// The pixel m with m + d(m) = `corrected`. NaN where the model folds the image.
Eigen::Vector2d solve_correction(const Intrinsics& k, const Eigen::Vector2d& corrected);

// Whether the corrected image is not folded at this pixel.
inline bool keeps_orientation(const Correction& c) {
  const Eigen::Matrix2d j = Eigen::Matrix2d::Identity() + c.by_pixel;
  return j(0, 0) * j(1, 1) - j(0, 1) * j(1, 0) > 0 && j.trace() > 0;
}

namespace detail {

// x^i or the Legendre polynomial P_i(x), i = 0 to n.
template <typename Scalar>
void basis_values(CameraModelKind kind, int n, const Scalar& x, Scalar* values) {
  values[0] = Scalar(1);
  if (n >= 1) values[1] = x;
  for (int i = 1; i < n; ++i)
    values[i + 1] = kind == CameraModelKind::kPolynomial
                        ? Scalar(x * values[i])
                        : Scalar((double(2 * i + 1) * x * values[i] - double(i) * values[i - 1]) / double(i + 1));
}

// Limits a scaled coordinate to the range in which the correction varies.
template <typename Scalar>
Scalar within_extent(const Scalar& x) {
  if (x > Scalar(kCorrectedExtent)) return Scalar(kCorrectedExtent);
  if (x < Scalar(-kCorrectedExtent)) return Scalar(-kCorrectedExtent);
  return x;
}

}  // namespace detail

template <typename Scalar, typename Parameter>
Eigen::Matrix<Scalar, 2, 1> correction(const CameraModel& model, const Parameter* k,
                                       const Eigen::Matrix<Scalar, 2, 1>& pixel) {
  using std::cos;
  using std::sin;
  using std::sqrt;
  Eigen::Matrix<Scalar, 2, 1> d(Scalar(0), Scalar(0));
  if (is_radial(model)) {
    const Scalar qx = pixel.x() - k[kSymmetryX], qy = pixel.y() - k[kSymmetryY];
    const Scalar r2 = qx * qx + qy * qy;
    if (!(r2 > Scalar(0))) return d;
    const Scalar r = model.kind == CameraModelKind::kIgnRadial ? Scalar(sqrt(r2)) : Scalar(sqrt(r2) / k[kFocal]);
    Scalar power = model.kind == CameraModelKind::kEvenRadial ? r : Scalar(r * r), g(0);
    for (int p = kRadialTerms; p < parameter_count(model); ++p) {
      g += k[p] * power;
      power *= r * r;
    }
    return {qx * g, qy * g};
  }
  constexpr double kHalfPi = 1.57079632679489661923;
  const Scalar x = detail::within_extent(Scalar(2.0 * pixel.x() / k[kImageWidth] - 1.0));
  const Scalar y = detail::within_extent(Scalar(2.0 * pixel.y() / k[kImageHeight] - 1.0));
  const bool fourier = model.kind == CameraModelKind::kFourier;
  Scalar px[8], py[8];
  if (!fourier) detail::basis_values(model.kind, model.order, x, px);
  if (!fourier) detail::basis_values(model.kind, model.order, y, py);
  int p = kCorrectionTerms;
  for (const CorrectionTerm& t : correction_term_list(model)) {
    const Scalar phase = kHalfPi * (double(t.i) * x + double(t.j) * y);
    const Scalar value = !fourier ? Scalar(px[t.i] * py[t.j]) : t.sine ? Scalar(sin(phase)) : Scalar(cos(phase));
    d[t.component] += k[p++] * value;
  }
  return d;
}

}  // namespace megablock
