#include "io/text/side_text.h"

#include <gtest/gtest.h>

namespace megablock {
namespace {

TEST(SideText, NamesTheSidesOfAnOffset) {
  EXPECT_EQ(side_text({0, 0, 46.9}), "46.90 m above");
  EXPECT_EQ(side_text({0, 0, -0.125}), "0.12 m below");
  EXPECT_EQ(side_text({-2, 0, -3}), "2.00 m west of and 3.00 m below");
  EXPECT_EQ(side_text({2, -1.5, 3}), "2.00 m east of, 1.50 m south of and 3.00 m above");
  EXPECT_EQ(side_text({0, 0, 0}), "");
}

}  // namespace
}  // namespace megablock
