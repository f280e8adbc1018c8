// Exports of a result: one entry for all formats. What each file holds: docs/reference/exports.md and the writers'
// headers.
#pragma once

#include <string>
#include <vector>

#include "io/result/result.h"

namespace megablock {

// colmap-text, colmap-bin: folder with cameras, images, points3D       (io/exchange/colmap/export_colmap.h)
// bal:             one file                                            (io/exchange/bal/export_bal.h)
// bundler:         one file and its image list, <out>.list.txt         (io/exchange/bal/export_bal.h)
// ply, geojson:    one file                                            (io/exchange/tables/export_tables.h)
// csv:             folder with frames.csv, images_local.csv, images_wgs84.csv, cameras.csv, mounts.csv
//                  (io/exchange/tables/export_tables.h)
// h5:              one self-contained file (write_result)
const std::vector<std::string>& export_formats();

// The files that a format writes for `out`; of csv some only where the block has what they hold.
std::vector<std::string> export_files(const std::string& format, const std::string& out);

// Makes the folder of a format that is one, in a folder that is there. InputError for an unknown format, or when it
// cannot be written.
void export_result(const BlockResult& result, const std::string& format, const std::string& out);

}  // namespace megablock
