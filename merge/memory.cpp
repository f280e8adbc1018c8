#include "merge/memory.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "io/error.h"
#include "merge/scratch_file.h"

namespace megablock {

void NodeFactors::write(ByteWriter& out) const {
  tile.write(out);
  front.write(out);
  condensed.write(out);
}

NodeFactors NodeFactors::read(ByteReader& in) {
  NodeFactors factors;
  factors.tile = TileFactor::read(in);
  factors.front = FrontFactor::read(in);
  factors.condensed = UpdateMatrix::read(in);
  if (!in.at_end()) throw StoreError("merge: a spilled factor has the wrong size");
  return factors;
}

void make_scratch_directory(const MemoryOptions& options) {
  if (options.scratch_directory.empty()) return;
  std::error_code error;
  std::filesystem::create_directories(options.scratch_directory, error);
  if (error)
    throw InputError("cannot make the scratch directory " + options.scratch_directory + ": " + error.message());
}

FactorStore::FactorStore(MemoryOptions options) : options_(std::move(options)) { make_scratch_directory(options_); }

FactorStore::~FactorStore() {
  for (const std::string& path : files_) remove_scratch_file(path);
}

std::string factor_path(const std::string& scratch_directory, std::int64_t node) {
  return scratch_directory + "/factor-" + std::to_string(node) + ".bin";
}

void FactorStore::put(std::int64_t node, NodeFactors factors, Loss loss) {
  if (const auto old = kept_.find(node); old != kept_.end()) {
    bytes_ -= old->second.byte_count();
    node_by_time_.erase(time_of_node_[node]);
  }
  bytes_ += factors.byte_count();
  kept_[node] = std::move(factors);
  time_of_node_[node] = clock_;
  node_by_time_[clock_++] = node;
  if (loss == Loss::kNever) never_lost_.insert(node);
  ++statistics_.put;
  make_room();
  statistics_.peak_bytes = std::max(statistics_.peak_bytes, bytes_);
}

// The oldest leave first; the newest stays.
void FactorStore::make_room() {
  for (auto oldest = node_by_time_.begin();
       bytes_ + others_ > options_.factor_bytes && std::next(oldest) != node_by_time_.end();) {
    const std::int64_t node = oldest->second;
    const auto entry = kept_.find(node);
    if (!spill(node, entry->second) && never_lost_.contains(node)) {
      ++oldest;
      continue;
    }
    bytes_ -= entry->second.byte_count();
    kept_.erase(entry);
    time_of_node_.erase(node);
    oldest = node_by_time_.erase(oldest);
  }
}

bool FactorStore::spill(std::int64_t node, const NodeFactors& factors) {
  if (spilled_.contains(node)) return true;
  if (options_.scratch_directory.empty() || scratch_full_ ||
      scratch_bytes_ + factors.byte_count() > options_.scratch_bytes)
    return false;
  const std::string path = factor_path(options_.scratch_directory, node);
  files_.insert(path);
  const bool whole = write_scratch_file(path, [&](std::ofstream& file) {
    ByteWriter writer(file);
    factors.write(writer);
  });
  if (!whole) {  // the disk is full: what is there stays, the rest is computed again
    scratch_full_ = true;
    return false;
  }
  spilled_[node] = path;
  scratch_bytes_ += factors.byte_count();
  ++statistics_.spilled;
  return true;
}

const NodeFactors* FactorStore::get(std::int64_t node) {
  if (const auto entry = kept_.find(node); entry != kept_.end()) return &entry->second;
  const auto entry = spilled_.find(node);
  if (entry == spilled_.end()) return nullptr;
  std::ifstream file(entry->second, std::ios::binary | std::ios::ate);
  if (!file) throw StoreError("cannot read " + entry->second);
  const auto size = static_cast<std::size_t>(file.tellg());
  file.seekg(0);
  ByteReader reader(file, size);
  loaded_ = NodeFactors();  // makes room first
  loaded_ = NodeFactors::read(reader);
  return &loaded_;
}

void FactorStore::discard(std::int64_t node) {
  if (const auto entry = kept_.find(node); entry != kept_.end()) {
    bytes_ -= entry->second.byte_count();
    node_by_time_.erase(time_of_node_[node]);
    time_of_node_.erase(node);
    kept_.erase(entry);
  }
  if (spilled_.erase(node) > 0) loaded_ = NodeFactors();
}

void FactorStore::leave_room(std::int64_t bytes) {
  others_ = bytes;
  if (!node_by_time_.empty()) make_room();
}

void FactorStore::clear() {
  spilled_.clear();
  kept_.clear();
  node_by_time_.clear();
  time_of_node_.clear();
  never_lost_.clear();
  bytes_ = others_ = scratch_bytes_ = 0;
  scratch_full_ = false;
  loaded_ = NodeFactors();
}

std::int64_t FactorStore::bytes_without_copy() const {
  std::int64_t bytes = 0;
  for (const auto& [node, factors] : kept_)
    if (!spilled_.contains(node)) bytes += factors.byte_count();
  return bytes;
}

bool FactorStore::copy_to_scratch() {
  return std::ranges::all_of(kept_, [&](const auto& entry) { return spill(entry.first, entry.second); });
}

std::vector<std::int64_t> FactorStore::nodes_in_scratch() const {
  std::vector<std::int64_t> nodes;
  for (const auto& [node, path] : spilled_) nodes.push_back(node);
  return nodes;
}

void FactorStore::adopt(const std::vector<std::int64_t>& nodes) {
  for (const std::int64_t node : nodes) {
    const std::string path = factor_path(options_.scratch_directory, node);
    files_.insert(path);
    spilled_[node] = path;
    scratch_bytes_ += static_cast<std::int64_t>(std::filesystem::file_size(path));
  }
}

}  // namespace megablock
