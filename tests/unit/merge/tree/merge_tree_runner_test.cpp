// Passes of one rank within a budget of scratch: its directory never holds more, and no bit changes.
#include "merge/tree/merge_tree_runner.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "merge/tree/sweep_recorder.h"
#include "merge/tree/tree_communicator.h"
#include "tests/support/io/scratch_directory.h"
#include "tests/support/merge/tiled_block.h"

namespace megablock {
namespace {

std::int64_t bytes_in(const std::string& folder) {
  std::int64_t bytes = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    bytes += static_cast<std::int64_t>(entry.file_size());
  return bytes;
}

class ScratchBudgetTest : public testing::Test {
 protected:
  static SimulationOptions scene() {
    SimulationOptions options;
    options.frames = 90;
    options.points_per_frame = 60;
    return options;
  }
  ScratchBudgetTest() : block_(simulate_block(scene()), 12, {}, 0.1) {}

  // Two rounds, as of screening, with `memory`; a record after every tile. Asks `look` after every pass.
  struct End {
    double cost = 0;
    Bytes points;
    std::int64_t tiles_in_scratch = 0, spilled = 0, recomputed = 0;
  };
  End run(const MemoryOptions& memory, const std::function<void()>& look) {
    SweepRecorder recorder(memory.scratch, 0);
    recorder.set_position([] { return SweepRecorder::Position{1, "somewhere"}; });
    recorder.keep_found(1);
    TileStore tiles(memory);
    for (std::size_t t = 0; t < block_.problems.size(); ++t)
      tiles.add({static_cast<std::int64_t>(t), block_.problems[t], block_.states[t]});
    End end;
    for (int round = 0; round < 2; ++round) {
      MergeTreeRunner runner(ranks_, block_.tiles.tree, std::vector<int>(tiles.size(), 0), tiles, memory);
      runner.record_sweeps(recorder);
      GlobalState state = start_global({});
      adjust_globally(runner, {}, state, [&](const GlobalState&) { look(); });
      runner.posterior([&](const RankTile&, const TileCovariance&) { look(); });
      end = {state.cost, {}, tiles.spilled(), runner.memory().spilled, runner.memory().recomputed};
      for (std::size_t row = 0; row < tiles.size(); ++row)
        tiles.change(row, [](RankTile& tile) { tile.problem.kept.front() ^= 1; });
      look();
    }
    ByteWriter writer;
    for (std::size_t row = 0; row < tiles.size(); ++row) {
      const std::vector<Eigen::Vector3d>& points = tiles.whole(row).state.points;
      writer.elements(points.front().data(), 3 * points.size());
    }
    end.points = writer.take();
    return end;
  }

  OneProcess ranks_;
  TiledBlock block_;
};

TEST_F(ScratchBudgetTest, IsKeptAfterEveryPassAndChangesNoBit) {
  const ScratchDirectory scratch;
  const End reference = run({}, [] {});
  std::int64_t most = 0;
  const auto run_within = [&](std::int64_t budget) {
    const std::string folder = scratch.path(std::to_string(budget));
    MemoryOptions memory{1 << 16, std::make_shared<ScratchSpace>(folder, budget), 1 << 14};
    most = 0;
    const End end = run(memory, [&] {
      most = std::max(most, bytes_in(folder));
      EXPECT_LE(bytes_in(folder), memory.scratch->bytes());
      EXPECT_LE(memory.scratch->bytes(), budget);
    });
    EXPECT_EQ(end.cost, reference.cost) << budget;
    EXPECT_EQ(end.points, reference.points) << budget;
    EXPECT_LE(most, budget);
    return end;
  };
  const End free = run_within(std::int64_t{1} << 40);
  EXPECT_GT(free.tiles_in_scratch, 5);
  EXPECT_GT(free.spilled, 10);
  EXPECT_EQ(free.recomputed, 0);
  const std::int64_t all = most;
  for (const int sixteenths : {15, 12, 8, 4, 1}) {
    const End end = run_within(all * sixteenths / 16);
    EXPECT_TRUE(sixteenths > 8 || end.recomputed > 0) << sixteenths;
  }
}

}  // namespace
}  // namespace megablock
