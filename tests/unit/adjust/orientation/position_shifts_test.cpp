// Blocks of known places whose positions have one datum, two or three.
#include "adjust/orientation/position_shifts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "adjust/orientation/position_offset.h"
#include "geometry/transform/rotation.h"
#include "io/block/observed_poses.h"

namespace megablock {
namespace {

using testing::HasSubstr;

// Strips of ten frames, 20 m apart, in three heights. The positions scatter by `scatter_m`, and state `sigma_m`.
struct Flight {
  Block block;
  BlockState state;
  std::vector<FrameIndex> frames;

  explicit Flight(std::int64_t count, double scatter_m = 0.3, double sigma_m = 0.5, std::uint64_t seed = 1) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> gauss;
    Camera camera;
    camera.width = camera.height = 1000;
    block.cameras.push_back(camera);
    block.rigs.push_back({"rig", {Mount{CameraIndex(0), {}}}});
    for (std::int64_t i = 0; i < count; ++i) {
      const Eigen::Vector3d place(20.0 * static_cast<double>(i % 10), 20.0 * static_cast<double>(i / 10),
                                  100 + 5.0 * static_cast<double>(i % 3));
      Frame frame;
      frame.name = "f" + std::to_string(i);
      frame.rig = RigIndex(0);
      PositionPrior prior;
      prior.position = place;
      for (double& v : prior.position) v += scatter_m * gauss(random);
      prior.sigma.setConstant(sigma_m);
      frame.position_prior = prior;
      block.frames.push_back(frame);
      block.add_image(frame.name + ".jpg", {FrameIndex(i), 0, 0});
      state.frames.push_back({Eigen::Quaterniond::Identity(), place});
      state.oriented.push_back(1);
      frames.emplace_back(i);
    }
    state.mounts.push_back({Pose{}});
  }
  PositionPrior& prior(std::int64_t frame) { return *block.frames[FrameIndex(frame)].position_prior; }
  PositionShifts find() const { return find_position_shifts(block, state, frames); }
};

// The shift is found whatever the block's own datum is. Each side is a strip: along it the shift looks like a tilt.
TEST(PositionShifts, OfOneSideOfAStrip) {
  Flight flight(20);
  for (std::int64_t i = 12; i < 20; ++i) flight.prior(i).position.z() += 30;
  const Similarity datum{1.1, Eigen::Quaterniond(rotation_exp<double>(Eigen::Vector3d(0.1, -0.2, 0.3))), {5, 7, -60}};
  for (Pose& pose : flight.state.frames) pose = datum(pose);
  const PositionShifts found = flight.find();
  ASSERT_EQ(found.groups.size(), 1u);
  const PositionShift& shift = found.groups.front();
  EXPECT_EQ(shift.frames, std::vector(flight.frames.begin() + 12, flight.frames.end()));
  EXPECT_EQ(shift.others, 12u);
  EXPECT_EQ(shift.offset.head<2>(), Eigen::Vector2d::Zero());
  EXPECT_NEAR(shift.offset.z(), 30, 1.5);
  EXPECT_EQ(shift.shifted, (ShiftAxes(0, 0, 1)));
  for (const FrameIndex f : flight.frames)
    if (f.value < 12) {
      const Eigen::Vector3d moved = found.to_others(flight.state.frames[f]).centre;
      EXPECT_LT((moved - flight.prior(f.value).position).norm(), 2.5);
    }
  EXPECT_THAT(shift_text(flight.block, shift),
              testing::MatchesRegex("8 positions [(]images from f12 on[)] lie [0-9.]+ m "
                                    "above the 12 of the largest group: f12, f13, f14, f15, f16 and "
                                    "3 more; flights or receivers .*"));
}

// On a line nothing tells the turn about it, which must stay.
TEST(PositionShifts, OfADriveDoNotTurnTheBlock) {
  Flight drive(40, 0.05, 0.1);
  for (std::int64_t i = 0; i < 40; ++i) {
    const Eigen::Vector3d place(3.0 * static_cast<double>(i), 0.01 * static_cast<double>(i % 3), 2);
    drive.prior(i).position += place - drive.state.frames[FrameIndex(i)].centre;
    drive.state.frames[FrameIndex(i)].centre = place + Eigen::Vector3d(1, 2, 3);
    if (i >= 25) drive.prior(i).position += Eigen::Vector3d(0, 4, 0);
  }
  const PositionShifts found = drive.find();
  ASSERT_EQ(found.groups.size(), 1u);
  EXPECT_NEAR(found.groups[0].offset.y(), 4, 0.2);
  EXPECT_LT(found.to_others.rotation.angularDistance(Eigen::Quaterniond::Identity()), 0.005);
  for (const FrameIndex f : {FrameIndex(0), FrameIndex(39)}) {
    const Eigen::Vector3d& centre = drive.state.frames[f].centre;
    EXPECT_LT((found.to_others(centre) - (centre - Eigen::Vector3d(1, 2, 3))).norm(), 0.15);
  }
}

TEST(PositionShifts, OfFoldersRigsAndFlights) {
  const Eigen::Vector3d offset(2, -3, 0);
  const auto check = [&](const Flight& flight, const char* kind) {
    const PositionShifts found = flight.find();
    ASSERT_EQ(found.groups.size(), 1u) << kind;
    EXPECT_THAT(found.groups[0].kind, HasSubstr(kind));
    EXPECT_EQ(found.groups[0].frames.size(), 12u);
    EXPECT_LT((found.groups[0].offset - offset).norm(), 0.4);
  };
  // Every third frame: no moment divides them.
  const auto is_of_group = [](std::int64_t i) { return i % 3 == 1 && i < 36; };
  Flight folders(40, 0.1, 0.3), rigs = folders, flights = folders;
  folders.block.image_names = {};
  rigs.block.rigs.push_back({"other", {Mount{CameraIndex(0), {}}}});
  rigs.state.mounts.push_back({Pose{}});
  for (std::int64_t i = 0; i < 40; ++i) {
    const bool of_group = is_of_group(i);
    folders.block.image_names.push_back((of_group ? "day2/" : "day1/") + std::to_string(i) + ".jpg");
    if (of_group) rigs.block.frames[FrameIndex(i)].rig = RigIndex(1);
    flights.block.frames[FrameIndex(i)].time_s = 1e9 + 2.0 * static_cast<double>(i) + (of_group ? 3600 : 0);
    for (Flight* flight : {&folders, &rigs, &flights})
      if (of_group) flight->prior(i).position += offset;
  }
  check(folders, "folder 'day2'");
  check(rigs, "rig 'other'");
  check(flights, "flight 2");
}

TEST(PositionShifts, OfThreeFlights) {
  Flight flight(40, 0.02, 0.03);
  for (std::int64_t i = 0; i < 40; ++i) {
    const std::int64_t number = i < 20 ? 0 : i < 30 ? 1 : 2;
    flight.block.frames[FrameIndex(i)].time_s = 1e9 + static_cast<double>(2 * i + 1000 * number);
    flight.prior(i).position.z() += number == 1 ? 0.5 : number == 2 ? -0.4 : 0;
  }
  const PositionShifts found = flight.find();
  ASSERT_EQ(found.groups.size(), 2u);
  EXPECT_NEAR(found.groups[0].offset.z(), 0.5, 0.1);
  EXPECT_NEAR(found.groups[1].offset.z(), -0.4, 0.1);
}

// No folder and no time tells which images have the other datum.
TEST(PositionShifts, OfTwoHeaps) {
  Flight flight(30);
  for (const std::int64_t i : {1, 2, 5, 11, 12, 20, 21, 28}) flight.prior(i).position.z() -= 12;
  const PositionShifts found = flight.find();
  ASSERT_EQ(found.groups.size(), 1u);
  EXPECT_EQ(found.groups[0].frames.size(), 8u);
  EXPECT_NEAR(found.groups[0].offset.z(), -12, 1);
}

TEST(PositionShifts, AreNoErrorsOfOneDatum) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    Flight normal(30, 0.5, 0.5, seed), gross(30, 0.3, 0.5, seed), drift(60, 0.02, 0.02, seed);
    gross.prior(4).position += Eigen::Vector3d(200, 0, 0);
    gross.prior(17).position.z() -= 90;
    std::mt19937_64 random(seed);
    std::normal_distribution<double> gauss(0, 0.05);
    Eigen::Vector3d walk = Eigen::Vector3d::Zero();
    for (std::int64_t i = 0; i < 60; ++i) {
      for (double& v : walk) v += gauss(random);
      drift.prior(i).position += walk;
      drift.block.frames[FrameIndex(i)].time_s = static_cast<double>(i);
    }
    EXPECT_TRUE(normal.find().groups.empty()) << seed;
    EXPECT_TRUE(gross.find().groups.empty()) << seed;
    EXPECT_TRUE(drift.find().groups.empty()) << seed;
  }
}

