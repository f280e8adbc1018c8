#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>

#include "io/base/error.h"
#include "io/project/inputs/pose_csv.h"
#include "io/simulate/blocks/simulate.h"
#include "io/simulate/files/project_text.h"
#include "io/simulate/files/write.h"
#include "io/simulate/files/write_rendered.h"
#include "io/store/units/block_file.h"
#include "io/store/units/state_file.h"
#include "io/store/units/track_writer.h"
#include "io/store/units/tracks_file.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

namespace fs = std::filesystem;

class SimulateWriteTest : public testing::Test {
 protected:
  std::string file(const std::string& name) const { return scratch_.path(name); }
  void write_text(const std::string& name, const std::string& text) const { std::ofstream(file(name)) << text; }
  // The message of the error that reading the file causes.
  std::string reading_fails(const std::string& text) const {
    write_text("poses.csv", text);
    try {
      read_pose_csv(file("poses.csv"));
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }

  ScratchDirectory scratch_;
};

TEST_F(SimulateWriteTest, AnEditedProjectIsNotOverwritten) {
  SimulationOptions options;
  options.frames = 4;
  options.image_width = options.image_height = 96;
  options.focal_px = 80;
  const auto check = [](const std::string& folder, const std::function<void(EditedProject)>& write) {
    write(EditedProject::kRefuse);
    write(EditedProject::kRefuse);  // as it was written
    std::ofstream(folder + "/block.yaml", std::ios::app) << "tiles: {tile_max_frames: 6}\n";
    fs::remove(folder + "/truth.csv");
    EXPECT_THROW(write(EditedProject::kRefuse), InputError);
    EXPECT_FALSE(fs::exists(folder + "/truth.csv"));  // nothing was written
    write(EditedProject::kOverwrite);
    write(EditedProject::kRefuse);
  };
  const std::string points = file("points"), pictures = file("rendered");
  check(points, [&](EditedProject edited) { write_simulated_block(options, points, edited); });
  check(pictures, [&](EditedProject edited) { write_rendered_block(options, pictures, edited); });
}

TEST_F(SimulateWriteTest, FilesHoldTheBlock) {
  SimulationOptions options;
  options.frames = 12;
  options.control_points = 4;
  const SimulatedBlock s = simulate_block(options);
  write_simulated_block(options, scratch_.path());

  const Block block = read_block(file("given.h5"));
  ASSERT_EQ(block.frames.size(), s.block.frames.size());
  EXPECT_EQ(block.frames.back().given_pose->centre, s.block.frames.back().given_pose->centre);
  EXPECT_EQ(block.control_points.size(), s.block.control_points.size());
  const TrackSet tracks = read_tracks(file("tie_points.h5"));
  EXPECT_EQ(tracks.x, s.tracks.x);
  EXPECT_EQ(tracks.image, s.tracks.image);
  const BlockState truth = read_state(file("truth.h5"));
  EXPECT_EQ(truth.cameras.front(), s.truth.cameras.front());

  std::ifstream yaml(file("block.yaml"));
  std::stringstream text;
  text << yaml.rdbuf();
  EXPECT_NE(text.str().find("block: given.h5"), std::string::npos);
  EXPECT_NE(text.str().find("tie_points: tie_points.h5"), std::string::npos);

  const PoseTable poses = read_pose_csv(file("truth.csv"));
  ASSERT_EQ(poses.names.size(), s.block.frames.size());
  ASSERT_TRUE(poses.ground.has_value());
  EXPECT_EQ(poses.ground->latitude_deg, s.block.ground.latitude_deg);
  for (std::size_t f = 0; f < poses.names.size(); ++f) {
    const FrameIndex frame(static_cast<std::int64_t>(f));
    EXPECT_EQ(poses.names[f], s.block.frames[frame].name);
    EXPECT_EQ(poses.poses[f].centre, s.truth.frames[frame].centre);  // 17 digits: the same bits
    EXPECT_LT(rotation_angle(poses.poses[f].rotation, s.truth.frames[frame].rotation), 1e-15);
  }
}

// Streamed in batches of a few tracks, the files hold what is made in memory.
TEST_F(SimulateWriteTest, BatchesLeaveNoTrace) {
  SimulationOptions options;
  options.frames = 30;
  options.points_per_frame = 40;
  options.outlier_share = 0.1;
  for (const auto scene : {SimulationOptions::Scene::kAerial, SimulationOptions::Scene::kStreet}) {
    options.scene = scene;
    const SimulatedBlock s = simulate_block(options);
    for (const std::int64_t batch : {std::int64_t{1}, std::int64_t{37}, kTrackBatch}) {
      write_simulated_block(options, scratch_.path(), EditedProject::kRefuse, batch);
      const TrackSet tracks = read_tracks(file("tie_points.h5"));
      EXPECT_EQ(tracks.id, s.tracks.id);
      EXPECT_EQ(tracks.begin, s.tracks.begin);
      EXPECT_EQ(tracks.image, s.tracks.image);
      EXPECT_EQ(tracks.x, s.tracks.x);
      EXPECT_EQ(tracks.y, s.tracks.y);
      EXPECT_EQ(tracks.feature, s.tracks.feature);
      const SimulatedTracks truth = read_truth_tracks(file("truth_tracks.h5"));
      EXPECT_EQ(truth.points, s.points);
      EXPECT_EQ(truth.outlier, s.outlier);
    }
  }
}

TEST_F(SimulateWriteTest, BatchesAreNoLargerThanAsked) {
  SimulationOptions options;
  options.frames = 30;
  options.points_per_frame = 40;
  std::int64_t batches = 0, observations = 0;
  simulate_block(
      options,
      [&](const SimulatedTracks& batch) {
        ++batches;
        observations += batch.tracks.observation_count();
        EXPECT_LT(batch.tracks.observation_count(), 100 + 30);  // the last track of a batch is kept whole
      },
      100);
  EXPECT_GE(batches, observations / 130);
}

// Reserved disk space is given back: a file of few tracks is not larger for having been streamed.
TEST_F(SimulateWriteTest, StreamedFilesAreSmall) {
  SimulationOptions options;
  options.frames = 30;
  options.points_per_frame = 40;
  write_simulated_block(options, scratch_.path());
  write_tracks(file("plain.h5"), read_tracks(file("tie_points.h5")));
  EXPECT_LT(fs::file_size(file("tie_points.h5")), fs::file_size(file("plain.h5")) + 10000);
}

TEST_F(SimulateWriteTest, AWriterThatIsAbandonedLeavesNoFile) {
  {
    TrackWriter writer(file("half.h5"));
    TrackSet batch;
    batch.begin = {0};
    writer.append(batch);
  }
  EXPECT_FALSE(fs::exists(file("half.h5")));
}

TEST_F(SimulateWriteTest, ColumnsOfAPoseTableMayStandInAnyOrder) {
  write_text("poses.csv",
             "# a comment\nx,y,z,roll,name,qx,qy,qz,qw\n1, 2,3,99,a.jpg,0,0,0,1\r\n\n4,5,6,99,b.jpg,0.6,0,0,0.8\n");
  const PoseTable table = read_pose_csv(file("poses.csv"));
  ASSERT_EQ(table.names, (std::vector<std::string>{"a.jpg", "b.jpg"}));
  EXPECT_EQ(table.poses[0].centre, Eigen::Vector3d(1, 2, 3));
  EXPECT_NEAR(table.poses[1].rotation.w(), 0.8, 1e-15);
  EXPECT_NEAR(table.poses[1].rotation.x(), 0.6, 1e-15);
  EXPECT_FALSE(table.ground.has_value());
}

TEST_F(SimulateWriteTest, BadPoseTablesAreNamedByLine) {
  const std::string header = "name,qw,qx,qy,qz,x,y,z\n";
  EXPECT_NE(reading_fails("name,qw,qx,qy,qz,x,y\n").find("poses.csv:1: column 'z'"), std::string::npos);
  EXPECT_NE(reading_fails("name;qw;qx;qy;qz;x;y;z\na;1;0;0;0;1,5;2;x\n").find(":2: z: 'x'"), std::string::npos);
  EXPECT_NE(reading_fails(header + "a,1,0,0,0,1,2,three\n").find(":2: z: 'three'"), std::string::npos);
  EXPECT_NE(reading_fails(header + "a,1,0,0,0,1,2,nan\n").find(":2: z: 'nan'"), std::string::npos);
  EXPECT_NE(reading_fails(header + "a,1,1,0,0,1,2,3\n").find(":2: qw,qx,qy,qz"), std::string::npos);
  EXPECT_NE(reading_fails(header + "a,1,0,0,0,1,2,3\na,1,0,0,0,1,2,3\n").find(":3: frame 'a' appears twice"),
            std::string::npos);
  EXPECT_NE(reading_fails(header + "a,1,0,0\n").find(":2: column 'qz'"), std::string::npos);
  EXPECT_NE(reading_fails("# origin: 48 x\n" + header).find(":1: origin"), std::string::npos);
  EXPECT_NE(reading_fails(header).find("no poses"), std::string::npos);
  EXPECT_THROW(read_pose_csv(file("missing.csv")), InputError);
}

TEST_F(SimulateWriteTest, AFolderThatCannotBeMadeIsReported) {
  write_text("occupied", "");
  SimulationOptions options;
  options.frames = 4;
  EXPECT_THROW(write_simulated_block(options, file("occupied")), InputError);
}

}  // namespace
}  // namespace megablock
