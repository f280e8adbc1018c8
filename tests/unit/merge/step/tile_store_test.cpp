// Tiles on disk are read back as they were written, with any memory limit and after failures of the scratch disk.
#include "merge/step/tile_store.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/support/io/scratch_directory.h"
#include "tests/support/merge/damaged_scratch.h"

namespace megablock {
namespace {

// Tile `number` with `points` points of three observations each; every value tells where it belongs.
RankTile made_up_tile(std::int64_t number, std::int64_t points) {
  RankTile tile;
  tile.tile = number;
  tile.problem.frames = {FrameIndex(number)};
  tile.state.frames.resize(1);
  tile.state.frames[0].centre = Eigen::Vector3d(static_cast<double>(number), 0, 0);
  for (std::int64_t i = 0; i < 3; ++i)
    tile.problem.images.push_back({ImageIndex(3 * number + i), LocalFrame(0), LocalCamera(0), 0});
  tile.problem.positions.push_back({LocalFrame(0), {.position = tile.state.frames[0].centre}});
  tile.problem.begin.push_back(0);
  for (std::int64_t p = 0; p < points; ++p) {
    const auto value = static_cast<double>(1000 * number + p);
    tile.problem.points.push_back({PointRole::kTie, 1000 * number + p});
    tile.state.points.emplace_back(value, value + 0.25, value + 0.5);
    for (int k = 0; k < 3; ++k) {
      tile.problem.image.push_back(LocalImage(k));
      tile.problem.x.push_back(value + k);
      tile.problem.y.push_back(-value - k);
      tile.problem.inverse_sigma.push_back(2 + k);
      tile.problem.kept.push_back(static_cast<std::uint8_t>(p % 2));
    }
    tile.problem.begin.push_back(3 * (p + 1));
  }
  return tile;
}

void expect_equal(const RankTile& found, const RankTile& expected) {
  EXPECT_EQ(found.tile, expected.tile);
  EXPECT_EQ(found.problem.frames, expected.problem.frames);
  EXPECT_EQ(found.state.frames[0].centre, expected.state.frames[0].centre);
  ASSERT_EQ(found.problem.images.size(), expected.problem.images.size());
  for (std::size_t i = 0; i < expected.problem.images.size(); ++i)
    EXPECT_EQ(found.problem.images[i].image, expected.problem.images[i].image);
  ASSERT_EQ(found.problem.positions.size(), 1u);
  EXPECT_EQ(found.problem.positions[0].prior.position, expected.problem.positions[0].prior.position);
  ASSERT_EQ(found.problem.points.size(), expected.problem.points.size());
  for (std::size_t p = 0; p < expected.problem.points.size(); ++p)
    EXPECT_EQ(found.problem.points[p].index, expected.problem.points[p].index);
  EXPECT_EQ(found.problem.begin, expected.problem.begin);
  EXPECT_EQ(found.problem.image, expected.problem.image);
  EXPECT_EQ(found.problem.x, expected.problem.x);
  EXPECT_EQ(found.problem.y, expected.problem.y);
  EXPECT_EQ(found.problem.inverse_sigma, expected.problem.inverse_sigma);
  EXPECT_EQ(found.problem.kept, expected.problem.kept);
  EXPECT_EQ(found.state.points, expected.state.points);
}

class TileStoreTest : public testing::Test {
 protected:
  static constexpr std::int64_t kTiles = 5, kPoints = 40;

