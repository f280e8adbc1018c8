// Tests which files an export writes, and when it refuses to write.
#include <gmock/gmock.h>

#include <filesystem>
#include <set>

#include "io/base/error.h"
#include "io/exchange/export.h"
#include "io/text/csv_table.h"
#include "tests/support/io/image_files.h"
#include "tests/support/io/scratch_directory.h"
#include "tests/support/io/small_result.h"

namespace megablock {
namespace {

using fixture::message_of;
using fixture::small_result;
using fixture::write_file;
using ::testing::HasSubstr;

TEST(ExportFiles, SaysWhichFilesItWrites) {
  const BlockResult result = small_result();
  for (const std::string& format : export_formats()) {
    ScratchDirectory folder;
    export_result(result, format, folder.path("out"));
    std::set<std::string> written;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder.path()))
      if (entry.is_regular_file()) written.insert(entry.path().string());
    const std::vector<std::string> said = export_files(format, folder.path("out"));
    EXPECT_EQ(written, std::set<std::string>(said.begin(), said.end())) << format;
  }
}

TEST(ExportFiles, RefusesUnknownFormatsAndPlacesItCannotWrite) {
  ScratchDirectory folder;
  const BlockResult result = small_result();
  EXPECT_THAT(message_of<InputError>([&] { export_result(result, "kml", folder.path("x")); }),
              HasSubstr("'kml' is not an export format; the formats are colmap-text, "));
  for (const std::string& format : export_formats())  // a place that is mistyped
    EXPECT_THAT(
        message_of<InputError>([&] { export_result(result, format, folder.path("nowhere/out/")); }),
        HasSubstr("nowhere/out/: the folder '" + folder.path("nowhere") + "' does not exist; make it, or check"));
  EXPECT_FALSE(std::filesystem::exists(folder.path("nowhere")));
  write_file(folder.path("file"), "in the way");
  EXPECT_THAT(message_of<InputError>([&] { export_result(result, "csv", folder.path("file")); }),
              HasSubstr("file: cannot be created as a directory: a file is where a directory is needed; move it away"));
  for (const std::string& format : export_formats())
    EXPECT_NE(message_of<Error>([&] { export_result(result, format, folder.path("file/out")); }), "") << format;
  EXPECT_NE(message_of<InputError>([&] { export_result(result, "bal", "/dev/full"); }), "");
}

TEST(ExportFiles, TablesHoldAnyName) {
  ScratchDirectory folder;
  BlockResult result = small_result();
  fixture::name_oddly(result.block);
  export_result(result, "csv", folder.path("out"));
  const Block& block = result.block;
  const CsvTable images(folder.path("out/images_local.csv")), cameras(folder.path("out/cameras.csv"));
  ASSERT_EQ(images.row_count(), 6u);  // of the three frames with an orientation
  EXPECT_EQ(images.text(0, "image"), block.name_of(ImageIndex(0)));
  EXPECT_EQ(images.text(0, "frame"), block.frames[FrameIndex(0)].name);
  EXPECT_EQ(images.text(0, "camera"), block.cameras[CameraIndex(0)].name);
  EXPECT_EQ(images.number(5, "x_m").has_value(), true);
  EXPECT_EQ(cameras.text(1, "name"), block.cameras[CameraIndex(1)].name);
  EXPECT_EQ(cameras.text(1, "width"), "2000");
  const CsvTable mounts(folder.path("out/mounts.csv"));
  EXPECT_EQ(mounts.text(1, "rig"), block.rigs[RigIndex(0)].name);
  EXPECT_EQ(mounts.text(1, "camera"), block.cameras[CameraIndex(1)].name);
  EXPECT_EQ(mounts.text(1, "x_m"), "0.5");
}

}  // namespace
}  // namespace megablock
