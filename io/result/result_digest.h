// Computes the digest of a result (result_digest()) batch by batch, for tracks that do not fit into memory.
#pragma once

#include <string>

#include "io/base/hash.h"
#include "io/result/result.h"

namespace megablock {

class ResultDigest {
 public:
  ResultDigest(const BlockState& state, std::int64_t track_count);
  void add(const TrackResults& batch);  // batches must come in global order
  void add(const TrackResults& batch, std::size_t row);
  std::string text() const;

 private:
  Hasher hasher_;
};

}  // namespace megablock
