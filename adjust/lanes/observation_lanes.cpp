// Keeps the lanes in the layout that the kernels read, and chooses the kernels. A vector needs kGroup lanes: pad()
// fills the last group with copies of the first lane, whose values nobody reads.
#include "adjust/lanes/observation_lanes.h"

namespace megablock {

using lane_kernels::kAvx2;
using lane_kernels::kAvx512;
using lane_kernels::kByPoint;
using lane_kernels::kFromFrame;
using lane_kernels::kPortable;
using lane_kernels::kResidual;

const lane_kernels::Kernels* lane_kernels_of_width(int width) {
  __builtin_cpu_init();
  // cmake/rooms.cmake compiles the kernels for these instruction sets.
  if (width == 8) {
    const bool has =
        __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
    return has ? &kAvx512 : nullptr;
  }
  // The file is compiled with -mavx2 and -mfma, so that the processor must have both.
  if (width == 4) return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") ? &kAvx2 : nullptr;
  return &kPortable;
}

const lane_kernels::Kernels& lane_kernels_of_processor() {
  for (int width : {8, 4})
    if (const lane_kernels::Kernels* kernels = lane_kernels_of_width(width)) return *kernels;
  return kPortable;
}

// The layout of the kernels: rotation by rows, centre, shift, parameters of Brown's model.
LaneView::LaneView(const ImageView& view) {
  const Intrinsics& k = *view.intrinsics;
  simple = k.model().kind == CameraModelKind::kBrown;
  double* out = values.data();
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) *out++ = view.rotation(i, j);
  out = std::copy_n(view.centre.data(), 3, out);
  out = std::copy_n(view.shift.data(), 3, out);
  if (simple) std::copy_n(k.data(), BrownModel::parameter_count(0), out);
}

SeenImages::SeenImages(const TileProblem& problem, const TileState& state)
    : views(image_views(problem, state)), lanes(views.begin(), views.end()) {}

void AlignedValues::resize(std::int64_t count) {
  // A vector that crosses the border of a cache line takes two accesses.
  constexpr std::uintptr_t kLine = 64;
  storage_.resize(static_cast<std::size_t>(count) + kLine / sizeof(double));
  const auto address = reinterpret_cast<std::uintptr_t>(storage_.data());
  first_ = storage_.data() + ((address + kLine - 1) / kLine * kLine - address) / sizeof(double);
}

void ObservationLanes::reserve(std::int64_t lanes) {
  clear();
  if (lanes <= capacity_) return;
  capacity_ = lane_kernels::padded(lanes);
  views_.resize(static_cast<std::size_t>(capacity_));
  records_.resize(capacity_ * lane_kernels::kRecordSize);
  values_.resize(capacity_ * lane_kernels::kValueCount);
}

void ObservationLanes::pad() {
  for (std::int64_t i = size_; i < padded_size(); ++i) {
    views_[static_cast<std::size_t>(i)] = views_[0];
    std::copy_n(records_.data(), lane_kernels::kRecordSize, records_.data() + lane_kernels::kRecordSize * i);
  }
}

void ObservationLanes::project() {
  pad();
  kernels_->project(views_.data(), records_.data(), padded_size(), values_.data(), capacity_);
}

void ObservationLanes::linearise() {
  pad();
  kernels_->linearise(views_.data(), records_.data(), padded_size(), values_.data(), capacity_);
}

Eigen::Vector2d ObservationLanes::residual(std::int64_t lane) const {
  return {value(kResidual, lane), value(kResidual + 1, lane)};
}

Eigen::Vector3d ObservationLanes::from_frame(std::int64_t lane) const {
  return {value(kFromFrame, lane), value(kFromFrame + 1, lane), value(kFromFrame + 2, lane)};
}

Eigen::Matrix<double, 2, 3> ObservationLanes::by_point(std::int64_t lane) const {
  Eigen::Matrix<double, 2, 3> result;
  for (int k = 0; k < 6; ++k) result(k / 3, k % 3) = value(kByPoint + k, lane);
  return result;
}

void ObservationLanes::set(std::int64_t lane, const Eigen::Vector2d& residual, const Eigen::Vector3d& from_frame,
                           const Eigen::Matrix<double, 2, 3>& by_point) {
  for (int k = 0; k < 2; ++k) value(kResidual + k, lane) = residual[k];
  for (int k = 0; k < 3; ++k) value(kFromFrame + k, lane) = from_frame[k];
  for (int k = 0; k < 6; ++k) value(kByPoint + k, lane) = by_point(k / 3, k % 3);
}

}  // namespace megablock
