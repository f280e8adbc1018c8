// Converts a camera to another camera model. It fits the parameters of the new model, in least squares, so that it
// projects the rays of a grid of pixels of the given camera to the same pixels (damped Gauss-Newton). The result gives
// start values for the comparison of models and takes a calibration to a program that knows other models.
#pragma once

#include "geometry/camera/camera.h"

namespace megablock {

struct CameraFit {
  Intrinsics camera;
  double rms_px = 0;  // of the lengths of the residuals over the grid
};

// `free`: parameters that are fitted (those fixed by the model never are); others keep the values of start_intrinsics()
// with the given focal length and principal point. width, height: of the image, px.
CameraFit fit_camera(const CameraModel& model, ParameterMask free, const Intrinsics& given, int width, int height);

}  // namespace megablock
