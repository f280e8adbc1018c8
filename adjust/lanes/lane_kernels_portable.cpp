#define MEGABLOCK_LANE_WIDTH 2
#include "adjust/lanes/lane_kernels_body.h"

const megablock::lane_kernels::Kernels megablock::lane_kernels::kPortable{work<false>, work<true>};
