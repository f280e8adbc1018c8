#include "io/project/project_init.h"

#include <gmock/gmock.h>

#include <filesystem>

#include "io/base/error.h"
#include "io/project/project.h"
#include "tests/support/io/image_files.h"
#include "tests/support/io/project_text.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

using fixture::gps_tags;
using fixture::message_of;
using fixture::read_file;
using fixture::write_file;
using fixture::write_image_file;
using fixture::write_line;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

TEST(InitProject, WritesWhatTheReaderReads) {
  ScratchDirectory folder;
  write_line(folder);
  write_file(folder.path("images/broken.jpg"), "");
  InitOptions options;
  options.images = folder.path("images/");
  options.output = folder.path("block.yaml");
  const std::string summary = init_project(options);
  EXPECT_THAT(summary, HasSubstr("5 images of 1 camera, 5 with a position, 0 with angles, 1 unreadable"));
  EXPECT_THAT(summary, HasSubstr("broken.jpg"));
  EXPECT_THAT(read_file(options.output), HasSubstr("images: \"images\"\n"));
  const Project project = read_project(options.output);
  EXPECT_THAT(project.block.images, SizeIs(5));
  EXPECT_THAT(project.warnings, IsEmpty());
  EXPECT_DOUBLE_EQ(project.block.ground.longitude_deg, -91.988);
  // The origin is in the file: an image added later does not move it.
  for (int i = 0; i < 20; ++i)
    write_image_file(folder.path("images/new" + std::to_string(i) + ".jpg"), 64, 48, 200 + i,
                     gps_tags(46.86, -91.99, 250));
  EXPECT_DOUBLE_EQ(read_project(options.output).block.ground.latitude_deg, 46.84);
  EXPECT_THAT(message_of<InputError>([&] { init_project(options); }), HasSubstr("exists already"));
}

TEST(InitProject, NamesControlPointsWithOneMark) {
  ScratchDirectory folder;
  write_line(folder);
  write_file(folder.path("images/gcp_list.txt"),
             "WGS84\n-91.988 46.84 250 10 10 0.jpg pole\n"
             "-91.988 46.84 250 20 20 0.jpg kerb\n-91.988 46.84 250 20 21 3.jpg kerb\n");
  InitOptions options;
  options.images = folder.path("images");
  options.output = folder.path("block.yaml");
  EXPECT_THAT(init_project(options),
              HasSubstr("control: 1 of 2 points is marked in one image only, so that nothing can check it: pole"));
}

TEST(InitProject, LeavesNothingBehindWhenItFails) {
  ScratchDirectory folder;
  std::filesystem::create_directories(folder.path("images"));
  InitOptions options;
  options.images = folder.path("images");
  options.output = folder.path("block.yaml");
  EXPECT_THROW(init_project(options), InputError);
  EXPECT_FALSE(std::filesystem::exists(options.output));
  EXPECT_FALSE(std::filesystem::exists(options.output + ".draft"));
  write_line(folder, 1);
  options.output = folder.path("absent/block.yaml");
  EXPECT_THAT(message_of<InputError>([&] { init_project(options); }),
              testing::AllOf(testing::StartsWith(options.output + ": the folder '" + folder.path("absent") +
                                                 "' does not exist; make it"),
                             testing::Not(HasSubstr("draft"))));
  options.images = folder.path("absent");
  EXPECT_THAT(message_of<InputError>([&] { init_project(options); }), HasSubstr("is not a folder"));
}

}  // namespace
}  // namespace megablock
