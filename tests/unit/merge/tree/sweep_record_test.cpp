// Records of a sweep up: they are read back as they were written, and incomplete records are ignored.
#include "merge/tree/sweep_record.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "io/base/error.h"
#include "merge/step/memory.h"
#include "merge/tree/gather_by_tile.h"
#include "tests/support/io/scratch_directory.h"
#include "tests/support/merge/damaged_scratch.h"

namespace megablock {
namespace {

UpdateMatrix made_up_update(double value) {
  UpdateMatrix update;
  update.sums.cost = value;
  update.alone.rank = 7;
  return update;
}

NodeFactors made_up_factors(double value) {
  NodeFactors factors;
  factors.front.eliminated = {{{UnknownKind::kFrame, 0, 0}, 1}};
  factors.front.separator = {{{UnknownKind::kFrame, 0, 1}, 999}};
  factors.front.factor.assign(1000, value);
  factors.front.z.assign(1, 0.5);
  return factors;
}

class PassRecordTest : public testing::Test {
 protected:
  PassRecordTest() : files_(space()) {
    FactorStore store({4 << 20, space()});
    std::filesystem::create_directory(scratch_.path("kept"));
    for (const std::int64_t node : {0, 1, 2}) store.put(node, made_up_factors(static_cast<double>(node)));
    EXPECT_EQ(store.bytes_without_copy(), 3 * made_up_factors(0).byte_count());
    EXPECT_TRUE(store.copy_to_scratch());
    EXPECT_EQ(store.bytes_without_copy(), 0);
    EXPECT_EQ(store.nodes_in_scratch(), (std::vector<std::int64_t>{0, 1, 2}));
    for (const std::int64_t node : {0, 1, 2})  // the store takes its files along
      std::filesystem::copy_file(factor(node), scratch_.path("kept/" + std::to_string(node)));
  }
  void SetUp() override {
    for (const std::int64_t node : {0, 1, 2})
      std::filesystem::copy_file(scratch_.path("kept/" + std::to_string(node)), factor(node));
    ASSERT_TRUE(files_.write_update(2, made_up_update(0.1)));
    ASSERT_TRUE(files_.write_update(5, made_up_update(0.2)));
    ASSERT_TRUE(files_.write(record()));
  }
  static SweepRecord record() {
    SweepRecord record;
    record.state = 11;
    record.sweep = 12;
    record.position = "where it stands";
    record.tiles = 3;
    record.subtrees = {2, 5};
    record.factors = {0, 1, 2};
    record.seams = {{2, 3.5, 4, 20}};
    return record;
  }
  std::shared_ptr<ScratchSpace> space(std::int64_t budget = 1 << 20) const {
    return std::make_shared<ScratchSpace>(scratch_.path(), budget);
  }
  std::string factor(std::int64_t node) const { return scratch_.path(factor_file(node)); }
  std::string path() const { return scratch_.path("pass.bin"); }

