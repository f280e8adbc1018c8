#include "cluster/process_memory.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>

namespace megablock {
namespace {

namespace fs = std::filesystem;

class ControlGroup : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("megablock-control-group-" + std::to_string(::getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  void write(const std::string& name, const std::string& text) {
    fs::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name) << text << "\n";
  }
  double limit() const { return control_group_memory_mib((folder_ / "list").string(), (folder_ / "root").string()); }

  fs::path folder_;
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
  EXPECT_TRUE(std::isinf(control_group_memory_mib((folder_ / "absent").string(), (folder_ / "root").string())));
}

TEST(HostMemory, IsFiniteAndPositive) {
  EXPECT_GT(host_memory_mib(), 0);
  EXPECT_TRUE(std::isfinite(host_memory_mib()));
}

}  // namespace
}  // namespace megablock
