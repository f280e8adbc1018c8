// The camera models and their parameters. A model consists of a kind and an order, which determine the number and the
// names of its parameters. projection.h defines the parameters of models that project from the ground to the image,
// correction.h those of models that correct the measured pixel.
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
  kFisheye,          // equidistant, as in OpenCV
  kEquirectangular,  // panorama, all directions
  // Models that correct the measured pixel
  kIgnRadial,
  kOddRadial,   // order: number of terms
  kEvenRadial,  // order: number of terms
  kPolynomial,  // order: degree
  kLegendre,    // order: degree
  kFourier      // order: highest frequency
};

struct CameraModel {
  CameraModelKind kind = CameraModelKind::kBrown;
  std::int32_t order = 0;  // 0 for models without an order
  friend constexpr bool operator==(const CameraModel&, const CameraModel&) = default;
};

// A kind of model with its name and its range of orders, 0 to 0 for models without an order.
struct CameraModelForm {
  const char* name;
  CameraModelKind kind;
  std::int32_t lowest_order, highest_order;
};
const std::vector<CameraModelForm>& camera_model_forms();

// Positions of the parameters. The first three are the same in every model.
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

// A set of parameters: bit p stands for parameter p.
using ParameterMask = std::uint64_t;
constexpr bool contains(ParameterMask mask, int parameter) { return (mask >> parameter & 1) != 0; }
constexpr ParameterMask mask_of(int parameter) { return ParameterMask{1} << parameter; }
constexpr int count_of(ParameterMask mask) { return __builtin_popcountll(mask); }

// Number of terms of one component (columns or rows) of an additive correction, see correction.h.
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
// The names of all parameters, separated by blanks: "f cx cy k1 k2 k3 p1 p2".
std::string parameter_names(const CameraModel& model);
// Position of the parameter with this name; empty if the model has none.
std::optional<int> find_parameter(const CameraModel& model, const std::string& name);
// Whether a parameter follows from the size of the image and is never estimated: width and height of the additive
// corrections, f of the panorama.
bool is_fixed(const CameraModel& model, int parameter);

// The images that are needed to determine a parameter. Leading: focal length and first radial term, from any strip of
// images. Ordinary: several images. High: many images whose corners have observations.
enum class ParameterRank { kLeading, kOrdinary, kHigh };
ParameterRank parameter_rank(const CameraModel& model, int parameter);
// The first `terms` radial terms; none in models without radial terms.
ParameterMask radial_terms(const CameraModel& model, int terms);

// The name of a model in files and project files ("brown", "odd-radial-3"), and the model of a name. Empty if there is
// no such model or not with this order.
std::string model_name(const CameraModel& model);
std::optional<CameraModel> find_model(const std::string& name);
// The names that find_model() accepts, for messages: "brown, pinhole, ..., odd-radial-N (N = 1 to 9), ...".
std::string model_list();

// The values of a camera's parameters, as many as its model has, held in place.
class Intrinsics {
 public:
  constexpr Intrinsics() = default;  // Brown, all zero
  constexpr explicit Intrinsics(const CameraModel& model) : model_(model) {}
  constexpr Intrinsics(const CameraModel& model, std::initializer_list<double> values) : model_(model) {
    std::copy(values.begin(), values.end(), values_.begin());
  }
  // Parameters of Brown's model: f, cx, cy, k1, k2, k3, p1, p2.
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

// Prior standard deviations that keep the self-calibration of small blocks stable: the given one for the focal length
// (pixels), 2 % of the width for the principal point, 5 % for the centre of symmetry. A distortion term has 0.2 at one
// focal length from the centre (Brown's p1 and p2 0.01), in the unit of the parameter; terms of additive corrections
// have 1 % of the width. Fixed parameters have 0. The cx of a panorama, a turn about its vertical axis, is held fixed
// as well.
IntrinsicSigmas weak_sigmas(const Intrinsics& start, double focal_sigma_px, int width);

}  // namespace megablock
