// Gives one camera of every model, with strong distortion and 1920 x 1080 pixels.
#pragma once

#include <cmath>
#include <random>
#include <vector>

#include "geometry/camera/camera.h"

namespace megablock {

inline constexpr int kSampleWidth = 1920, kSampleHeight = 1080;

// Every kind of model in every order.
inline std::vector<CameraModel> every_model() {
  std::vector<CameraModel> models;
  for (const CameraModelForm& form : camera_model_forms())
    for (std::int32_t order = form.orders.lowest; order <= form.orders.highest; ++order)
      models.push_back({form.kind, order});
  return models;
}

// A camera whose corrections reach tens of pixels in the corners.
inline Intrinsics sample_camera(const CameraModel& model, double focal, int width, int height) {
  Intrinsics k = start_intrinsics(model, focal, width, height);
  std::mt19937_64 random(static_cast<std::uint64_t>(100 * static_cast<int>(model.kind) + model.order));
  std::uniform_real_distribution<double> unit(-1, 1);
  k[kPrincipalX] += 11;
  k[kPrincipalY] -= 7;
  switch (model.kind) {
    case CameraModelKind::kBrown:
      for (int p = 3; const double value : {-0.12, 0.05, -0.01, 1e-3, -7e-4, 4.2, -1.7}) k[p++] = value;
      break;
    case CameraModelKind::kFisheye:
      for (int p = 3; const double value : {-0.03, 0.012, -0.008, 0.001}) k[p++] = value;
      break;
    case CameraModelKind::kThinPrismFisheye:
      for (int p = 3; const double value : {-0.03, 0.012, -0.008, 0.001, 2e-3, -1e-3, 1.5e-3, -2e-3}) k[p++] = value;
      break;
    case CameraModelKind::kIgnRadial:
      k[kSymmetryX] -= 9;
      k[kSymmetryY] += 22;
      for (int p = kRadialTerms; const double value : {-0.09, 0.12, -0.009}) k[p++] = value;
      for (int p = kRadialTerms; p < k.size(); ++p) k[p] /= std::pow(focal, 2 * (p - kRadialTerms + 1));
      break;
    case CameraModelKind::kOddRadial:
    case CameraModelKind::kEvenRadial:
      k[kSymmetryX] += 25;
      k[kSymmetryY] -= 31;
      for (int p = kRadialTerms; p < k.size(); ++p) k[p] = 0.1 * unit(random);
      break;
    default:
      for (int p = 0; p < k.size(); ++p)
        if (contains(parameters_with(model, ParameterRole::kAdditive), p)) k[p] = 15 * unit(random) / model.order;
  }
  return k;
}
inline Intrinsics sample_camera(const CameraModel& model) {
  return sample_camera(model, field_of_view(model) == FieldOfView::kWide ? 560 : 1400, kSampleWidth, kSampleHeight);
}

}  // namespace megablock
