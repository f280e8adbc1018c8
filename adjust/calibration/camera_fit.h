// A camera of one model as another model says it: the parameters of `model` under which the rays of a grid of pixels
// of the given camera have these pixels, in least squares (Gauss-Newton, damped). Good start values when models are
// compared, and the way to bring a calibration into a program that knows other models.
#pragma once

#include "geometry/camera/camera.h"

namespace megablock {

struct CameraFit {
  Intrinsics camera;
  double rms_px = 0;  // length of what is left, over the grid
};

// `free`: parameters that are fitted (those fixed by the model never are); others keep the values of start_intrinsics()
// with the given focal length and principal point. width, height: of the image, px.
CameraFit fit_camera(const CameraModel& model, ParameterMask free, const Intrinsics& given, int width, int height);

}  // namespace megablock
