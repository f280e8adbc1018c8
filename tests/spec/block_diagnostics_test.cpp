// Acceptance of the block diagnostics (M57): AT-36.
#include "io/block/block_diagnostics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "io/simulate/blocks/simulate.h"
#include "partition/diagnostics/block_diagnostics.h"
#include "partition/links/link_weights.h"
#include "tests/spec/reached.h"

namespace megablock {
namespace {

constexpr std::int64_t kLines = 7, kPerLine = 14, kMissingLine = 3;

// A survey with 60 % and 30 % overlap, and what was taken out of it.
class AT36 : public testing::Test {
 protected:
  AT36() {
    SimulationOptions options;
    options.frames = kLines * kPerLine;
    options.height_m = 1000;
    options.terrain_relief_m = 40;
    options.forward_overlap = 0.6;
    options.side_overlap = 0.3;
    options.image_width = 4000;
    options.image_height = 3500;
    options.focal_px = 3000;
    options.points_per_frame = 500;
    options.mean_track = 3;
    options.calibrate = false;
    options.distortion = false;
    simulated_ = simulate_block(options);
    std::map<std::int64_t, std::vector<FrameIndex>> lines;
    for (FrameIndex f(0); simulated_.block.frames.contains(f); ++f.value)
      lines[simulated_.block.frames[f].pass].push_back(f);
    for (const auto& line : lines) lines_.push_back(line.second);
  }

  BlockDiagnostics found(const std::set<FrameIndex>& removed, const DiagnosticsOptions& options) {
    BlockState state = simulated_.truth;
    for (const FrameIndex f : removed) state.oriented[f] = 0;
    TieEvidence ties;
    const TrackSet& t = simulated_.tracks;
    points_.clear();
    ties.ground_height.assign(simulated_.block.images.size(), 0.0);
    for (std::int64_t track = 0; track < t.track_count(); ++track)
      for (std::int64_t i = t.begin[track]; i < t.begin[track + 1]; ++i)
        for (std::int64_t j = i + 1; j < t.begin[track + 1]; ++j) {
          const FrameIndex a = simulated_.block.images[t.image[i]].frame, b = simulated_.block.images[t.image[j]].frame;
          if (removed.contains(a) || removed.contains(b)) continue;
          ties.links.add(a, b, 1);
          ++points_[std::minmax(a, b)];
        }
    return diagnose(
        simulated_.block, state, [&](bool) { return ties; }, options);
  }
  double base_to_height(FrameIndex a, FrameIndex b) const {
    const Eigen::Vector3d &p = simulated_.truth.frames[a].centre, &q = simulated_.truth.frames[b].centre;
    return (p - q).norm() / ((p.z() + q.z()) / 2);
  }

