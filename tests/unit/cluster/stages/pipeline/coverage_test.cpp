#include "cluster/stages/pipeline/coverage.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <tuple>
#include <vector>

#include "cluster/job/job_options.h"
#include "io/base/error.h"
#include "io/store/units/block_file.h"
#include "io/text/csv_row.h"
#include "tests/support/io/image_files.h"
#include "tests/support/io/scratch_directory.h"
#include "tests/support/io/small_result.h"

namespace megablock {
namespace {

using testing::HasSubstr;
using testing::Not;

// Three images of one camera of 400 x 200 px.
Block three_images() {
  Block block;
  block.cameras.push_back({});
  block.cameras.back().width = 400;
  block.cameras.back().height = 200;
  block.rigs.push_back({});
  block.rigs.back().mounts.push_back({});
  block.rigs.back().mounts.back().camera = CameraIndex(0);
  for (const char* name : {"a.jpg", "b.jpg", "c.jpg"}) {
    block.frames.push_back({});
    block.frames.back().rig = RigIndex(0);
    block.add_image(name, {.frame = FrameIndex(std::ssize(block.frames) - 1), .mount = 0});
  }
  return block;
}

void add_track(TrackSet& tracks, const std::vector<std::tuple<int, double, double>>& observations) {
  if (tracks.begin.empty()) tracks.begin.push_back(0);
  tracks.id.emplace_back(tracks.track_count());
  for (const auto& [image, x, y] : observations) {
    tracks.image.emplace_back(image);
    tracks.x.push_back(to_fixed_pixel(x));
    tracks.y.push_back(to_fixed_pixel(y));
    tracks.feature.push_back(-1);
  }
  tracks.begin.push_back(std::ssize(tracks.image));
}

TEST(Coverage, CountsObservationsCellsAndImages) {
  TrackSet tracks;
  add_track(tracks, {{0, 99.9, 49.9}, {1, 100.1, 49.9}});                   // cell 0, 0; cell 0, 1
  add_track(tracks, {{0, 0.5, 0.5}, {1, 399.5, 199.5}, {2, -0.4, 200.3}});  // 0, 0; 3, 3; measured beyond the edge
  const auto coverage = coverage_of(tracks, three_images());
  const auto expect = [&](int image, std::int64_t observations, std::int64_t images, int cells) {
    const ImageCoverage& c = coverage.at(ImageIndex(image));
    EXPECT_EQ(c.observations, observations) << image;
    EXPECT_EQ(c.images_of_points, images) << image;
    EXPECT_EQ(c.cells, cells) << image;
  };
  expect(0, 2, 5, 1 << 0);
  expect(1, 2, 5, 1 << 1 | 1 << 15);
  expect(2, 1, 3, 1 << 12);
  EXPECT_EQ(coverage.at(ImageIndex(1)).covered_share(), 2.0 / 16);
}

TEST(Coverage, OfTwoTilesIsThatOfAllTheirTracks) {
  ImageCoverage sum{2, 5, 0b0011};
  sum.add({1, 3, 0b0110});
  EXPECT_EQ(sum.observations, 3);
  EXPECT_EQ(sum.images_of_points, 8);
  EXPECT_EQ(sum.covered_share(), 3.0 / 16);
}

TEST(Coverage, TheNoteNamesImagesBelowTheShareThatHaveTiePoints) {
  const Block block = three_images();
  IndexedVector<ImageIndex, ImageCoverage> coverage(3);
  coverage[ImageIndex(0)] = {9, 20, 0b0111};
  coverage[ImageIndex(2)] = {9, 20, 0b1111};
  EXPECT_THAT(coverage_note(coverage, block.image_names, 0.25),
              testing::AllOf(HasSubstr("1 of 2 images has tie points in less than 25 % of their area: a.jpg;"),
                             Not(HasSubstr("b.jpg")), Not(HasSubstr("c.jpg"))));
  EXPECT_EQ(coverage_note(coverage, block.image_names, 0.1), "");
}

TEST(Coverage, TheCheckNamesWhatIsWrongWithTheTable) {
  ScratchDirectory folder;
  const JobStore store(folder.path("job"));
  store.create();
  Block block = three_images();
  fixture::name_oddly(block);
  store.write("block.h5", 1, [&](const std::string& path) { write_block(path, block); });
  const auto problem = [&] { return fixture::message_of<Error>([&] { check_coverage(store); }); };
  EXPECT_EQ(problem(), "") << "no coverage yet";
  store.write("coverage/000000.txt", 1, [](const std::string& path) { std::ofstream(path) << "0 2 5 1\n"; });
  EXPECT_THAT(problem(), HasSubstr("result/coverage.csv: is missing; run the job again"));

  const std::string header = "image,observations,covered_share,images_per_point\n";
  const auto row = [&](int image, const std::string& numbers) {
    return csv_field(block.name_of(ImageIndex(image))) + "," + numbers + "\n";
  };
  const std::string two = header + row(0, "9,0.25,3.50") + row(1, "0,0.0000,0.00"), whole = two + row(2, "1,0.5,2");
  const auto problem_of = [&](const std::string& text) {
    store.write_text("result/coverage.csv", text);
    return problem();
  };
  EXPECT_EQ(problem_of(whole), "");
  EXPECT_THAT(problem_of(""), HasSubstr("coverage.csv:1: the header is not 'image,"));
  EXPECT_THAT(problem_of(two), HasSubstr("coverage.csv: has rows of 2 of 3 images; delete it and run the job again"));
  EXPECT_THAT(problem_of(two + row(1, "1,0.5,2")), HasSubstr("coverage.csv:6: is not the row of the block's image 2"));
  EXPECT_THAT(problem_of(whole + row(2, "1,0.5,2")),
              HasSubstr("coverage.csv:8: is not the row of the block's image 3"));
  EXPECT_THAT(problem_of(two + row(2, "1,0.5")), HasSubstr("coverage.csv:6: is not the row"));
  EXPECT_THAT(problem_of(two + row(2, "1,half,2")), HasSubstr("coverage.csv:6: covered_share: 'half' is not a"));
  EXPECT_THAT(problem_of(two + row(2, "-1,0.5,2")), HasSubstr("coverage.csv:6: observations must not be negative"));
  store.remove("result/coverage.csv");
  std::filesystem::create_directory(store.path("result/coverage.csv"));
  EXPECT_THAT(problem(), HasSubstr("coverage.csv: cannot be read: a directory is where a file is needed"));
}

TEST(Coverage, ItsOptionIsReadFromTheProjectFile) {
  EXPECT_EQ(read_options({}).numbers.at("coverage.min_share"), 0.25);
  const auto setting = [](const char* value) { return StageSettings{{{"coverage", "min_share", value, "b.yaml:3"}}}; };
  EXPECT_EQ(read_options(setting("0.5")).numbers.at("coverage.min_share"), 0.5);
  try {
    read_options(setting("2"));
    ADD_FAILURE();
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(), "b.yaml:3: coverage: min_share must lie in [0, 1], not 2");
  }
}

}  // namespace
}  // namespace megablock
