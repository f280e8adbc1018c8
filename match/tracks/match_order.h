// The matches of a block in the order in which tracks are made of them, which does not depend on the cells they came
// from: by generation; then pairs with many matches first, as their links are the surest; then by image.
//
// More than memory holds are sorted in runs of MatchMemory::bytes that wait in a scratch file and are merged while
// read.
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
  std::int64_t bytes = std::int64_t{128} << 20;  // of matches held at a time
  std::string scratch_file;                      // made where they exceed it, and removed; empty: all stay in memory
};

// Matches of one pair of images.
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

  // InputError where the pair is none. StoreError where the scratch file cannot be written.
  void add(const VerifiedPair& pair, std::int32_t generation);
  // Once, after all pairs. The argument of `visit` holds until it returns.
  void visit(const std::function<void(const PairMatches&)>& visit);

 private:
  struct Header {
    std::int32_t generation, count;
    std::int64_t a, b;
    std::int64_t offset;  // in rows_: of a's rows, then b's
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
  std::vector<std::int64_t> run_begin_;  // bytes of each run in the file, and the end
};

}  // namespace megablock
