#include "geometry/intrinsics.h"

namespace megablock {

std::string parameter_name(const CameraModel&, int parameter) {
  static constexpr std::array<const char*, 8> kNames = {"f", "cx", "cy", "k1", "k2", "k3", "p1", "p2"};
  return kNames[static_cast<std::size_t>(parameter)];
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

std::string model_name(const CameraModel&) { return "brown"; }

std::optional<CameraModel> find_model(const std::string& name) {
  if (name == "brown") return CameraModel();
  return std::nullopt;
}

}  // namespace megablock
