// Runs `megablock register` with bad input. It must end with an error that names file, place, cause and remedy, or give
// a remark and register everything else as well as before.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <numeric>

#include "cluster/process/exit_codes.h"
#include "cluster/stages/registration/registration.h"
#include "io/base/error.h"
#include "io/base/index.h"
#include "io/project/inputs/pose_csv.h"
#include "io/simulate/blocks/simulate.h"
#include "tests/integration/block_folder.h"
#include "tests/support/io/image_names.h"

namespace megablock {
namespace {

using testing::HasSubstr;

constexpr std::int64_t kFrames = 160;  // of two drives

SimulatedBlock make_block(bool held_rig, int cameras) {
  SimulationOptions options = SimulationOptions::of(SimulationOptions::Scene::kStereopolis);
  options.frames = kFrames;
  options.rig_cameras = cameras;
  options.street_spacing_m = 60;
  options.points_per_frame = 150;
  options.drift_per_frame_m = 0.05;
  options.control_zones = 1;
  options.calibrate = !held_rig;
  return simulate_block(options);
}

const SimulatedBlock& town() {
  static const SimulatedBlock block = make_block(true, 10);
  return block;
}

// Frames in another order, or fewer of them; images and tracks with them.
void keep_frames(
    SimulatedBlock& s, const std::vector<std::int64_t>& order,
    const std::function<bool(const Image&)>& keep_image = [](const Image&) { return true; }) {
  const Block& old = s.block;
  std::vector<std::int64_t> frame_row(old.frames.size(), -1), image_row(old.images.size(), -1);
  Block block = old;
  BlockState truth = s.truth;
  block.frames.clear(), block.images.clear(), block.image_names = {}, block.relative_poses.clear(),
                                              truth.frames.clear();
  truth.oriented.assign(order.size(), 1);
  for (const std::int64_t f : order) {
    frame_row[static_cast<std::size_t>(f)] = block.frames.next_index().value;
    block.frames.push_back(old.frames[FrameIndex(f)]);
    truth.frames.push_back(s.truth.frames[FrameIndex(f)]);
    for (std::size_t i = 0; i < old.images.size(); ++i) {
      const ImageIndex index(static_cast<std::int64_t>(i));
      Image image = old.images[index];
      if (image.frame.value != f || !keep_image(image)) continue;
      image_row[i] = block.images.next_index().value;
      image.frame = FrameIndex(frame_row[static_cast<std::size_t>(f)]);
      block.add_image(old.image_names[index], image);
    }
  }
  const auto frame = [&](FrameIndex f) { return FrameIndex(frame_row[static_cast<std::size_t>(f.value)]); };
  const auto image = [&](ImageIndex i) { return ImageIndex(image_row[static_cast<std::size_t>(i.value)]); };
  for (RelativePose r : old.relative_poses) {
    r.from = frame(r.from), r.to = frame(r.to);
    if (r.from.valid() && r.to.valid()) block.relative_poses.push_back(r);
  }
  for (ControlPoint& point : block.control_points) {
    for (ImageMeasurement& m : point.measurements) m.image = image(m.image);
    std::erase_if(point.measurements, [](const ImageMeasurement& m) { return !m.image.valid(); });
  }
  TrackSet tracks;
  tracks.begin = {0};
  for (std::int64_t t = 0; t < s.tracks.track_count(); ++t) {
    struct Row {
      ImageIndex image;
      std::size_t row;
    };
    std::vector<Row> rows;
    for (auto o = s.tracks.begin[static_cast<std::size_t>(t)]; o < s.tracks.begin[static_cast<std::size_t>(t) + 1];
         ++o) {
      const ImageIndex kept = image(s.tracks.image[static_cast<std::size_t>(o)]);
      if (kept.valid()) rows.push_back({kept, static_cast<std::size_t>(o)});
    }
    if (rows.size() < 2) continue;
    std::sort(rows.begin(), rows.end(), [](const Row& a, const Row& b) { return a.image < b.image; });
    for (const Row& r : rows) {
      tracks.image.push_back(r.image);
      tracks.x.push_back(s.tracks.x[r.row]);
      tracks.y.push_back(s.tracks.y[r.row]);
      tracks.feature.push_back(-1);
    }
    tracks.id.emplace_back(tracks.track_count());
    tracks.begin.push_back(tracks.observation_count());
  }
  s.block = std::move(block);
  s.truth = std::move(truth);
  s.tracks = std::move(tracks);
}

std::vector<std::int64_t> all_frames() {
  std::vector<std::int64_t> order(static_cast<std::size_t>(kFrames));
  std::iota(order.begin(), order.end(), std::int64_t{0});
  return order;
}

class RegistrationInput : public testing::Test {
 protected:
  // What `register` prints; throws what it throws.
  std::string register_block(const SimulatedBlock& s, const RegistrationSettings& settings = {}) {
    folder_.write(s);
    testing::internal::CaptureStdout();
    int code = -1;
    try {
      code =
          folder_.run([&](const RunOptions& run, Communicator& ranks) { return register_job(run, settings, ranks); });
    } catch (...) {
      testing::internal::GetCapturedStdout();
      throw;
    }
    const std::string said = testing::internal::GetCapturedStdout();
    EXPECT_EQ(code, kExitDone) << said;
    return said;
  }
  std::string refusal(const SimulatedBlock& s) {
    try {
      register_block(s);
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr("block.yaml")) << "the file is named";
      return error.what();
    }
    return "nothing was refused";
  }
  // rms distance of the registered frames from their true positions.
  double error_m(const SimulatedBlock& s) const {
    const PoseTable table = read_pose_csv(folder_.job("register/poses.csv"));
    EXPECT_EQ(table.poses.size(), s.block.frames.size());
    double sum = 0;
    for (std::size_t f = 0; f < table.poses.size(); ++f)
      sum += (table.poses[f].centre - s.truth.frames[FrameIndex(static_cast<std::int64_t>(f))].centre).squaredNorm();
    return std::sqrt(sum / static_cast<double>(table.poses.size()));
  }

