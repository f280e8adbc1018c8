#include "cluster/job/paged_tables.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <numeric>

#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

double resident_mib() {
  long pages = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> pages >> resident;
  return static_cast<double>(resident * sysconf(_SC_PAGESIZE)) / (1 << 20);
}

constexpr std::size_t kRows = 8 << 20;  // 64 MiB

std::vector<std::int64_t> numbers() {
  std::vector<std::int64_t> table(kRows);
  std::iota(table.begin(), table.end(), std::int64_t{0});
  return table;
}

// Rows that are not what numbers() has there.
std::size_t other_rows(const std::vector<std::int64_t>& table) {
  std::size_t other = 0;
  for (std::size_t i = 0; i < table.size(); ++i) other += table[i] != static_cast<std::int64_t>(i);
  return other;
}

TEST(PagedTables, TakeNoMemoryButOfWhatIsRead) {
  const ScratchDirectory scratch;
  PagedTables tables(scratch.path());
  const std::vector<std::int64_t> table = numbers();
  const double held = resident_mib();
  tables.put(table);
  EXPECT_LT(resident_mib(), held - 50);
  EXPECT_EQ(other_rows(table), 0u);
  tables.release();
  EXPECT_LT(resident_mib(), held - 50);
  EXPECT_EQ(table[kRows / 2], static_cast<std::int64_t>(kRows / 2));
  EXPECT_LT(resident_mib(), held - 50);
}

TEST(PagedTables, KeepWhatIsWrittenToThem) {
  const ScratchDirectory scratch;
  PagedTables tables(scratch.path());
  std::vector<std::int64_t> table = numbers();
  tables.put(table);
  for (std::size_t i = 0; i < kRows; i += 1000) table[i] = -1;
  tables.release();
  EXPECT_EQ(other_rows(table), (kRows + 999) / 1000);
}

TEST(PagedTables, LeaveNoFileAndLetTheirMemoryBeUsedAnew) {
  const ScratchDirectory scratch;
  PagedTables tables(scratch.path());
  {
    const std::vector<std::int64_t> table = numbers();
    tables.put(table);
    EXPECT_TRUE(std::filesystem::is_empty(scratch.path()));
  }
  const std::vector<std::int64_t> next = numbers();  // mostly where the former one was
  tables.release();
  EXPECT_EQ(other_rows(next), 0u);
}

TEST(PagedTables, AreForgottenOneByOne) {
  const ScratchDirectory scratch;
  PagedTables tables(scratch.path());
  const std::vector<std::int64_t> first = numbers(), second = numbers();
  tables.put(first);
  tables.put(second);
  tables.forget(first);
  EXPECT_EQ(other_rows(first) + other_rows(second), 0u);
  const double held = resident_mib();
  tables.release();
  EXPECT_LT(resident_mib(), held - 50);
  EXPECT_GT(resident_mib(), held - 80);  // the first one's pages stay
}

TEST(PagedTables, StayInMemoryWhereThereIsNoFolder) {
  const ScratchDirectory scratch;
  PagedTables tables(scratch.path() + "/missing");
  const std::vector<std::int64_t> table = numbers();
  tables.put(table);
  tables.release();
  EXPECT_EQ(other_rows(table), 0u);
}

}  // namespace
}  // namespace megablock
