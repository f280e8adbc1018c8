#define MEGABLOCK_LANE_WIDTH 8
#include "adjust/lanes/lane_kernels_body.h"

const megablock::lane_kernels::Kernels megablock::lane_kernels::kAvx512{work<false>, work<true>};