  BlockFolder folder_;
};

// The block itself, for comparison with what follows.
constexpr double kGoodTrajectory = 0.1;  // metres; the trajectory is off by metres

TEST_F(RegistrationInput, SoundBlock) {
  register_block(town());
  EXPECT_LT(error_m(town()), kGoodTrajectory);
}

TEST_F(RegistrationInput, MissingCameraImages) {
  SimulatedBlock s = town();
  keep_frames(s, all_frames(), [](const Image& image) { return image.frame.value % 3 != 0 || image.mount % 2 == 0; });
  ASSERT_LT(s.block.images.size(), 9 * s.block.frames.size());
  register_block(s);
  EXPECT_LT(error_m(s), kGoodTrajectory);
}

TEST_F(RegistrationInput, ClockThatRunsBackwards) {
  SimulatedBlock s = town();
  s.block.frames[FrameIndex(40)].time_s -= 1000;
  EXPECT_THAT(refusal(s), HasSubstr("block.yaml: frame 'f000040': the clock of pass 0 runs backwards from frame "
                                    "'f000039' on; list the frames of a pass in the order of their times"));
}

TEST_F(RegistrationInput, GapsInTheTrajectory) {
  SimulatedBlock s = town();
  std::vector<std::int64_t> order = all_frames();
  order.erase(order.begin() + 30, order.begin() + 50);  // 84 m
  keep_frames(s, order);
  for (std::int64_t f = 30; f < 60; ++f) s.block.frames[FrameIndex(f)].time_s += 3600;
  const std::string said = register_block(s);
  EXPECT_THAT(said, HasSubstr("look: gap of "));
  EXPECT_THAT(said, HasSubstr("between frames 'f000029' and 'f000050': not linked"));
  EXPECT_LT(error_m(s), kGoodTrajectory);
}

TEST_F(RegistrationInput, FramesListedTwice) {
  SimulatedBlock s = town();
  std::vector<std::int64_t> order = all_frames();
  order.insert(order.begin() + 41, 40);
  keep_frames(s, order);
  // Measurements and relative poses have gone to the copy.
  s.block.frames[FrameIndex(41)].name += "_copy";
  rename_images(
      s.block, [&](ImageIndex i) { return s.block.name_of(i) + (s.block.images[i].frame.value == 41 ? "_copy" : ""); });
  const std::string said = register_block(s);
  EXPECT_THAT(said,
              HasSubstr("look: frames 'f000040' and 'f000040_copy' have the same time and place: is one of them a "
                        "copy?"));
  EXPECT_LT(error_m(s), kGoodTrajectory);
}

TEST_F(RegistrationInput, NumbersThatAreNone) {
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  SimulatedBlock s = town();
  s.block.frames[FrameIndex(7)].given_pose->centre.y() = kUnknown;
  EXPECT_THAT(refusal(s), HasSubstr("frame 'f000007': position is not finite; leave the pose out"));
  s = town();
  s.block.frames[FrameIndex(8)].given_pose->rotation.coeffs().setConstant(kUnknown);
  EXPECT_THAT(refusal(s), HasSubstr("frame 'f000008': rotation is not a unit quaternion"));
  s = town();
  s.block.frames[FrameIndex(9)].position_prior->position.x() = kUnknown;
  EXPECT_THAT(refusal(s), HasSubstr("frame 'f000009': position prior must be finite"));
  s = town();
  s.block.frames[FrameIndex(10)].attitude_prior->rotation_cw.coeffs().setConstant(kUnknown);
  EXPECT_THAT(refusal(s), HasSubstr("frame 'f000010': attitude prior must be a unit quaternion"));
  s = town();
  s.block.relative_poses[11].pose.centre.z() = kUnknown;
  EXPECT_THAT(refusal(s), HasSubstr("relative pose of frames 'f000011' and 'f000012': position is not finite"));
  // Left out, the pose is carried on from the frame before.
  s = town();
  s.block.frames[FrameIndex(7)].given_pose.reset();
  s.block.frames[FrameIndex(7)].position_prior.reset();
  s.block.frames[FrameIndex(7)].attitude_prior.reset();
  register_block(s);
  EXPECT_LT(error_m(s), kGoodTrajectory);
  // Nothing to carry it on from.
  s.block.relative_poses.clear();
  EXPECT_THAT(refusal(s), HasSubstr("frame 'f000007' has no pose in the trajectory; give an approximate pose"));
}

// The most points within 2 cm of the line through two of them.
std::vector<ControlPoint> on_one_line(const std::vector<ControlPoint>& points,
                                      const std::vector<Eigen::Vector3d>& truth) {
  std::vector<ControlPoint> best;
  for (std::size_t i = 0; i < truth.size(); ++i)
    for (std::size_t j = i + 1; j < truth.size(); ++j) {
      const Eigen::Vector3d along = (truth[j] - truth[i]).normalized();
      std::vector<ControlPoint> line;
      for (std::size_t k = 0; k < truth.size(); ++k)
        if (along.cross(truth[k] - truth[i]).norm() < 0.02) line.push_back(points[k]);
      if (line.size() > best.size()) best = line;
    }
  return best;
}

// Control on one line leaves a frame the turn about it: such resections are refused, the rest goes on.
TEST_F(RegistrationInput, CollinearControl) {
  SimulatedBlock s = town();
  RegistrationSettings settings;
  settings.use_resections = true;
  EXPECT_THAT(register_block(s, settings), testing::Not(HasSubstr("resections            0\n")));
  std::vector<ControlPoint>& points = s.block.control_points;
  const std::vector<ControlPoint> line = on_one_line(points, s.control_truth);
  ASSERT_GE(line.size(), 3u) << "corners of stripes stand in rows";
  points = line;
  for (ControlPoint& point : points) point.role = PointRole::kControl;
  const std::string said = register_block(s, settings);
  EXPECT_THAT(said, HasSubstr("resections            0\n"));
  EXPECT_THAT(said, HasSubstr("the points lie on one line, about which the rig could turn freely"));
  EXPECT_LT(error_m(s), kGoodTrajectory);
}

// A pass listed against its times, its relative poses as they were measured.
TEST_F(RegistrationInput, PassListedBackwards) {
  SimulatedBlock s = town();
  std::vector<std::int64_t> order = all_frames();
  std::reverse(order.begin() + kFrames / 2, order.end());
  keep_frames(s, order);
  EXPECT_THAT(register_block(s), HasSubstr("in a chain of " + std::to_string(kFrames - 2) + " links"));
  EXPECT_LT(error_m(s), kGoodTrajectory);
}

// One camera ahead, one behind, cameras and mounts to be estimated: what ties them is the chain.
TEST_F(RegistrationInput, CamerasThatShareNoView) {
  const SimulatedBlock s = make_block(false, 2);
  ASSERT_EQ(s.block.rigs.front().mounts.size(), 2u);
  const std::string said = register_block(s);
  EXPECT_THAT(said, HasSubstr("rig                   estimated from"));
  const Block registered = read_block(folder_.job("register/block.h5"));
  const auto off = [&](const Block& block) {
    return rotation_angle(block.rigs.front().mounts[1].pose.rotation, s.truth.mounts.front()[1].rotation);
  };
  EXPECT_LT(off(registered), 0.1 * off(s.block));
  EXPECT_LT(error_m(s), 3 * kGoodTrajectory);
}

}  // namespace
}  // namespace megablock