  SimulatedBlock simulated_;
  std::vector<std::vector<FrameIndex>> lines_;
  std::map<std::pair<FrameIndex, FrameIndex>, std::int64_t> points_;  // common ones
};

TEST_F(AT36, NothingIsMissingInTheWholeBlock) {
  const BlockDiagnostics d = found({}, {});
  ASSERT_EQ(lines_.size(), static_cast<std::size_t>(kLines));
  EXPECT_TRUE(d.aerial);
  EXPECT_EQ(d.lines, kLines);
  EXPECT_TRUE(d.gaps.empty());
  EXPECT_TRUE(d.thin_ground.empty());
  EXPECT_EQ(d.part_frames.size(), 1u);
  EXPECT_TRUE(d.weak_links.empty());
  EXPECT_TRUE(d.single_links.empty());
  EXPECT_TRUE(d.proposals.empty());
}

TEST_F(AT36, ThreeImagesAndAFlightLineAreMissing) {
  // Two neighbours of one line, and one image of another.
  const std::set<FrameIndex> images = {lines_[1][5], lines_[1][6], lines_[5][8]};
  std::set<FrameIndex> removed = images;
  removed.insert(lines_[kMissingLine].begin(), lines_[kMissingLine].end());
  DiagnosticsOptions options;
  options.min_base_to_height = 0.45;
  options.max_base_to_height = 0.7;
  const BlockDiagnostics d = found(removed, options);

  // Gaps: exactly these three, with what is missing.
  std::int64_t wrong = 0, line_gaps = 0;
  std::map<std::pair<FrameIndex, FrameIndex>, std::int64_t> gaps;
  for (const auto& gap : d.gaps) {
    if (!gap.line) gaps[{gap.before, gap.after}] = gap.missing;
    if (!gap.line) continue;
    ++line_gaps;
    wrong += gap.missing != 1 || gap.before != lines_[kMissingLine - 1].front() ||
             gap.after != lines_[kMissingLine - 1].back();
  }
  EXPECT_EQ(line_gaps, 1);
  const std::map<std::pair<FrameIndex, FrameIndex>, std::int64_t> expected = {{{lines_[1][4], lines_[1][7]}, 2},
                                                                              {{lines_[5][7], lines_[5][9]}, 1}};
  EXPECT_EQ(gaps, expected);
  expect_at_most(
      static_cast<double>(wrong) + static_cast<double>(line_gaps != 1) + static_cast<double>(gaps != expected), 0,
      "gaps that are not as they should be");

  // Weakly connected: what lies on both sides of the missing line.
  std::int64_t elsewhere = 0;
  ASSERT_EQ(d.part_frames.size(), 2u);
  for (std::size_t l = 0; l < lines_.size(); ++l)
    for (const FrameIndex f : lines_[l]) {
      if (removed.contains(f)) {
        EXPECT_EQ(d.part_of_frame[f], -1);
      } else {
        elsewhere += d.part_of_frame[f] != d.part_of_frame[lines_[l < kMissingLine ? 0 : kLines - 1][0]];
      }
    }
  EXPECT_NE(d.part_of_frame[lines_[0][0]], d.part_of_frame[lines_[kLines - 1][0]]);
  expect_at_most(static_cast<double>(elsewhere), 0, "frames in another part than their side of the missing line");
  std::map<std::pair<FrameIndex, FrameIndex>, std::int64_t> weak;
  for (const auto& [pair, points] : points_)
    if (d.part_of_frame[pair.first] != d.part_of_frame[pair.second]) weak[pair] = points;
  std::map<std::pair<FrameIndex, FrameIndex>, std::int64_t> reported;
  for (const auto& link : d.weak_links) reported[{link.a, link.b}] = link.points;
  EXPECT_EQ(reported, weak);

  // Bases outside the interval.
  std::set<std::pair<FrameIndex, FrameIndex>> outside, said;
  for (const std::vector<FrameIndex>& line : lines_) {
    std::vector<FrameIndex> there;
    for (const FrameIndex f : line)
      if (!removed.contains(f)) there.push_back(f);
    for (std::size_t i = 0; i + 1 < there.size(); ++i)
      if (const double b = base_to_height(there[i], there[i + 1]); b < 0.45 || b > 0.7)
        outside.insert({there[i], there[i + 1]});
  }
  for (const auto& pair : d.pairs)
    if (d.base_is_outside(pair)) said.insert({pair.a, pair.b});
  EXPECT_GE(outside.size(), 2u);
  EXPECT_EQ(said, outside);
  expect_at_most(static_cast<double>(said != outside), 0, "whether pairs with a base outside the interval differ");

  // The machine-readable form says the same.
  const auto json = nlohmann::json::parse(to_json(d, simulated_.block));
  EXPECT_EQ(json.at("gaps").size(), 3u);
  EXPECT_EQ(json.at("smaller_parts").size(), 1u);
  EXPECT_EQ(json.at("smaller_parts")[0].size(), static_cast<std::size_t>(d.part_frames[1]));
  EXPECT_EQ(json.at("weak_links").size(), weak.size());
  std::size_t marked = 0;
  for (const auto& pair : json.at("pairs")) marked += pair.at("outside").get<bool>() ? 1 : 0;
  EXPECT_EQ(marked, outside.size());
  EXPECT_EQ(json.at("proposals").size(), d.proposals.size());

  // A view is proposed where each was taken away, and nowhere else.
  double farthest = 0;
  for (const FrameIndex f : removed) {
    double nearest = 1e9;
    for (const auto& proposal : d.proposals)
      nearest = std::min(nearest, (proposal.centre - simulated_.truth.frames[f].centre).head<2>().norm());
    keep_largest(farthest, nearest);
  }
  expect_within(static_cast<double>(d.proposals.size()), static_cast<double>(removed.size()), 0, "views proposed");
  expect_at_most(farthest / d.usual_step_m, 0.25, "from a removed image to the nearest proposal, usual steps");
}

TEST_F(AT36, GroundThatTooFewImagesSeeIsFoundWhereItIs) {
  std::set<FrameIndex> removed = {lines_[1][5], lines_[1][6], lines_[5][8]};
  removed.insert(lines_[kMissingLine].begin(), lines_[kMissingLine].end());
  const BlockDiagnostics d = found(removed, {});
  // By brute force: places between the corners of the block that fewer than two footprints contain.
  const auto seen = [&](const Eigen::Vector2d& place) {
    int count = 0;
    for (const auto& footprint : d.footprints) {
      double turn = 0;
      for (std::size_t k = 0; k < 4; ++k) {
        const Eigen::Vector2d a = footprint.corners[k] - place, b = footprint.corners[(k + 1) % 4] - place;
        turn += std::atan2(a.x() * b.y() - a.y() * b.x(), a.dot(b));
      }
      count += std::abs(turn) > 3;
    }
    return count;
  };
  ASSERT_FALSE(d.thin_ground.empty());
  double area = 0;
  for (const auto& ground : d.thin_ground) {
    area += ground.area_m2;
    for (const Eigen::Vector2d& cell : ground.cells) EXPECT_LT(seen(cell), 2) << cell.transpose();
  }
  const Eigen::Vector2d low = simulated_.truth.frames[lines_.front().front()].centre.head<2>(),
                        high = simulated_.truth.frames[lines_.back().back()].centre.head<2>();
  const Eigen::Vector2d from = low.cwiseMin(high), to = low.cwiseMax(high);
  double inside = 0;
  for (double x = from.x(); x < to.x(); x += d.cell_m)
    for (double y = from.y(); y < to.y(); y += d.cell_m) inside += (seen({x, y}) < 2) * d.cell_m * d.cell_m;
  expect_within(area / inside, 1, 0.2, "area of thin ground over that by brute force");
}

}  // namespace
}  // namespace megablock
