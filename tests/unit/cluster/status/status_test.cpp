#include "cluster/status/status.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/file.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "cluster/job/stage_record.h"
#include "io/store/job/job_lock.h"
#include "tests/support/io/made_up_result.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

using testing::HasSubstr;
using testing::Not;

class StatusTest : public testing::Test {
 protected:
  StatusTest() : store_(scratch_.path("job")) {
    store_.create();
    std::ofstream(store_.path("job.json")) << R"({"settings": []})";
    SimulationOptions options;
    options.frames = 30;
    options.control_points = 3;
    options.check_points = 2;
    result_ = made_up_result(options, 2);
  }

  void write() {
    store_.write("result/block.h5", 1, [&](const std::string& path) { write_result(path, result_); });
  }
  nlohmann::json json() const { return nlohmann::json::parse(status_json(store_)); }

  ScratchDirectory scratch_;
  JobStore store_;
  BlockResult result_;
};

TEST_F(StatusTest, NamesControlPointsThatTakeNoPart) {
  write();
  EXPECT_EQ(json()["control_points_unused"], 0);
  EXPECT_THAT(status_text(store_), Not(HasSubstr("look:")));
  for (std::size_t p = 0; p < result_.control.size(); ++p) {
    const bool control = result_.block.control_points[p].role == PointRole::kControl;
    result_.control[p].kept.assign(result_.control[p].residual_px.size(), control ? 0 : 1);
  }
  write();
  EXPECT_EQ(json()["control_points_unused"], 3);
  EXPECT_EQ(json()["check_points_unused"], 0);
  EXPECT_THAT(status_text(store_), HasSubstr("\n  look: 3 control points take no part: "));
}

// What the report has besides the figures, a line each, where there is any.
TEST_F(StatusTest, TellsCheckPointsSeamsAndNotes) {
  result_.notes = {result_.seams[1].note, "3 of 40 verticals take no part: 3 contradicted by most others (a, b, c)"};
  write();
  EXPECT_THAT(
      status_text(store_),
      testing::AllOf(testing::ContainsRegex("\n  2 check points: rms of adjusted - given 0\\.0[0-9]+ m "
                                            "horizontal, 0\\.0[0-9]+ m vertical, [0-9.]+ of their sigmas\n"),
                     HasSubstr("\n  seams: 1 of 2 joints raises an alarm, the sides differ up to 1.5 times what"),
                     HasSubstr("\n  note: 3 of 40 verticals take no part: 3 contradicted"),
                     Not(HasSubstr("tile 2 disagrees"))));
  EXPECT_EQ(json()["check_points"]["compared"], 2);
  EXPECT_EQ(json()["notes"].size(), 1u);
  result_.seams.pop_back();
  result_.notes.clear();
  result_.gauge = "free, inner constraints";
  write();
  EXPECT_THAT(status_text(store_),
              Not(testing::AnyOf(HasSubstr("note:"), HasSubstr("seams:"), HasSubstr("check point"))));
}

TEST_F(StatusTest, SaysWhenTheDatumIsFree) {
  result_.free_parts = {{FrameIndex(0), 7}};
  write();
  EXPECT_THAT(status_text(store_),
              HasSubstr("\n  look: The datum is free: nothing determines place, direction and scale"));
  EXPECT_EQ(json()["remarks"].size(), 1u);
}

// CN-09: by camera, of the images whose features are known.
TEST_F(StatusTest, TellsInterestPointsByCamera) {
  result_.image_records.assign(result_.block.images.size(), {});
  result_.image_records[ImageIndex(0)].features = 40;
  result_.image_records[ImageIndex(1)].features = 10;
  result_.image_records[ImageIndex(5)].features = 100;
  write();
  const auto list = json()["interest_points"];
  ASSERT_EQ(list.size(), 1u);
  EXPECT_EQ(list[0]["images"], 3);
  EXPECT_EQ(list[0]["least"], 10);
  EXPECT_EQ(list[0]["most"], 100);
  EXPECT_EQ(list[0]["mean"], 50);
  EXPECT_EQ(list[0]["total"], 150);
  EXPECT_THAT(status_text(store_), HasSubstr("10 to 100 interest points per image, mean 50, 150 in 3 images"));
}

TEST_F(StatusTest, SaysWhoIsAtWorkAndHowToStopIt) {
  EXPECT_THAT(status_text(store_), HasSubstr("no result yet: run the same command again to resume"));
  EXPECT_TRUE(json()["in_use_by"].is_null());
  const std::string process = std::to_string(getpid());
  std::optional<JobLock> lock(store_);
  EXPECT_THAT(status_text(store_),
              testing::ContainsRegex("\n  process " + process + " on [^ ]+, started [^ ]+Z, is at " +
                                     "work on it; 'kill -USR1 " + process + "' stops it"));
  EXPECT_THAT(status_text(store_), Not(HasSubstr("run the same")));
  EXPECT_THAT(json()["in_use_by"].get<std::string>(), testing::StartsWith("process " + process + " on "));
  StageRecord record{"features", 0, {{"features/000000.h5", 1}}, {}};
  write_record(store_, record);
  EXPECT_THAT(unfinished_stages(store_).front(), testing::EndsWith(", is at work on it"));
  lock.reset();
  EXPECT_THAT(unfinished_stages(store_).front(), testing::EndsWith("; run the job again to complete it"));
  std::ofstream(store_.path("lock")) << "process 12 on elsewhere, started 2026-11-21T07:00:00Z\n";
  const int other = open(store_.path("lock").c_str(), O_RDONLY);
  ASSERT_EQ(flock(other, LOCK_EX), 0);
  EXPECT_THAT(status_text(store_), HasSubstr("'kill -USR1 12 on elsewhere' stops it"));
  close(other);
}

TEST_F(StatusTest, KeysAreThereBeforeAResult) {
  EXPECT_TRUE(json()["control_points_unused"].is_null());
  EXPECT_EQ(json()["result"], "none");
}

}  // namespace
}  // namespace megablock
