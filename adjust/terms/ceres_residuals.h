// Gives the residuals of a tile for Ceres' automatic differentiation. They are written from the definitions in
// tile_problem.h alone, independently of linearise.cpp, so that each can be checked against the other.
//
// A frame or mount has a parameter block of 7 numbers (quaternion w, x, y, z, then centre), a camera as many as its
// model has parameters (Intrinsics), and a point 3. PoseManifold gives a pose the tangent increment of this project
// (PoseIncrement, right perturbation). Jacobians, gradients and steps that Ceres reports in tangent space therefore
// have the six columns of a frame in our order and sign.
#pragma once

#include <ceres/jet.h>
#include <ceres/manifold.h>

#include <Eigen/LU>

#include "adjust/problem/tile_problem.h"

namespace megablock {

inline constexpr int kPoseBlock = 7;

class PoseManifold : public ceres::Manifold {
 public:
  int AmbientSize() const override { return kPoseBlock; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;
  bool Minus(const double* y, const double* x, double* y_minus_x) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;
};

// The derivatives of the quaternion (w, x, y, z) by the right perturbation are this matrix / 4, transposed. The
// derivative of the perturbation by the quaternion is the matrix itself.
Eigen::Matrix<double, 3, 4> quaternion_to_tangent(const double* quaternion_wxyz);

void to_block(const Pose& pose, double* block);
Pose from_block(const double* block);

namespace residual {

template <typename Scalar>
using Vector3 = Eigen::Matrix<Scalar, 3, 1>;

template <typename Scalar>
Eigen::Quaternion<Scalar> rotation_of(const Scalar* pose) {
  return Eigen::Quaternion<Scalar>(pose[0], pose[1], pose[2], pose[3]);
}
template <typename Scalar>
Vector3<Scalar> centre_of(const Scalar* pose) {
  return Vector3<Scalar>(pose[4], pose[5], pose[6]);
}

inline double value_of(double x) { return x; }
template <typename T, int kSize>
double value_of(const ceres::Jet<T, kSize>& x) {
  return x.a;
}

// Finds the pixel m with m + d(m) = `straight`. Starting from its value, it takes Newton steps with the derivative of d
// by automatic differentiation: the first step gives m its derivatives, and the second shows that the value was a
// solution.
template <typename Model, typename Scalar>
Eigen::Matrix<Scalar, 2, 1> corrected_pixel(int order, const Intrinsics& plain, const Scalar* camera,
                                            const Eigen::Vector2d& value, const Eigen::Matrix<Scalar, 2, 1>& straight) {
  using Jet = ceres::Jet<double, 2>;
  Eigen::Matrix<Scalar, 2, 1> pixel(Scalar(value.x()), Scalar(value.y()));
  for (int step = 0; step < 2; ++step) {
    const Eigen::Matrix<Jet, 2, 1> at(Jet(value_of(pixel.x()), 0), Jet(value_of(pixel.y()), 1));
    const Eigen::Matrix<Jet, 2, 1> d = Model::template correction<Jet>(order, plain.data(), at);
    Eigen::Matrix2d jacobian;
    jacobian << 1 + d.x().v[0], d.x().v[1], d.y().v[0], 1 + d.y().v[1];
    const Eigen::Matrix2d inverse = jacobian.inverse();
    const Eigen::Matrix<Scalar, 2, 1> open =
        straight - pixel - Model::template correction<Scalar>(order, camera, pixel);
    for (int i = 0; i < 2; ++i) pixel[i] += inverse(i, 0) * open[0] + inverse(i, 1) * open[1];
  }
  return pixel;
}

// The image observation. The perspective models are written as templates and give the pixel with its derivatives. A
// model that corrects the measured pixel gives the pixel only implicitly (corrected_pixel).
struct ImageMeasured {
  CameraModel model;
  Eigen::Vector2d measured;
  double inverse_sigma;
  template <typename Scalar>
  bool operator()(const Scalar* frame, const Scalar* mount, const Scalar* camera, const Scalar* point,
                  Scalar* result) const {
    const Vector3<Scalar> ground(point[0], point[1], point[2]);
    const Vector3<Scalar> in_rig = to_inside<Scalar>(rotation_of(frame), centre_of(frame), ground);
    const Vector3<Scalar> in_camera = to_inside<Scalar>(rotation_of(mount), centre_of(mount), in_rig);
    Eigen::Matrix<Scalar, 2, 1> pixel;
    if (!project_point(camera, in_camera, pixel)) return false;
    const Eigen::Matrix<Scalar, 2, 1> difference = pixel_difference(model, camera, pixel, measured);
    result[0] = difference.x() * inverse_sigma;
    result[1] = difference.y() * inverse_sigma;
    return true;
  }