  ScratchDirectory scratch_;
  SweepRecordFiles files_;
};

TEST_F(PassRecordTest, ComesBack) {
  const auto found = files_.read();
  ASSERT_TRUE(found);
  EXPECT_EQ(found->state, 11U);
  EXPECT_EQ(found->sweep, 12U);
  EXPECT_EQ(found->position, "where it stands");
  EXPECT_EQ(found->tiles, 3);
  EXPECT_EQ(found->subtrees, record().subtrees);
  EXPECT_EQ(found->factors, record().factors);
  ASSERT_EQ(found->seams.size(), 1U);
  EXPECT_EQ(found->seams[0].statistic, 3.5);
  EXPECT_EQ(files_.read_update(5).sums.cost, 0.2);
  EXPECT_EQ(files_.read_update(2).alone.rank, 7);
}

TEST_F(PassRecordTest, FactorsAreTakenOver) {
  {
    FactorStore store({4 << 20, space()});
    store.adopt({0, 2});
    ASSERT_NE(store.get(2), nullptr);
    EXPECT_EQ(store.get(2)->front.factor, made_up_factors(2).front.factor);
    EXPECT_EQ(store.get(1), nullptr);  // not named
    store.put(2, made_up_factors(3));
    EXPECT_EQ(store.get(2)->front.factor, made_up_factors(3).front.factor);  // what is put counts
  }
  EXPECT_FALSE(std::filesystem::exists(factor(0)));  // from then on they are the store's
  EXPECT_TRUE(std::filesystem::exists(factor(1)));
}

TEST_F(PassRecordTest, CountsOnlyIfWhole) {
  const std::string whole = bytes_of(path());
  for (std::size_t size = 0; size < whole.size(); ++size) {
    std::ofstream(path(), std::ios::binary) << whole.substr(0, size);
    EXPECT_FALSE(files_.read()) << size << " bytes of " << whole.size();
  }
  std::ofstream(path(), std::ios::binary) << whole << 'x';
  EXPECT_FALSE(files_.read());
  std::ofstream(path(), std::ios::binary) << whole;
  EXPECT_TRUE(files_.read());
  files_.remove();
  EXPECT_FALSE(files_.read());
}

TEST_F(PassRecordTest, NamesFilesThatAreThere) {
  std::filesystem::resize_file(factor(1), std::filesystem::file_size(factor(1)) - 1);
  EXPECT_FALSE(files_.read());
  std::filesystem::remove(factor(1));
  EXPECT_FALSE(files_.read());
  EXPECT_FALSE(files_.write(record()));  // nor are others written
  std::filesystem::copy_file(scratch_.path("kept/1"), factor(1));
  EXPECT_TRUE(files_.read());
  files_.remove_update(5);
  EXPECT_FALSE(files_.read());
  EXPECT_THROW(files_.read_update(5), StoreError);
}

// What an earlier run left beside it is gone; a record that is more than the budget does not count.
TEST_F(PassRecordTest, IsKeptAloneAndWithinTheBudget) {
  std::ofstream(scratch_.path("tile-3-measurements.bin")) << "of a killed run";
  std::int64_t all = static_cast<std::int64_t>(std::filesystem::file_size(path()));
  for (const std::string& file :
       {factor(0), factor(1), factor(2), scratch_.path("update-2.bin"), scratch_.path("update-5.bin")})
    all += static_cast<std::int64_t>(std::filesystem::file_size(file));
  EXPECT_FALSE(SweepRecordFiles(space(all - 1)).read());
  const auto enough = space(all);
  const SweepRecordFiles files(enough);
  const auto found = files.read();
  ASSERT_TRUE(found);
  files.keep_only(found);
  EXPECT_EQ(enough->bytes(), all);
  EXPECT_FALSE(std::filesystem::exists(scratch_.path("tile-3-measurements.bin")));
  EXPECT_TRUE(files.read());
  files.keep_only(std::nullopt);
  EXPECT_EQ(enough->bytes(), 0);
  EXPECT_FALSE(std::filesystem::exists(factor(0)));
}

TEST_F(PassRecordTest, NamesAnUpdateThatIsDamagedAndCountsNoMore) {
  const std::string file = scratch_.path("update-5.bin");
  const auto size = std::filesystem::file_size(file);
  std::filesystem::resize_file(file, size - 1);
  expect_named([&] { files_.read_update(5); }, file);
  EXPECT_FALSE(files_.read());
  expect_named([&] { files_.read_update(5); }, file);
}

// Of another start of the machine: what was not on the disk then is lost.
TEST_F(PassRecordTest, EndsWithTheMachine) {
  std::string start;
  if (!std::getline(std::ifstream("/proc/sys/kernel/random/boot_id"), start)) GTEST_SKIP() << "no boot_id here";
  std::string bytes = bytes_of(path());
  const std::size_t at = bytes.find(start);
  ASSERT_NE(at, std::string::npos);
  bytes[at] = bytes[at] == 'a' ? 'b' : 'a';
  std::ofstream(path(), std::ios::binary) << bytes;
  EXPECT_FALSE(files_.read());
}

TEST_F(PassRecordTest, AFullDiskHasNone) {
  const SweepRecordFiles nowhere(std::make_shared<ScratchSpace>());
  EXPECT_FALSE(nowhere.write_update(2, made_up_update(1)));
  EXPECT_FALSE(nowhere.write(record()));
  FactorStore small({1 << 20, std::make_shared<ScratchSpace>(scratch_.path("small"), 1000)});  // less than one
  small.put(0, made_up_factors(1));
  EXPECT_FALSE(small.copy_to_scratch());
  EXPECT_TRUE(small.nodes_in_scratch().empty());
}

}  // namespace
}  // namespace megablock
