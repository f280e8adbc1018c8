// Normal and Student distribution against tables and closed forms.
#include "geometry/numbers/student.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace megablock {
namespace {

TEST(NormalDistribution, QuantilesOfTables) {
  EXPECT_NEAR(normal_quantile(0.025), 1.959963985, 1e-9);
  EXPECT_NEAR(normal_quantile(0.0005), 3.290526731, 1e-9);
  EXPECT_NEAR(normal_quantile(0.8), -0.841621234, 1e-9);
  EXPECT_NEAR(normal_exceeds(normal_quantile(1e-12)), 1e-12, 1e-21);
}

TEST(StudentDistribution, QuantilesOfTables) {
  EXPECT_NEAR(student_quantile(0.025, 1), 12.706, 5e-4);
  EXPECT_NEAR(student_quantile(0.025, 2), 4.303, 5e-4);
  EXPECT_NEAR(student_quantile(0.025, 10), 2.228, 5e-4);
  EXPECT_NEAR(student_quantile(0.0005, 30), 3.646, 5e-4);
  EXPECT_NEAR(student_quantile(0.05, 120), 1.658, 5e-4);
}

// The distributions with one and with two degrees of freedom have closed forms.
TEST(StudentDistribution, ClosedForms) {
  for (const double p : {0.4, 0.1, 1e-3, 1e-6}) {
    EXPECT_NEAR(student_quantile(p, 1) * std::tan(std::numbers::pi * p), 1, 1e-9) << p;
    const double t = student_quantile(p, 2);
    EXPECT_NEAR(0.5 * (1 - t / std::sqrt(2 + t * t)), p, 1e-12) << p;
  }
  for (const double t : {-3.0, 0.0, 0.2, 1.0, 5.0})
    EXPECT_NEAR(student_exceeds(t, 1), 0.5 - std::atan(t) / std::numbers::pi, 1e-13) << t;
}

TEST(StudentDistribution, IsNormalWithManyDegrees) {
  for (const double p : {0.3, 0.01, 5e-4}) EXPECT_NEAR(student_quantile(p, 1e9), normal_quantile(p), 1e-7) << p;
}

}  // namespace
}  // namespace megablock
