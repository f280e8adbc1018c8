#include "geometry/camera/intrinsics.h"

#include <charconv>
#include <numbers>

#include "geometry/camera/correction.h"

namespace megablock {

namespace {

using Kind = CameraModelKind;

const CameraModelForm& form_of(Kind kind) {
  const auto& all = camera_model_forms();
  return *std::find_if(all.begin(), all.end(), [&](const CameraModelForm& form) { return form.kind == kind; });
}

// Names of additive terms: component, function, powers or frequencies, as "x20", "y11", "xc10", "ys2m1".
std::string term_name(const CameraModel& model, int term) {
  const CorrectionTerm& t = correction_term_list(model)[static_cast<std::size_t>(term)];
  std::string name = t.component == 0 ? "x" : "y";
  if (model.kind == Kind::kFourier) name += t.sine ? "s" : "c";
  for (const int power : {t.i, t.j}) name += (power < 0 ? "m" : "") + std::to_string(std::abs(power));
  return name;
}

}  // namespace

const std::vector<CameraModelForm>& camera_model_forms() {
  static const std::vector<CameraModelForm> all = {
      {"brown", Kind::kBrown, 0, 0},
      {"pinhole", Kind::kPinhole, 0, 0},
      {"opencv-fisheye", Kind::kFisheye, 0, 0},
      {"equirectangular", Kind::kEquirectangular, 0, 0},
      {"ign-radial", Kind::kIgnRadial, 0, 0},
      {"odd-radial", Kind::kOddRadial, 1, 9},
      {"even-radial", Kind::kEvenRadial, 1, 9},
      {"polynomial", Kind::kPolynomial, 1, 6},
      {"legendre", Kind::kLegendre, 1, 6},
      {"fourier", Kind::kFourier, 1, 2},
  };
  return all;
}

std::string parameter_name(const CameraModel& model, int parameter) {
  static constexpr std::array<const char*, 8> kBrown = {"f", "cx", "cy", "k1", "k2", "k3", "p1", "p2"};
  static constexpr std::array<const char*, 8> kIgn = {"f", "cx", "cy", "sx", "sy", "a", "b", "c"};
  const auto at = static_cast<std::size_t>(parameter);
  if (parameter <= kPrincipalY) return kBrown[at];
  switch (model.kind) {
    case Kind::kFisheye:
      return "k" + std::to_string(parameter - kPrincipalY);
    case Kind::kIgnRadial:
      return kIgn[at];
    case Kind::kOddRadial:
    case Kind::kEvenRadial:
      return parameter < kRadialTerms ? kIgn[at] : "k" + std::to_string(parameter - kRadialTerms + 1);
    case Kind::kPolynomial:
    case Kind::kLegendre:
    case Kind::kFourier:
      if (parameter == kImageWidth) return "width";
      if (parameter == kImageHeight) return "height";
      return term_name(model, parameter - kCorrectionTerms);
    default:
      return kBrown[at];
  }
}

std::string parameter_names(const CameraModel& model) {
  std::string names;
  for (int p = 0; p < parameter_count(model); ++p) names += (p == 0 ? "" : " ") + parameter_name(model, p);
  return names;
}

std::optional<int> find_parameter(const CameraModel& model, const std::string& name) {
  for (int p = 0; p < parameter_count(model); ++p)
    if (parameter_name(model, p) == name) return p;
  return std::nullopt;
}

bool is_fixed(const CameraModel& model, int parameter) {
  if (model.kind == Kind::kEquirectangular) return parameter == kFocal;
  return is_additive(model) && (parameter == kImageWidth || parameter == kImageHeight);
}

ParameterMask radial_terms(const CameraModel& model, int terms) {
  int first = model.kind == Kind::kBrown || model.kind == Kind::kFisheye ? kRadial1 : kRadialTerms;
  int count = model.kind == Kind::kBrown ? 3 : parameter_count(model) - first;
  if (is_additive(model) || model.kind == Kind::kPinhole || model.kind == Kind::kEquirectangular) count = 0;
  ParameterMask mask = 0;
  for (int i = 0; i < std::min(terms, count); ++i) mask |= mask_of(first + i);
  return mask;
}

ParameterRank parameter_rank(const CameraModel& model, int parameter) {
  if (parameter == kFocal || contains(radial_terms(model, 1), parameter)) return ParameterRank::kLeading;
  constexpr int kHighestDegree = 3;
  bool high = contains(radial_terms(model, kMaxIntrinsics) & ~radial_terms(model, 2), parameter);
  if (is_additive(model) && parameter >= kCorrectionTerms) {
    const CorrectionTerm& t = correction_term_list(model)[static_cast<std::size_t>(parameter - kCorrectionTerms)];
    high = t.i + std::abs(t.j) > kHighestDegree;
  }
  return high ? ParameterRank::kHigh : ParameterRank::kOrdinary;
}

std::string model_name(const CameraModel& model) {
  const std::string name = form_of(model.kind).name;
  return model.order == 0 ? name : name + "-" + std::to_string(model.order);
}

std::optional<CameraModel> find_model(const std::string& name) {
  for (const CameraModelForm& form : camera_model_forms()) {
    const std::string base = form.name;
    if (form.highest_order == 0 && name == base) return CameraModel{form.kind, 0};
    if (form.highest_order == 0 || !name.starts_with(base + "-")) continue;
    CameraModel model{form.kind, 0};
    const char* end = name.data() + name.size();
    const auto read = std::from_chars(name.data() + base.size() + 1, end, model.order);
    if (read.ec == std::errc() && read.ptr == end && model.order >= form.lowest_order &&
        model.order <= form.highest_order)
      return model;
  }
  return std::nullopt;
}

std::string model_list() {
  std::string list;
  for (const CameraModelForm& form : camera_model_forms()) {
    list += std::string(list.empty() ? "" : ", ") + form.name;
    if (form.highest_order > 0)
      list += "-N (N = " + std::to_string(form.lowest_order) + " to " + std::to_string(form.highest_order) + ")";
  }
  return list;
}

Intrinsics start_intrinsics(const CameraModel& model, double focal_px, int width, int height) {
  Intrinsics k(model);
  k[kFocal] = model.kind == Kind::kEquirectangular ? width / (2 * std::numbers::pi) : focal_px;
  k[kPrincipalX] = 0.5 * width;
  k[kPrincipalY] = 0.5 * height;
  if (is_radial(model)) {
    k[kSymmetryX] = k[kPrincipalX];
    k[kSymmetryY] = k[kPrincipalY];
  }
  if (is_additive(model)) {
    k[kImageWidth] = width;
    k[kImageHeight] = height;
  }
  return k;
}

IntrinsicSigmas weak_sigmas(const Intrinsics& start, double focal_sigma_px, int width) {
  constexpr double kTerm = 0.2, kDecentring = 0.01;
  const CameraModel& model = start.model();
  const double principal = 0.02 * width, symmetry = 0.05 * width, additive = 0.01 * width;
  IntrinsicSigmas sigma{};
  const auto last = sigma.begin() + start.size();
  const auto fill_from = [&](int first, double value) { std::fill(sigma.begin() + first, last, value); };
  fill_from(kPrincipalY + 1, is_additive(model) ? additive : kTerm);
  sigma[kFocal] = focal_sigma_px;
  sigma[kPrincipalX] = sigma[kPrincipalY] = principal;
  if (model.kind == Kind::kBrown) fill_from(kDecentring1, kDecentring);
  if (model.kind == Kind::kEquirectangular) sigma[kPrincipalX] = 0;
  if (is_radial(model)) sigma[kSymmetryX] = sigma[kSymmetryY] = symmetry;
  if (model.kind == Kind::kIgnRadial) {
    double scale = 1 / (start[kFocal] * start[kFocal]);
    for (int p = kRadialTerms; p < start.size(); ++p) {
      sigma[static_cast<std::size_t>(p)] = kTerm * scale;
      scale /= start[kFocal] * start[kFocal];
    }
  }
  for (int p = 0; p < start.size(); ++p)
    if (is_fixed(model, p)) sigma[static_cast<std::size_t>(p)] = 0;
  return sigma;
}

}  // namespace megablock
