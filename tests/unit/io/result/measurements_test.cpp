#include "io/result/measurements.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <random>
#include <tuple>

#include "io/base/error.h"
#include "io/result/result.h"
#include "io/store/hdf5/hdf5_tables.h"
#include "io/store/units/block_file.h"
#include "io/store/units/track_reader.h"
#include "io/store/units/tracks_file.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

using ::testing::HasSubstr;
using Row = std::tuple<std::int64_t, std::int64_t, std::int64_t, int, int, int>;  // image, tile, track, x, y, feature

constexpr int kFrames = 200, kImages = 2 * kFrames, kTiles = 5;

std::string complaint_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

// A street along which points are seen by successive images; every tile owns a stretch, the third has no track, and
// image 7 no measurement. Some tracks come back to earlier images, as where a street is driven twice.
std::vector<TrackSet> street() {
  std::mt19937_64 random(3);
  std::vector<TrackSet> tiles(kTiles);
  for (TrackSet& tile : tiles) tile.begin = {0};
  for (int t = 0; t < 9000; ++t) {
    TrackSet& tile = tiles[static_cast<std::size_t>(t * kTiles / 9000)];
    if (&tile == &tiles[2]) continue;
    tile.id.emplace_back(10 * t + static_cast<int>(random() % 10));
    int image = t * (kImages - 60) / 9000;
    if (random() % 10 == 0) image /= 2;
    for (int o = 0; o < 5; ++o, image += 1 + static_cast<int>(random() % 8)) {
      if (image == 7) continue;
      tile.image.emplace_back(image);
      tile.x.push_back(static_cast<int>(random() % 2000000));
      tile.y.push_back(static_cast<int>(random() % 1000000));
      tile.feature.push_back(static_cast<int>(random() % 8000));
    }
    tile.begin.push_back(tile.observation_count());
  }
  return tiles;
}

Block block_of_street() {
  Block block;
  Camera camera;
  camera.width = camera.height = 1000;
  camera.intrinsics = {800, 500, 500, 0, 0, 0, 0, 0};
  for (const char* name : {"left", "right"}) {
    camera.name = name;
    block.cameras.push_back(camera);
  }
  block.rigs.push_back({"rig", {Mount{CameraIndex(0), {}}, Mount{CameraIndex(1), {}}}});
  for (int f = 0; f < kFrames; ++f) {
    Frame frame;
    frame.name = "frame " + std::to_string(f);
    frame.rig = RigIndex(0);
    block.frames.push_back(frame);
    for (int m = 0; m < 2; ++m) block.add_image(frame.name + "/" + std::to_string(m), {FrameIndex(f), m, 0});
  }
  return block;
}

std::string unit_of(std::size_t tile) { return "tracks/00000" + std::to_string(tile) + ".h5"; }

class StreetJob : public ::testing::Test {
 protected:
  void SetUp() override {
    store_.write_text("job.json", "{}");
    store_.write("block.h5", 1, [](const std::string& path) { write_block(path, block_of_street()); });
    write(street());
  }

  void write(const std::vector<TrackSet>& tiles) {
    tiles_ = tiles;
    std::vector<std::string> names;
    for (std::size_t t = 0; t < tiles.size(); ++t) {
      names.push_back(unit_of(t));
      const auto fingerprint = static_cast<std::uint64_t>(tiles[t].observation_count());
      store_.write(names.back(), fingerprint, [&](const std::string& path) { write_tracks(path, tiles[t]); });
    }
    write_list();
    update_measurement_index(store_, names);
  }

  void write_list() {
    store_.write("tracks/index.txt", 1, [&](const std::string& path) {
      std::ofstream list(path);
      for (std::size_t t = 0; t < tiles_.size(); ++t)
        list << unit_of(t) << ' ' << tiles_[t].observation_count() << '\n';
    });
  }

  std::vector<Row> brute_force(const std::vector<std::int64_t>& images) const {
    std::vector<Row> rows;
    for (std::size_t t = 0; t < tiles_.size(); ++t) {
      const TrackSet tile = read_tracks(store_.path(unit_of(t)));
      for (std::size_t k = 0; k < tile.id.size(); ++k)
        for (auto o = static_cast<std::size_t>(tile.begin[k]); o < static_cast<std::size_t>(tile.begin[k + 1]); ++o)
          if (std::find(images.begin(), images.end(), tile.image[o].value) != images.end())
            rows.emplace_back(tile.image[o].value, t, tile.id[k].value, tile.x[o], tile.y[o], tile.feature[o]);
    }
    std::sort(rows.begin(), rows.end());
    return rows;
  }

