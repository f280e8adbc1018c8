
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <fstream>

#include "io/base/error.h"
#include "io/block/observed_poses.h"
#include "io/store/hdf5/hdf5_file.h"
#include "io/store/units/block_file.h"
#include "io/store/units/state_file.h"
#include "io/store/units/tracks_file.h"
#include "tests/support/io/example_block.h"
#include "tests/support/io/same_bits.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

using ::testing::HasSubstr;

void expect_equal(const Camera& a, const Camera& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.width, b.width);
  EXPECT_EQ(a.height, b.height);
  EXPECT_EQ(a.intrinsics, b.intrinsics);
  EXPECT_EQ(a.prior_sigma, b.prior_sigma);
  EXPECT_EQ(a.focal_known, b.focal_known);
  EXPECT_EQ(a.mask_path, b.mask_path);
  EXPECT_EQ(a.readout_s, b.readout_s);
  EXPECT_EQ(a.estimate_readout, b.estimate_readout);
}

void expect_equal(const Frame& a, const Frame& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.rig, b.rig);
  EXPECT_EQ(a.pass, b.pass);
  EXPECT_TRUE(same_bits(a.time_s, b.time_s));
  ASSERT_EQ(a.position_prior.has_value(), b.position_prior.has_value());
  if (a.position_prior) {
    EXPECT_TRUE(same_bits(a.position_prior->position, b.position_prior->position));
    EXPECT_TRUE(same_bits(a.position_prior->sigma, b.position_prior->sigma));
    EXPECT_TRUE(same_bits(a.position_prior->lever_arm, b.position_prior->lever_arm));
    EXPECT_EQ(a.position_prior->group, b.position_prior->group);
    EXPECT_EQ(a.position_prior->shifted, b.position_prior->shifted);
  }
  ASSERT_EQ(a.attitude_prior.has_value(), b.attitude_prior.has_value());
  if (a.attitude_prior) {
    EXPECT_TRUE(same_bits(a.attitude_prior->rotation_cw, b.attitude_prior->rotation_cw));
    EXPECT_TRUE(same_bits(a.attitude_prior->sigma_rad, b.attitude_prior->sigma_rad));
  }
  ASSERT_EQ(a.given_pose.has_value(), b.given_pose.has_value());
  if (a.given_pose) {
    EXPECT_TRUE(same_bits(*a.given_pose, *b.given_pose));
  }
}

void expect_equal(const ControlPoint& a, const ControlPoint& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.role, b.role);
  EXPECT_TRUE(same_bits(a.position, b.position));
  EXPECT_TRUE(same_bits(a.sigma, b.sigma));
  ASSERT_EQ(a.measurements.size(), b.measurements.size());
  for (std::size_t m = 0; m < a.measurements.size(); ++m) {
    EXPECT_EQ(a.measurements[m].image, b.measurements[m].image);
    EXPECT_EQ(a.measurements[m].pixel, b.measurements[m].pixel);
    EXPECT_EQ(a.measurements[m].sigma_px, b.measurements[m].sigma_px);
  }
}

