// The table of camera models. A new model is a file beside this one (model.h tells what it gives) and its place in the
// two lists here; every other part of the program asks this table.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "geometry/camera/models/additive_correction.h"
#include "geometry/camera/models/brown.h"
#include "geometry/camera/models/equirectangular.h"
#include "geometry/camera/models/fisheye.h"
#include "geometry/camera/models/pinhole.h"
#include "geometry/camera/models/radial_correction.h"
#include "geometry/camera/models/thin_prism_fisheye.h"

namespace megablock {

// The number of each model, its place in the list below. Fingerprints of jobs hold it, so new models come last.
enum class CameraModelKind : std::int32_t {
  kBrown,
  kPinhole,
  kFisheye,
  kEquirectangular,
  kIgnRadial,
  kOddRadial,
  kEvenRadial,
  kPolynomial,
  kLegendre,
  kFourier,
  kThinPrismFisheye
};

template <typename... Models>
struct CameraModelList {};
using AllCameraModels =
    CameraModelList<BrownModel, PinholeModel, FisheyeModel, EquirectangularModel, IgnRadialModel, OddRadialModel,
                    EvenRadialModel, PolynomialModel, LegendreModel, FourierModel, ThinPrismFisheyeModel>;

// A model consists of a kind and an order, which determine the number and the names of its parameters.
struct CameraModel {
  CameraModelKind kind = CameraModelKind::kBrown;
  std::int32_t order = 0;  // 0 for models without an order
  friend constexpr bool operator==(const CameraModel&, const CameraModel&) = default;
};

namespace detail {
template <typename Visit, typename First, typename... Others>
constexpr decltype(auto) visit_model(int number, Visit&& visit, CameraModelList<First, Others...>) {
  if constexpr (sizeof...(Others) > 0)
    if (number != 0) return visit_model(number - 1, std::forward<Visit>(visit), CameraModelList<Others...>());
  return visit(std::type_identity<First>());
}
}  // namespace detail

// Calls `visit` with the struct of a kind, as in with_model(kind, [&]<typename Model>(std::type_identity<Model>)
// {...}).
template <typename Visit>
constexpr decltype(auto) with_model(CameraModelKind kind, Visit&& visit) {
  return detail::visit_model(static_cast<int>(kind), std::forward<Visit>(visit), AllCameraModels());
}

constexpr int parameter_count(const CameraModel& model) {
  return with_model(model.kind,
                    [&]<typename Model>(std::type_identity<Model>) { return Model::parameter_count(model.order); });
}
constexpr FieldOfView field_of_view(const CameraModel& model) {
  return with_model(model.kind, []<typename Model>(std::type_identity<Model>) { return Model::kField; });
}
// Whether the model sees directions of 90 degrees from its axis and more.
constexpr bool sees_sideways(const CameraModel& model) { return field_of_view(model) != FieldOfView::kFront; }
constexpr bool is_panorama(const CameraModel& model) { return field_of_view(model) == FieldOfView::kPanorama; }
// Whether the model is one of those of pixel_correction.h.
constexpr bool corrects_pixels(const CameraModel& model) {
  return with_model(model.kind, []<typename Model>(std::type_identity<Model>) { return Model::kCorrectsPixels; });
}

// A row of the table.
struct CameraModelForm {
  CameraModelKind kind;
  const char* name;
  OrderRange orders;
  std::vector<ColmapModel> colmap;
};
const std::vector<CameraModelForm>& camera_model_forms();
const std::vector<ColmapModel>& colmap_models_of(CameraModelKind kind);

// The parameters of a model in their order.
const std::vector<CameraParameter>& camera_parameters(const CameraModel& model);
std::string parameter_name(const CameraModel& model, int parameter);
// The names of all parameters, separated by blanks: "f cx cy k1 k2 k3 p1 p2".
std::string parameter_names(const CameraModel& model);
// Position of the parameter with this name; empty if the model has none.
std::optional<int> find_parameter(const CameraModel& model, const std::string& name);
// Whether a parameter follows from the size of the image and is never estimated: width and height of the additive
// corrections, f of the panorama.
bool is_fixed(const CameraModel& model, int parameter);

// The name of a model in files and project files ("brown", "odd-radial-3"), and the model of a name. Empty if there is
// no such model or not with this order.
std::string model_name(const CameraModel& model);
std::optional<CameraModel> find_model(const std::string& name);
// The names that find_model() accepts, for messages: "brown, pinhole, ..., odd-radial-N (N = 1 to 9), ...".
std::string model_list();

}  // namespace megablock
