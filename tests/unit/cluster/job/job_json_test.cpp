#include "cluster/job/job_json.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

#include "cluster/job/job_options.h"
#include "cluster/status/status.h"
#include "io/base/error.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

using testing::AllOf;
using testing::EndsWith;
using testing::HasSubstr;
using testing::StartsWith;

class JobJsonTest : public testing::Test {
 protected:
  JobJsonTest() : store_(scratch_.path("job")) { store_.create(); }

  void write(const std::string& text) { std::ofstream(store_.path("job.json")) << text; }

  static std::string message(const auto& action) {
    try {
      action();
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }

  ScratchDirectory scratch_;
  JobStore store_;
};

constexpr const char* kRemedy = "finish it with the program that began it, or start a new job directory";

TEST_F(JobJsonTest, ReadsWhatIsThere) {
  EXPECT_FALSE(JobJson::read(store_));
  write(R"({"version": 1, "generations": [12, 20], "settings": [["tiles", "max_frames", "50", "b.yaml:3"]]})");
  const JobJson job = JobJson::of_job(store_);
  job.check_version();
  EXPECT_EQ(job.at<std::vector<std::int64_t>>("generations"), (std::vector<std::int64_t>{12, 20}));
  EXPECT_EQ(job.value<std::string>("tie_points", "none"), "none");
  ASSERT_EQ(job.settings().entries.size(), 1u);
  EXPECT_EQ(job.settings().entries[0].value, "50");
  EXPECT_EQ(job.settings().entries[0].where, "b.yaml:3");
}

TEST_F(JobJsonTest, NamesTheKeyOfAnotherForm) {
  write(R"({"program": "megablock 0.0.1", "generations": 12, "settings": [["tiles", 50]], "tie_points": 7})");
  const JobJson job = JobJson::of_job(store_);
  const auto generations = [&] { return job.at<std::vector<std::int64_t>>("generations"); };
  EXPECT_THAT(message(generations),
              AllOf(StartsWith(store_.path("job.json") + ": the key 'generations' has another form than here: "),
                    HasSubstr("megablock 0.0.1 wrote this job"), EndsWith(kRemedy)));
  EXPECT_THAT(message([&] { options_of_job(store_); }), HasSubstr("the key 'settings' has another form"));
  EXPECT_THAT(message([&] { status_text(store_); }), HasSubstr("the key 'tie_points' has another form"));
}

TEST_F(JobJsonTest, NamesTheKeyThatIsMissing) {
  write("{}");
  EXPECT_THAT(message([&] { options_of_job(store_); }),
              AllOf(HasSubstr("the key 'settings' is missing: another version wrote this job"), EndsWith(kRemedy)));
  EXPECT_THAT(message([&] { JobJson::of_job(store_).check_version(); }),
              AllOf(HasSubstr("job of version 0, this program writes version 1"), EndsWith(kRemedy)));
}

TEST_F(JobJsonTest, RefusesWhatIsNoJob) {
  EXPECT_THAT(message([&] { JobJson::of_job(store_); }), HasSubstr("is not a job directory"));
  for (const char* text : {"", "{", "[1]", "7"}) {
    write(text);
    EXPECT_THAT(message([&] { status_text(store_); }), HasSubstr("job.json: is not readable; restore it"));
  }
}

}  // namespace
}  // namespace megablock
