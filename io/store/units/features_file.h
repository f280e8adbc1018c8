// Stores the features of a shard of images in a file (shapes, types and units: docs/reference/file-formats.md,
// "Features").
//
// The writer makes a plain HDF5 file at `path`, which JobStore::write seals. The reader throws StoreError with the name
// of the file.
#pragma once

#include <string>
#include <vector>

#include "io/block/features.h"

namespace megablock {

void write_features(const std::string& path, const std::vector<ImageFeatures>& images);
std::vector<ImageFeatures> read_features(const std::string& path);
// Reads the features without the descriptors of the keypoints, which is an eighth of the bytes.
std::vector<ImageFeatures> read_keypoints(const std::string& path);

}  // namespace megablock
