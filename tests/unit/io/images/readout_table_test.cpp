#include "io/images/readout_table.h"

#include <gtest/gtest.h>

namespace megablock {
namespace {

// The figures are those of OpenDroneMap's table.
TEST(ReadoutTable, KnowsCommonDrones) {
  EXPECT_EQ(readout_time_s("DJI", "FC300S", 12), 0.033);
  EXPECT_EQ(readout_time_s("Hasselblad", "L1D-20c", 20), 0.056);
  EXPECT_EQ(readout_time_s("Hasselblad", "L1D-20c", 16.8), 0.047);
  EXPECT_EQ(readout_time_s("GoPro", "HERO4 Black", 12), 0.030);
  EXPECT_EQ(readout_time_s("DJI", "FC6310", 20), std::nullopt);  // has a mechanical shutter
  EXPECT_EQ(readout_time_s("Canon", "Canon EOS 5D", 12), std::nullopt);
}

}  // namespace
}  // namespace megablock
