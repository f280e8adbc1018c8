// Writes and reads the covariances of a result: the formal and the empirical ones, the latter with the prefix
// "empirical_". Internal to io/.
#pragma once

#include "io/result/result.h"
#include "io/store/hdf5/hdf5_tables.h"

namespace megablock {

void put_precision(Hdf5Writer& file, const BlockResult& result);
void get_precision(const Hdf5Reader& file, BlockResult& result);

}  // namespace megablock
