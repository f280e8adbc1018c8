// Tests which files an export writes, and when it refuses to write.
#include <gmock/gmock.h>

#include <filesystem>
#include <set>

#include "io/base/error.h"
#include "io/exchange/export.h"
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

}  // namespace
}  // namespace megablock