  // Returns false where the model has no pixel for the point.
  template <typename Scalar>
  bool project_point(const Scalar* camera, const Vector3<Scalar>& point, Eigen::Matrix<Scalar, 2, 1>& pixel) const {
    // The default model is Brown's. It goes without the table, and without the detour by the plain value.
    if (model == CameraModel()) {
      if (!(point.z() > Scalar(0))) return false;
      pixel = BrownModel::project<Scalar>(0, camera, point);
      return true;
    }
    Intrinsics plain(model);
    for (int p = 0; p < plain.size(); ++p) plain[p] = value_of(camera[p]);
    const Eigen::Vector2d value =
        project(plain, Eigen::Vector3d(value_of(point.x()), value_of(point.y()), value_of(point.z())));
    if (!value.allFinite()) return false;
    pixel = with_model(model.kind, [&]<typename Model>(std::type_identity<Model>) {
      if constexpr (Model::kCorrectsPixels)
        return corrected_pixel<Model>(model.order, plain, camera, value,
                                      PinholeModel::project<Scalar>(0, camera, point));
      else
        return Model::template project<Scalar>(model.order, camera, point);
    });
    return true;
  }
};

// r = (C + R' (l + c) + o - P) / sigma, with the receiver at c and the shift o of the group, where there are any.
struct PositionMeasured {
  PositionPrior prior;
  bool has_receiver = false;  // of one mount, whether it is the receiver
  template <typename Scalar>
  bool operator()(const Scalar* frame, Scalar* result) const {
    return differ<Scalar>(frame, nullptr, nullptr, result);
  }
  template <typename Scalar>
  bool operator()(const Scalar* frame, const Scalar* mount, Scalar* result) const {
    return differ<Scalar>(frame, has_receiver ? mount : nullptr, has_receiver ? nullptr : mount, result);
  }
  template <typename Scalar>
  bool operator()(const Scalar* frame, const Scalar* receiver, const Scalar* group, Scalar* result) const {
    return differ<Scalar>(frame, receiver, group, result);
  }
  template <typename Scalar>
  bool differ(const Scalar* frame, const Scalar* receiver, const Scalar* group, Scalar* result) const {
    Vector3<Scalar> in_rig = prior.lever_arm.cast<Scalar>(), shift = Vector3<Scalar>::Zero();
    if (receiver) in_rig += centre_of(receiver);
    if (group) shift = prior.shifted.cast<Scalar>().cwiseProduct(centre_of(group));
    const Vector3<Scalar> arm = rotation_of(frame).conjugate() * in_rig + shift;
    for (int i = 0; i < 3; ++i) result[i] = (frame[4 + i] - prior.position[i] + arm[i]) / prior.sigma[i];
    return true;
  }
};

// r = Log(R R_0') / sigma, and with a receiver of the rotation R_m r = Log(R (R_m' R_0)') / sigma.
struct AttitudeMeasured {
  AttitudePrior prior;
  template <typename Scalar>
  bool operator()(const Scalar* frame, Scalar* result) const {
    return differ<Scalar>(rotation_of(frame) * prior.rotation_cw.cast<Scalar>().conjugate(), result);
  }
  template <typename Scalar>
  bool operator()(const Scalar* frame, const Scalar* receiver, Scalar* result) const {
    return differ<Scalar>(rotation_of(frame) * prior.rotation_cw.cast<Scalar>().conjugate() * rotation_of(receiver),
                          result);
  }
  template <typename Scalar>
  bool differ(const Eigen::Quaternion<Scalar>& difference, Scalar* result) const {
    const Vector3<Scalar> w = rotation_log<Scalar>(difference);
    for (int i = 0; i < 3; ++i) result[i] = w[i] / prior.sigma_rad[i];
    return true;
  }
};

// r = Log(R_to R_from' R_m') / sigma and (R_from (C_to - C_from) - T_m) / sigma.
struct RelativeMeasured {
  TileProblem::RelativeTerm term;
  template <typename Scalar>
  bool operator()(const Scalar* from, const Scalar* to, Scalar* result) const {
    const Eigen::Quaternion<Scalar> measured = term.pose.rotation.cast<Scalar>();
    const Vector3<Scalar> w =
        rotation_log<Scalar>(rotation_of(to) * rotation_of(from).conjugate() * measured.conjugate());
    const Vector3<Scalar> base = to_inside<Scalar>(rotation_of(from), centre_of(from), centre_of(to));
    for (int i = 0; i < 3; ++i) {
      result[i] = w[i] / term.rotation_sigma_rad;
      result[3 + i] = (base[i] - term.pose.centre[i]) / term.position_sigma_m;
    }
    return true;
  }
};

// The residual of line_terms.h. Both parts are zero where nothing is observed (linearise_line): 1e-12 is the square of
// the smallest sine of line_terms.cpp.
template <typename Scalar>
Scalar off_direction(const TileProblem::LineTerm& term, const Vector3<Scalar>& direction) {
  const Vector3<Scalar> normal = term.middle.cast<Scalar>().cross(direction);
  const Scalar squares = normal.squaredNorm();
  if (squares < Scalar(1e-12)) return Scalar(0);
  return direction.dot(term.across.cast<Scalar>()) * term.weight / sqrt(squares);
}

// v = R z.
struct VerticalLine {
  TileProblem::LineTerm term;
  template <typename Scalar>
  bool operator()(const Scalar* frame, Scalar* result) const {
    const Vector3<Scalar> up = term.up.cast<Scalar>();
    const Vector3<Scalar> direction = rotation_of(frame) * up;
    result[0] = off_direction(term, direction);
    return true;
  }
};

// v = R d, d = N x z / |N x z|, N = R_o' n_o.
struct HorizontalLine {
  TileProblem::LineTerm term;
  template <typename Scalar>
  bool operator()(const Scalar* frame, const Scalar* other, Scalar* result) const {
    const Vector3<Scalar> up = term.up.cast<Scalar>(), seen = term.other_normal.cast<Scalar>();
    const Vector3<Scalar> normal = rotation_of(other).conjugate() * seen;
    const Vector3<Scalar> horizontal = normal.cross(up);
    const Scalar squares = horizontal.squaredNorm();
    result[0] = Scalar(0);
    if (squares < Scalar(1e-12)) return true;
    const Vector3<Scalar> unit = horizontal / sqrt(squares);
    const Vector3<Scalar> direction = rotation_of(frame) * unit;
    result[0] = off_direction(term, direction);
    return true;
  }
};

// The residual of vertical_terms.h.
struct VerticalSeen {
  TileProblem::VerticalTerm term;
  template <typename Scalar>
  bool operator()(const Scalar* frame, const Scalar* mount, const Scalar* camera, Scalar* result) const {
    const Vector3<Scalar> ground = term.ground.cast<Scalar>();
    const Vector3<Scalar> in_rig = rotation_of(frame) * ground;
    const Vector3<Scalar> down = rotation_of(mount) * in_rig;
    // The bound keeps the root finite where the image looks up. linearise_vertical() has the same bound.
    const Scalar sum = term.seen.cast<Scalar>().dot(down) + Scalar(1);
    const Scalar stretch = sqrt(Scalar(2) / (sum > Scalar(1e-9) ? sum : Scalar(1e-9)));
    for (int i = 0; i < 2; ++i) {
      result[i] = stretch * term.weight.row(i).cast<Scalar>().dot(down);
      for (int p = 0; p < term.camera.size(); ++p) result[i] -= term.by_camera(i, p) * (camera[p] - term.camera[p]);
    }
    return true;
  }
  template <typename Scalar>
  bool operator()(const Scalar* frame, const Scalar* mount, Scalar* result) const {
    return (*this)(frame, mount, static_cast<const Scalar*>(nullptr), result);
  }
};

// r = (X - X_0) / sigma. An axis without a sigma has an infinite one and gives r = 0.
struct PointKnown {
  TileProblem::PointTerm term;
  template <typename Scalar>
  bool operator()(const Scalar* point, Scalar* result) const {
    for (int i = 0; i < 3; ++i) result[i] = (point[i] - term.position[i]) * (1 / term.sigma[i]);
    return true;
  }
};

// r = (k - k_0) / sigma. A parameter that is held, or has no prior, gives r = 0 and counts for nothing.
struct IntrinsicsKnown {
  TileProblem::IntrinsicTerm term;
  template <typename Scalar>
  bool operator()(const Scalar* camera, Scalar* result) const {
    for (int p = 0; p < term.value.size(); ++p) {
      const auto k = static_cast<std::size_t>(p);
      const double sigma = term.sigma[k];
      result[k] = (camera[k] - term.value[k]) * (sigma > 0 ? 1 / sigma : 0.0);
    }
    return true;
  }
};

// r = Log(R R_0') / sigma, (C - C_0) / sigma.
struct MountKnown {
  TileProblem::MountTerm term;
  template <typename Scalar>
  bool operator()(const Scalar* mount, Scalar* result) const {
    const Eigen::Quaternion<Scalar> reference = term.value.rotation.cast<Scalar>();
    const Vector3<Scalar> w = rotation_log<Scalar>(rotation_of(mount) * reference.conjugate());
    for (int i = 0; i < 3; ++i) {
      result[i] = w[i] / term.rotation_sigma_rad;
      result[3 + i] = (mount[4 + i] - term.value.centre[i]) / term.position_sigma_m;
    }
    return true;
  }
};

}  // namespace residual
}  // namespace megablock