  std::vector<Row> asked(const std::vector<std::int64_t>& images) const {
    std::vector<ImageIndex> indices;
    for (const std::int64_t image : images) indices.emplace_back(image);
    const Measurements found = MeasurementStore(scratch_.path()).of_images(indices);
    std::vector<Row> rows;
    for (std::size_t r = 0; r < found.image.size(); ++r)
      rows.emplace_back(found.image[r].value, found.tile[r].value, found.track[r].value, found.x[r], found.y[r],
                        found.feature[r]);
    return rows;
  }

  ScratchDirectory scratch_;
  JobStore store_{scratch_.path()};
  std::vector<TrackSet> tiles_;
};

using MeasurementsByImage = StreetJob;
using MeasurementsByPlace = StreetJob;

TEST_F(MeasurementsByImage, EqualASearchThroughAllTiles) {
  std::int64_t rows = 0, in_several_tiles = 0;
  for (std::int64_t image = 0; image < kImages; image += 3) {
    const std::vector<Row> expected = brute_force({image});
    EXPECT_EQ(asked({image}), expected) << image;
    rows += std::ssize(expected);
    in_several_tiles += !expected.empty() && std::get<1>(expected.front()) != std::get<1>(expected.back());
  }
  EXPECT_GT(rows, 5000);
  EXPECT_GT(in_several_tiles, 20);
  EXPECT_EQ(asked({300, 12, 13, 12, 399, 7}), brute_force({12, 13, 300, 399}));
}

TEST_F(MeasurementsByImage, AnImageWithoutAnyHasNoRows) {
  EXPECT_TRUE(asked({7}).empty());
  EXPECT_TRUE(asked({kImages + 1000}).empty());  // came after the tracks were made
  EXPECT_TRUE(asked({}).empty());
  EXPECT_THROW(asked({-1}), InputError);
}

TEST_F(MeasurementsByImage, NamesAreFound) {
  const MeasurementStore store(scratch_.path());
  EXPECT_EQ(store.find_images({"frame 150/1", "frame 0/0"}), (std::vector{ImageIndex(301), ImageIndex(0)}));
  EXPECT_EQ(store.images_of_frames({"frame 199", "frame 3"}),
            (std::vector{ImageIndex(6), ImageIndex(7), ImageIndex(398), ImageIndex(399)}));
  EXPECT_EQ(store.names_of({ImageIndex(6), ImageIndex(398)}), (std::vector<std::string>{"frame 3/0", "frame 199/0"}));
  EXPECT_THAT(complaint_of([&] { store.find_images({"frame 0/0", "frame 0"}); }), HasSubstr("no image 'frame 0'"));
  EXPECT_THAT(complaint_of([&] { store.images_of_frames({"frame 200"}); }), HasSubstr("no frame 'frame 200'"));
}

TEST_F(MeasurementsByImage, FollowTheTilesWhenABlockGrows) {
  std::vector<TrackSet> tiles = street();
  tiles[4].image.back() = ImageIndex(kImages + 5);
  tiles[4].x.back() = 123;
  tiles[2] = tiles[3];
  write(tiles);
  EXPECT_EQ(asked({kImages + 5}), brute_force({kImages + 5}));
  EXPECT_EQ(asked({kImages + 5}).size(), 1u);
  EXPECT_EQ(asked({250}), brute_force({250}));
}

TEST_F(MeasurementsByImage, AStaleIndexIsRefusedAndMadeAgain) {
  tiles_[0] = tiles_[1];
  store_.write(unit_of(0), 77, [&](const std::string& path) { write_tracks(path, tiles_[0]); });  // killed thereafter
  EXPECT_THAT(complaint_of([&] { asked({0}); }), HasSubstr("is newer than measurements.h5"));
  EXPECT_THAT(complaint_of([&] { check_measurement_index(store_); }),
              HasSubstr("does not belong to the present tracks"));
  write_list();
  EXPECT_THAT(complaint_of([&] { asked({0}); }), HasSubstr("is older than the job's tracks"));
  EXPECT_THAT(complaint_of([&] { check_measurement_index(store_); }),
              HasSubstr("does not belong to the present tracks"));
  update_measurement_index(store_, {unit_of(0), unit_of(1), unit_of(2), unit_of(3), unit_of(4)});
  check_measurement_index(store_);
  EXPECT_EQ(asked({100}), brute_force({100}));
}

