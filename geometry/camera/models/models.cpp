#include "geometry/camera/models/models.h"

#include <charconv>

namespace megablock {

namespace {

template <typename... Models>
std::vector<CameraModelForm> forms_of(CameraModelList<Models...>) {
  int number = 0;
  return {CameraModelForm{static_cast<CameraModelKind>(number++),
                          Models::kName,
                          Models::kOrders,
                          {Models::kColmap.begin(), Models::kColmap.end()}}...};
}

const CameraModelForm& form_of(CameraModelKind kind) { return camera_model_forms()[static_cast<std::size_t>(kind)]; }

}  // namespace

const std::vector<CameraModelForm>& camera_model_forms() {
  static const std::vector<CameraModelForm> all = forms_of(AllCameraModels());
  return all;
}

const std::vector<ColmapModel>& colmap_models_of(CameraModelKind kind) { return form_of(kind).colmap; }

const std::vector<CameraParameter>& camera_parameters(const CameraModel& model) {
  static const std::vector<std::vector<std::vector<CameraParameter>>> all = [] {  // [kind][order]
    std::vector<std::vector<std::vector<CameraParameter>>> tables;
    for (const CameraModelForm& form : camera_model_forms()) {
      auto& orders = tables.emplace_back(form.orders.highest + 1);
      for (std::int32_t order = form.orders.lowest; order <= form.orders.highest; ++order)
        orders[static_cast<std::size_t>(order)] =
            with_model(form.kind, [&]<typename Model>(std::type_identity<Model>) { return Model::parameters(order); });
    }
    return tables;
  }();
  return all[static_cast<std::size_t>(model.kind)][static_cast<std::size_t>(model.order)];
}

std::string parameter_name(const CameraModel& model, int parameter) {
  return camera_parameters(model)[static_cast<std::size_t>(parameter)].name;
}

std::string parameter_names(const CameraModel& model) {
  std::string names;
  for (const CameraParameter& parameter : camera_parameters(model))
    names += (names.empty() ? "" : " ") + parameter.name;
  return names;
}

std::optional<int> find_parameter(const CameraModel& model, const std::string& name) {
  for (int p = 0; p < parameter_count(model); ++p)
    if (parameter_name(model, p) == name) return p;
  return std::nullopt;
}

bool is_fixed(const CameraModel& model, int parameter) {
  return camera_parameters(model)[static_cast<std::size_t>(parameter)].fixed;
}

std::string model_name(const CameraModel& model) {
  const std::string name = form_of(model.kind).name;
  return model.order == 0 ? name : name + "-" + std::to_string(model.order);
}

std::optional<CameraModel> find_model(const std::string& name) {
  for (const CameraModelForm& form : camera_model_forms()) {
    const std::string base = form.name;
    if (form.orders.highest == 0 && name == base) return CameraModel{form.kind, 0};
    if (form.orders.highest == 0 || !name.starts_with(base + "-")) continue;
    CameraModel model{form.kind, 0};
    const char* end = name.data() + name.size();
    const auto read = std::from_chars(name.data() + base.size() + 1, end, model.order);
    if (read.ec == std::errc() && read.ptr == end && model.order >= form.orders.lowest &&
        model.order <= form.orders.highest)
      return model;
  }
  return std::nullopt;
}

std::string model_list() {
  std::string list;
  for (const CameraModelForm& form : camera_model_forms()) {
    list += std::string(list.empty() ? "" : ", ") + form.name;
    if (form.orders.highest > 0)
      list += "-N (N = " + std::to_string(form.orders.lowest) + " to " + std::to_string(form.orders.highest) + ")";
  }
  return list;
}

}  // namespace megablock
