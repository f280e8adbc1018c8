// Differentiates the corrections, with u = 1 px or f, rho = r/u, g = sum c_i rho^e_i:
//     d_q = g I + q q' (sum e_i c_i rho^(e_i - 2)) / u^2,   d_s = -d_q,   d_c_i = q rho^e_i,
//     d_f = -q/f sum e_i c_i rho^e_i   (u = f only)
#include "geometry/camera/models/radial_correction.h"

namespace megablock {

std::vector<CameraParameter> radial_parameters(RadialForm form, int count) {
  std::vector<CameraParameter> all = common_parameters();
  for (const char* name : {"sx", "sy"}) all.push_back({name, ParameterRole::kSymmetry, ParameterUnit::kPixels});
  const auto unit = form.in_pixels ? ParameterUnit::kInversePixels : ParameterUnit::kNone;
  for (int i = 0; kRadialTerms + i < count; ++i) {
    const std::string name = form.in_pixels ? std::string(1, static_cast<char>('a' + i)) : "k" + std::to_string(i + 1);
    all.push_back({name, ParameterRole::kRadial, unit, form.first_power + 2 * i});
  }
  return all;
}

Correction radial_correction(RadialForm form, int count, const double* k, const Eigen::Vector2d& pixel,
                             bool by_parameters) {
  Correction c;
  if (by_parameters) c.by_parameters.setZero(2, count);
  const double unit = form.in_pixels ? 1 : k[kFocal];
  const Eigen::Vector2d q = pixel - Eigen::Vector2d(k[kSymmetryX], k[kSymmetryY]);
  const double rho2 = q.squaredNorm() / (unit * unit);
  if (!(rho2 > 0)) return c;
  double power = form.first_power == 1 ? std::sqrt(rho2) : rho2;  // rho^e, e the exponent of the first term
  int exponent = form.first_power;
  double g = 0, slope = 0;  // slope: sum e c rho^e
  for (int p = kRadialTerms; p < count; ++p, power *= rho2, exponent += 2) {
    g += k[p] * power;
    slope += exponent * k[p] * power;
    if (by_parameters) c.by_parameters.col(p) = power * q;
  }
  c.value = g * q;
  c.by_pixel = (slope / q.squaredNorm()) * q * q.transpose();
  c.by_pixel.diagonal().array() += g;
  if (!by_parameters) return c;
  c.by_parameters.middleCols<2>(kSymmetryX) = -c.by_pixel;
  if (!form.in_pixels) c.by_parameters.col(kFocal) = -(slope / k[kFocal]) * q;
  return c;
}

}  // namespace megablock
