// Defines the kernels for vectors of any width, so that all processors run one source. Internal to adjust/lanes/: each
// lane_kernels_*.cpp sets the width and includes it. The formulas are those of linearise.h and of
// geometry/camera/models/brown.h, written out:
//
//     u = X - C,   X_cam = R u - t,   (x, y) = (X_cam.x, X_cam.y) / depth,   r2 = x^2 + y^2,
//     radial = 1 + k1 r2 + k2 r2^2 + k3 r2^3,   slope = d radial / d r2,
//     distorted_x = x radial + 2 p1 x y + p2 (r2 + 2 x^2),   distorted_y = y radial + p1 (r2 + 2 y^2) + 2 p2 x y,
//     residual_x = w (cx + (f + b1) distorted_x + b2 distorted_y - measured_x),
//     residual_y = w (cy + f distorted_y - measured_y)
//
// The derivatives of the distorted point are
//
//     dx = d distorted_x / dx,   dy = d distorted_y / dy,   cross = d distorted_x / dy = d distorted_y / dx,
//
// and those of the residual by X_cam, with wide = w (f + b1) / depth, scale = w f / depth and skew = w b2 / depth,
//
//     | xx  xy  xz |     xx = wide dx + skew cross,   xy = wide cross + skew dy,   xz = -x xx - y xy,
//     | yx  yy  yz |     yx = scale cross,            yy = scale dy,               yz = -x yx - y yy,
//
// because x and y do not change along the ray. That by the point X is this matrix times R; those by the poses follow
// from it and from u (by_pose in linearise.h).
//
// Lanes behind the camera are computed like the others and then set to NaN, since a branch would have to hold for all
// lanes of a vector.
#pragma once

#include "adjust/lanes/lane_kernels.h"
#include "geometry/numbers/lane_vector.h"

namespace megablock::lane_kernels {
namespace {

// With `kDerivatives` it computes all values, otherwise the residual alone.
template <bool kDerivatives>
void work(const double* const* views, const double* records, std::int64_t count, double* values, std::int64_t stride) {
  for (std::int64_t i = 0; i < count; i += kWidth) {
    Lanes view[kViewSize], record[kRecordSize];
    read_records(
        [&](int lane) __attribute__((always_inline)) { return views[i + lane]; }, view);
    read_records(
        [&](int lane) __attribute__((always_inline)) { return records + (i + lane) * kRecordSize; }, record);
    const Lanes* r = view;
    const Lanes *centre = view + 9, *shift = view + 12, *k = view + 15;  // k: f, cx, cy, k1, k2, k3, p1, p2, b1, b2
    const Lanes u0 = record[0] - centre[0], u1 = record[1] - centre[1], u2 = record[2] - centre[2];
    const Lanes depth = r[6] * u0 + r[7] * u1 + r[8] * u2 - shift[2];
    const Lanes inverse = 1 / depth;
    const Lanes x = (r[0] * u0 + r[1] * u1 + r[2] * u2 - shift[0]) * inverse;
    const Lanes y = (r[3] * u0 + r[4] * u1 + r[5] * u2 - shift[1]) * inverse;
    const Lanes r2 = x * x + y * y, xy2 = 2 * x * y;
    const Lanes radial = 1 + r2 * (k[3] + r2 * (k[4] + r2 * k[5]));
    const Lanes distorted_x = x * radial + k[6] * xy2 + k[7] * (r2 + 2 * x * x);
    const Lanes distorted_y = y * radial + k[6] * (r2 + 2 * y * y) + k[7] * xy2;
    const Lanes weight = record[5];
    const Lanes nan = Lanes{} + __builtin_nan("");
    const LaneMask in_front = depth > 0;
    double* out = values + i;
    const Lanes fx = k[0] + k[8];
    const Lanes residual_x = weight * (k[1] + (fx * distorted_x + k[9] * distorted_y) - record[3]);
    const Lanes residual_y = weight * (k[2] + k[0] * distorted_y - record[4]);
    store(out + kResidual * stride, in_front ? residual_x : nan);
    store(out + (kResidual + 1) * stride, in_front ? residual_y : nan);
    if constexpr (kDerivatives) {
      store(out + kFromFrame * stride, u0);
      store(out + (kFromFrame + 1) * stride, u1);
      store(out + (kFromFrame + 2) * stride, u2);
      const Lanes slope = k[3] + r2 * (2 * k[4] + 3 * r2 * k[5]);  // d radial / d r2
      const Lanes cross = xy2 * slope + 2 * k[6] * x + 2 * k[7] * y;
      const Lanes dx = radial + 2 * x * x * slope + 2 * k[6] * y + 6 * k[7] * x;
      const Lanes dy = radial + 2 * y * y * slope + 6 * k[6] * y + 2 * k[7] * x;
      const Lanes wide = weight * (fx * inverse), scale = weight * (k[0] * inverse), skew = weight * (k[9] * inverse);
      const Lanes xx = wide * dx + skew * cross, xy = wide * cross + skew * dy;
      const Lanes yx = scale * cross, yy = scale * dy;
      const Lanes xz = -x * xx - y * xy, yz = -x * yx - y * yy;
#pragma GCC unroll 64
      for (int j = 0; j < 3; ++j) {
        store(out + (kByPoint + j) * stride, xx * r[j] + xy * r[3 + j] + xz * r[6 + j]);
        store(out + (kByPoint + 3 + j) * stride, yx * r[j] + yy * r[3 + j] + yz * r[6 + j]);
      }
    }
  }
}

}  // namespace
}  // namespace megablock::lane_kernels
