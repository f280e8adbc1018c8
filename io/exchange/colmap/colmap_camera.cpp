#include "io/exchange/colmap/colmap_camera.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "io/base/error.h"

namespace megablock {

namespace {

std::vector<std::string> words_of(const char* text) {
  std::istringstream stream(text);
  return {std::istream_iterator<std::string>(stream), {}};
}

// The parameters here whose sum is a parameter of COLMAP. Of its two focal lengths fy is f, and fx = f + b1 where the
// model has an affinity b1.
std::vector<int> parameters_here(const CameraModel& model, const std::string& name) {
  std::vector<int> all;
  const auto add = [&](const char* here) {
    if (const auto p = find_parameter(model, here)) all.push_back(*p);
  };
  if (name == "fx") add("b1");
  add(name == "fx" || name == "fy" ? "f" : name.c_str());
  return all;
}

// Whether the form has every parameter that is not zero. A zero one is implied: COLMAP's smaller models are ours with
// some terms zero. No form has a skew; without_skew() takes it out.
bool holds(const ColmapCameraForm& form, const Intrinsics& k) {
  ParameterMask missing = 0;
  for (int p = 0; p < k.size(); ++p)
    if (k[static_cast<std::size_t>(p)] != 0) missing |= mask_of(p);
  if (const auto skew = find_parameter(k.model(), "b2")) missing &= ~mask_of(*skew);
  for (const std::string& name : form.parameters)
    for (const int p : parameters_here(k.model(), name)) missing &= ~mask_of(p);
  return missing == 0;
}

Intrinsics as_brown(const Intrinsics& pinhole) {
  return {pinhole[kFocal], pinhole[kPrincipalX], pinhole[kPrincipalY], 0, 0, 0, 0, 0};
}

std::string exportable_models() {
  std::vector<std::string> names;
  for (const CameraModelForm& form : camera_model_forms())
    if (!form.colmap.empty()) names.emplace_back(form.name);
  std::string list;
  for (std::size_t i = 0; i < names.size(); ++i)
    list += (i == 0 ? "" : i + 1 < names.size() ? ", " : " and ") + names[i];
  return list;
}

}  // namespace

const std::vector<ColmapCameraForm>& colmap_camera_forms() {
  static const std::vector<ColmapCameraForm> all = [] {
    std::vector<ColmapCameraForm> forms;
    for (const CameraModelForm& model : camera_model_forms())
      for (const ColmapModel& form : model.colmap)
        forms.push_back({form.number, form.name, model.kind, words_of(form.parameters)});
    std::sort(forms.begin(), forms.end(), [](const auto& a, const auto& b) { return a.number < b.number; });
    return forms;
  }();
  return all;
}

ColmapCamera to_colmap(const std::string& camera, const Intrinsics& k) {
  const auto& all = colmap_camera_forms();
  for (const ColmapModel& model : colmap_models_of(k.model().kind)) {
    const auto form =
        std::find_if(all.begin(), all.end(), [&](const ColmapCameraForm& f) { return f.number == model.number; });
    if (!holds(*form, k)) continue;
    ColmapCamera result{&*form, {}};
    for (const std::string& name : form->parameters) {
      double value = 0;
      for (const int p : parameters_here(k.model(), name)) value += k[static_cast<std::size_t>(p)];
      result.parameters.push_back(value);
    }
    return result;
  }
  throw InputError("camera '" + camera + "' has the model " + model_name(k.model()) + ", which COLMAP does not have; " +
                   "choose another format (COLMAP has " + exportable_models() + ")");
}

Eigen::Vector2d without_skew(const Intrinsics& k, const Eigen::Vector2d& pixel) {
  const auto skew = find_parameter(k.model(), "b2");
  if (!skew) return pixel;
  return {pixel.x() - k[static_cast<std::size_t>(*skew)] * (pixel.y() - k[kPrincipalY]) / k[kFocal], pixel.y()};
}

CameraFromColmap from_colmap(const ColmapCameraForm& form, const std::vector<double>& parameters) {
  CameraFromColmap result{Intrinsics(CameraModel{form.kind}), ""};
  double fx = 0;
  for (std::size_t i = 0; i < form.parameters.size(); ++i) {
    const std::string& name = form.parameters[i];
    const double value = parameters[i];
    if (name == "fx") {
      fx = value;
    } else if (name == "fy") {
      result.intrinsics[kFocal] = value;
      // The smallest difference is that of a file with nine digits.
      const bool differ = std::abs(value - fx) > 1e-9 * std::abs(fx);
      // A pinhole camera of two focal lengths is one of Brown's model without distortion.
      if (differ && form.kind == CameraModelKind::kPinhole) result.intrinsics = as_brown(result.intrinsics);
      const auto affinity = find_parameter(result.intrinsics.model(), "b1");
      if (differ && affinity)
        result.intrinsics[static_cast<std::size_t>(*affinity)] = fx - value;
      else if (differ)
        result.refusal = "has fx " + std::to_string(fx) + " and fy " + std::to_string(value) + "; in the model " +
                         model_name(result.intrinsics.model()) + " only square pixels (fx = fy) are supported";
    } else if (const auto p = find_parameter(result.intrinsics.model(), name)) {
      result.intrinsics[static_cast<std::size_t>(*p)] = value;
    } else if (value != 0) {
      result.refusal = "uses " + name + ", which is not supported";
    }
    if (!result.refusal.empty()) return result;
  }
  return result;
}

}  // namespace megablock
