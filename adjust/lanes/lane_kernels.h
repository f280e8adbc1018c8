// Declares the inner loops that project and linearise observations in lanes (observation_lanes.h), on raw pointers.
#pragma once

#include <cstdint>

namespace megablock::lane_kernels {

// The kernels work on groups of lanes; counts are multiples of this, the widest vector of any processor. All kernels
// thus process the same lanes.
constexpr std::int64_t kGroup = 8;
constexpr std::int64_t padded(std::int64_t count) { return (count + kGroup - 1) / kGroup * kGroup; }

// How many doubles describe the image and the observation of a lane. Both are multiples of kGroup: the kernels read
// them by vectors of any width and transpose these into lanes.
constexpr int kViewSize = 32;   // rotation by rows [9], centre [3], shift [3], Brown's parameters [10], unused
constexpr int kRecordSize = 8;  // point [3], measured x and y [2], inverse sigma, unused [2]

// Value v of lane i: values[v * stride + i].
enum Value : int { kResidual = 0, kFromFrame = 2, kByPoint = 5, kValueCount = 11 };

struct Kernels {
  // `views`: one for each lane; `records`: [count x kRecordSize]. Computes the residual alone; NaN behind the camera.
  void (*project)(const double* const* views, const double* records, std::int64_t count, double* values,
                  std::int64_t stride);
  // Computes all values.
  void (*linearise)(const double* const* views, const double* records, std::int64_t count, double* values,
                    std::int64_t stride);
};
extern const Kernels kPortable, kAvx2, kAvx512;

}  // namespace megablock::lane_kernels
