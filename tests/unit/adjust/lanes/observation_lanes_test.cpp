// Observations in lanes: equal to one at a time, with the same bits on all processors.
#include "adjust/lanes/observation_lanes.h"

#include <gtest/gtest.h>

#include <random>

#include "geometry/transform/rotation.h"

namespace megablock {
namespace {

class Lanes : public testing::Test {
 protected:
  // Views and points that see each other, but for every seventh, which lies behind its camera.
  void fill(std::int64_t count) {
    std::mt19937_64 random(7);
    std::normal_distribution<double> normal;
    const auto vector = [&] { return Eigen::Vector3d(normal(random), normal(random), normal(random)); };
    for (std::int64_t i = 0; i < count; ++i) {
      const Pose frame{rotation_exp<double>(vector()), 100 * vector()},
          mount{rotation_exp<double>(0.3 * vector()), 0.2 * vector()};
      views_.emplace_back(frame, mount, camera_);
      const double depth = i % 7 == 3 ? -20 : 20;
      const Eigen::Vector3d in_camera = depth * Eigen::Vector3d(0.3 * normal(random), 0.3 * normal(random), 1);
      const ImageView& view = views_.back();
      points_.push_back(view.centre + view.rotation.transpose() * (in_camera + view.shift));
      measured_.emplace_back(1000 + 300 * normal(random), 800 + 300 * normal(random));
      inverse_sigma_.push_back(1 + std::abs(normal(random)));
    }
    for (const ImageView& view : views_) lane_views_.emplace_back(view);
  }
  void put(ObservationLanes& lanes) const {
    lanes.reserve(std::ssize(points_));
    for (std::size_t i = 0; i < points_.size(); ++i)
      lanes.add(lane_views_[i], points_[i], measured_[i].x(), measured_[i].y(), inverse_sigma_[i]);
  }

  const Intrinsics camera_{1500, 1010, 790, -0.11, 0.04, -0.007, 6e-4, -3e-4, 5.5, -2.5};
  std::vector<ImageView> views_;
  std::vector<LaneView> lane_views_;
  std::vector<Eigen::Vector3d> points_;
  std::vector<Eigen::Vector2d> measured_;
  std::vector<double> inverse_sigma_;
};

TEST_F(Lanes, AreLinearisedAsSingleObservations) {
  fill(21);
  ObservationLanes lanes, projected;
  put(lanes);
  lanes.linearise();
  put(projected);
  projected.project();
  for (std::int64_t i = 0; i < lanes.size(); ++i) {
    const auto row = static_cast<std::size_t>(i);
    CameraResidual single;
    if (!linearise_in_camera(views_[row], points_[row], measured_[row], inverse_sigma_[row], false, single)) {
      EXPECT_EQ(i % 7, 3);
      EXPECT_FALSE(lanes.residual(i).allFinite());
      EXPECT_FALSE(projected.residual(i).allFinite());
      continue;
    }
    const Eigen::Matrix<double, 2, 3> by_point = single.by_camera * views_[row].rotation;
    EXPECT_LT((lanes.residual(i) - single.residual).norm(), 1e-12 * single.residual.norm());
    EXPECT_LT((lanes.by_point(i) - by_point).norm(), 1e-12 * by_point.norm());
    EXPECT_EQ(lanes.from_frame(i), single.from_frame);
    EXPECT_EQ(lanes.residual(i), projected.residual(i));
  }
}

TEST_F(Lanes, HaveTheSameBitsInVectorsOfAllWidths) {
  fill(64);
  ObservationLanes narrow(*lane_kernels_of_width(2));
  put(narrow);
  narrow.linearise();
  for (const int width : {4, 8}) {
    const lane_kernels::Kernels* kernels = lane_kernels_of_width(width);
    if (kernels == nullptr) continue;  // not on this processor
    ObservationLanes wide(*kernels);
    put(wide);
    wide.linearise();
    for (std::int64_t i = 0; i < narrow.size(); ++i) {
      EXPECT_EQ(std::isfinite(narrow.residual(i).x()), std::isfinite(wide.residual(i).x()));
      if (!narrow.residual(i).allFinite()) continue;
      EXPECT_EQ(narrow.residual(i), wide.residual(i)) << width;
      EXPECT_EQ(narrow.by_point(i), wide.by_point(i)) << width;
    }
  }
}

}  // namespace
}  // namespace megablock
