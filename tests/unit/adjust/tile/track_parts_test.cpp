#include "adjust/tile/track_parts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "io/base/error.h"
#include "tests/support/adjust/single_tile.h"

namespace megablock {
namespace {

constexpr double kPartThreshold = 4;  // sigmas

// Tracks that see parts of other points, at the true poses.
class TrackPartsOf : public testing::Test {
 protected:
  std::int64_t long_track(std::int64_t count) const { return tile_.long_track(count); }
  void see(std::int64_t row, const Eigen::Vector3d& point) {
    tile_.redirect(row, point);
    tile_.problem.kept[row] = 0;
  }
  TrackParts parts() const { return find_track_parts(tile_.problem, tile_.state, kPartThreshold, tile_.options); }
  std::vector<int> parts_of(std::int64_t p) const {
    const TrackParts all = parts();
    return {all.begin() + tile_.problem.begin[p], all.begin() + tile_.problem.begin[p + 1]};
  }

  ExactTile tile_;
};

TEST_F(TrackPartsOf, ObservationsThatAgreeBecomeTracks) {
  const std::int64_t p = long_track(8), begin = tile_.problem.begin[p];
  for (const std::int64_t i : {1, 4}) see(begin + i, tile_.state.points[p] + Eigen::Vector3d(8, 5, 1));
  for (const std::int64_t i : {2, 5}) see(begin + i, tile_.state.points[p] - Eigen::Vector3d(6, -7, 1));
  see(begin + 3, tile_.state.points[p] + Eigen::Vector3d(-3, 9, -1));  // alone
  std::vector<int> found = parts_of(p);
  EXPECT_EQ(found[0], 0);
  EXPECT_EQ(found[3], 0);
  EXPECT_EQ(found[1], found[4]);
  EXPECT_EQ(found[2], found[5]);
  EXPECT_EQ(found[1] + found[2], 3);  // 1 and 2, whichever fits better
  EXPECT_EQ(std::count(found.begin() + 6, found.end(), 0), static_cast<std::ptrdiff_t>(found.size()) - 6);
}

TEST_F(TrackPartsOf, NothingIsSplitThatWasNotRejected) {
  const TrackParts found = parts();
  EXPECT_EQ(std::count(found.begin(), found.end(), 0), std::ssize(found));
}

// Rejected for being a little off, not for seeing another point.
TEST_F(TrackPartsOf, ObservationsNearTheirPointAreNoOtherPoint) {
  const std::int64_t p = long_track(6), begin = tile_.problem.begin[p];
  for (const std::int64_t i : {0, 3}) {
    tile_.problem.kept[begin + i] = 0;
    tile_.problem.x[begin + i] += 0.5;
  }
  const std::vector<int> found = parts_of(p);
  EXPECT_EQ(std::count(found.begin(), found.end(), 0), std::ssize(found));
}

TEST_F(TrackPartsOf, SplitTracksHoldTheSameObservations) {
  const std::int64_t p = long_track(5), begin = tile_.problem.begin[p];
  const TrackSet& tracks = tile_.simulated.tracks;
  TrackParts parts(static_cast<std::size_t>(tracks.observation_count()), 0);
  parts[begin + 0] = 1;
  parts[begin + 2] = 1;
  const TrackSet split = split_tracks(tracks, parts);
  EXPECT_EQ(split.track_count(), tracks.track_count() + 1);
  EXPECT_EQ(split.observation_count(), tracks.observation_count());
  EXPECT_EQ(split.id[p], tracks.id[p]);
  EXPECT_EQ(split.id[p + 1], tracks.id[p]);
  EXPECT_EQ(split.begin[p + 2] - split.begin[p + 1], 2);
  const auto at = static_cast<std::size_t>(split.begin[p + 1]);
  EXPECT_EQ(split.image[at], tracks.image[begin]);
  EXPECT_EQ(split.image[at + 1], tracks.image[begin + 2]);
  EXPECT_EQ(split.x[at + 1], tracks.x[begin + 2]);
  for (std::int64_t t = 0; t < split.track_count(); ++t)
    EXPECT_TRUE(std::is_sorted(split.image.begin() + split.begin[t], split.image.begin() + split.begin[t + 1]));
  const std::vector<std::int64_t> rows = rows_of_split(tracks, parts);
  for (std::size_t i = 0; i < rows.size(); ++i)
    EXPECT_EQ(split.feature[i], tracks.feature[static_cast<std::size_t>(rows[i])]);
  EXPECT_THROW(split_tracks(tracks, {0, 0}), StoreError);
}

// Repeated facades and moving vehicles give groups of outliers that agree with each other. Most of these come back as
// tracks of their own, at the places that they show.
TEST(TrackParts, OfASimulatedStreetBringBackAgreeingGroups) {
  SimulationOptions simulation;
  simulation.scene = SimulationOptions::Scene::kStereopolis;
  simulation.frames = 60;
  simulation.points_per_frame = 200;
  simulation.outlier_share = 0.06;
  simulation.mount_position_error_m = simulation.mount_rotation_error_deg = 0;
  simulation.start_position_error_m = 0.05;
  simulation.start_rotation_error_deg = 0.05;
  SingleTile tile(simulation);
  adjust_tile(tile.problem, tile.state, tile.options);
  const TrackParts parts = find_track_parts(tile.problem, tile.state,
                                            screening_threshold(tile.problem, tile.state, tile.options), tile.options);
  const TrackSet& tracks = tile.simulated.tracks;
  const std::vector<std::uint8_t>& verdicts = tile.simulated.outlier;
  std::map<Verdict, std::int64_t> back;
  std::int64_t agreeing = 0, agreeing_back = 0;
  for (std::int64_t t = 0; t < tracks.track_count(); ++t) {
    if (!tile.problem.active(t)) continue;
    const auto begin = verdicts.begin() + tracks.begin[t], end = verdicts.begin() + tracks.begin[t + 1];
    const bool group = std::count(begin, end, static_cast<std::uint8_t>(Verdict::kRepeated)) >= 2;
    for (std::int64_t o = tracks.begin[t]; o < tracks.begin[t + 1]; ++o) {
      const auto verdict = static_cast<Verdict>(verdicts[o]);
      agreeing += group && verdict == Verdict::kRepeated;
      agreeing_back += group && verdict == Verdict::kRepeated && parts[o] > 0;
      back[verdict] += parts[o] > 0;
    }
  }
  std::printf(
      "%lld observations of agreeing groups, %lld put back; outliers %lld, vehicles %lld, right %lld put back\n",
      static_cast<long long>(agreeing), static_cast<long long>(agreeing_back),
      static_cast<long long>(back[Verdict::kStray]), static_cast<long long>(back[Verdict::kVehicle]),
      static_cast<long long>(back[Verdict::kRight]));
  EXPECT_GT(agreeing, 100);
  EXPECT_GE(agreeing_back, agreeing * 7 / 10);
  EXPECT_LE(back[Verdict::kStray], agreeing_back / 20);
}

}  // namespace
}  // namespace megablock
