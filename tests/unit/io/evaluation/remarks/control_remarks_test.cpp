#include "io/evaluation/remarks/control_remarks.h"

#include <gmock/gmock.h>

#include <cmath>

#include "io/evaluation/remarks/remarks.h"
#include "io/report/report.h"
#include "tests/support/io/made_up_result.h"

namespace megablock {
namespace {

using testing::HasSubstr;

TEST(ControlRemarks, NamesTheWorstOfUnusedPointsFirst) {
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
  EXPECT_EQ(unused_points_text(result, PointRole::kControl), "");
}

// Marks without an intersection have no residuals, although their images are oriented.
TEST(ControlRemarks, PointsWhoseMarksHaveNoResiduals) {
  BlockResult result = made_up_result(small_block());
  std::size_t p = 0;
  while (result.block.control_points[p].role != PointRole::kCheck) ++p;
  ControlPoint& point = result.block.control_points[p];
  point.name = "nail";
  for (auto& residual : result.control[p].residual_px) residual.setConstant(std::nan(""));
  const auto orient = [&](std::size_t marks) {
    result.state.oriented.assign(result.block.frames.size(), 0);
    for (std::size_t m = 0; m < marks; ++m)
      result.state.oriented[result.block.images[point.measurements[m].image].frame] = 1;
  };
  ASSERT_GE(point.measurements.size(), 3u);
  const auto said = [&] { return unused_points_text(result, PointRole::kCheck); };
  orient(3);
  EXPECT_EQ(said(), "1 check point takes no part: nail (all 3 marks in oriented images rejected)");
  orient(1);
  EXPECT_EQ(said(), "1 check point takes no part: nail (only 1 mark in an oriented image)");
  orient(0);
  EXPECT_EQ(said(), "1 check point takes no part: nail (not seen by an oriented image)");
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

// The block bends to a wrong one of few points, and the largest difference may be that of a right one.
TEST(ControlRemarks, FewPointsThatContradictEachOtherAreAllNamed) {
  SimulationOptions options = small_block();
  options.control_points = 3;
  BlockResult result = made_up_result(options);
  for (std::size_t p = 0; p < result.control.size(); ++p) {
    ControlPoint& point = result.block.control_points[p];
    point.name = (point.role == PointRole::kControl ? "P" : "C") + std::to_string(p);
    point.position = result.control[p].adjusted;
    point.sigma.setConstant(0.02);
    for (auto& residual : result.control[p].residual_px) residual = {0.3, 0.4};
  }
  const auto of = [&](PointRole role) {
    std::vector<std::size_t> rows;
    for (std::size_t p = 0; p < result.control.size(); ++p)
      if (result.block.control_points[p].role == role) rows.push_back(p);
    return rows;
  };
  const std::vector<std::size_t> control = of(PointRole::kControl), check = of(PointRole::kCheck);
  ASSERT_EQ(control.size(), 3u);
  const auto& points = result.block.control_points;
  result.block.control_points[control[2]].position.z() += 2.3;
  result.block.control_points[check[0]].position.z() += 4;
  const auto said = [&] { return wrong_control_texts(result); };
  const std::string blamed =
      "1 of 3 control points differs from the block by more than 6 sigmas and has hardly any "
      "weight: " +
      points[control[2]].name + " by 2.300 m";
  const auto state_positions = [&](double sigma) {
    for (Frame& frame : result.block.frames) frame.position_prior->sigma.setConstant(sigma);
  };
  state_positions(0.05);
  EXPECT_THAT(said().at(0), testing::StartsWith(blamed)) << "positions check the points";
  EXPECT_THAT(said().at(1), testing::EndsWith("; check its coordinates and its name"));
  const std::string contradiction =
      "The 3 control points contradict each other: they differ from the block by up to 2.300 m, more than 6 sigmas "
      "(their marks fit within 0.5 px), and so few cannot tell which of them is wrong; check the coordinates and names "
      "of " +
      points[control[0]].name + ", " + points[control[1]].name + " and " + points[control[2]].name;
  state_positions(5);
  EXPECT_THAT(said(), testing::ElementsAre(
                          contradiction,
                          "1 of 5 check points differs from the block by more than 6 sigmas: " + points[check[0]].name +
                              " by 4.000 m (its marks fit within 0.5 px); the control points that contradict each "
                              "other move the block"));
  state_positions(0.05);
  result.provenance.options.push_back({"adjustment.use_position_priors", "false", "true"});
  EXPECT_EQ(said().at(0), contradiction);
  result.provenance.options.pop_back();
  for (Frame& frame : result.block.frames) frame.position_prior.reset();
  EXPECT_EQ(said().at(0), contradiction);
  EXPECT_THAT(report_html(result), HasSubstr("<li class=look>The 3 control points contradict each other"));
  result.control_aside = {static_cast<std::int64_t>(control[2])};
  EXPECT_THAT(said().at(0), HasSubstr(" and takes no part: ")) << "the comparison without it has told";
}

// Ellipsoidal heights of the positions against orthometric ones of all points, of which two are control.
TEST(ControlRemarks, ACommonHeightBlamesNoPoint) {
  BlockResult result = made_up_result(small_block());
  std::int64_t control = 0;
  for (std::size_t p = 0; p < result.control.size(); ++p) {
    ControlPoint& point = result.block.control_points[p];
    point.role = control < 2 ? PointRole::kControl : PointRole::kCheck;
    ++control;
    point.position = result.control[p].adjusted - Eigen::Vector3d(0.1, -0.2, 47 + 0.1 * static_cast<double>(p % 3));
    point.sigma.setConstant(0.02);
  }
  ASSERT_EQ(result.control.size(), 9u);
  EXPECT_THAT(wrong_control_texts(result),
              testing::ElementsAre("2 control points and 7 check points lie 47.1 m below the block that the positions "
                                   "place: ellipsoidal against orthometric heights? Name a system with a vertical "
                                   "part, or give three control points, which show it before the adjustment"));
  BlockResult other = result;
  other.block.control_points[4].position.z() += 10;  // it differs from the others
  EXPECT_EQ(wrong_control_texts(other).size(), 2u);
  other = result;
  other.block.control_points[4].position.x() += 10;
  EXPECT_EQ(wrong_control_texts(other).size(), 2u);
  for (Frame& frame : result.block.frames) frame.position_prior.reset();
  EXPECT_EQ(wrong_control_texts(result).size(), 2u);
}

}  // namespace
}  // namespace megablock
