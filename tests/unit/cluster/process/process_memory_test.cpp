#include "cluster/process/process_memory.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

namespace fs = std::filesystem;

class ControlGroup : public testing::Test {
 protected:
  void write(const std::string& name, const std::string& text) {
    fs::create_directories(fs::path(scratch_.path(name)).parent_path());
    std::ofstream(scratch_.path(name)) << text << "\n";
  }
  double limit() const { return control_group_memory_mib(scratch_.path("list"), scratch_.path("root")); }

  ScratchDirectory scratch_;
};

TEST_F(ControlGroup, LeastOfTheGroupAndThoseAboveIt) {
  write("list", "0::/slurm/job_7/step_0");
  write("root/slurm/job_7/step_0/memory.max", "max");
  write("root/slurm/job_7/memory.max", "4294967296");
  write("root/slurm/memory.max", "8589934592");
  EXPECT_EQ(limit(), 4096);
}

TEST_F(ControlGroup, VersionOneHasAFolderOfItsOwn) {
  write("list", "5:cpu,cpuacct:/other\n3:memory:/slurm/uid_0");
  write("root/memory/slurm/uid_0/memory.limit_in_bytes", "1073741824");
  write("root/memory/other/memory.limit_in_bytes", "1");
  EXPECT_EQ(limit(), 1024);
}

TEST_F(ControlGroup, NoLimit) {
  write("list", "0::/");
  EXPECT_TRUE(std::isinf(limit()));
  EXPECT_TRUE(std::isinf(control_group_memory_mib(scratch_.path("absent"), scratch_.path("root"))));
}

TEST(HostMemory, IsFiniteAndPositive) {
  EXPECT_GT(host_memory_mib(), 0);
  EXPECT_TRUE(std::isfinite(host_memory_mib()));
}

}  // namespace
}  // namespace megablock
