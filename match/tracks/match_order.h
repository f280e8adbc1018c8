// Sorts the matches of a block into the order in which tracks are built: by generation, then pairs with many matches
// first, because their links are the most reliable, then by image. This order does not depend on the cells in which
// pairs were matched.
//
// Matches that exceed MatchMemory::bytes are sorted in runs, which wait in a scratch file and are merged while they are
// read (external merge sort).
#pragma once

#include <cstdint>
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "io/block/features.h"

namespace megablock {

struct MatchMemory {
  std::int64_t bytes = std::int64_t{128} << 20;  // largest size of matches in memory
  std::string scratch_file;  // written where they exceed it, and removed later; empty: all stay in memory
};

// The matches of one pair of images: feature_a[i] matches feature_b[i].
struct PairMatches {
  std::int32_t generation = 0;
  ImageIndex a, b;
  std::vector<std::int32_t> feature_a, feature_b;
};

class MatchOrder {
 public:
  explicit MatchOrder(MatchMemory memory);
  ~MatchOrder();
  MatchOrder(const MatchOrder&) = delete;
  MatchOrder& operator=(const MatchOrder&) = delete;

  // Adds the matches of a pair. Throws InputError for an invalid pair, and StoreError where the scratch file cannot be
  // written.
  void add(const VerifiedPair& pair, std::int32_t generation);
  // Calls `visit` for all pairs in order. Call it once, after all pairs were added. The argument is valid during the
  // call only.
  void visit(const std::function<void(const PairMatches&)>& visit);

 private:
  struct Header {
    std::int32_t generation, count;
    std::int64_t a, b;
    std::int64_t offset;  // in rows_: first the rows of a, then those of b
    bool operator<(const Header& other) const;
  };
  class Run;
  void write_run();
  void visit_memory(const std::function<void(const PairMatches&)>& visit);
  void visit_runs(const std::function<void(const PairMatches&)>& visit);
  [[noreturn]] void fail(const char* what) const;

  MatchMemory memory_;
  std::vector<Header> headers_;
  std::vector<std::int32_t> rows_;
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
  std::vector<std::int64_t> run_begin_;  // first byte of each run in the file, and the end
};

}  // namespace megablock
