// The features of a shard of images (shapes, types and units: docs/reference/file-formats.md, "Features").
//
// The writer makes a plain HDF5 file at `path`, which JobStore::write seals. The reader throws StoreError naming the
// file.
#pragma once

#include <string>
#include <vector>

#include "io/block/features.h"

namespace megablock {

void write_features(const std::string& path, const std::vector<ImageFeatures>& images);
std::vector<ImageFeatures> read_features(const std::string& path);
// Without the descriptors of the keypoints: an eighth of the bytes.
std::vector<ImageFeatures> read_keypoints(const std::string& path);

}  // namespace megablock
