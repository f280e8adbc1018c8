#include "cluster/job/stage_record.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "io/base/error.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

const std::vector<Stage> kExpected = {{.name = "tiles"},
                                      {.name = "tracks"},
                                      {.name = "orientation", .optional = true},
                                      {.name = "adjustment"},
                                      {.name = "merge"}};

class StageRecordTest : public testing::Test {
 protected:
  StageRecordTest() : store_(scratch_.path("job")) { store_.create(); }

  // The record of a stage after the one before, with one unit; `make`: the unit's file too.
  StageRecord add(const std::string& stage, const StageRecord* before, std::uint64_t fingerprint, bool make) {
    const StageRecord record{stage, before ? before->hash() : 0, {{stage + ".h5", fingerprint}}, {}};
    write_record(store_, record);
    if (make) store_.write(stage + ".h5", fingerprint, [](const std::string& path) { std::ofstream(path) << "x"; });
    return record;
  }

  std::vector<std::string> states() const {
    std::vector<std::string> names;
    for (const StageStatus& stage : stage_status(store_, kExpected))
      names.push_back(stage.record.stage + " " + name_of(stage.state));
    return names;
  }

  ScratchDirectory scratch_;
  JobStore store_;
};

UnitEvent event(const std::string& stage, const std::string& unit, int rank, double from, double to, double rss = 0) {
  UnitEvent event;
  event.stage = stage;
  event.unit = unit;
  event.rank = rank;
  event.time_s = to;
  event.seconds = to - from;
  event.peak_rss_mib = rss;
  return event;
}

TEST_F(StageRecordTest, StatesFollowUnitFiles) {
  EXPECT_EQ(states().front(), "tiles waiting");
  const StageRecord tiles = add("tiles", nullptr, 1, true);
  add("tracks", &tiles, 2, false);
  EXPECT_THAT(states(), testing::ElementsAre("tiles done", "tracks waiting", "orientation waiting",
                                             "adjustment waiting", "merge waiting"));
}

TEST_F(StageRecordTest, EverythingAfterAChangeIsStaleThoughItsFilesAreThere) {
  const StageRecord tiles = add("tiles", nullptr, 1, true);
  const StageRecord tracks = add("tracks", &tiles, 2, true);
  const StageRecord adjustment = add("adjustment", &tracks, 3, true);
  add("merge", &adjustment, 4, true);
  EXPECT_THAT(states(), testing::ElementsAre("tiles done", "tracks done", "adjustment done", "merge done"));
  add("tiles", nullptr, 5, true);  // an option changed, only this stage was run
  EXPECT_THAT(states(), testing::ElementsAre("tiles done", "tracks stale", "adjustment stale", "merge stale"));
}

TEST_F(StageRecordTest, AStageTheJobDoesWithoutLeavesNoTrace) {
  const StageRecord tiles = add("tiles", nullptr, 1, true);
  const StageRecord tracks = add("tracks", &tiles, 2, true);
  add("orientation", &tracks, 3, true);
  const StageRecord adjustment = add("adjustment", &tracks, 4, true);  // of a run that had all poses
  add("merge", &adjustment, 5, true);
  remove_record(store_, "orientation");
  remove_record(store_, "orientation");  // none there
  EXPECT_THAT(states(), testing::ElementsAre("tiles done", "tracks done", "adjustment done", "merge done"));
}

TEST_F(StageRecordTest, KeepsFailuresAndRefusesAnUnreadableRecord) {
  StageRecord record{"features", 7, {{"features/000000.h5", 8}}, {{"features", "a.jpg", "is empty"}}};
  write_record(store_, record);
  const auto read = read_record(store_, "features");
  ASSERT_TRUE(read);
  EXPECT_EQ(read->hash(), record.hash());
  EXPECT_EQ(read->failures.front().reason, "is empty");
  store_.write_text("stages/features.json", "{");
  EXPECT_THROW(read_record(store_, "features"), StoreError);
}

TEST(StageStatistics, WallClockIsTheTimeAnyRankWorkedOnItsPresentUnits) {
  const StageRecord record{"features", 0, {{"a", 1}, {"b", 1}}, {}};
  const StageStatistics statistics =
      stage_statistics(record, {event("features", "a", 0, 0, 50, 900),    // computed again below
                                event("features", "a", 0, 100, 110, 20),  //
                                event("features", "b", 1, 105, 120, 30),  // overlaps
                                event("matching", "a", 1, 200, 300, 99)});
  EXPECT_DOUBLE_EQ(statistics.seconds, 20);
  EXPECT_DOUBLE_EQ(statistics.peak_rss_mib, 30);
  EXPECT_EQ(statistics.units, 2);
}

TEST(StageStatistics, AMergeCountsFromTheOneBefore) {
  const StageRecord record{"merge", 0, {{"result", 1}}, {}};
  const StageStatistics statistics = stage_statistics(
      record, {event("merge", "00-0001", 0, 0, 5), event("merge", "result", 0, 0, 9),  // an earlier result
               event("merge", "00-0001", 0, 20, 23),                                   // then killed
               event("merge", "00-0002", 0, 40, 42), event("merge", "result", 0, 39, 45)});
  EXPECT_DOUBLE_EQ(statistics.seconds, 3 + 6);
}

}  // namespace
}  // namespace megablock
