#include "io/project/append.h"

#include <gmock/gmock.h>

#include "io/base/error.h"
#include "io/block/crs.h"
#include "io/project/project.h"
#include "tests/support/io/image_names.h"

namespace megablock {
namespace {

// One image per name, and one camera per first letter of the names. Position priors lie east of the origin.
Block block_of(const std::vector<std::string>& names, const GroundFrame& ground) {
  Block block;
  block.ground = ground;
  std::vector<std::string> cameras;
  for (const std::string& name : names) {
    const std::string camera_name = name.substr(0, 1);
    auto found = std::find(cameras.begin(), cameras.end(), camera_name);
    if (found == cameras.end()) {
      Camera camera;
      camera.name = camera_name;
      camera.width = camera.height = 100;
      camera.intrinsics[kFocal] = 100;
      block.rigs.push_back({camera_name, {Mount{block.cameras.next_index(), {}}}});
      block.cameras.push_back(camera);
      cameras.push_back(camera_name);
      found = cameras.end() - 1;
    }
    Frame frame;
    frame.name = name;
    frame.rig = RigIndex(found - cameras.begin());
    frame.position_prior = PositionPrior{{static_cast<double>(name.back()), 2, 3}};
    frame.attitude_prior = AttitudePrior{};
    frame.given_pose = Pose{Eigen::Quaterniond::Identity(), {1, 2, static_cast<double>(name.back())}};
    block.add_image(name, {block.frames.next_index(), 0, 0});
    block.frames.push_back(frame);
  }
  ControlPoint point;
  point.name = "p";
  point.position = {5, 6, 7};
  point.measurements.push_back({ImageIndex(static_cast<std::int64_t>(names.size()) - 1), {1, 2}, 0.5});
  block.control_points.push_back(point);
  KnownLine line;
  line.name = "edge";
  line.measurements.push_back({point.measurements.front().image, {1, 2}, {3, 90}, 1});
  block.lines.push_back(line);
  block.verticals.push_back(
      {point.measurements.front().image, Eigen::Vector3d::UnitY(), Eigen::Matrix3d::Identity(), {}, {}});
  return block;
}

const GroundFrame kHere{true, 46.84, -91.99, 200, "EPSG:4979"};
const GroundFrame kThere{true, 46.93, -91.9, 250, "EPSG:4979"};

TEST(AppendTo, OldIndicesStayNewImagesFollow) {
  const Block previous = block_of({"b1", "b2", "c1"}, kHere);
  const Block merged = append_to(previous, block_of({"a1", "b1", "b15", "b2", "c1"}, kHere));
  EXPECT_THAT(image_names(merged), ::testing::ElementsAre("b1", "b2", "c1", "a1", "b15"));
  EXPECT_NO_THROW(check(merged));
  for (std::size_t i = 0; i < merged.images.size(); ++i) {
    const ImageIndex image(static_cast<std::int64_t>(i));
    EXPECT_EQ(merged.frames[merged.images[image].frame].name, merged.name_of(image));
    EXPECT_EQ(merged.cameras[merged.camera_of(image)].name, merged.name_of(image).substr(0, 1));
  }
  EXPECT_EQ(merged.cameras[CameraIndex(2)].name, "a");
  EXPECT_EQ(merged.name_of(merged.control_points[0].measurements[0].image), "c1");
}

TEST(ImageNames, DifferInWhateverOrder) {
  const std::vector<std::vector<std::string>> sound = {{"a1"}, {"a1", "a2", "b1"}, {"b1", "a2", "a1"}};
  for (const auto& names : sound) EXPECT_NO_THROW(check(block_of(names, kHere)));
  const std::vector<std::vector<std::string>> twice = {{"a1", "a1"}, {"a1", "b1", "a1"}, {"b1", "a1", "a2", "a1"}};
  for (const auto& names : twice) EXPECT_THROW(check(block_of(names, kHere)), InputError);
}

TEST(AppendTo, TablesMayLeaveMemoryBehindOneAnother) {
  int tables = 0;
  const Block previous = block_of({"b1", "b2"}, kHere);
  const Block merged = append_to(previous, previous, [&] { ++tables; });
  EXPECT_GT(tables, 0);
  EXPECT_THAT(image_names(merged), ::testing::ElementsAre("b1", "b2"));
}

TEST(AppendTo, MeasurementsFollowTheirImages) {
  const Block now = block_of({"a1", "b1", "b15", "b2"}, kHere);
  const Block merged = append_to(block_of({"b1", "b2", "c1"}, kHere), now);
  ASSERT_EQ(merged.verticals.size(), 1u);
  EXPECT_EQ(merged.name_of(merged.verticals.front().image), "b2");
  ASSERT_EQ(merged.lines.size(), 1u);
  EXPECT_EQ(merged.name_of(merged.lines.front().measurements.front().image), "b2");
  EXPECT_EQ(merged.name_of(merged.control_points.front().measurements.front().image), "b2");
}

TEST(AppendTo, ContentsAreTheNewOnes) {
  Block now = block_of({"b1", "b2"}, kHere);
  now.cameras[CameraIndex(0)].intrinsics[kFocal] = 123;
  now.frames[FrameIndex(1)].position_prior.reset();
  now.image_folder = "/moved/";
  const Block merged = append_to(block_of({"b1", "b2"}, kHere), now);
  EXPECT_EQ(merged.image_folder, "/moved/");
  EXPECT_EQ(merged.cameras[CameraIndex(0)].intrinsics[kFocal], 123);
  EXPECT_FALSE(merged.frames[FrameIndex(1)].position_prior);
}

TEST(AppendTo, RemovedImagesStayAndAreNoticed) {
  const Block previous = block_of({"b1", "b2"}, kHere), now = block_of({"b2"}, kHere);
  EXPECT_THAT(image_names(append_to(previous, now)), ::testing::ElementsAre("b1", "b2"));
  EXPECT_FALSE(has_all_images_of(previous, now));
  EXPECT_TRUE(has_all_images_of(now, previous));
  EXPECT_TRUE(has_all_images_of(previous, previous));
  EXPECT_TRUE(has_all_images_of(previous, block_of({"b2", "c1", "b1"}, kHere)));
}

TEST(AppendTo, ABlockThatHasNotGrownIsTheOneGivenNow) {
  const Block previous = block_of({"b1", "b2"}, kHere);
  Block now = previous;
  now.image_folder = "/moved/";
  now.frames[FrameIndex(1)].position_prior.reset();
  now.ground.crs = "EPSG:4326";
  SeenVertical second = now.verticals.front(), first = second;
  first.image = ImageIndex(0);
  now.verticals = {second, first};
  const Block merged = append_to(previous, now);
  EXPECT_THAT(image_names(merged), ::testing::ElementsAre("b1", "b2"));
  EXPECT_EQ(merged.image_folder, "/moved/");
  EXPECT_FALSE(merged.frames[FrameIndex(1)].position_prior);
  EXPECT_EQ(merged.ground.crs, previous.ground.crs);
  EXPECT_EQ(merged.verticals[0].image, ImageIndex(0));
}

TEST(AppendTo, TheGroundFrameStaysThePreviousOne) {
  const Block now = block_of({"b1", "b2"}, kThere);
  const Block merged = append_to(block_of({"b1"}, kHere), now);
  EXPECT_EQ(merged.ground.latitude_deg, kHere.latitude_deg);
  const Georeference here(kHere), there(kThere);
  const FrameIndex frame(1);
  const auto difference = [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    return (a - here.to_local(there.to_geodetic(b))).norm();
  };
  EXPECT_LT(difference(merged.frames[frame].position_prior->position, now.frames[frame].position_prior->position),
            1e-6);
  EXPECT_LT(difference(merged.frames[frame].given_pose->centre, now.frames[frame].given_pose->centre), 1e-6);
  EXPECT_LT(difference(merged.control_points[0].position, now.control_points[0].position), 1e-6);
  // A point 50 m along the camera's axis keeps its camera coordinates.
  const Pose &before = *now.frames[frame].given_pose, &after = *merged.frames[frame].given_pose;
  const Eigen::Vector3d point(20, -10, 50);
  const Eigen::Vector3d moved = here.to_local(there.to_geodetic(point));
  EXPECT_LT((to_inside(after, moved) - to_inside(before, point)).norm(), 1e-6);
  EXPECT_LT(rotation_angle(after.rotation, merged.frames[frame].attitude_prior->rotation_cw), 1e-12);
}

// Images that were there keep the very bits of their priors, whatever the new origin.
TEST(AppendTo, AnotherOriginChangesNoBitOfWhatWasThere) {
  const Block previous = block_of({"b1", "b2"}, kHere);
  const Georeference here(kHere), there(kThere);
  Block now = block_of({"a0", "b1", "b2"}, kThere);
  const Eigen::Quaterniond turn = here.own_from_block({kThere.latitude_deg, kThere.longitude_deg, kThere.height_m});
  for (const FrameIndex f : {FrameIndex(1), FrameIndex(2)}) {
    const Frame& former = previous.frames[FrameIndex(f.value - 1)];
    Frame& frame = now.frames[f];
    frame.position_prior->position = there.to_local(here.to_geodetic(former.position_prior->position));
    frame.attitude_prior->rotation_cw = former.attitude_prior->rotation_cw * turn.conjugate();
    frame.given_pose = Pose{former.given_pose->rotation * turn.conjugate(),
                            there.to_local(here.to_geodetic(former.given_pose->centre))};
  }
  const Block merged = append_to(previous, now);
  for (const FrameIndex f : {FrameIndex(0), FrameIndex(1)}) {
    EXPECT_EQ(merged.frames[f].position_prior->position, previous.frames[f].position_prior->position);
    EXPECT_EQ(merged.frames[f].attitude_prior->rotation_cw.coeffs(),
              previous.frames[f].attitude_prior->rotation_cw.coeffs());
    EXPECT_EQ(merged.frames[f].given_pose->centre, previous.frames[f].given_pose->centre);
    EXPECT_EQ(merged.frames[f].given_pose->rotation.coeffs(), previous.frames[f].given_pose->rotation.coeffs());
  }
}

}  // namespace
}  // namespace megablock
