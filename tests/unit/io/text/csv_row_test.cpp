// Tests that names are read from CSV files as they were written, and that fields follow RFC 4180.
#include "io/text/csv_row.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <sstream>

#include "io/base/error.h"
#include "io/project/inputs/pose_csv.h"
#include "io/text/csv_table.h"
#include "tests/support/io/image_files.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

using fixture::message_of;
using fixture::read_file;
using fixture::write_file;
using ::testing::ElementsAre;

// Names that a folder can give to images: all are names of files on Linux.
const std::vector<std::string> kNames = {
    "plain.jpg",
    "a, b.jpg",
    "the \"big\" one.jpg",
    "\"",
    "\"\"",
    ",",
    "two\nlines.jpg",
    "mac\rlines.jpg",
    "dos\r\n.jpg",
    "# no comment.jpg",
    " blanks ",
    "6\".jpg",
    "\",\"\n\",",
    "ends in\n",
    "\tturn",
    "inner  blanks",
    "",
    "naïve é中",
    "a;b",
};

TEST(CsvRow, QuotesAsTheStandardSays) {
  EXPECT_EQ(csv_field("a b.jpg"), "a b.jpg");
  EXPECT_EQ(csv_field("a,b"), "\"a,b\"");
  EXPECT_EQ(csv_field("a\"b"), "\"a\"\"b\"");
  EXPECT_EQ(csv_field("a\nb"), "\"a\nb\"");
  EXPECT_EQ(csv_field("a\rb"), "\"a\rb\"");
}

TEST(CsvRow, EveryNameComesBack) {
  std::string row;
  for (const std::string& name : kNames) row += csv_field(name) + ',';
  std::vector<std::string> expected = kNames;
  expected.emplace_back();
  EXPECT_EQ(csv_fields(row), expected);

  // In rows of a file, with the ends of lines of both systems.
  for (const std::string end : {"\n", "\r\n"}) {
    std::stringstream file("\xef\xbb\xbfname,x" + end);
    file.seekp(0, std::ios::end);
    for (const std::string& name : kNames) file << csv_field(name) << ",1" << end;
    std::int64_t lines = 0;
    ASSERT_TRUE(read_csv_row(file, "f", row, lines));
    EXPECT_THAT(csv_fields(row), ElementsAre("name", "x"));
    for (const std::string& name : kNames) {
      ASSERT_TRUE(read_csv_row(file, "f", row, lines));
      EXPECT_THAT(csv_fields(row), ElementsAre(name, "1"));
    }
    EXPECT_FALSE(read_csv_row(file, "f", row, lines));
  }
}

TEST(CsvRow, BlanksAroundFieldsDoNotBelongToThem) {
  EXPECT_THAT(csv_fields(" a , \"b, c\" ,\t\"\"\t, d e \r"), ElementsAre("a", "b, c", "", "d e"));
  EXPECT_THAT(csv_fields(""), ElementsAre(""));
  EXPECT_THAT(csv_fields("6\" lens,a\"b,c\"d"), ElementsAre("6\" lens", "a\"b", "c\"d"))
      << "a quote inside a field is a letter";
}

TEST(CsvRow, ReadersCountTheLinesOfRowsAndNameAQuoteThatIsNotClosed) {
  ScratchDirectory folder;
  write_file(folder.path("t.csv"), "# it's a \"comment\nname,x\n\"a\nb\",1\nc,oops\n");
  const CsvTable table(folder.path("t.csv"));
  EXPECT_EQ(table.text(0, "name"), "a\nb");
  EXPECT_EQ(table.where(0), folder.path("t.csv") + ":3");
  EXPECT_EQ(table.where(1), folder.path("t.csv") + ":5");
  write_file(folder.path("open.csv"), "name,x\na,1\n\"b,2\nc,3\n");
  EXPECT_EQ(message_of<InputError>([&] { CsvTable(folder.path("open.csv")); }),
            folder.path("open.csv") +
                ":3: a field begins with a quote that is not closed; close it, or double a quote "
                "that belongs to the text");
}

TEST(CsvRow, PosesComeBackByTheirNames) {
  ScratchDirectory folder;
  PoseTable table;
  for (const std::string& name : kNames) {
    table.names.push_back(name);
    table.poses.emplace_back();
    table.passes.push_back(7);
  }
  write_pose_csv(folder.path("poses.csv"), table);
  const PoseTable read = read_pose_csv(folder.path("poses.csv"));
  EXPECT_EQ(read.names, table.names);
  EXPECT_EQ(read.passes, table.passes);
  write_file(folder.path("poses.csv"), read_file(folder.path("poses.csv")) + "x,1,0,0,0,1,2,oops,7\n");
  const auto line = std::ranges::count(read_file(folder.path("poses.csv")), '\n');
  EXPECT_EQ(message_of<InputError>([&] { read_pose_csv(folder.path("poses.csv")); }),
            folder.path("poses.csv") + ":" + std::to_string(line) +
                ": z: 'oops' is not a number; delete the line if the frame has no pose");
}

}  // namespace
}  // namespace megablock
