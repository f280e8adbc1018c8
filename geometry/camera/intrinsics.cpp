#include "geometry/camera/intrinsics.h"

#include <algorithm>
#include <numbers>

namespace megablock {

namespace {

// The parameters for which `chosen` is true.
template <typename Chosen>
ParameterMask select(const CameraModel& model, Chosen&& chosen) {
  ParameterMask mask = 0;
  for (int p = 0; p < parameter_count(model); ++p)
    if (chosen(camera_parameters(model)[static_cast<std::size_t>(p)])) mask |= mask_of(p);
  return mask;
}

// 1 / f^degree for an even degree.
double inverse_power(double focal, int degree) {
  double scale = 1;
  for (int i = 0; i < degree / 2; ++i) scale /= focal * focal;
  return scale;
}

double weak_sigma(const CameraParameter& parameter, double focal, double focal_sigma, int width) {
  if (parameter.fixed) return 0;
  switch (parameter.role) {
    case ParameterRole::kFocal:
      return focal_sigma;
    case ParameterRole::kPrincipalPoint:
      return 0.02 * width;
    case ParameterRole::kSymmetry:
      return 0.05 * width;
    case ParameterRole::kRadial:
      return parameter.unit == ParameterUnit::kInversePixels ? 0.2 * inverse_power(focal, parameter.degree) : 0.2;
    case ParameterRole::kTangential:
      return 0.01;
    case ParameterRole::kAffinity:
      return 0.01 * focal;
    case ParameterRole::kAdditive:
      return 0.01 * width;
    case ParameterRole::kImageSize:
      break;
  }
  return 0;
}

}  // namespace

ParameterMask free_parameters(const CameraModel& model) {
  return select(model, [](const CameraParameter& parameter) { return !parameter.fixed; });
}

ParameterMask parameters_with(const CameraModel& model, ParameterRole role) {
  return select(model, [&](const CameraParameter& parameter) { return parameter.role == role; });
}

ParameterMask usual_parameters(const CameraModel& model) {
  return select(model, [](const CameraParameter& parameter) {
    return !parameter.fixed && !parameter.same_as_rotation && !parameter.rare;
  });
}

int count_without_rare(const CameraModel& model) {
  const auto rare = [](const CameraParameter& parameter) { return parameter.rare; };
  const std::vector<CameraParameter>& all = camera_parameters(model);
  return static_cast<int>(std::find_if(all.begin(), all.end(), rare) - all.begin());
}

ParameterMask radial_terms(const CameraModel& model, int terms) {
  int left = terms;
  return select(
      model, [&](const CameraParameter& parameter) { return parameter.role == ParameterRole::kRadial && left-- > 0; });
}

ParameterRank parameter_rank(const CameraModel& model, int parameter) {
  const CameraParameter& p = camera_parameters(model)[static_cast<std::size_t>(parameter)];
  constexpr int kLeadingPower = 2, kHighPower = 5, kHighDegree = 4;
  if (p.role == ParameterRole::kFocal) return ParameterRank::kLeading;
  if (p.role == ParameterRole::kRadial && p.degree <= kLeadingPower) return ParameterRank::kLeading;
  const bool high = (p.role == ParameterRole::kRadial && p.degree >= kHighPower) ||
                    (p.role == ParameterRole::kAdditive && p.degree >= kHighDegree);
  return high ? ParameterRank::kHigh : ParameterRank::kOrdinary;
}

Intrinsics start_intrinsics(const CameraModel& model, double focal_px, int width, int height) {
  Intrinsics k(model);
  k[kFocal] = is_panorama(model) ? width / (2 * std::numbers::pi) : focal_px;
  set_principal_point(0.5 * width, 0.5 * height, k);
  if (parameters_with(model, ParameterRole::kImageSize) != 0) {
    k[kImageWidth] = width;
    k[kImageHeight] = height;
  }
  return k;
}

void set_principal_point(double x_px, double y_px, Intrinsics& k) {
  k[kPrincipalX] = x_px;
  k[kPrincipalY] = y_px;
  if (parameters_with(k.model(), ParameterRole::kSymmetry) == 0) return;
  k[kSymmetryX] = x_px;
  k[kSymmetryY] = y_px;
}

IntrinsicSigmas weak_sigmas(const Intrinsics& start, double focal_sigma_px, int width, ParameterMask which) {
  IntrinsicSigmas sigma{};
  const std::vector<CameraParameter>& parameters = camera_parameters(start.model());
  for (std::size_t p = 0; p < parameters.size(); ++p)
    if (contains(which, static_cast<int>(p)))
      sigma[p] = weak_sigma(parameters[p], start[kFocal], focal_sigma_px, width);
  return sigma;
}

IntrinsicSigmas weak_sigmas(const Intrinsics& start, double focal_sigma_px, int width) {
  return weak_sigmas(start, focal_sigma_px, width, usual_parameters(start.model()));
}

}  // namespace megablock