TEST_F(MeasurementsByImage, TheIndexIsLeftAloneWhileItIsRightAndRepairedWhenItIsNot) {
  const std::vector<std::string> names = {unit_of(0), unit_of(1), unit_of(2), unit_of(3), unit_of(4)};
  const std::string path = store_.path("measurements.h5");
  const auto written = std::filesystem::last_write_time(path);
  update_measurement_index(store_, names);
  EXPECT_EQ(std::filesystem::last_write_time(path), written);
  {
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(500).put('\x5a');
  }
  EXPECT_THAT(complaint_of([&] { asked({0}); }), HasSubstr("measurements.h5: is damaged"));
  update_measurement_index(store_, names);
  EXPECT_EQ(asked({100}), brute_force({100}));
}

TEST_F(MeasurementsByImage, ADamagedTileIsNamed) {
  const auto size = std::filesystem::file_size(store_.path(unit_of(1)));
  std::fstream file(store_.path(unit_of(1)), std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(static_cast<std::streamoff>(size / 2)).put('\x5a').put('\x5b');
  file.close();
  EXPECT_THAT(complaint_of([&] { asked({100}); }), HasSubstr("tracks/000001.h5: is damaged"));
  EXPECT_EQ(asked({399}), brute_force({399}));  // of other tiles
}

TEST_F(MeasurementsByImage, AJobWithoutTracksSaysSo) {
  store_.remove("tracks/index.txt");
  EXPECT_THAT(complaint_of([&] { asked({0}); }), HasSubstr("the job has no tracks yet"));
  EXPECT_THROW(MeasurementStore(scratch_.path("elsewhere")), InputError);
}

// The tracks of the street, again and again, as points along it: more than a district. Every ninth has no position.
BlockResult result_of(std::vector<TrackSet> tiles) {
  constexpr int kCopies = 10;
  const std::vector<TrackSet> street = tiles;
  for (int copy = 1; copy < kCopies; ++copy) tiles.insert(tiles.end(), street.begin(), street.end());
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> offset(-20, 20);
  BlockResult result;
  result.block = block_of_street();
  result.state = initial_state(result.block);
  result.boundary.assign(kFrames, 0);
  result.tiles.tile_count = kTiles;
  result.tiles.tile_of_frame.assign(kFrames, TileIndex(0));
  result.tiles.component.assign(kFrames, 0);
  result.tracks.begin = {0};
  for (std::size_t t = 0; t < tiles.size(); ++t)
    for (std::size_t k = 0; k < tiles[t].id.size(); ++k) {
      const auto row = static_cast<double>(result.tracks.id.size());
      result.tracks.id.emplace_back(static_cast<std::int64_t>(row));
      result.file_tracks.push_back(tiles[t].id[k]);
      result.file_tiles.emplace_back(static_cast<std::int64_t>(t % street.size()));
      result.points.emplace_back(1e4 + 0.25 * row, -500 + offset(random), offset(random));
      if (random() % 9 == 0) result.points.back().setConstant(std::nan(""));
      for (auto o = static_cast<std::size_t>(tiles[t].begin[k]); o < static_cast<std::size_t>(tiles[t].begin[k + 1]);
           ++o) {
        result.tracks.image.push_back(tiles[t].image[o]);
        result.tracks.x.push_back(tiles[t].x[o]);
        result.tracks.y.push_back(tiles[t].y[o]);
        result.tracks.feature.push_back(tiles[t].feature[o]);
        result.kept.push_back(random() % 5 != 0);
        result.residual_x.push_back(static_cast<float>(offset(random)));
        result.residual_y.push_back(static_cast<float>(offset(random)));
      }
      result.tracks.begin.push_back(result.tracks.observation_count());
    }
  return result;
}

TEST_F(MeasurementsByPlace, EqualASearchThroughAllPoints) {
  const BlockResult result = result_of(tiles_);
  store_.write("result/block.h5", 1, [&](const std::string& path) { write_result(path, result); });
  const MeasurementStore store(scratch_.path());
  std::int64_t total = 0;
  for (const GroundPlace& place : std::vector<GroundPlace>{{{1.1e4, -500, 0}, 15},
                                                           {{1.1e4, -500, std::nan("")}, 15},
                                                           {{1e4, -510, 12}, 300},
                                                           {result.points[4000], 0},
                                                           {{2.75e4, -500, 0}, 15},
                                                           {{1.05e4, -500, 0}, 5000},
                                                           {{0, 0, 0}, 100}}) {
    Measurements expected;
    for (std::size_t p = 0; p < result.points.size(); ++p) {
      Eigen::Vector3d offset = result.points[p] - place.centre;
      if (std::isnan(place.centre.z()) && !std::isnan(offset.x())) offset.z() = 0;
      if (!(offset.norm() <= place.radius_m)) continue;
      for (auto o = static_cast<std::size_t>(result.tracks.begin[p]);
           o < static_cast<std::size_t>(result.tracks.begin[p + 1]); ++o) {
        expected.image.push_back(result.tracks.image[o]);
        expected.track.push_back(result.file_tracks[p]);
        expected.tile.push_back(result.file_tiles[p]);
        expected.x.push_back(result.tracks.x[o]);
        expected.y.push_back(result.tracks.y[o]);
        expected.feature.push_back(result.tracks.feature[o]);
        expected.kept.push_back(result.kept[o]);
        expected.residual_x.push_back(result.residual_x[o]);
        expected.residual_y.push_back(result.residual_y[o]);
      }
    }
    const Measurements found = store.near(place);
    EXPECT_EQ(found.image, expected.image);
    EXPECT_EQ(found.track, expected.track);
    EXPECT_EQ(found.tile, expected.tile);
    EXPECT_EQ(found.x, expected.x);
    EXPECT_EQ(found.y, expected.y);
    EXPECT_EQ(found.feature, expected.feature);
    EXPECT_EQ(found.kept, expected.kept);
    EXPECT_EQ(found.residual_x, expected.residual_x);
    EXPECT_EQ(found.residual_y, expected.residual_y);
    total += found.size();
  }
  EXPECT_GT(total, 35000);  // the whole street among them
  Eigen::AlignedBox3d extent;
  for (const Eigen::Vector3d& point : result.points)
    if (point.allFinite()) extent.extend(point);
  EXPECT_LT((store.extent().min() - extent.min()).norm() + (store.extent().max() - extent.max()).norm(), 0.01);
  EXPECT_THROW(store.near({{0, std::nan(""), 0}, 1}), InputError);
  EXPECT_THROW(store.near({{0, 0, 0}, -1}), InputError);
}

TEST_F(MeasurementsByPlace, NeedAResult) {
  EXPECT_THAT(complaint_of([&] {
                MeasurementStore(scratch_.path()).near({{0, 0, 0}, 1});
              }),
              HasSubstr("the job has no result yet"));
}

TEST(TrackReader, BatchesAreTheWholeFile) {
  const ScratchDirectory scratch;
  const std::string path = scratch.path("tracks.h5");
  const TrackSet all = street()[1];
  write_tracks(path, all);
  for (const std::int64_t batch : {std::int64_t{1}, std::int64_t{100}, std::int64_t{1} << 20}) {
    std::int64_t t = 0, row = 0;
    TrackReader(path).visit(
        [&](const TrackSet& part) {
          const bool measured = part.x.size() == part.image.size();
          EXPECT_EQ(measured, t % 3 == 0);
          EXPECT_TRUE(measured || (part.x.empty() && part.y.empty() && part.feature.empty()));
          for (std::int64_t p = 0; p < part.track_count(); ++p, ++t) {
            ASSERT_EQ(part.id[p], all.id[t]);
            ASSERT_EQ(part.begin[p + 1] - part.begin[p], all.begin[t + 1] - all.begin[t]);
          }
          for (std::int64_t o = 0; o < part.observation_count(); ++o, ++row) {
            ASSERT_EQ(part.image[o], all.image[row]);
            if (!measured) continue;
            ASSERT_EQ(std::tuple(part.x[o], part.y[o], part.feature[o]),
                      std::tuple(all.x[row], all.y[row], all.feature[row]));
          }
        },
        [](std::int64_t first, std::int64_t) { return first % 3 == 0; }, batch);
    EXPECT_EQ(t, all.track_count());
    EXPECT_EQ(row, all.observation_count());
  }
}

}  // namespace
}  // namespace megablock
