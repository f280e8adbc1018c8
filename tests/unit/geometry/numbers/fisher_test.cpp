// Fisher's distribution against tables and Student's.
#include "geometry/numbers/fisher.h"

#include <gtest/gtest.h>

#include "geometry/numbers/student.h"

namespace megablock {
namespace {

TEST(FisherDistribution, QuantilesOfTables) {
  EXPECT_NEAR(fisher_exceeds(4.9646, 1, 10), 0.05, 2e-6);
  EXPECT_NEAR(fisher_exceeds(3.3258, 5, 10), 0.05, 2e-6);
  EXPECT_NEAR(fisher_exceeds(8.0215, 2, 9), 0.01, 2e-6);
}

// The square of Student's variable is Fisher's with one degree of freedom above.
TEST(FisherDistribution, IsTheSquareOfStudents) {
  for (const double degrees : {1.0, 4.0, 19.0})
    for (const double value : {0.3, 2.0, 7.0})
      EXPECT_NEAR(fisher_exceeds(value * value, 1, degrees), 2 * student_exceeds(value, degrees), 1e-12);
}

}  // namespace
}  // namespace megablock
