// Corrects the measured pixel by functions over the image (see pixel_correction.h), which is scaled to [-1, 1]: x = 2
// m_x / width - 1, y = 2 m_y / height - 1. Each component of d is a sum of coefficients (pixels) times
//     polynomial-N   x^i y^j,          1 <= i + j <= N
//     legendre-N     P_i(x) P_j(y),    1 <= i + j <= N
//     fourier-N      cos or sin of pi/2 (i x + j y),  0 <= i <= N, |j| <= N, i > 0 or j > 0   (period: two images)
// Terms that other unknowns of a camera can replace are left out of the polynomials: the constant (cx, cy); x and y in
// the component of the rows (f and a turn about the axis, once the component of the columns has both); xy in both
// components (to first order a tilt with a shift of the principal point). Beyond 1.1 times the image the correction is
// constant.
#pragma once

#include <cmath>
#include <vector>

#include "geometry/camera/models/pixel_correction.h"

namespace megablock {

enum class AdditiveBasis { kPowers, kLegendre, kFourier };

// One function of an additive correction.
struct CorrectionTerm {
  int component;      // 0 columns, 1 rows
  int i, j;           // powers, degrees or frequencies in x and y
  bool sine = false;  // in a Fourier series: sine instead of cosine
};
// The functions in the order of the parameters from kCorrectionTerms on.
const std::vector<CorrectionTerm>& correction_terms(AdditiveBasis basis, int order);

// The number of functions of one component.
constexpr int count_correction_terms(AdditiveBasis basis, int order, int component) {
  if (basis == AdditiveBasis::kFourier) return (2 * order + 1) * (2 * order + 1) - 1;
  const int all = (order + 1) * (order + 2) / 2 - 1;  // without the constant
  return all - (component == 0 ? 0 : 2) - (order >= 2 ? 1 : 0);
}

Correction additive_correction(AdditiveBasis basis, int order, const double* k, const Eigen::Vector2d& pixel,
                               bool by_parameters);
std::vector<CameraParameter> additive_parameters(AdditiveBasis basis, int order);

inline constexpr double kCorrectedExtent = 1.1;  // of x and y above; beyond it the correction is constant

namespace detail {

// x^i or the Legendre polynomial P_i(x), i = 0 to n.
template <typename Scalar>
void basis_values(AdditiveBasis basis, int n, const Scalar& x, Scalar* values) {
  values[0] = Scalar(1);
  if (n >= 1) values[1] = x;
  for (int i = 1; i < n; ++i)
    values[i + 1] = basis == AdditiveBasis::kPowers
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

template <typename Model>
struct AdditiveCorrection : PixelCorrection<Model> {
  static constexpr int parameter_count(int order) {
    return kCorrectionTerms + count_correction_terms(Model::kBasis, order, 0) +
           count_correction_terms(Model::kBasis, order, 1);
  }
  static std::vector<CameraParameter> parameters(int order) { return additive_parameters(Model::kBasis, order); }
  template <typename Scalar, typename Parameter>
  static PixelOf<Scalar> correction(int order, const Parameter* k, const PixelOf<Scalar>& pixel) {
    using std::cos;
    using std::sin;
    constexpr double kHalfPi = 1.57079632679489661923;
    constexpr bool kFourier = Model::kBasis == AdditiveBasis::kFourier;
    PixelOf<Scalar> d(Scalar(0), Scalar(0));
    const Scalar x = detail::within_extent(Scalar(2.0 * pixel.x() / k[kImageWidth] - 1.0));
    const Scalar y = detail::within_extent(Scalar(2.0 * pixel.y() / k[kImageHeight] - 1.0));
    Scalar px[8], py[8];
    if (!kFourier) detail::basis_values(Model::kBasis, order, x, px);
    if (!kFourier) detail::basis_values(Model::kBasis, order, y, py);
    int p = kCorrectionTerms;
    for (const CorrectionTerm& t : correction_terms(Model::kBasis, order)) {
      const Scalar phase = kHalfPi * (double(t.i) * x + double(t.j) * y);
      const Scalar value = !kFourier ? Scalar(px[t.i] * py[t.j]) : t.sine ? Scalar(sin(phase)) : Scalar(cos(phase));
      d[t.component] += k[p++] * value;
    }
    return d;
  }
  static Correction correct(int order, const double* k, const Eigen::Vector2d& pixel, bool by_parameters) {
    return additive_correction(Model::kBasis, order, k, pixel, by_parameters);
  }
};

struct PolynomialModel : AdditiveCorrection<PolynomialModel> {
  static constexpr const char* kName = "polynomial";
  static constexpr OrderRange kOrders{1, 6};
  static constexpr AdditiveBasis kBasis = AdditiveBasis::kPowers;
};
struct LegendreModel : AdditiveCorrection<LegendreModel> {
  static constexpr const char* kName = "legendre";
  static constexpr OrderRange kOrders{1, 6};
  static constexpr AdditiveBasis kBasis = AdditiveBasis::kLegendre;
};
struct FourierModel : AdditiveCorrection<FourierModel> {
  static constexpr const char* kName = "fourier";
  static constexpr OrderRange kOrders{1, 2};
  static constexpr AdditiveBasis kBasis = AdditiveBasis::kFourier;
};

}  // namespace megablock
