#include "adjust/problem/long_tracks.h"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "tests/support/adjust/single_tile.h"

namespace megablock {
namespace {

SimulationOptions aerial(std::int64_t points_per_frame) {
  SimulationOptions options;
  options.frames = 12;
  options.points_per_frame = points_per_frame;
  return options;
}

std::set<std::int32_t> frames_of(const TileProblem& problem, std::int64_t p) {
  std::set<std::int32_t> frames;
  for (std::int64_t row = problem.begin[p]; row < problem.begin[p + 1]; ++row)
    if (problem.kept[row]) frames.insert(problem.images[problem.image[row].value].frame.value);
  return frames;
}

// The number of tracks that each two frames have in common.
std::map<std::pair<std::int32_t, std::int32_t>, std::int64_t> common_tracks(const TileProblem& problem) {
  std::map<std::pair<std::int32_t, std::int32_t>, std::int64_t> common;
  for (std::int64_t p = 0; p < problem.point_count(); ++p) {
    const std::set<std::int32_t> frames = frames_of(problem, p);
    for (const std::int32_t a : frames)
      for (const std::int32_t b : frames)
        if (a < b) ++common[{a, b}];
  }
  return common;
}

// Shortens all tracks but 28 of the last ones to the frames of one side, frames 0 to 2 or the others. Those 28 are as
// short as the others.
void weaken_links(TileProblem& problem) {
  int across = 0;
  for (std::int64_t p = problem.point_count() - 1; p >= 0; --p) {
    const std::set<std::int32_t> frames = frames_of(problem, p);
    if (*frames.begin() > 2 || *frames.rbegin() <= 2) continue;
    const bool weak = across++ < 28;
    int beyond = 0;
    for (std::int64_t row = problem.begin[p]; row < problem.begin[p + 1]; ++row)
      if (problem.images[problem.image[row].value].frame.value > 2 && (!weak || beyond++ > 0)) problem.kept[row] = 0;
  }
}

TEST(LongTracks, EachTwoFramesKeepTracksInCommon) {
  SingleTile tile(aerial(2000));
  weaken_links(tile.problem);
  const auto before = common_tracks(tile.problem);
  const auto observations = std::ranges::count(tile.problem.kept, 1);
  ASSERT_TRUE(choose_long_tracks(tile.problem));
  const auto after = common_tracks(tile.problem);
  for (const auto& [pair, count] : before)
    EXPECT_GE(after.at(pair), std::min(count, kTracksOfPair)) << pair.first << " and " << pair.second;
  EXPECT_LT(std::ranges::count(tile.problem.kept, 1), observations / 2);
}

TEST(LongTracks, EachFrameKeepsEnough) {
  SingleTile tile(aerial(2000));
  ASSERT_TRUE(choose_long_tracks(tile.problem));
  std::vector<std::int64_t> tracks(tile.problem.frames.size(), 0);
  for (std::int64_t p = 0; p < tile.problem.point_count(); ++p)
    for (const std::int32_t frame : frames_of(tile.problem, p)) ++tracks[static_cast<std::size_t>(frame)];
  EXPECT_GE(*std::ranges::min_element(tracks), kTracksOfFrame);
}

TEST(LongTracks, ATileThatIsNotDenseStaysAsItIs) {
  SingleTile tile(aerial(100));
  const std::vector<std::uint8_t> before = tile.problem.kept;
  EXPECT_FALSE(choose_long_tracks(tile.problem));
  EXPECT_EQ(tile.problem.kept, before);
}

}  // namespace
}  // namespace megablock
