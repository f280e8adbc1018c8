#include "io/text/text_lines.h"

#include <gmock/gmock.h>

#include "io/base/error.h"
#include "io/text/csv_table.h"
#include "tests/support/io/image_files.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

using ::testing::ElementsAre;
using ::testing::SizeIs;

std::vector<TextLine> text_lines_of(const std::string& bytes) {
  ScratchDirectory folder;
  fixture::write_file(folder.path("file.txt"), bytes);
  return read_text_lines(folder.path("file.txt"));
}

TEST(TextLines, ReadsEveryLineEndAndEncoding) {
  // U+00E4 and U+1F600 in UTF-8; the second one takes two units of UTF-16.
  const std::string text = "\xc3\xa4\xf0\x9f\x98\x80";
  const std::string little("\xff\xfe\xe4\0\x3d\xd8\0\xde\r\0\n\0b\0", 14);
  const std::string big("\xfe\xff\0\xe4\xd8\x3d\xde\0\0\r\0\n\0b", 14);
  for (const std::string& bytes :
       {text + "\nb", text + "\r\nb\r\n", text + "\rb\r", "\xef\xbb\xbf" + text + "\nb\n", little, big}) {
    const std::vector<TextLine> lines = text_lines_of(bytes);
    ASSERT_THAT(lines, SizeIs(2)) << bytes;
    EXPECT_EQ(lines[0].text, text);
    EXPECT_EQ(lines[1].text, "b");
    EXPECT_EQ(lines[1].number, 2);
  }
}

TEST(TextLines, CountsEmptyLinesWithoutReturningThem) {
  const std::vector<TextLine> lines = text_lines_of("\n  a \n\t\n\nb\t\n");
  ASSERT_THAT(lines, SizeIs(2));
  EXPECT_EQ(lines[0].text, "a");
  EXPECT_EQ(lines[0].number, 2);
  EXPECT_EQ(lines[1].text, "b\t") << "an empty field follows";
  EXPECT_EQ(lines[1].number, 5);
  EXPECT_THAT(text_lines_of(""), SizeIs(0));
  EXPECT_THROW(read_text_lines("/no/such/file"), InputError);
}

TEST(TextLines, SplitsAtTheSeparatorOutsideQuotes) {
  EXPECT_THAT(split_fields("a  \"b c\"\td ", Separator::kBlanks), ElementsAre("a", "b c", "d"));
  EXPECT_THAT(split_fields("a, \"b, c\",,d,", Separator::kComma), ElementsAre("a", "b, c", "", "d", ""));
  EXPECT_THAT(split_fields("1,5;2;", Separator::kSemicolon), ElementsAre("1,5", "2", ""));
  EXPECT_EQ(separator_of("x;y,5;z"), Separator::kSemicolon);
  EXPECT_EQ(separator_of("x,\ty,z"), Separator::kComma);
  EXPECT_EQ(separator_of("x\ty z"), Separator::kTab);
  EXPECT_EQ(separator_of("\"x,y\""), Separator::kBlanks);
}

TEST(TextLines, TakesDecimalCommasForPointsWhereTheySeparateNothing) {
  EXPECT_EQ(with_decimal_point("-1,25", Separator::kSemicolon), "-1.25");
  EXPECT_EQ(with_decimal_point("1,25", Separator::kComma), "1,25");
  EXPECT_EQ(with_decimal_point("1,234,567", Separator::kTab), "1,234,567") << "not a number; the reader says so";
  EXPECT_EQ(with_decimal_point("a,b", Separator::kTab), "a,b");
  EXPECT_TRUE(is_number("+1e-3"));
  for (const char* text : {"", "1.5 m", "nan", "--1"}) EXPECT_FALSE(is_number(text)) << text;
}

TEST(TextLines, CsvTablesHaveTheSeparatorOfTheirHeader) {
  ScratchDirectory folder;
  for (const std::string text : {"sep=;\nname;x\na;1,5\n", "name\tx\na\t1,5\n", "\xef\xbb\xbfname,x\r\na,1.5\r\n"}) {
    fixture::write_file(folder.path("t.csv"), text);
    const CsvTable table(folder.path("t.csv"));
    ASSERT_EQ(table.row_count(), 1U) << text;
    EXPECT_EQ(table.text(0, "name"), "a");
    EXPECT_EQ(table.needed_number(0, "x"), 1.5);
    EXPECT_EQ(table.number(0, "x"), 1.5);
  }
}

}  // namespace
}  // namespace megablock
