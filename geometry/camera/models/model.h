// What a camera model gives to the table of models (models.h).
//
// A model is a struct of static members in a file of its own. To add one, write such a file and add the struct to the
// list in models.h. Everything else (project file, files, report, exports, solvers) asks the table.
//
//   kName            the name in files and project files; an order is appended to it ("odd-radial-3")
//   kOrders          the range of orders; 0 to 0 for a model without an order
//   kField           the directions that the model can see, see FieldOfView
//   kColmap          COLMAP's models of the same projection; an export takes the first that holds all parameters
//   kCorrectsPixels  whether the model is a PixelCorrection (pixel_correction.h), which has everything below
//   parameter_count  their number, a constant expression of the order
//   parameters       name, role and unit of every parameter; f, cx and cy come first
//   sees             whether the model has a pixel for a point
//   project          the pixel of a point that it sees; a template for automatic differentiation
//   linearise        the pixel with its derivatives; false where the model has no pixel
//   normalised       for FieldOfView::kFront: (X/Z, Y/Z) of a pixel; empty where the model cannot be inverted
//   viewing_ray      for the other fields of view: the unit direction of a pixel, or empty
//
// Points are in camera axes (x right, y down, z along the view) in any unit. Pixels have their centres at +0.5. `k` is
// the array of the parameters.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

namespace megablock {

// Positions of the parameters. The first three are the same in every model.
enum IntrinsicParameter : int {
  kFocal = 0,
  kPrincipalX,
  kPrincipalY,
  // Brown; the fisheyes have their k1 to k4 from kRadial1 on
  kRadial1,
  kRadial2,
  kRadial3,
  kDecentring1,
  kDecentring2,
  kAffinity,
  kSkew,
  // Radial corrections
  kSymmetryX = 3,
  kSymmetryY,
  kRadialTerms,
  // Corrections by polynomials or Fourier series
  kImageWidth = 3,
  kImageHeight,
  kCorrectionTerms
};

inline constexpr int kMaxIntrinsics = 64;

// What a parameter describes. The prior standard deviation that weak_sigmas() gives it follows from this.
enum class ParameterRole {
  kFocal,           // focal length; its sigma is given by the caller
  kPrincipalPoint,  // 2 % of the width
  kSymmetry,        // centre of symmetry of a radial distortion; 5 % of the width
  kRadial,          // radial term; 0.2 at one focal length from the centre
  kTangential,      // decentring or thin prism; 0.01 at one focal length from the centre
  kAffinity,        // affinity or skew of the pixels; 1 % of the focal length
  kAdditive,        // coefficient of a function over the image; 1 % of the width
  kImageSize        // width or height of the image; fixed
};

enum class ParameterUnit {
  kNone,  // the distortion is in focal lengths
  kPixels,
  kInversePixels  // px to the power of minus `degree`
};

struct CameraParameter {
  std::string name;
  ParameterRole role = ParameterRole::kRadial;
  ParameterUnit unit = ParameterUnit::kNone;
  // Radial: power of the distance in the factor that stretches the image point. Additive: degree or frequency.
  int degree = 0;
  bool fixed = false;             // follows from the size of the image and is never estimated
  bool same_as_rotation = false;  // a rotation of the camera has the same effect, so it is held unless asked for
  bool rare = false;              // zero in most cameras, so it is held unless asked for; such parameters come last
};

// f, cx and cy, with which the parameters of every model begin.
inline std::vector<CameraParameter> common_parameters() {
  return {{"f", ParameterRole::kFocal, ParameterUnit::kPixels},
          {"cx", ParameterRole::kPrincipalPoint, ParameterUnit::kPixels},
          {"cy", ParameterRole::kPrincipalPoint, ParameterUnit::kPixels}};
}
// Appends k1, k2, ... with the powers 2, 4, ... of the distance, as many as there are.
inline void add_radial_terms(int count, std::vector<CameraParameter>& parameters) {
  for (int i = 1; i <= count; ++i)
    parameters.push_back({"k" + std::to_string(i), ParameterRole::kRadial, ParameterUnit::kNone, 2 * i});
}

enum class FieldOfView {
  kFront,    // points with Z > 0
  kWide,     // also directions beyond 90 degrees from the axis
  kPanorama  // all directions; the left and the right border of the image are the same place
};

struct OrderRange {
  std::int32_t lowest = 0, highest = 0;
};

// A camera model of COLMAP: its number in binary files, its name in text files, and its parameters in COLMAP's order,
// separated by blanks. "fx" and "fy" must both be f; the other names are those of the model here. A parameter that the
// model here does not have must be zero.
struct ColmapModel {
  int number;
  const char* name;
  const char* parameters;
};

// Derivatives of a pixel by the model's parameters, one column each. Held in place, without heap memory.
using IntrinsicJacobian = Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::ColMajor, 2, kMaxIntrinsics>;

// A projection with its derivatives by the camera coordinates and by the parameters (zero for fixed ones).
struct ProjectionJacobian {
  bool valid = false;  // otherwise the rest is undefined: the model has no pixel for the point
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 3> by_point;
  IntrinsicJacobian by_intrinsics;
};

template <typename Scalar>
using PixelOf = Eigen::Matrix<Scalar, 2, 1>;
template <typename Scalar>
using PointOf = Eigen::Matrix<Scalar, 3, 1>;

// A pixel's distance from the principal point in focal lengths.
inline Eigen::Vector2d in_focal_lengths(const double* k, const Eigen::Vector2d& pixel) {
  return {(pixel.x() - k[kPrincipalX]) / k[kFocal], (pixel.y() - k[kPrincipalY]) / k[kFocal]};
}

}  // namespace megablock
