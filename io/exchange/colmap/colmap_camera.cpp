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

// COLMAP has two focal lengths, which are f here.
std::optional<int> parameter_here(const CameraModel& model, const std::string& name) {
  return find_parameter(model, name == "fx" || name == "fy" ? "f" : name);
}

// Whether the form has every parameter that is not zero. A zero one is implied: COLMAP's smaller models are ours with
// some terms zero.
bool holds(const ColmapCameraForm& form, const Intrinsics& k) {
  ParameterMask missing = 0;
  for (int p = 0; p < k.size(); ++p)
    if (k[static_cast<std::size_t>(p)] != 0) missing |= mask_of(p);
  for (const std::string& name : form.parameters)
    if (const auto p = parameter_here(k.model(), name)) missing &= ~mask_of(*p);
  return missing == 0;
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
      const auto p = parameter_here(k.model(), name);
      result.parameters.push_back(p ? k[static_cast<std::size_t>(*p)] : 0);
    }
    return result;
  }
  throw InputError("camera '" + camera + "' has the model " + model_name(k.model()) + ", which COLMAP does not have; " +
                   "choose another format (COLMAP has " + exportable_models() + ")");
}

CameraFromColmap from_colmap(const ColmapCameraForm& form, const std::vector<double>& parameters) {
  CameraFromColmap result{Intrinsics(CameraModel{form.kind}), ""};
  double fx = 0;
  for (std::size_t i = 0; i < form.parameters.size(); ++i) {
    const std::string& name = form.parameters[i];
    const double value = parameters[i];
    if (name == "fx") fx = value;
    if (name == "fy" && std::abs(value - fx) > 1e-9 * std::abs(fx))
      result.refusal = "has fx " + std::to_string(fx) + " and fy " + std::to_string(value) +
                       "; only square pixels (fx = fy) are supported";
    else if (const auto p = parameter_here(result.intrinsics.model(), name))
      result.intrinsics[static_cast<std::size_t>(*p)] = value;
    else if (value != 0)
      result.refusal = "uses " + name + ", which is not supported";
    if (!result.refusal.empty()) return result;
  }
  return result;
}

}  // namespace megablock
