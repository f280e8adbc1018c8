#define MEGABLOCK_LANE_WIDTH 2
#include "merge/tile/point_kernels_body.h"

const megablock::point_kernels::Kernels megablock::point_kernels::kPortable{
    normal, merge, sum, factorise, reduce, move, solve, subtract_product, subtract_pairs};
