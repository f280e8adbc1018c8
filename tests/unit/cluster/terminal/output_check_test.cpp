#include "cluster/terminal/output_check.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

#include "io/base/error.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class OutputCheckTest : public testing::Test {
 protected:
  OutputCheckTest() {
    for (const char* folder : {"flight/day", "job/events", "job/result", "job/features"})
      fs::create_directories(scratch_.path(folder));
    for (const char* file : {"flight/day/a.JPG", "flight/notes.txt", "gcp.csv", "poses.csv", "seen.csv", "rig.json"})
      std::ofstream(scratch_.path(file)) << "x";
    std::ofstream(scratch_.path("block.yaml")) << "images: flight\ncontrol: {file: gcp.csv, check: [p1]}\n"
                                                  "rigs: {cameras: rig.json}\nposes: poses.csv\nverticals: seen.csv\n";
    std::ofstream(scratch_.path("job/job.json"))
        << R"({"version": 1, "project": ")" << scratch_.path("block.yaml") << "\"}";
  }

  // Empty: the output is accepted.
  std::string refusal(const std::string& output, const std::vector<std::string>& inputs = {},
                      const std::string& own = "") {
    try {
      check_output(scratch_.path(output), inputs, own);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }

  ScratchDirectory scratch_;
};

TEST_F(OutputCheckTest, TakesTheProjectAndWhatItNamesForInputs) {
  for (const std::string& source : {scratch_.path("block.yaml"), scratch_.path("job")}) {
    const std::vector<std::string> inputs = inputs_of(source);
    for (const char* input : {"block.yaml", "flight/day/a.JPG", "gcp.csv", "rig.json", "poses.csv", "seen.csv",
                              "flight/../gcp.csv", "./block.yaml"})
      EXPECT_THAT(refusal(input, inputs), HasSubstr(": is an input of this command or of its job")) << input;
    for (const char* other : {"new.csv", "flight/b.jpg", "flight/notes.txt", "flight", "gcp.csv.found"})
      EXPECT_EQ(refusal(other, inputs), "") << other;
  }
}

TEST_F(OutputCheckTest, FollowsLinks) {
  fs::create_symlink(scratch_.path("gcp.csv"), scratch_.path("soft.csv"));
  fs::create_hard_link(scratch_.path("gcp.csv"), scratch_.path("hard.csv"));
  fs::create_directory_symlink(scratch_.path("job/features"), scratch_.path("elsewhere"));
  const std::vector<std::string> inputs = inputs_of(scratch_.path("block.yaml"));
  EXPECT_THAT(refusal("soft.csv", inputs), HasSubstr("is an input"));
  EXPECT_THAT(refusal("hard.csv", inputs), HasSubstr("is an input"));
  EXPECT_THAT(refusal("elsewhere/x.csv", inputs), HasSubstr("belongs to the job directory"));
}

TEST_F(OutputCheckTest, AllowsTheFileThatTheCommandMakes) {
  EXPECT_EQ(refusal("seen.csv", inputs_of(scratch_.path("block.yaml"), "verticals")), "");
  EXPECT_THAT(refusal("poses.csv", inputs_of(scratch_.path("block.yaml"), "verticals")), HasSubstr("is an input"));
}

TEST_F(OutputCheckTest, KeepsOutOfJobDirectoriesButForNewResults) {
  for (const char* own : {"job", "job/", "job/x.csv", "job/job.json", "job/features", "job/features/x.csv",
                          "job/merge/x", "job/result", "job/result/block.h5", "job/result/report.html",
                          "job/result/figures.json", "job/result/diagnostics.json", "job/result/../block.h5"})
    EXPECT_THAT(refusal(own),
                HasSubstr(": belongs to the job directory '" + fs::canonical(scratch_.path("job")).string()))
        << own;
  EXPECT_EQ(refusal("job/result/model.ply"), "");
  EXPECT_EQ(refusal("job/result/model/cameras.txt"), "");
  EXPECT_EQ(refusal("job/result/report.html", {}, "result/report.html"), "");
  EXPECT_EQ(refusal("job2/x.csv"), "");
}

TEST_F(OutputCheckTest, LeavesWhatIsWrongWithTheSourceToItsReader) {
  std::ofstream(scratch_.path("bad.yaml")) << "images: [";
  EXPECT_THAT(refusal("bad.yaml", inputs_of(scratch_.path("bad.yaml"))), HasSubstr("is an input"));
  EXPECT_EQ(refusal("x.csv", inputs_of(scratch_.path("nowhere.yaml"))), "");
  std::ofstream(scratch_.path("job/job.json")) << "{";
  EXPECT_EQ(refusal("x.csv", inputs_of(scratch_.path("job"))), "");
}

}  // namespace
}  // namespace megablock
