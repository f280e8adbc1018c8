#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <regex>

#include "io/report/drawing/drawing.h"
#include "io/report/drawing/html.h"
#include "io/report/drawing/plane.h"
#include "io/report/report.h"
#include "tests/support/io/made_up_result.h"

namespace megablock {
namespace {

using testing::HasSubstr;

// A facade lies beside the frames, so the map must contain its points, except outliers.
TEST(ReportDrawing, MapsAreFramedByFramesAndTiePoints) {
  BlockResult result = made_up_result(SimulationOptions{.frames = 60});
  double low = 1e300, high = -1e300;
  for (std::size_t t = 0; t < result.points.size(); ++t) {
    result.points[t].y() += 5000;
    low = std::min(low, result.points[t].y());
    high = std::max(high, result.points[t].y());
  }
  result.points[0].y() = 1e7;
  const auto plane = report::plane_of(
      result, [](FrameIndex) { return true; }, false, [] {});
  ASSERT_TRUE(plane);
  EXPECT_GT(plane->high.y(), low + 0.9 * (high - low));
  EXPECT_LT(plane->high.y(), high);
  for (FrameIndex f(0); f.value < 60; ++f.value) {
    if (f.value == 3) continue;  // not oriented
    EXPECT_TRUE(plane->shows(plane->at(result.state.frames[f].centre.head<2>())));
  }
}

// A control point with wrong coordinates is drawn where the block sees it; one that no image sees is left out.
TEST(ReportDrawing, MapsAreNotFramedByWrongControl) {
  const auto all = [](FrameIndex) { return true; };
  SimulationOptions options{.frames = 60};
  options.control_points = 6;
  BlockResult result = made_up_result(options);
  const auto right = report::plane_of(result, all, true, [] {});
  result.block.control_points[2].position.x() += 11000;
  result.block.control_points[3].position.y() -= 11000;
  result.control[3].adjusted.setConstant(std::numeric_limits<double>::quiet_NaN());
  const auto plane = report::plane_of(result, all, true, [] {});
  ASSERT_TRUE(right && plane);
  EXPECT_LE((plane->high - plane->low).maxCoeff(), (right->high - right->low).maxCoeff());
  const std::string map = report::draw_map(result, all, "m", true, [] {});
  EXPECT_THAT(map, HasSubstr(result.block.control_points[2].name + "</title>"));
  EXPECT_THAT(map, testing::Not(HasSubstr(result.block.control_points[3].name + "</title>")));
}

TEST(ReportDrawing, TablesMayLeaveMemoryWhileMapsAreDrawn) {
  const BlockResult result = made_up_result(SimulationOptions{.frames = 60});
  const auto all = [](FrameIndex) { return true; };
  int rests = 0;
  const auto rest = [&] { ++rests; };
  EXPECT_EQ(report::draw_map(result, all, "m", true, rest), report::draw_map(result, all, "m", true, [] {}));
  EXPECT_GE(rests, 3);  // what frames it, tie points, colours of tiles
  rests = 0;
  EXPECT_EQ(report::draw_coverage(result, all, "m", rest), report::draw_coverage(result, all, "m", [] {}));
  EXPECT_GE(rests, 2);
}

TEST(ReportDrawing, TextOfCellsBreaksOnlyWhereItMay) {
  report::Table table({"name", "note"}, 2);
  table.add({"control", "a note of many words that does not fit one line"});
  table.add({std::string(60, 'x'), ""});
  const std::string html = table.html();
  EXPECT_THAT(html, HasSubstr("<td class=t>control</td><td class=\"t note\">"));
  EXPECT_THAT(html, HasSubstr("<td class=\"t long\">xxx"));
}

// Residuals that point outwards everywhere, those at the border most; and one that would reach across the drawing.
TEST(ReportDrawing, ArrowsOfResidualsEndInsideTheFrame) {
  const BlockResult result = made_up_result(small_block());
  const Camera& camera = result.block.cameras.front();
  for (const double longest : {1.0, 300.0}) {
    ResidualField field(camera);
    for (int r = 0; r < field.rows; ++r)
      for (int c = 0; c < field.columns; ++c)
        for (int i = 0; i < 50; ++i) {
          const Eigen::Vector2d pixel((c + 0.5) * camera.width / field.columns, (r + 0.5) * camera.height / field.rows);
          const Eigen::Vector2d out = (pixel - Eigen::Vector2d(0.5 * camera.width, 0.5 * camera.height)) / camera.width;
          field.add(camera, pixel, r == 0 && c == 0 ? longest * out : out);
        }
    const report::FieldDrawing drawing = report::draw(field, camera);
    const double height = 480.0 * camera.height / camera.width;
    const std::regex arrow("M([0-9.-]+) ([0-9.-]+)l([0-9.-]+) ([0-9.-]+)");
    int arrows = 0;
    for (std::sregex_iterator a(drawing.svg.begin(), drawing.svg.end(), arrow), end; a != end; ++a, ++arrows) {
      const double x = std::stod((*a)[1]) + std::stod((*a)[3]), y = std::stod((*a)[2]) + std::stod((*a)[4]);
      EXPECT_TRUE(x > -0.2 && x < 480.2 && y > -0.2 && y < height + 0.2) << (*a)[0];
    }
    EXPECT_GT(arrows, 20);
    EXPECT_EQ(drawing.caption.find("cut short") != std::string::npos, longest > 1) << drawing.caption;
  }
}

TEST(ReportDrawing, LeavesOutWhatIsHeld) {
  BlockResult result = made_up_result(small_block());
  EXPECT_THAT(report_html(result), testing::AllOf(HasSubstr("GNSS residuals"), HasSubstr("Attitude residuals"),
                                                  HasSubstr("59 of 59 oriented frames carry a GNSS position. ")));
  result.block.frames[FrameIndex(0)].position_prior->sigma.setConstant(1e-8);
  EXPECT_THAT(report_html(result),
              HasSubstr("58 of 59 oriented frames carry a GNSS position that is not held (1 more are held). "));
  for (Frame& frame : result.block.frames) {
    frame.position_prior->sigma.setConstant(1e-8);
    frame.attitude_prior->sigma_rad.setConstant(1e-11);
  }
  EXPECT_THAT(report_html(result),
              testing::Not(testing::AnyOf(HasSubstr("GNSS residuals"), HasSubstr("Attitude residuals"))));
}

TEST(ReportNumbers, ReadWell) {
  EXPECT_EQ(report::count(27503), "27\u202f503");
  EXPECT_EQ(report::count(-1234567), "\u22121\u202f234\u202f567");
  EXPECT_EQ(report::count(999), "999");
  EXPECT_EQ(report::fixed(-0.0001, 2), "0.00");
  EXPECT_EQ(report::with_sign(0.0123, 3), "+0.012");
  EXPECT_EQ(report::with_sign(-0.0123, 3), "\u22120.012");
  EXPECT_EQ(report::fixed(std::nan(""), 2), report::kMissing);
  EXPECT_EQ(report::significant(0.012345), "0.0123");
  EXPECT_EQ(report::significant(12345), "12345");
  EXPECT_EQ(report::significant(3.1e-7, 2), "3.1\u00b710<sup>\u22127</sup>");
  EXPECT_EQ(report::percent(9999, 10000), "99.9\u202f%");
  EXPECT_EQ(report::percent(5, 5), "100\u202f%");
  EXPECT_EQ(report::percent(1, 0), report::kMissing);
  EXPECT_EQ(report::duration(0.44), "0.4\u202fs");
  EXPECT_EQ(report::duration(59.9), "1\u202fmin 00\u202fs");
  EXPECT_EQ(report::duration(7800), "2\u202fh 10\u202fmin");
  EXPECT_EQ(report::memory(2150), "2.1\u202fGiB");
  EXPECT_EQ(report::sigma_text(27.733), "27.7");
  EXPECT_EQ(report::sigma_text(0.01234), "0.012");
  EXPECT_EQ(report::sigma_text(std::nan("")), report::kMissing);
  EXPECT_DOUBLE_EQ(report::step_below(0.0999), 0.05);
  EXPECT_DOUBLE_EQ(report::step_below(4.9), 2);
  EXPECT_DOUBLE_EQ(report::step_below(100), 100);
  EXPECT_EQ(report::exaggeration_text(0.1), "reduced tenfold");
  EXPECT_EQ(report::exaggeration_text(20), "exaggerated 20-fold");
  EXPECT_EQ(report::exaggeration_text(1), "drawn to scale");
  EXPECT_EQ(report::round_step(10, 5), 2);
  EXPECT_EQ(report::round_step(11, 5), 5);
  EXPECT_DOUBLE_EQ(report::round_step(0.7, 6), 0.2);
}

}  // namespace
}  // namespace megablock
