// Tests the files of distances between frames: what they give to the block, and what they may not say.
#include "io/project/inputs/frame_measurements_file.h"

#include <gmock/gmock.h>

#include "io/base/error.h"
#include "tests/support/io/image_files.h"
#include "tests/support/io/scratch_directory.h"
#include "tests/support/io/small_result.h"

namespace megablock {
namespace {

using fixture::message_of;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Frames frame0 to frame3 with two images each; the text is the file without its header.
class Distances : public ::testing::Test {
 protected:
  std::vector<FrameMeasurement>& read(const std::string& lines) {
    fixture::write_file(file_, "from,to,distance_m,sigma_m\n" + lines);
    read_frame_measurements(frame_measurement_types().front(), file_, {"frame3/0.jpg"}, block_, warnings_);
    return block_.frame_measurements["distances"];
  }
  std::string refusal(const std::string& lines) {
    block_.frame_measurements.clear();
    return message_of<InputError>([&] { read(lines); });
  }
  ScratchDirectory folder_;
  std::string file_ = folder_.path("d.csv");
  Block block_ = fixture::small_result().block;
  std::vector<std::string> warnings_;
};

TEST_F(Distances, NameFramesOrTheirImages) {
  const auto& read_ones =
      read("frame0,frame1,15.5,0.01\nframe2/1.jpg,frame0/0.jpg,30,0.02\nframe3/0.jpg,frame1,3,0.1\n");
  ASSERT_EQ(read_ones.size(), 2u);
  EXPECT_EQ(read_ones[0].from, FrameIndex(0));
  EXPECT_EQ(read_ones[0].to, FrameIndex(1));
  EXPECT_EQ(read_ones[0].value, 15.5);
  EXPECT_EQ(read_ones[1].from, FrameIndex(2));
  EXPECT_EQ(read_ones[1].sigma, 0.02);
  EXPECT_THAT(warnings_, ElementsAre(HasSubstr("d.csv:4: the line is not used")));
}

TEST_F(Distances, OfTheSamePairAreRefusedWithBothPlaces) {
  EXPECT_EQ(
      refusal("frame0,frame1,15,0.01\nframe1,frame2,15,0.01\nframe1/1.jpg,frame0,15.01,0.01\n"),
      file_ + ":4: the two frames are measured in " + file_ + ":2 already; keep one line of them, or write their mean");
  block_.frame_measurements["distances"] = {{FrameIndex(0), FrameIndex(2), 30, 0.1}};
  EXPECT_THAT(message_of<InputError>([&] { read("frame2,frame0,30,0.01\n"); }), HasSubstr("in the block's own file"));
}

TEST_F(Distances, BeyondAnySenseAreRefused) {
  for (const std::string value : {"0", "-3", "1e-300", "1e300", "1e9"})
    EXPECT_THAT(refusal("frame0,frame1," + value + ",0.01\n"),
                HasSubstr("d.csv:2: distance_m must lie in [1e-06, 1e+08]; correct the number or its unit, not "))
        << value;
  for (const std::string sigma : {"0", "-1", "1e-300", "1e9"})
    EXPECT_THAT(refusal("frame0,frame1,15," + sigma + "\n"), HasSubstr("d.csv:2: sigma_m must lie in [1e-08, 1e+06]"))
        << sigma;
  EXPECT_THAT(refusal("frame0,frame1,15,0.01\nframe1,frame2,15,16\n"),
              HasSubstr("d.csv:3: sigma_m must lie in [1e-09, 1] times distance_m, not 16 with 15; correct"));
  EXPECT_THAT(refusal("frame0,frame1,1000,1e-7\n"), HasSubstr("times distance_m, not 1e-07 with 1000"));
  EXPECT_EQ(refusal("frame0,frame1,1000,1e-5\nframe1,frame2,0.001,0.001\n"), "");
}

}  // namespace
}  // namespace megablock
