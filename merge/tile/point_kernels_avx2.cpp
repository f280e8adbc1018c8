#define MEGABLOCK_LANE_WIDTH 4
#include "merge/tile/point_kernels_body.h"

const megablock::point_kernels::Kernels megablock::point_kernels::kAvx2{
    normal, merge, sum, factorise, reduce, move, solve, subtract_product, subtract_pairs};
