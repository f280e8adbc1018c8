// Holds the values of a camera's parameters, with start values and priors. models/models.h is the table of the models.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>

#include "geometry/camera/models/models.h"

namespace megablock {

// A set of parameters: bit p stands for parameter p.
using ParameterMask = std::uint64_t;
constexpr bool contains(ParameterMask mask, int parameter) { return (mask >> parameter & 1) != 0; }
constexpr ParameterMask mask_of(int parameter) { return ParameterMask{1} << parameter; }
constexpr int count_of(ParameterMask mask) { return __builtin_popcountll(mask); }

// The parameters of a model that are not fixed.
ParameterMask free_parameters(const CameraModel& model);
// The parameters with this role.
ParameterMask parameters_with(const CameraModel& model, ParameterRole role);
// The parameters that are estimated unless more is asked for: not those that are fixed, that a rotation of the camera
// can replace, or that are rare.
ParameterMask usual_parameters(const CameraModel& model);
// The number of leading parameters that every camera of the model has; rare ones come after them.
int count_without_rare(const CameraModel& model);
// The first `terms` radial terms; none in models without radial terms.
ParameterMask radial_terms(const CameraModel& model, int terms);

// The images that are needed to determine a parameter. Leading: focal length and first radial term, from any strip of
// images. Ordinary: several images. High: many images whose corners have observations.
enum class ParameterRank { kLeading, kOrdinary, kHigh };
ParameterRank parameter_rank(const CameraModel& model, int parameter);

// The values of a camera's parameters, as many as its model has, held in place.
class Intrinsics {
 public:
  constexpr Intrinsics() = default;  // Brown, all zero
  constexpr explicit Intrinsics(const CameraModel& model) : model_(model) {}
  constexpr Intrinsics(const CameraModel& model, std::initializer_list<double> values) : model_(model) {
    std::copy(values.begin(), values.end(), values_.begin());
  }
  // Parameters of Brown's model: f, cx, cy, k1, k2, k3, p1, p2, b1, b2. The last ones may be left out and are zero
  // then.
  constexpr Intrinsics(std::initializer_list<double> brown) : Intrinsics(CameraModel(), brown) {}

  constexpr const CameraModel& model() const { return model_; }
  constexpr int size() const { return parameter_count(model_); }
  constexpr double& operator[](std::size_t parameter) { return values_[parameter]; }
  constexpr double operator[](std::size_t parameter) const { return values_[parameter]; }
  constexpr double* data() { return values_.data(); }
  constexpr const double* data() const { return values_.data(); }
  constexpr double* begin() { return data(); }
  constexpr double* end() { return data() + size(); }
  constexpr const double* begin() const { return data(); }
  constexpr const double* end() const { return data() + size(); }
  friend constexpr bool operator==(const Intrinsics&, const Intrinsics&) = default;

 private:
  CameraModel model_;
  std::array<double, kMaxIntrinsics> values_{};  // zero after the last parameter
};

// A standard deviation for each parameter; zero after the last one.
using IntrinsicSigmas = std::array<double, kMaxIntrinsics>;

// A camera without distortion. `focal_px` is its focal length in pixels (a panorama has its own, width / 2 pi);
// principal point and centre of symmetry are in the middle of the image, all other parameters zero.
Intrinsics start_intrinsics(const CameraModel& model, double focal_px, int width, int height);

// Moves the principal point, and with it the centre of symmetry where the model has one.
void set_principal_point(double x_px, double y_px, Intrinsics& k);

// Prior standard deviations that keep the self-calibration of small blocks stable: the given one for the focal length
// (pixels), for the others what ParameterRole says, in the unit of the parameter. Parameters outside of `which` have 0,
// and so have fixed ones.
IntrinsicSigmas weak_sigmas(const Intrinsics& start, double focal_sigma_px, int width, ParameterMask which);
// The same for usual_parameters().
IntrinsicSigmas weak_sigmas(const Intrinsics& start, double focal_sigma_px, int width);

}  // namespace megablock