  // Room for about two of the five tiles.
  MemoryOptions options() const {
    MemoryOptions options;
    options.scratch = std::make_shared<ScratchSpace>(scratch_.path("rank-0"));
    options.tile_bytes = 2 * 40 * (2 * 24 + 16 + 8 + 3 * 29) + 600;
    return options;
  }
  static void fill(TileStore& store) {
    for (std::int64_t t = 0; t < kTiles; ++t) store.add(made_up_tile(t, kPoints));
  }
  std::int64_t files() const {
    const std::filesystem::directory_iterator all(scratch_.path("rank-0"));
    return std::distance(begin(all), end(all));
  }
  ScratchDirectory scratch_;
};

TEST_F(TileStoreTest, EveryTileComesBackWhole) {
  TileStore store(options());
  fill(store);
  ASSERT_EQ(store.size(), 5u);
  EXPECT_EQ(store.spilled(), 3);
  for (const std::size_t row : {0u, 4u, 2u, 2u, 1u, 3u, 0u})
    expect_equal(store.whole(row), made_up_tile(static_cast<std::int64_t>(row), kPoints));
  EXPECT_EQ(store.number(3), 3);
  EXPECT_EQ(store.outline(3).problem.frames, made_up_tile(3, kPoints).problem.frames);
}

// Of its files as they are, with a trial's points beside the present ones.
TEST_F(TileStoreTest, CountsWhatIsInScratch) {
  const MemoryOptions memory = options();
  const ScratchSpace& scratch = *memory.scratch;
  TileStore store(memory);
  fill(store);
  const auto expected = [&] {
    std::int64_t bytes = 0;
    for (std::int64_t row = 0; row < kTiles; ++row)
      if (store.in_scratch(static_cast<std::size_t>(row)))
        bytes += 2 * (8 + kPoints * 24) + static_cast<std::int64_t>(std::filesystem::file_size(scratch_.path(
                                              "rank-0/tile-" + std::to_string(row) + "-measurements.bin")));
    return bytes;
  };
  const std::int64_t before = scratch.bytes();
  EXPECT_EQ(before, expected());
  EXPECT_GT(before, 3 * 2 * kPoints * 24);
  for (std::size_t row = 0; row < store.size(); ++row)
    store.change(row, [](RankTile& tile) { tile.problem.kept.assign(tile.problem.kept.size(), 1); });
  EXPECT_EQ(scratch.bytes(), expected());
  EXPECT_LT(scratch.bytes(), before);
}

TEST_F(TileStoreTest, ATileInScratchTakesNoMemory) {
  TileStore store(options());
  fill(store);
  store.whole(4);
  store.whole(3);
  EXPECT_TRUE(store.outline(4).problem.x.empty());
  EXPECT_TRUE(store.outline(4).state.points.empty());
}

TEST_F(TileStoreTest, ChangesStay) {
  TileStore store(options());
  fill(store);
  for (std::size_t row = 0; row < store.size(); ++row)
    store.change(row, [](RankTile& tile) {
      tile.problem.kept.assign(tile.problem.kept.size(), 1);
      tile.state.points[7].setConstant(static_cast<double>(tile.tile));
    });
  for (std::size_t row = 0; row < store.size(); ++row) {
    RankTile expected = made_up_tile(static_cast<std::int64_t>(row), kPoints);
    expected.problem.kept.assign(expected.problem.kept.size(), 1);
    expected.state.points[7].setConstant(static_cast<double>(row));
    expect_equal(store.whole(row), expected);
  }
}

// A state whose points and frame are moved by `step`.
TileState moved(TileState state, double step) {
  for (Eigen::Vector3d& point : state.points) point.x() += step;
  state.frames[0].centre.x() += step;
  return state;
}

TEST_F(TileStoreTest, TrialsAreTakenOrLeft) {
  TileStore store(options());
  fill(store);
  double total = 0;
  for (const double step : {1.0, 0.5, 0.25}) {
    for (std::size_t row = 0; row < store.size(); ++row) store.put_trial(row, moved(store.whole(row).state, step));
    if (step == 0.5) {
      store.reject();
    } else {
      store.accept();
      total += step;
    }
    for (std::size_t row = 0; row < store.size(); ++row) {
      RankTile expected = made_up_tile(static_cast<std::int64_t>(row), kPoints);
      expected.state = moved(expected.state, total);
      expect_equal(store.whole(row), expected);
    }
  }
}

// The disk fills while the adjustment runs.
TEST_F(TileStoreTest, NothingIsLostWhenTheScratchDiskFails) {
  const MemoryOptions memory = options();
  TileStore store(memory);
  fill(store);
  // Points of a step that find no room stay in memory...
  for (std::size_t row = 0; row < store.size(); ++row) {
    TileState trial = moved(store.whole(row).state, 2);
    const BrokenDisk disk(scratch_.path("rank-0"));
    store.put_trial(row, std::move(trial));
  }
  store.accept();
  // ... and so do whole tiles.
  for (std::size_t row = 0; row < store.size(); ++row) {
    store.whole(row);
    const BrokenDisk disk(scratch_.path("rank-0"));
    store.change(row, [](RankTile& tile) { tile.problem.kept[0] = 1; });
  }
  EXPECT_EQ(store.spilled(), 0);
  EXPECT_EQ(memory.scratch->bytes(), 0);
  for (std::size_t row = 0; row < store.size(); ++row) {
    RankTile expected = made_up_tile(static_cast<std::int64_t>(row), kPoints);
    expected.problem.kept[0] = 1;
    expected.state = moved(expected.state, 2);
    expect_equal(store.whole(row), expected);
  }
}

TEST_F(TileStoreTest, KeepsWhatHasNoRoomInScratch) {
  MemoryOptions none = options();
  none.scratch = std::make_shared<ScratchSpace>(scratch_.path("none"), 0);
  MemoryOptions nowhere = options();
  nowhere.scratch = std::make_shared<ScratchSpace>();
  for (const MemoryOptions& memory : {none, nowhere}) {
    TileStore store(memory);
    fill(store);
    EXPECT_EQ(store.spilled(), 0);
    for (std::size_t row = 0; row < store.size(); ++row)
      expect_equal(store.whole(row), made_up_tile(static_cast<std::int64_t>(row), kPoints));
  }
}

TEST_F(TileStoreTest, NamesAFileThatIsDamaged) {
  TileStore store(options());
  fill(store);
  const std::string file = scratch_.path("rank-0/tile-4-measurements.bin");
  std::filesystem::resize_file(file, 100);
  expect_named([&] { store.whole(4); }, file);
}

// With a number of values that no memory can hold.
TEST_F(TileStoreTest, NamesAFileWithADamagedSize) {
  for (const std::string name : {"tile-4-measurements.bin", "tile-4-points-0.bin"}) {
    TileStore store(options());
    fill(store);
    const std::string file = scratch_.path("rank-0/" + name);
    std::fstream(file, std::ios::binary | std::ios::in | std::ios::out).seekp(7).put('\x40');
    expect_named([&] { store.whole(4); }, file);
  }
}

TEST_F(TileStoreTest, LeavesNoFiles) {
  {
    TileStore store(options());
    fill(store);
    EXPECT_GT(files(), 0);
  }
  EXPECT_EQ(files(), 0);
}

}  // namespace
}  // namespace megablock
