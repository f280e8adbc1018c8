// The observation equation of every camera model against automatic differentiation of its definition.
#include <ceres/dynamic_autodiff_cost_function.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "adjust/terms/ceres_residuals.h"
#include "adjust/terms/linearise.h"
#include "tests/support/geometry/camera_samples.h"

namespace megablock {
namespace {

struct MeasuredImage {
  residual::ImageMeasured image;
  template <typename Scalar>
  bool operator()(const Scalar* const* blocks, Scalar* result) const {
    return image(blocks[0], blocks[1], blocks[2], blocks[3], result);
  }
};

struct EvaluatedImage {
  bool valid;
  Eigen::Vector2d residual;
  std::vector<Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>> jacobians;
};

EvaluatedImage image_by_ceres(const residual::ImageMeasured& image, const std::vector<std::vector<double>>& blocks) {
  ceres::DynamicAutoDiffCostFunction<MeasuredImage, 8> cost(new MeasuredImage{image});
  cost.SetNumResiduals(2);
  EvaluatedImage result;
  std::vector<const double*> values;
  std::vector<double*> jacobians;
  for (const auto& block : blocks) {
    cost.AddParameterBlock(static_cast<int>(block.size()));
    values.push_back(block.data());
    result.jacobians.emplace_back(2, static_cast<Eigen::Index>(block.size()));
  }
  for (auto& jacobian : result.jacobians) jacobians.push_back(jacobian.data());
  result.valid = cost.Evaluate(values.data(), result.residual.data(), jacobians.data());
  return result;
}

std::vector<double> pose_block(const Pose& pose) {
  std::vector<double> values(kPoseBlock);
  to_block(pose, values.data());
  return values;
}

Eigen::MatrixXd in_tangent(const Eigen::MatrixXd& ambient, const Pose& pose) {
  Eigen::Matrix<double, 7, 6, Eigen::RowMajor> plus;
  PoseManifold().PlusJacobian(pose_block(pose).data(), plus.data());
  return ambient * plus;
}

void expect_same_rows(const Eigen::MatrixXd& ours, const Eigen::MatrixXd& reference, const char* what) {
  for (Eigen::Index row = 0; row < ours.rows(); ++row)
    EXPECT_LE((ours.row(row) - reference.row(row)).cwiseAbs().maxCoeff<Eigen::PropagateNaN>(),
              1e-9 * reference.row(row).cwiseAbs().maxCoeff() + 1e-300)
        << what;
}

class CameraModels : public testing::TestWithParam<CameraModel> {};

TEST_P(CameraModels, LineariseAsAutomaticDifferentiation) {
  std::mt19937_64 random(17);
  std::uniform_real_distribution<double> unit(-1, 1);
  const auto vector = [&](double size) {
    return Eigen::Vector3d(size * Eigen::Vector3d(unit(random), unit(random), unit(random)));
  };
  const Intrinsics k = sample_camera(GetParam());
  for (int trial = 0; trial < 30; ++trial) {
    const Pose frame{rotation_exp<double>(vector(2)), Eigen::Vector3d(4e3, -3e3, 50) + vector(100)};
    const Pose mount{rotation_exp<double>(vector(2)), vector(2)};
    const Eigen::Vector2d pixel(960 + 950 * unit(random), 540 + 430 * unit(random));
    const Eigen::Vector3d in_camera = (30 + 20 * unit(random)) * *viewing_ray(k, pixel);
    const Eigen::Vector3d in_rig = mount.rotation.conjugate() * in_camera + mount.centre;
    const Eigen::Vector3d point = frame.rotation.conjugate() * in_rig + frame.centre;
    const Eigen::Vector2d measured = pixel + Eigen::Vector2d(unit(random), unit(random));

    const ImageResidual ours = linearise_image(frame, mount, k, point, measured, 2);
    const EvaluatedImage reference =
        image_by_ceres({GetParam(), measured, 2},
                       {pose_block(frame), pose_block(mount), {k.begin(), k.end()}, {point.x(), point.y(), point.z()}});
    ASSERT_TRUE(ours.in_front);
    ASSERT_TRUE(reference.valid);
    EXPECT_LT((ours.residual - reference.residual).norm(), 1e-9);
    expect_same_rows(ours.by_frame, in_tangent(reference.jacobians[0], frame), "frame");
    expect_same_rows(ours.by_mount, in_tangent(reference.jacobians[1], mount), "mount");
    expect_same_rows(ours.by_point, reference.jacobians[3], "point");
    ASSERT_EQ(ours.by_intrinsics.cols(), k.size());
    for (int p = 0; p < k.size(); ++p) {
      const bool size_of_image =
          contains(parameters_with(GetParam(), ParameterRole::kImageSize), p);  // never an unknown
      const double scale = reference.jacobians[2].col(p).cwiseAbs().maxCoeff();
      if (size_of_image) continue;
      EXPECT_LE((ours.by_intrinsics.col(p) - reference.jacobians[2].col(p)).cwiseAbs().maxCoeff<Eigen::PropagateNaN>(),
                1e-9 * scale)
          << parameter_name(GetParam(), p);
    }
  }
}

TEST_P(CameraModels, RefuseWhatTheyDoNotSee) {
  const Intrinsics k = sample_camera(GetParam());
  for (const Eigen::Vector3d& point : {Eigen::Vector3d(0, 0, -3), Eigen::Vector3d(0, 2, 0)}) {
    const bool sees = is_panorama(GetParam()) ? point.z() < 0 : sees_sideways(GetParam()) && point.z() == 0;
    EXPECT_EQ(linearise_image({}, {}, k, point, {5, 5}, 1).in_front, sees) << point.transpose();
    EXPECT_EQ(image_by_ceres(
                  {GetParam(), {5, 5}, 1},
                  {pose_block(Pose()), pose_block(Pose()), {k.begin(), k.end()}, {point.x(), point.y(), point.z()}})
                  .valid,
              sees)
        << point.transpose();
  }
}

INSTANTIATE_TEST_SUITE_P(All, CameraModels, testing::ValuesIn(every_model()), [](const auto& p) {
  std::string name = model_name(p.param);
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
});

}  // namespace
}  // namespace megablock
