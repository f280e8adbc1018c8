#include <gmock/gmock.h>

#include <cmath>

#include "io/report/drawing.h"
#include "io/report/html.h"
#include "tests/unit/io/made_up_result.h"

namespace megablock {
namespace {

using testing::HasSubstr;

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
