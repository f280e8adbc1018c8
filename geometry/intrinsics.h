// Camera models and their parameters. A model is a kind and an order; the number and the names of its parameters are
// functions of it. What the parameters mean: camera.h.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>

namespace megablock {

enum class CameraModelKind : std::int32_t { kBrown = 0 };

struct CameraModel {
  CameraModelKind kind = CameraModelKind::kBrown;
  std::int32_t order = 0;  // number of terms or degree, 0 for models without
  friend constexpr bool operator==(const CameraModel&, const CameraModel&) = default;
};

// Positions of parameters. The first three are the same in every model.
enum IntrinsicParameter : int {
  kFocal = 0,
  kPrincipalX,
  kPrincipalY,
  // Brown
  kRadial1,
  kRadial2,
  kRadial3,
  kDecentring1,
  kDecentring2
};

inline constexpr int kMaxIntrinsics = 64;  // a bit mask of parameters is a 64-bit integer

constexpr int parameter_count(const CameraModel&) { return 8; }
std::string parameter_name(const CameraModel& model, int parameter);
// "f cx cy k1 k2 k3 p1 p2"
std::string parameter_names(const CameraModel& model);
// Position of the parameter with this name.
std::optional<int> find_parameter(const CameraModel& model, const std::string& name);

// Name of a model in files and project files ("brown"), and back.
std::string model_name(const CameraModel& model);
std::optional<CameraModel> find_model(const std::string& name);

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

// Set of parameters: bit p = parameter p.
using ParameterMask = std::uint64_t;
constexpr bool contains(ParameterMask mask, int parameter) { return (mask >> parameter & 1) != 0; }
constexpr ParameterMask mask_of(int parameter) { return ParameterMask{1} << parameter; }
constexpr int count_of(ParameterMask mask) { return __builtin_popcountll(mask); }

}  // namespace megablock
