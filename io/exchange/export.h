// Exports a result in any format. docs/reference/exports.md and the headers of the writers describe the files.
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

// The files that a format writes for `out`. Some files of csv are written only if the block has contents for them.
std::vector<std::string> export_files(const std::string& format, const std::string& out);

// What the format cannot hold of the cameras, in a sentence; empty: nothing that matters. COLMAP has no skew, BAL and
// Bundler have no affinity either: the observations are corrected for it, but images are not.
std::string export_note(const BlockResult& result, const std::string& format);

// Writes the export. If the format is a folder, the folder is made; its parent must exist. Throws InputError for an
// unknown format, and if the export cannot be written.
void export_result(const BlockResult& result, const std::string& format, const std::string& out);

}  // namespace megablock
