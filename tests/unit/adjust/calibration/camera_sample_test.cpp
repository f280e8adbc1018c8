// The sample of frames and tracks, whatever tiles own the tracks.
#include "adjust/calibration/camera_sample.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace megablock {
namespace {

// Frames on a line, every tenth of another rig, the last ones of another component.
struct Line {
  Block block;
  BlockState state;
  IndexedVector<FrameIndex, std::int32_t> component;
  explicit Line(int frames) : component(static_cast<std::size_t>(frames)) {
    for (int c = 0; c < 2; ++c) {
      Camera camera;
      camera.name = "camera" + std::to_string(c);
      camera.width = 100;
      camera.height = 80;
      camera.intrinsics = {90, 50, 40, 0, 0, 0, 0, 0};
      block.cameras.push_back(camera);
      block.rigs.push_back({camera.name, {Mount{CameraIndex(c), {}, 0, 0}}});
    }
    for (int f = 0; f < frames; ++f) {
      Frame frame;
      frame.name = std::to_string(f);
      frame.rig = RigIndex(f % 10 == 9);
      block.add_image(frame.name, {FrameIndex(f), 0, 0});
      block.frames.push_back(frame);
      component[FrameIndex(f)] = f >= frames - 5;
    }
    state = initial_state(block);
    for (int f = 0; f < frames; ++f) {
      state.frames[FrameIndex(f)].centre = {10.0 * f, 0, 0};
      state.oriented[FrameIndex(f)] = f != 20;
    }
  }
};

TEST(CameraSample, TakesFramesAboutTheMiddle) {
  const Line line(45);
  const auto frames = frames_near_the_middle(line.block, line.state, RigIndex(0), line.component, 7);
  ASSERT_EQ(frames.size(), 7u);
  for (const FrameIndex f : frames) {
    EXPECT_EQ(line.block.frames[f].rig, RigIndex(0));
    EXPECT_NE(f.value, 20);  // not oriented
    EXPECT_LE(std::abs(static_cast<double>(f.value) - 19.0), 6);
  }
  EXPECT_TRUE(std::is_sorted(frames.begin(), frames.end()));
  EXPECT_EQ(frames_near_the_middle(line.block, line.state, RigIndex(1), line.component, 7).size(), 4u);
}

// Four tracks of three images, as tiles of one division and of another list them.
Measurements listed(bool other_tiles) {
  Measurements m;
  for (int image = 0; image < 3; ++image)
    for (int t = 0; t < 4; ++t) {
      const int track = other_tiles ? 3 - t : t;
      m.image.emplace_back(image);
      m.track.emplace_back(other_tiles ? track / 2 : track);
      m.tile.emplace_back(other_tiles ? track % 2 : 0);
      m.x.push_back(100 * track + image);
      m.y.push_back(7);
      m.feature.push_back(track);
    }
  m.image.emplace_back(2);  // a track in one image
  m.track.emplace_back(9);
  m.tile.emplace_back(0);
  m.x.push_back(1);
  m.y.push_back(1);
  m.feature.push_back(9);
  return m;
}

TEST(CameraSample, OrdersTracksAlikeInAnyDivision) {
  const Line line(45);
  const TrackSet one = tracks_in_frames(line.block, listed(false), 1000),
                 other = tracks_in_frames(line.block, listed(true), 1000);
  ASSERT_EQ(one.track_count(), 4);
  EXPECT_EQ(one.begin, other.begin);
  EXPECT_EQ(one.image, other.image);
  EXPECT_EQ(one.x, other.x);
  EXPECT_EQ(one.feature, other.feature);
  EXPECT_EQ(tracks_in_frames(line.block, listed(true), 6).track_count(), 2);
}

}  // namespace
}  // namespace megablock
