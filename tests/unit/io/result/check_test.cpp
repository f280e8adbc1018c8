#include "io/result/check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "io/base/error.h"
#include "io/result/result.h"
#include "io/store/hdf5/hdf5_file.h"
#include "io/store/job/events.h"
#include "io/store/units/adjustment_file.h"
#include "io/store/units/block_file.h"
#include "io/store/units/features_file.h"
#include "io/store/units/graph_files.h"
#include "io/store/units/state_file.h"
#include "io/store/units/tracks_file.h"
#include "tests/support/io/example_block.h"
#include "tests/support/io/image_files.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const std::vector<StageFiles> kStages = {
    {"features", [](const std::string& path) { read_features(path); }, "", "features"},
    {"candidates", [](const std::string& path) { read_candidates(path); }, ""},
    {"matches", [](const std::string& path) { read_matches(path); }, ""},
    {"tiles", [](const std::string& path) { read_tiles(path); }, ""},
    {"tracks", [](const std::string& path) { read_tracks(path); }, "tracks"},
    {"adjustment", [](const std::string& path) { read_adjustment(path); }, "adjust"}};

// A job with a file of every kind.
class CheckJob : public ::testing::Test {
 protected:
  CheckJob() {
    store_.create();
    store_.write_text("job.json", "{}\n");
    const Block block = example_block();
    Tiles tiles;
    tiles.tile_count = 2;
    tiles.tile_of_frame.assign(4, TileIndex(0));
    tiles.component.assign(4, 0);
    put("block.h5", [&](const std::string& path) { write_block(path, block); });
    put("graph.h5", [&](const std::string& path) { write_candidates(path, {{}, {0}, {}}); });
    put("tiles.h5", [&](const std::string& path) { write_tiles(path, tiles); });
    put("features/000000.h5", [&](const std::string& path) { write_features(path, {}); });
    put("matches/000000.h5", [&](const std::string& path) { write_matches(path, {}); });
    for (const char* tile : {"000000.h5", "000001.h5"}) {
      put(std::string("tracks/") + tile, [&](const std::string& path) { write_tracks(path, example_tracks()); });
      put(std::string("adjust/") + tile, [&](const std::string& path) { write_adjustment(path, {}); });
    }
    put("merge/00-0001/state.h5", [&](const std::string& path) { write_state(path, initial_state(block)); });
    put("merge/00-0001/iteration.bin", [&](const std::string& path) { std::ofstream(path) << "a marker"; });
    BlockResult result;
    result.block = block;
    result.state = initial_state(block);
    result.boundary.assign(4, 0);
    result.tracks.begin = {0};
    result.digest = result_digest(result);
    put("result/block.h5", [&](const std::string& path) { write_result(path, result); });
    std::ofstream(store_.path("result/report.html")) << "<html>";
    EventLog(store_, 0).append({});
  }
  void put(const std::string& unit, const std::function<void(const std::string&)>& writer) {
    store_.write(unit, 1, writer);
  }
  std::vector<std::string> problems() const { return check_job(JobStore(store_.directory()), kStages); }

  ScratchDirectory scratch_;
  JobStore store_{scratch_.path("job")};
};

TEST_F(CheckJob, WholeJobHasNoProblems) { EXPECT_THAT(problems(), IsEmpty()); }

TEST_F(CheckJob, DamageInAnyFileIsNamed) {
  for (const std::string unit :
       {"block.h5", "graph.h5", "tiles.h5", "features/000000.h5", "matches/000000.h5", "tracks/000001.h5",
        "adjust/000000.h5", "merge/00-0001/state.h5", "merge/00-0001/iteration.bin", "result/block.h5"}) {
    std::fstream file(store_.path(unit), std::ios::binary | std::ios::in | std::ios::out);
    const char good = static_cast<char>(file.seekg(5).get());
    file.seekp(5).put(static_cast<char>(good ^ 4)).flush();
    const std::vector<std::string> found = problems();
    file.seekp(5).put(good).flush();
    ASSERT_FALSE(found.empty()) << unit;
    EXPECT_THAT(found.front(), HasSubstr(store_.path(unit) + ": is damaged"));
  }
  EXPECT_THAT(problems(), IsEmpty());
}

TEST_F(CheckJob, MissingTileIsNamed) {
  store_.remove("adjust/000001.h5");
  EXPECT_THAT(problems(), ElementsAre(HasSubstr("adjust: has files of 1 of 2 tiles")));
}

TEST_F(CheckJob, SealedFileThatCannotBeReadIsNamed) {
  put("tracks/000000.h5", [](const std::string& path) { Hdf5Writer(path, "tracks").close(); });
  EXPECT_THAT(problems(), ElementsAre(HasSubstr("tracks/000000.h5: tracks/id_difference")));
}

TEST_F(CheckJob, ResultWhoseDigestIsNotItsOwnIsNamed) {
  BlockResult result = read_result(store_.path("result/block.h5"));
  result.state.cameras[CameraIndex(0)][kFocal] += 1;
  put("result/block.h5", [&](const std::string& path) { write_result(path, result); });
  EXPECT_THAT(problems(), ElementsAre(HasSubstr(": its digest is ")));
}

TEST_F(CheckJob, FileThatNoStageMadeIsNamedAsThat) {
  std::filesystem::create_directories(store_.path("features/mine"));
  for (const std::string name : {"features/notes.txt", "features/mine/photo.jpg"}) {
    std::ofstream(store_.path(name)) << "mine";
    EXPECT_THAT(problems(), ElementsAre(store_.path(name) + ": is no file of a job; move it away"));
    store_.remove(name);
  }
  std::ofstream(store_.path("features/000001.h5")) << "cut";
  EXPECT_THAT(problems(),
              ElementsAre(HasSubstr("has no valid seal: with 3 bytes it is truncated, or no unit of a job")));
}

TEST_F(CheckJob, FilesWithoutASealAreCheckedByTheirStage) {
  std::vector<StageFiles> stages = kStages;
  stages.back().check = [](const JobStore& store) {
    throw StoreError(store.path("result/table.csv") + ": is no table");
  };
  EXPECT_THAT(check_job(store_, stages), ElementsAre(HasSubstr("result/table.csv: is no table")));
}

TEST_F(CheckJob, BadJobFileIsNamed) {
  store_.write_text("job.json", "{");
  EXPECT_THAT(problems(), ElementsAre(HasSubstr("job.json: is not valid JSON")));
  store_.remove("job.json");
  EXPECT_THAT(problems(), ElementsAre(HasSubstr("job.json: is missing")));
}

TEST_F(CheckJob, NoJobIsBadInput) {
  const auto refusal = [&](const std::string& path) {
    return fixture::message_of<InputError>([&] { check_job(JobStore(scratch_.path(path)), {}); });
  };
  EXPECT_THAT(refusal("nowhere"), HasSubstr("nowhere: no such job directory; check the path"));
  std::filesystem::create_directories(scratch_.path("project"));
  std::ofstream(scratch_.path("project/block.yaml")) << "images: images\n";
  for (const std::string what : {"project", "project/block.yaml"})
    EXPECT_THAT(refusal(what), HasSubstr(what + ": is no job directory; name the folder given to 'run -j'"));
}

}  // namespace
}  // namespace megablock
