// Tests the pitch that the command 'verticals' expects of an image, and its remarks about all images.
#include "cluster/commands/verticals_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geometry/numbers/angles.h"
#include "io/simulate/blocks/simulate.h"

namespace megablock {
namespace {

FoundVertical found_at(double roll) {
  FoundVertical picture;
  picture.found = true;
  picture.roll = roll;
  return picture;
}

// By the median of five or more.
TEST(VerticalsCommand, SaysWhereMostAreTurnedTooFar) {
  const std::vector<FoundVertical> held{found_at(0.1), found_at(-0.8), found_at(0.9), found_at(-4), found_at(3)};
  EXPECT_EQ(remark_on(held), "");
  std::vector<FoundVertical> fields{found_at(-1.2), found_at(3), found_at(0.2), found_at(-5)};
  fields.emplace_back().roll = 5;  // shows none
  EXPECT_EQ(remark_on(fields), "");
  fields.push_back(found_at(1.1));
  EXPECT_THAT(remark_on(fields), testing::HasSubstr("turned farther than cameras are held"));
  EXPECT_EQ(remark_on({}), "");
}

// The attitude of the frame is worth more than a given pose, this more than how the camera was held.
TEST(VerticalsCommand, ExpectsDownWhereTheFrameSaysItIs) {
  SimulationOptions options;
  options.scene = SimulationOptions::Scene::kStreet;
  options.frames = 3;
  SimulatedBlock simulated = simulate_block(options);
  Block& block = simulated.block;
  const ImageIndex image(1);
  Frame& frame = block.frames[block.images[image].frame];
  const Eigen::Quaterniond mount = block.mount_of(image).pose.rotation;
  const Eigen::Quaterniond given(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()));
  frame.given_pose = Pose{given, {1, 2, 3}};
  frame.attitude_prior.reset();
  const VerticalPrior by_pose = expected_vertical(block, image);
  EXPECT_LT((by_pose.down - mount * (given * -Eigen::Vector3d::UnitZ())).norm(), 1e-12);
  EXPECT_LT(by_pose.roll_sigma, VerticalPrior().roll_sigma);

  const Eigen::Quaterniond sensor(Eigen::AngleAxisd(0.3, Eigen::Vector3d(-1, 0, 1).normalized()));
  frame.attitude_prior = AttitudePrior{sensor, Eigen::Vector3d::Constant(0.1 * kDegree)};
  const VerticalPrior by_attitude = expected_vertical(block, image);
  EXPECT_LT((by_attitude.down - mount * (sensor * -Eigen::Vector3d::UnitZ())).norm(), 1e-12);
  EXPECT_LT(by_attitude.roll_sigma, by_pose.roll_sigma);

  frame.attitude_prior.reset();
  frame.given_pose.reset();
  block.image_folder = "/nowhere/";
  const VerticalPrior by_camera = expected_vertical(block, image);
  EXPECT_EQ(by_camera.down, Eigen::Vector3d::UnitY());
  EXPECT_EQ(by_camera.roll_sigma, VerticalPrior().roll_sigma);
}

}  // namespace
}  // namespace megablock
