// Corrects the measured pixel radially about the model's own centre of symmetry s = (sx, sy) (see pixel_correction.h).
// With q = m - s, r = |q|, the correction is d = q g(r):
//     ign-radial     g = a r^2 + b r^4 + c r^6           (pixels: the correction's length is a r^3 + b r^5 + c r^7)
//     odd-radial-N   g = sum_i k_i (r/f)^(2i)            (length r^3, r^5, ... at r in focal lengths; i = 1 to N)
//     even-radial-N  g = sum_i k_i (r/f)^(2i - 1)        (length r^2, r^4, ...)
#pragma once

#include <cmath>

#include "geometry/camera/models/pixel_correction.h"

namespace megablock {

struct RadialForm {
  bool in_pixels;   // otherwise r is in focal lengths
  int first_power;  // of the first term of g; the others follow in steps of 2
};
Correction radial_correction(RadialForm form, int count, const double* k, const Eigen::Vector2d& pixel,
                             bool by_parameters);
std::vector<CameraParameter> radial_parameters(RadialForm form, int count);

template <typename Model>
struct RadialCorrection : PixelCorrection<Model> {
  static std::vector<CameraParameter> parameters(int order) {
    return radial_parameters(Model::kForm, Model::parameter_count(order));
  }
  template <typename Scalar, typename Parameter>
  static PixelOf<Scalar> correction(int order, const Parameter* k, const PixelOf<Scalar>& pixel) {
    using std::sqrt;
    const Scalar qx = pixel.x() - k[kSymmetryX], qy = pixel.y() - k[kSymmetryY];
    const Scalar r2 = qx * qx + qy * qy;
    if (!(r2 > Scalar(0))) return {Scalar(0), Scalar(0)};
    const Scalar r = Model::kForm.in_pixels ? Scalar(sqrt(r2)) : Scalar(sqrt(r2) / k[kFocal]);
    Scalar power = Model::kForm.first_power == 1 ? r : Scalar(r * r), g(0);
    for (int p = kRadialTerms; p < Model::parameter_count(order); ++p) {
      g += k[p] * power;
      power *= r * r;
    }
    return {qx * g, qy * g};
  }
  static Correction correct(int order, const double* k, const Eigen::Vector2d& pixel, bool by_parameters) {
    return radial_correction(Model::kForm, Model::parameter_count(order), k, pixel, by_parameters);
  }
};

struct IgnRadialModel : RadialCorrection<IgnRadialModel> {
  static constexpr const char* kName = "ign-radial";
  static constexpr OrderRange kOrders{};
  static constexpr RadialForm kForm{true, 2};
  static constexpr int parameter_count(int) { return kRadialTerms + 3; }
};
struct OddRadialModel : RadialCorrection<OddRadialModel> {
  static constexpr const char* kName = "odd-radial";
  static constexpr OrderRange kOrders{1, 9};
  static constexpr RadialForm kForm{false, 2};
  static constexpr int parameter_count(int order) { return kRadialTerms + order; }
};
struct EvenRadialModel : RadialCorrection<EvenRadialModel> {
  static constexpr const char* kName = "even-radial";
  static constexpr OrderRange kOrders{1, 9};
  static constexpr RadialForm kForm{false, 1};
  static constexpr int parameter_count(int order) { return kRadialTerms + order; }
};

}  // namespace megablock
