#include <gmock/gmock.h>

#include <cmath>

#include "io/report/drawing.h"
#include "io/report/html.h"
#include "tests/unit/io/made_up_result.h"

namespace megablock {
namespace {

using testing::HasSubstr;

// A facade lies beside the frames: the map is framed by its points, but for stray ones.
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
      result, [](FrameIndex) { return true; }, false);
  ASSERT_TRUE(plane);
  EXPECT_GT(plane->high.y(), low + 0.9 * (high - low));
  EXPECT_LT(plane->high.y(), high);
  for (FrameIndex f(0); f.value < 60; ++f.value)
    if (f.value != 3) EXPECT_TRUE(plane->shows(plane->at(result.state.frames[f].centre.head<2>())));
}

TEST(ReportDrawing, TextOfCellsBreaksOnlyWhereItMay) {
  report::Table table({"name", "note"}, 2);
  table.add({"control", "a note of many words that does not fit one line"});
  table.add({std::string(60, 'x'), ""});
  const std::string html = table.html();
  EXPECT_THAT(html, HasSubstr("<td class=t>control</td><td class=\"t note\">"));
  EXPECT_THAT(html, HasSubstr("<td class=\"t long\">xxx"));
}

}  // namespace
}  // namespace megablock
