// Camera models and their parameters. A model is a kind and an order; the number and the names of its parameters are
// functions of it. What the parameters mean: projection.h (models ground -> image) and correction.h (models that
// correct the measured pixel).
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <vector>

namespace megablock {

enum class CameraModelKind : std::int32_t {
  kBrown = 0,
  kPinhole,
  kFisheye,          // equidistant, as OpenCV's
  kEquirectangular,  // panorama, all directions
  // Corrections of the measured pixel
  kIgnRadial,
  kOddRadial,   // order: number of terms
  kEvenRadial,  // order: number of terms
  kPolynomial,  // order: degree
  kLegendre,    // order: degree
  kFourier      // order: highest frequency
};

struct CameraModel {
  CameraModelKind kind = CameraModelKind::kBrown;
  std::int32_t order = 0;  // 0 for models without
  friend constexpr bool operator==(const CameraModel&, const CameraModel&) = default;
};

// A kind and the orders it comes in: 0 to 0 for models without.
struct CameraModelForm {
  const char* name;
  CameraModelKind kind;
  std::int32_t lowest_order, highest_order;
};
const std::vector<CameraModelForm>& camera_model_forms();

// Positions of parameters. The first three are the same in every model.
enum IntrinsicParameter : int {
  kFocal = 0,
  kPrincipalX,
  kPrincipalY,
  // Brown; the fisheye has its k1 to k4 from kRadial1 on
  kRadial1,
  kRadial2,
  kRadial3,
  kDecentring1,
  kDecentring2,
  // Radial corrections
  kSymmetryX = 3,
  kSymmetryY,
  kRadialTerms,
  // Corrections by polynomials or Fourier series
  kImageWidth = 3,
  kImageHeight,
  kCorrectionTerms
};

inline constexpr int kMaxIntrinsics = 64;

// Set of parameters: bit p = parameter p.
using ParameterMask = std::uint64_t;
constexpr bool contains(ParameterMask mask, int parameter) { return (mask >> parameter & 1) != 0; }
constexpr ParameterMask mask_of(int parameter) { return ParameterMask{1} << parameter; }
constexpr int count_of(ParameterMask mask) { return __builtin_popcountll(mask); }

// Terms of one component (columns or rows) of a correction by polynomials or a Fourier series: see correction.h.
constexpr int correction_terms(const CameraModel& model, int component) {
  const int n = model.order;
  if (model.kind == CameraModelKind::kFourier) return (2 * n + 1) * (2 * n + 1) - 1;
  const int all = (n + 1) * (n + 2) / 2 - 1;  // without the constant
  return all - (component == 0 ? 0 : 2) - (n >= 2 ? 1 : 0);
}

constexpr int parameter_count(const CameraModel& model) {
  switch (model.kind) {
    case CameraModelKind::kBrown:
      return 8;
    case CameraModelKind::kPinhole:
    case CameraModelKind::kEquirectangular:
      return 3;
    case CameraModelKind::kFisheye:
      return 7;
    case CameraModelKind::kIgnRadial:
      return 8;
    case CameraModelKind::kOddRadial:
    case CameraModelKind::kEvenRadial:
      return kRadialTerms + model.order;
    default:
      return kCorrectionTerms + correction_terms(model, 0) + correction_terms(model, 1);
  }
}
std::string parameter_name(const CameraModel& model, int parameter);
// "f cx cy k1 k2 k3 p1 p2"
std::string parameter_names(const CameraModel& model);
// Position of the parameter with this name.
std::optional<int> find_parameter(const CameraModel& model, const std::string& name);
// Parameters that follow from the size of the image and are never estimated: width and height of the additive
// corrections, f of the panorama.
bool is_fixed(const CameraModel& model, int parameter);

// When a parameter can be told from others. Leading: focal length and the first radial term, from any strip of images;
// ordinary: needs several images; high: only where the corners of many images are covered.
enum class ParameterRank { kLeading, kOrdinary, kHigh };
ParameterRank parameter_rank(const CameraModel& model, int parameter);
// The first `terms` radial terms (none in models without).
ParameterMask radial_terms(const CameraModel& model, int terms);

// Name of a model in files and project files ("brown", "odd-radial-3"), and back; empty when there is no such model or
// it does not come in this order.
std::string model_name(const CameraModel& model);
std::optional<CameraModel> find_model(const std::string& name);
// "brown, pinhole, ..., odd-radial-N (N = 1 to 9), ...": what find_model takes.
std::string model_list();

// Values of a camera's parameters: as many as its model has, in place.
class Intrinsics {
 public:
  constexpr Intrinsics() = default;  // Brown, zero
  constexpr explicit Intrinsics(const CameraModel& model) : model_(model) {}
  constexpr Intrinsics(const CameraModel& model, std::initializer_list<double> values) : model_(model) {
    std::copy(values.begin(), values.end(), values_.begin());
  }
  // Brown: f, cx, cy, k1, k2, k3, p1, p2.
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
  std::array<double, kMaxIntrinsics> values_{};  // zero behind the last parameter
};

// A sigma per parameter, zero behind the last.
using IntrinsicSigmas = std::array<double, kMaxIntrinsics>;

// A camera without distortion: focal length (px; a panorama has its own, width / 2 pi), principal point and centre of
// symmetry in the middle of the image, everything else zero.
Intrinsics start_intrinsics(const CameraModel& model, double focal_px, int width, int height);

// Prior sigmas that keep self-calibration of small blocks stable: what the focal length is good for (px), principal
// point 2 % of the width, centre of symmetry 5 %. Terms of the distortion: 0.2 at one focal length from the centre
// (Brown's p1, p2 0.01), in the unit of the parameter; terms of additive corrections 1 % of the width. Fixed
// parameters: 0 (held). A panorama's cx, which is a turn about its vertical axis, is held too.
IntrinsicSigmas weak_sigmas(const Intrinsics& start, double focal_sigma_px, int width);

}  // namespace megablock
