#define MEGABLOCK_LANE_WIDTH 4
#include "adjust/lanes/lane_kernels_body.h"

const megablock::lane_kernels::Kernels megablock::lane_kernels::kAvx2{work<false>, work<true>};
