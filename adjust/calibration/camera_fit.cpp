// With v_g the ray of a grid pixel m_g by the given camera, the parameters k of the other model minimise sum
// |project(k, v_g) - m_g|^2 over 17 x 17 pixels. Levenberg-Marquardt steps with the columns scaled to unit length,
//
//     (D N D + lambda I) D^-1 dk = -D g,   D = diag(N)^-1/2,
//
// because the coefficients of high powers have units that differ by many orders of magnitude.
#include "adjust/calibration/camera_fit.h"

#include <cmath>
#include <limits>
#include <vector>

#include "geometry/numbers/decompositions.h"

namespace megablock {

namespace {

struct Sample {
  Eigen::Vector3d ray;
  Eigen::Vector2d pixel;
};

// The corners and edges of the image are in the grid, because that is where models differ. Pixels without a ray by the
// given camera are left out.
std::vector<Sample> grid_of(const Intrinsics& given, int width, int height) {
  constexpr int kCells = 16;
  std::vector<Sample> samples;
  for (int i = 0; i <= kCells; ++i)
    for (int j = 0; j <= kCells; ++j) {
      const Eigen::Vector2d pixel(width * (i + 0.0) / kCells, height * (j + 0.0) / kCells);
      if (const auto ray = viewing_ray(given, pixel)) samples.push_back({*ray, pixel});
    }
  return samples;
}

struct FitEquations {
  Eigen::MatrixXd normal;
  Eigen::VectorXd gradient;
  double squares = 0;
  bool valid = true;
};

// N = sum J'J, g = sum J'r with r = project(k, ray) - pixel, over the free parameters in the order of `parameters`.
FitEquations equations_of(const std::vector<Sample>& samples, const Intrinsics& k, const std::vector<int>& parameters) {
  const auto size = static_cast<Eigen::Index>(parameters.size());
  FitEquations result{Eigen::MatrixXd::Zero(size, size), Eigen::VectorXd::Zero(size)};
  Eigen::MatrixXd row(2, size);
  for (const Sample& s : samples) {
    const ProjectionJacobian p = project_with_jacobian(k, s.ray);
    // A trial camera may fold the image in the corners. Such a step is refused unless the present camera folds too.
    if (!p.valid) {
      result.valid = false;
      continue;
    }
    const Eigen::Vector2d difference = pixel_difference(k, p.pixel, s.pixel);
    for (Eigen::Index i = 0; i < size; ++i) row.col(i) = p.by_intrinsics.col(parameters[static_cast<std::size_t>(i)]);
    result.normal += row.transpose() * row;
    result.gradient += row.transpose() * difference;
    result.squares += difference.squaredNorm();
  }
  return result;
}

}  // namespace

CameraFit fit_camera(const CameraModel& model, ParameterMask free, const Intrinsics& given, int width, int height) {
  constexpr int kMaxSteps = 50;
  // The start has the focal length and the principal point of the given camera and no distortion.
  CameraFit fit{start_intrinsics(model, given[kFocal], width, height)};
  for (int p = kPrincipalX; p <= kPrincipalY; ++p) fit.camera[p] = given[p];
  std::vector<int> parameters;
  for (int p = 0; p < fit.camera.size(); ++p)
    if (contains(free, p) && !is_fixed(model, p)) parameters.push_back(p);
  const std::vector<Sample> samples = grid_of(given, width, height);
  FitEquations current = equations_of(samples, fit.camera, parameters);
  double damping = 1e-6;
  for (int step = 0; step < kMaxSteps && !parameters.empty(); ++step) {
    const Eigen::VectorXd scale =
        current.normal.diagonal().unaryExpr([](double d) { return d > 0 ? 1 / std::sqrt(d) : 1.0; });
    Eigen::MatrixXd scaled = scale.asDiagonal() * current.normal * scale.asDiagonal();
    scaled.diagonal().array() += damping;
    const Eigen::VectorXd move = scale.asDiagonal() * -solve_symmetric(scaled, scale.asDiagonal() * current.gradient);
    Intrinsics next = fit.camera;
    for (std::size_t i = 0; i < parameters.size(); ++i)
      next[static_cast<std::size_t>(parameters[i])] += move[static_cast<Eigen::Index>(i)];
    const FitEquations there = equations_of(samples, next, parameters);
    if (move.allFinite() && (there.valid || !current.valid) && there.squares < current.squares) {
      const bool settled = current.squares - there.squares < 1e-10 * current.squares;
      fit.camera = next;
      current = there;
      damping = std::max(1e-12, 0.1 * damping);
      if (settled) break;
    } else {
      damping *= 10;
      if (damping > 1e6) break;
    }
  }
  fit.rms_px = samples.empty() ? std::numeric_limits<double>::infinity()
                               : std::sqrt(current.squares / static_cast<double>(samples.size()));
  return fit;
}

}  // namespace megablock