// Of two parallel lines each has a group of its own: a roll of the block explains as much as a shift, and nothing
// contradicts it.
TEST(PositionShifts, AreNoRollOfTwoLines) {
  Flight lines(40, 0.05, 0.1);
  for (std::int64_t i = 0; i < 40; ++i) {
    const Eigen::Vector3d place(5.0 * static_cast<double>(i % 20), i < 20 ? 0 : 30, 50);
    lines.prior(i).position += place - lines.state.frames[FrameIndex(i)].centre;
    lines.state.frames[FrameIndex(i)].centre = place;
    lines.block.frames[FrameIndex(i)].time_s = static_cast<double>(i < 20 ? i : 5000 + i);
    if (i >= 20) lines.prior(i).position.z() += 3;
  }
  EXPECT_TRUE(lines.find().groups.empty());
}

// A corridor that sags, flown in parts one after another.
TEST(PositionShifts, AreNoBend) {
  for (const std::int64_t flights : {2, 4, 6, 10}) {
    Flight sag(20 * flights, 0.02, 0.02);
    const double length = static_cast<double>(20 * flights);
    for (std::int64_t i = 0; i < 20 * flights; ++i) {
      const double t = static_cast<double>(i) / length - 0.5;
      const Eigen::Vector3d place(10 * static_cast<double>(i), 3.0 * static_cast<double>(i % 2), 100);
      sag.prior(i).position += place - sag.state.frames[FrameIndex(i)].centre;
      sag.state.frames[FrameIndex(i)].centre = place + Eigen::Vector3d(0, 0, 2 * t * t);
      sag.block.frames[FrameIndex(i)].time_s = static_cast<double>(2 * i + 1000 * (i / 20));
    }
    EXPECT_TRUE(sag.find().groups.empty()) << flights;
  }
}

TEST(PositionShifts, NeedFourPositionsThatMayMove) {
  Flight few(20), held(20), grouped(20);
  for (std::int64_t i = 17; i < 20; ++i) few.prior(i).position.z() += 30;
  EXPECT_TRUE(few.find().groups.empty());
  held.block.rigs.push_back(position_group("positions of one", Eigen::Vector3d::Zero(), 10));
  grouped.block.rigs = held.block.rigs;
  for (std::int64_t i = 12; i < 20; ++i) {
    for (Flight* flight : {&held, &grouped}) flight->prior(i).position.z() += 30;
    grouped.prior(i).group = RigIndex(1);
  }
  EXPECT_FALSE(held.find().groups.empty());
  held.prior(3).sigma.setConstant(1e-8);  // it gives the datum
  EXPECT_TRUE(held.find().groups.empty());
  EXPECT_TRUE(grouped.find().groups.empty());
  EXPECT_TRUE(Flight(7).find().groups.empty());
}

}  // namespace
}  // namespace megablock