void expect_equal(const Block& a, const Block& b) {
  EXPECT_EQ(a.ground.georeferenced, b.ground.georeferenced);
  EXPECT_EQ(a.ground.latitude_deg, b.ground.latitude_deg);
  EXPECT_EQ(a.ground.longitude_deg, b.ground.longitude_deg);
  EXPECT_EQ(a.ground.height_m, b.ground.height_m);
  EXPECT_EQ(a.ground.crs, b.ground.crs);
  ASSERT_EQ(a.cameras.size(), b.cameras.size());
  for (CameraIndex c(0); a.cameras.contains(c); ++c.value) expect_equal(a.cameras[c], b.cameras[c]);
  ASSERT_EQ(a.rigs.size(), b.rigs.size());
  for (RigIndex r(0); a.rigs.contains(r); ++r.value) {
    EXPECT_EQ(a.rigs[r].name, b.rigs[r].name);
    ASSERT_EQ(a.rigs[r].mounts.size(), b.rigs[r].mounts.size());
    for (std::size_t m = 0; m < a.rigs[r].mounts.size(); ++m) {
      const Mount &left = a.rigs[r].mounts[m], &right = b.rigs[r].mounts[m];
      EXPECT_EQ(left.camera, right.camera);
      EXPECT_TRUE(same_bits(left.pose, right.pose));
      EXPECT_EQ(left.rotation_sigma_rad, right.rotation_sigma_rad);
      EXPECT_EQ(left.position_sigma_m, right.position_sigma_m);
    }
  }
  ASSERT_EQ(a.frames.size(), b.frames.size());
  for (FrameIndex f(0); a.frames.contains(f); ++f.value) expect_equal(a.frames[f], b.frames[f]);
  EXPECT_EQ(a.image_folder, b.image_folder);
  ASSERT_EQ(a.images.size(), b.images.size());
  for (ImageIndex i(0); a.images.contains(i); ++i.value) {
    EXPECT_EQ(a.name_of(i), b.name_of(i));
    EXPECT_EQ(a.images[i].frame, b.images[i].frame);
    EXPECT_EQ(a.images[i].mount, b.images[i].mount);
    EXPECT_EQ(a.images[i].file_hash, b.images[i].file_hash);
  }
  ASSERT_EQ(a.relative_poses.size(), b.relative_poses.size());
  for (std::size_t r = 0; r < a.relative_poses.size(); ++r) {
    EXPECT_EQ(a.relative_poses[r].from, b.relative_poses[r].from);
    EXPECT_EQ(a.relative_poses[r].to, b.relative_poses[r].to);
    EXPECT_TRUE(same_bits(a.relative_poses[r].pose, b.relative_poses[r].pose));
    EXPECT_EQ(a.relative_poses[r].rotation_sigma_rad, b.relative_poses[r].rotation_sigma_rad);
    EXPECT_EQ(a.relative_poses[r].position_sigma_m, b.relative_poses[r].position_sigma_m);
  }
  ASSERT_EQ(a.control_points.size(), b.control_points.size());
  for (std::size_t p = 0; p < a.control_points.size(); ++p) expect_equal(a.control_points[p], b.control_points[p]);
  ASSERT_EQ(a.verticals.size(), b.verticals.size());
  for (std::size_t v = 0; v < a.verticals.size(); ++v) {
    EXPECT_EQ(a.verticals[v].image, b.verticals[v].image);
    EXPECT_EQ(a.verticals[v].down, b.verticals[v].down);
    EXPECT_EQ(a.verticals[v].covariance, b.verticals[v].covariance);
    EXPECT_EQ(a.verticals[v].camera, b.verticals[v].camera);
    EXPECT_EQ(a.verticals[v].by_camera, b.verticals[v].by_camera);
  }
}

void expect_equal(const TrackSet& a, const TrackSet& b) {
  EXPECT_EQ(a.id, b.id);
  EXPECT_EQ(a.begin, b.begin);
  EXPECT_EQ(a.image, b.image);
  EXPECT_EQ(a.x, b.x);
  EXPECT_EQ(a.y, b.y);
  EXPECT_EQ(a.feature, b.feature);
}

class UnitFiles : public ::testing::Test {
 protected:
  ScratchDirectory scratch_;
  std::string path_ = scratch_.path("unit.h5");
};

TEST_F(UnitFiles, BlockComesBack) {
  write_block(path_, example_block());
  expect_equal(read_block(path_), example_block());
}

TEST_F(UnitFiles, GroupOfPositionsComesBack) {
  Block block = example_block();
  PositionPrior& prior = *block.frames[FrameIndex(0)].position_prior;
  prior.group = block.rigs.next_index();
  prior.shifted = {1, 0, 1};
  block.rigs.push_back(position_group("positions of a day", {1, 2, 3}, 0.5));
  write_block(path_, block);
  expect_equal(read_block(path_), block);
}

TEST_F(UnitFiles, EmptyBlockComesBack) {
  write_block(path_, Block{});
  expect_equal(read_block(path_), Block{});
}

// They are written and read in batches.
TEST_F(UnitFiles, ManyImagesComeBack) {
  Block block = example_block();
  const auto some = static_cast<std::int64_t>(block.images.size());
  for (std::int64_t i = some; i < 150000; ++i) {
    Image image = block.images[ImageIndex(i % some)];
    image.file_hash = static_cast<std::uint64_t>(i);
    block.add_image(std::to_string(i) + std::string(static_cast<std::size_t>(i * 7919 % 23), 'x') + ".jpg", image);
  }
  write_block(path_, block);
  expect_equal(read_block(path_), block);
}

TEST_F(UnitFiles, TracksComeBack) {
  write_tracks(path_, example_tracks());
  expect_equal(read_tracks(path_), example_tracks());
}

TEST_F(UnitFiles, EmptyTracksComeBack) {
  TrackSet none;
  none.begin = {0};
  write_tracks(path_, none);
  expect_equal(read_tracks(path_), none);
}

TEST_F(UnitFiles, ManyTracksComeBackFromCompressedChunks) {
  TrackSet tracks;
  tracks.begin = {0};
  for (std::int64_t t = 0; t < 60000; ++t) {
    tracks.id.push_back(TrackIndex(3 * t));
    for (std::int64_t o = 0; o <= t % 4; ++o) {
      tracks.image.push_back(ImageIndex(t / 50 + o * o));
      tracks.x.push_back(static_cast<std::int32_t>(t * 7919 % 4096000));
      tracks.y.push_back(static_cast<std::int32_t>(t * 104729 % 3072000));
      tracks.feature.push_back(static_cast<std::int32_t>(t % 8000));
    }
    tracks.begin.push_back(tracks.observation_count());
  }
  write_tracks(path_, tracks);
  expect_equal(read_tracks(path_), tracks);
}

