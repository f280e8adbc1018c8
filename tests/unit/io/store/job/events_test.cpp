#include "io/store/job/events.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "io/base/error.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

UnitEvent example_event(const std::string& unit) {
  UnitEvent event;
  event.stage = "features";
  event.unit = unit;
  event.rank = 3;
  event.seconds = 1.5;
  event.claim_seconds = 0.25;
  event.bytes = 5000000000;
  event.peak_rss_mib = 812.5;
  return event;
}

class Events : public ::testing::Test {
 protected:
  Events() { store_.create(); }
  ScratchDirectory scratch_;
  JobStore store_{scratch_.path("job")};
};

TEST_F(Events, ComeBackInOrder) {
  EXPECT_TRUE(read_events(store_).empty());
  EventLog log(store_, 3);
  log.append(example_event("features/000000.h5"));
  UnitEvent failed = example_event("features/000001.h5");
  failed.failure = "image \"a\\b.jpg\" is\ntruncated";
  log.append(failed);
  const std::vector<UnitEvent> events = read_events(store_);
  ASSERT_EQ(events.size(), 2u);
  EXPECT_EQ(events[0].unit, "features/000000.h5");
  EXPECT_EQ(events[0].stage, "features");
  EXPECT_EQ(events[0].rank, 3);
  EXPECT_EQ(events[0].seconds, 1.5);
  EXPECT_EQ(events[0].claim_seconds, 0.25);
  EXPECT_EQ(events[0].bytes, 5000000000);
  EXPECT_EQ(events[0].peak_rss_mib, 812.5);
  EXPECT_EQ(events[0].failure, "");
  EXPECT_EQ(events[1].failure, failed.failure);
  EXPECT_LE(events[0].time_s, events[1].time_s);
}

TEST_F(Events, OfAllRanksAreRead) {
  EventLog first(store_, 0), second(store_, 1);
  first.append(example_event("a"));
  second.append(example_event("b"));
  EXPECT_EQ(read_events(store_).size(), 2u);
  EXPECT_TRUE(first.path().ends_with("Z-0.jsonl"));
}

TEST_F(Events, TornLastLineIsLeftOutAtAnyLength) {
  EventLog log(store_, 0);
  log.append(example_event("a"));
  const auto whole = std::filesystem::file_size(log.path());
  log.append(example_event("b"));
  for (auto size = std::filesystem::file_size(log.path()) - 1; size >= whole; --size) {
    std::filesystem::resize_file(log.path(), size);
    EXPECT_EQ(read_events(store_).size(), 1u) << size;
  }
}

TEST_F(Events, ZeroBytesAfterAPowerCutAreLeftOut) {
  EventLog log(store_, 0);
  log.append(example_event("a"));
  std::filesystem::resize_file(log.path(), std::filesystem::file_size(log.path()) + 100);
  EXPECT_EQ(read_events(store_).size(), 1u);
}

TEST_F(Events, MalformedLineInTheMiddleIsNamed) {
  EventLog log(store_, 0);
  log.append(example_event("a"));
  std::ofstream(log.path(), std::ios::app) << "not json\n";
  log.append(example_event("b"));
  try {
    read_events(store_);
    FAIL() << "no error";
  } catch (const StoreError& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr(log.path() + ":2: "));
  }
}

TEST_F(Events, NameThatIsNoUtf8IsWritten) {
  EventLog log(store_, 0);
  log.append(example_event("M\xfcnchen.jpg"));
  EXPECT_EQ(read_events(store_).size(), 1u);
}

TEST_F(Events, FileInTheWayIsNamed) {
  std::filesystem::remove(store_.path("events"));
  std::ofstream(store_.path("events")) << "in the way";
  EXPECT_THROW(EventLog(store_, 0), InputError);
}

}  // namespace
}  // namespace megablock
