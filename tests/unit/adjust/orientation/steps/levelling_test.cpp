#include "adjust/orientation/steps/levelling.h"

#include <gtest/gtest.h>

#include "geometry/numbers/angles.h"

namespace megablock {
namespace {

const Eigen::Vector3d kEast = Eigen::Vector3d::UnitX(), kUp = Eigen::Vector3d::UnitZ();

TEST(Levelling, TurnsAboutTheAxisAlone) {
  const Eigen::Vector3d axis = Eigen::Vector3d(1, 2, 0.5).normalized(), from(0.3, -0.8, 0.2), to(-1, 0.1, 0.7);
  const Eigen::Quaterniond turn = turn_about(axis, from, to);
  EXPECT_LT((turn * axis - axis).norm(), 1e-14);
  const auto across = [&](const Eigen::Vector3d& v) { return Eigen::Vector3d(v - axis * axis.dot(v)).normalized(); };
  EXPECT_LT((across(turn * from) - across(to)).norm(), 1e-14);
}

TEST(Levelling, NadirImagesLookDownAndStreetImagesStand) {
  // A strip to the east: the images look down, their y axes point north, 100 m above ground.
  const MeanAxes nadir{-kUp, Eigen::Vector3d::UnitY()};
  EXPECT_EQ(which_points_down(nadir, kEast, 100), nadir.view);
  // A walk to the east that looks to the north at façades 10 m away.
  const MeanAxes walk{Eigen::Vector3d::UnitY(), -kUp};
  EXPECT_EQ(which_points_down(walk, kEast, 10), walk.down);
  // A walk that looks ahead: the viewing direction is along the line and says nothing.
  const MeanAxes ahead{kEast, -kUp};
  EXPECT_EQ(which_points_down(ahead, kEast, 100), ahead.down);
  // A strip whose images are turned in all directions: their y axes cancel out.
  const MeanAxes turned{-kUp, Eigen::Vector3d::Zero()};
  EXPECT_EQ(which_points_down(turned, kEast, 10), turned.view);
}

}  // namespace
}  // namespace megablock
