#include "io/evaluation/remarks/control_remarks.h"

#include <gmock/gmock.h>

#include <cmath>

#include "io/evaluation/remarks/remarks.h"
#include "io/report/report.h"
#include "tests/support/io/made_up_result.h"

namespace megablock {
namespace {

using testing::HasSubstr;

TEST(ControlRemarks, PointsThatAreNotSeenAndTheWorstFirst) {
  BlockResult result = made_up_result(small_block());
  EXPECT_TRUE(remarks(result).empty());
  for (std::size_t p = 0; p < result.control.size(); ++p) {
    result.block.control_points[p].name = std::to_string(p);
    if (result.block.control_points[p].role != PointRole::kCheck) continue;
    for (auto& residual : result.control[p].residual_px) residual.setConstant(std::nan(""));
    if (p + 1 == result.control.size()) {
      result.control[p].residual_px[0] = {4810, 0};
      result.control[p].residual_px[1] = {0, 52};
      result.control[p].kept.assign(result.control[p].residual_px.size(), 0);
    }
  }
  const auto& last = result.block.control_points.back();
  ASSERT_EQ(last.role, PointRole::kCheck);
  EXPECT_THAT(unused_points_text(result, PointRole::kCheck),
              testing::StartsWith("5 check points take no part: " + last.name + " (4810 px in " +
                                  result.block.name_of(last.measurements[0].image) + ", 52.0 px in " +
                                  result.block.name_of(last.measurements[1].image) + ", rejected), "));
  EXPECT_THAT(unused_points_text(result, PointRole::kCheck), HasSubstr(" (not seen by an oriented image), "));
  EXPECT_EQ(unused_points_text(result, PointRole::kControl), "");
}

// A wrong coordinate, and a mark that was rejected while the point takes part.
TEST(ControlRemarks, NamesWrongControlAndRejectedMarks) {
  BlockResult result = made_up_result(small_block());
  EXPECT_TRUE(wrong_control_texts(result).empty());
  std::vector<std::size_t> control;
  for (std::size_t p = 0; p < result.control.size(); ++p)
    if (result.block.control_points[p].role == PointRole::kControl) control.push_back(p);
  ASSERT_GE(control.size(), 2u);
  ControlPoint& moved = result.block.control_points[control[0]];
  moved.name = "nail";
  moved.position = result.control[control[0]].adjusted + Eigen::Vector3d(6, 0, 8);
  moved.sigma.setConstant(0.02);
  for (auto& residual : result.control[control[0]].residual_px) residual = {0.3, 0.4};
  ControlPoint& marked = result.block.control_points[control[1]];
  marked.name = "cross";
  BlockResult::ControlResult& seen = result.control[control[1]];
  ASSERT_GE(seen.residual_px.size(), 2u);
  seen.kept.assign(seen.residual_px.size(), 1);
  seen.kept[1] = 0;
  seen.residual_px[1] = {-300, 400};
  EXPECT_THAT(wrong_control_texts(result),
              testing::ElementsAre("1 of " + std::to_string(control.size()) +
                                       " control points differs from the block by more than 6 sigmas and has hardly "
                                       "any weight: nail by 10.0 m (its marks fit within 0.5 px); check its "
                                       "coordinates and its name",
                                   "1 mark of control and check points is rejected: cross in " +
                                       result.block.name_of(marked.measurements[1].image) + " by 500 px"));
  EXPECT_THAT(report_html(result), HasSubstr("<li class=look>1 mark of control and check points is rejected"));
}

}  // namespace
}  // namespace megablock