TEST_F(UnitFiles, StateComesBack) {
  BlockState state = initial_state(example_block());
  state.frames[FrameIndex(1)] = {Eigen::Quaterniond(0.1, 0.2, 0.3, 0.4), {-0.0, 1e-300, 1e300}};
  write_state(path_, state);
  const BlockState back = read_state(path_);
  ASSERT_EQ(back.frames.size(), state.frames.size());
  for (FrameIndex f(0); state.frames.contains(f); ++f.value) EXPECT_TRUE(same_bits(back.frames[f], state.frames[f]));
  EXPECT_EQ(back.oriented, state.oriented);
  EXPECT_EQ(back.cameras, state.cameras);
  ASSERT_EQ(back.mounts.size(), state.mounts.size());
  for (RigIndex r(0); state.mounts.contains(r); ++r.value) {
    ASSERT_EQ(back.mounts[r].size(), state.mounts[r].size());
    for (std::size_t m = 0; m < state.mounts[r].size(); ++m)
      EXPECT_TRUE(same_bits(back.mounts[r][m], state.mounts[r][m]));
  }
}

TEST_F(UnitFiles, EqualContentsGiveEqualBytes) {
  write_block(path_, example_block());
  const std::string first = bytes_of(path_);
  write_block(scratch_.path("other name.h5"), example_block());
  EXPECT_EQ(bytes_of(scratch_.path("other name.h5")), first);
}

std::string store_message_of(const auto& action) {
  try {
    action();
  } catch (const StoreError& error) {
    return error.what();
  }
  return "no StoreError";
}

TEST_F(UnitFiles, MissingFileIsNamed) {
  EXPECT_THAT(store_message_of([&] { read_block(path_); }), HasSubstr(path_ + ": is missing"));
}

TEST_F(UnitFiles, FileOfAnotherKindIsNamed) {
  write_block(path_, example_block());
  EXPECT_THAT(store_message_of([&] { read_tracks(path_); }), HasSubstr(path_ + ": holds 'block', not 'tracks'"));
}

TEST_F(UnitFiles, FileOfAnotherVersionIsNamed) {
  write_block(path_, example_block());
  const hid_t file = H5Fopen(path_.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  const hid_t version = H5Aopen(file, "format_version", H5P_DEFAULT);
  const std::uint32_t other = kFormatVersion + 1;
  EXPECT_GE(H5Awrite(version, H5T_NATIVE_UINT32, &other), 0);
  H5Aclose(version);
  H5Fclose(file);
  EXPECT_THAT(store_message_of([&] { read_block(path_); }),
              HasSubstr(path_ + ": has format version " + std::to_string(other)));
}

TEST_F(UnitFiles, FileThatIsNoHdf5IsNamed) {
  std::ofstream(path_) << "some text";
  EXPECT_THAT(store_message_of([&] { read_tracks(path_); }), HasSubstr(path_ + ": cannot be opened as HDF5"));
}

TEST_F(UnitFiles, MissingDatasetIsNamed) {
  Hdf5Writer file(path_, "tracks");
  file.close();
  EXPECT_THAT(store_message_of([&] { read_tracks(path_); }),
              HasSubstr(path_ + ": tracks/id_difference: cannot be read"));
}

TEST_F(UnitFiles, ContradictingLengthsAreNamed) {
  Hdf5Writer file(path_, "tracks");
  file.group("tracks");
  file.integers("tracks/id_difference", {0, 1});
  file.integers("tracks/observations", {2, 2});
  file.group("observations");
  for (const char* name : {"x", "y", "feature"})
    file.vector(std::string("observations/") + name, std::vector<std::int32_t>(3));
  file.integers("observations/image_difference", {0, 0, 0});
  file.close();
  EXPECT_THAT(store_message_of([&] { read_tracks(path_); }), HasSubstr("tracks/observations: adds up to 4 rows"));
}

TEST_F(UnitFiles, TracksOutOfOrderAreRefused) {
  TrackSet tracks = example_tracks();
  std::swap(tracks.image[0], tracks.image[1]);
  write_tracks(path_, tracks);
  EXPECT_THAT(store_message_of([&] { read_tracks(path_); }), HasSubstr("the images of a track do not ascend"));
  tracks = example_tracks();
  std::swap(tracks.id[0], tracks.id[1]);
  write_tracks(path_, tracks);
  EXPECT_THAT(store_message_of([&] { read_tracks(path_); }), HasSubstr("indices do not ascend"));
}

}  // namespace
}  // namespace megablock
