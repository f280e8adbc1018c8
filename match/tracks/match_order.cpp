#include "match/tracks/match_order.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <queue>
#include <tuple>

#include "io/base/error.h"

namespace megablock {

bool MatchOrder::Header::operator<(const Header& other) const {
  return std::tuple(generation, -count, a, b) < std::tuple(other.generation, -other.count, other.a, other.b);
}

MatchOrder::MatchOrder(MatchMemory memory) : memory_(std::move(memory)), file_(nullptr, &std::fclose) {}

MatchOrder::~MatchOrder() {
  if (!file_) return;
  file_.reset();
  std::error_code ignored;
  std::filesystem::remove(memory_.scratch_file, ignored);
}

void MatchOrder::fail(const char* what) const {
  throw StoreError(memory_.scratch_file + ": matches could not be " + what + " (" + std::strerror(errno) +
                   "); the job's folder must be writable, with free space");
}

void MatchOrder::add(const VerifiedPair& pair, std::int32_t generation) {
  if (pair.a.value < 0 || pair.b <= pair.a || pair.feature_a.size() != pair.feature_b.size())
    throw InputError("matches of images " + std::to_string(pair.a.value) + " and " + std::to_string(pair.b.value) +
                     ": the images must be two, the lower index first, with a feature of each for every match");
  headers_.push_back({generation, static_cast<std::int32_t>(pair.feature_a.size()), pair.a.value, pair.b.value,
                      static_cast<std::int64_t>(rows_.size())});
  rows_.insert(rows_.end(), pair.feature_a.begin(), pair.feature_a.end());
  rows_.insert(rows_.end(), pair.feature_b.begin(), pair.feature_b.end());
  const std::size_t bytes = headers_.size() * sizeof(Header) + rows_.size() * sizeof(std::int32_t);
  if (!memory_.scratch_file.empty() && bytes > static_cast<std::size_t>(memory_.bytes)) write_run();
}

// Writes the matches in memory to the file as one sorted run, each pair as its header and its rows.
void MatchOrder::write_run() {
  if (!file_) {
    std::error_code ignored;  // only the result counts: whether the file can be made
    std::filesystem::create_directories(std::filesystem::path(memory_.scratch_file).parent_path(), ignored);
    file_.reset(std::fopen(memory_.scratch_file.c_str(), "w+b"));
    if (!file_) fail("sorted");
    run_begin_.push_back(0);
  }
  std::sort(headers_.begin(), headers_.end());
  std::int64_t bytes = 0;
  for (const Header& header : headers_) {
    const std::size_t rows = 2 * static_cast<std::size_t>(header.count);
    if (std::fwrite(&header, sizeof header, 1, file_.get()) != 1 ||
        std::fwrite(rows_.data() + header.offset, sizeof(std::int32_t), rows, file_.get()) != rows)
      fail("written");
    bytes += static_cast<std::int64_t>(sizeof header + rows * sizeof(std::int32_t));
  }
  run_begin_.push_back(run_begin_.back() + bytes);
  headers_.clear();
  rows_.clear();
}

namespace {

void take_rows(const void* rows, std::int32_t count, PairMatches& pair) {
  const std::size_t each = static_cast<std::size_t>(count) * sizeof(std::int32_t);
  pair.feature_a.resize(static_cast<std::size_t>(count));
  pair.feature_b.resize(static_cast<std::size_t>(count));
  if (count == 0) return;
  std::memcpy(pair.feature_a.data(), rows, each);
  std::memcpy(pair.feature_b.data(), static_cast<const char*>(rows) + each, each);
}

}  // namespace

// A sorted run in the file, read through its own buffer.
class MatchOrder::Run {
 public:
  Run(const MatchOrder& order, std::int64_t begin, std::int64_t end) : order_(&order), next_(begin), end_(end) {
    advance();
  }
  const Header& header() const { return header_; }
  bool ended() const { return ended_; }
  // Copies the matches of header() into `pair` and moves on to the next pair.
  void take(PairMatches& pair) {
    pair.generation = header_.generation;
    pair.a = ImageIndex(header_.a);
    pair.b = ImageIndex(header_.b);
    const std::size_t bytes = 2 * static_cast<std::size_t>(header_.count) * sizeof(std::int32_t);
    take_rows(fetch(bytes), header_.count, pair);
    advance();
  }

 private:
  static constexpr std::size_t kBufferBytes = std::size_t{1} << 20;

  void advance() {
    ended_ = next_ == end_ && position_ == buffer_.size();
    if (!ended_) std::memcpy(&header_, fetch(sizeof header_), sizeof header_);
  }
  // The next bytes of the run. Reads at least a buffer at a time; the result is valid until the next call.
  const char* fetch(std::size_t bytes) {
    if (buffer_.size() - position_ < bytes) {
      buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(position_));
      position_ = 0;
      const std::size_t held = buffer_.size();
      const auto more =
          std::min<std::size_t>(std::max(bytes - held, kBufferBytes), static_cast<std::size_t>(end_ - next_));
      buffer_.resize(held + more);
      std::FILE* file = order_->file_.get();
      if (::fseeko(file, next_, SEEK_SET) != 0 || std::fread(buffer_.data() + held, 1, more, file) != more)
        order_->fail("read again");
      next_ += static_cast<std::int64_t>(more);
    }
    const char* result = buffer_.data() + position_;
    position_ += bytes;
    return result;
  }

  const MatchOrder* order_;
  std::int64_t next_, end_;  // position in the file behind the buffer, and end of the run
  std::vector<char> buffer_;
  std::size_t position_ = 0;
  Header header_{};
  bool ended_ = false;
};

void MatchOrder::visit(const std::function<void(const PairMatches&)>& visit) {
  if (!file_) return visit_memory(visit);
  write_run();
  rows_ = {};
  headers_ = {};
  if (std::fflush(file_.get()) != 0) fail("written");
  visit_runs(visit);
}

// All matches are in memory: only the headers are sorted.
void MatchOrder::visit_memory(const std::function<void(const PairMatches&)>& visit) {
  std::sort(headers_.begin(), headers_.end());
  PairMatches pair;
  for (const Header& header : headers_) {
    pair.generation = header.generation;
    pair.a = ImageIndex(header.a);
    pair.b = ImageIndex(header.b);
    take_rows(rows_.data() + header.offset, header.count, pair);
    visit(pair);
  }
}

// Merges the runs: the queue holds the runs by their next pair.
void MatchOrder::visit_runs(const std::function<void(const PairMatches&)>& visit) {
  std::vector<Run> runs;
  for (std::size_t r = 0; r + 1 < run_begin_.size(); ++r) runs.emplace_back(*this, run_begin_[r], run_begin_[r + 1]);
  const auto later = [&](std::size_t i, std::size_t j) { return runs[j].header() < runs[i].header(); };
  std::priority_queue<std::size_t, std::vector<std::size_t>, decltype(later)> first(later);
  for (std::size_t r = 0; r < runs.size(); ++r)
    if (!runs[r].ended()) first.push(r);
  PairMatches pair;
  while (!first.empty()) {
    const std::size_t r = first.top();
    first.pop();
    runs[r].take(pair);
    if (!runs[r].ended()) first.push(r);
    visit(pair);
  }
}

}  // namespace megablock
