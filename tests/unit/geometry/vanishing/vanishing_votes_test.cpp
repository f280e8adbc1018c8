// The vanishing point by votes.
#include "geometry/vanishing/vanishing_votes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/support/geometry/segment_scenes.h"

namespace megablock {
namespace {

using fixture::axis_error_deg;
using fixture::SegmentScene;

TEST(VanishingVotes, MostLinesDecide) {
  SegmentScene scene(5, 0.2);
  scene.add_family(Eigen::Vector3d(0, -2000, 3000), 40, 150, 250);
  scene.add_family(Eigen::Vector3d(3000, 100, 1500), 15, 150, 250);
  scene.add_clutter(10);
  const auto found = vanishing_point_by_votes(scene.planes());
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->norm(), 1, 1e-12);
  EXPECT_LT(axis_error_deg(*found, scene.axes[0]), 0.2);
}

TEST(VanishingVotes, NothingWhereNoTwoLinesMeet) {
  SegmentScene scene(6, 0.2);
  scene.add_family(Eigen::Vector3d(0, -2000, 3000), 3, 150, 250);
  std::vector<InterpretationPlane> planes = scene.planes();
  EXPECT_FALSE(vanishing_point_by_votes({}));
  EXPECT_FALSE(vanishing_point_by_votes(std::span(planes).first(1)));
  EXPECT_FALSE(vanishing_point_by_votes(std::vector<InterpretationPlane>(4, planes[0]))) << "one line, four times";
  planes[1].normal.x() = std::nan("");
  const auto found = vanishing_point_by_votes(planes);
  ASSERT_TRUE(found);
  EXPECT_LT(axis_error_deg(*found, scene.axes[0]), 0.5);
  planes[2].normal.z() = std::nan("");
  EXPECT_FALSE(vanishing_point_by_votes(planes));
}

}  // namespace
}  // namespace megablock
