#include "merge/scratch/row_list.h"

#include <gtest/gtest.h>

#include <random>

namespace megablock {
namespace {

TEST(RowList, GivesBackWhatWentIn) {
  EXPECT_TRUE(RowList().rows().empty());
  std::mt19937 random(1);
  for (const int largest : {1, 3, 253, 254, 255, 256, 510, 511, 70000}) {
    std::vector<std::int32_t> rows;
    RowList list;
    for (std::int32_t row = largest - 1; rows.size() < 1000; row += 1 + static_cast<std::int32_t>(random() % largest)) {
      rows.push_back(row);
      list.push_back(row);
    }
    list.shrink_to_fit();
    EXPECT_EQ(list.rows(), rows) << largest;
    EXPECT_EQ(list.size(), 1000);
  }
}

TEST(RowList, RefusesADamagedSize) {
  RowList list;
  for (const std::int32_t row : {3, 4, 900}) list.push_back(row);
  for (const std::int32_t size : {-1, 1 << 30}) {
    ByteWriter out;
    list.write(out);
    Bytes bytes = out.take();
    std::memcpy(bytes.data() + bytes.size() - sizeof size, &size, sizeof size);
    ByteReader in(bytes);
    EXPECT_THROW(RowList::read(in), StoreError) << size;
  }
}

// The distances at which a byte more begins, the first row's from before the table included.
TEST(RowList, EveryDistance) {
  for (std::int32_t distance = 1; distance < 2000; ++distance) {
    RowList list;
    const std::vector<std::int32_t> rows = {distance - 1, 2 * distance - 1, 2 * distance};
    for (const std::int32_t row : rows) list.push_back(row);
    ASSERT_EQ(list.rows(), rows);
  }
}

}  // namespace
}  // namespace megablock
