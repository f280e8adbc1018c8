// Stores candidate pairs, verified matches and tiles in files (shapes, types and units: docs/reference/file-formats.md,
// "Candidates", "Matches", "Tiles").
//
// The writers make plain HDF5 files at `path`, which JobStore::write seals. The readers throw StoreError with the name
// of the file.
#pragma once

#include <string>
#include <vector>

#include "io/block/features.h"
#include "io/block/image_graph.h"

namespace megablock {

void write_candidates(const std::string& path, const CandidateGraph& graph);
CandidateGraph read_candidates(const std::string& path);

void write_matches(const std::string& path, const std::vector<VerifiedPair>& pairs);
std::vector<VerifiedPair> read_matches(const std::string& path);

void write_tiles(const std::string& path, const Tiles& tiles);
Tiles read_tiles(const std::string& path);

}  // namespace megablock
