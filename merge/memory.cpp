#include "merge/memory.h"

#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "io/error.h"

namespace megablock {

Bytes NodeFactors::to_bytes() const {
  ByteWriter out;
  out.values(tile.to_bytes());
  front.write(out);
  return out.take();
}

NodeFactors NodeFactors::from_bytes(const Bytes& bytes) {
  ByteReader in(bytes);
  NodeFactors factors;
  factors.tile = TileFactor::from_bytes(in.values<char>());
  factors.front = FrontFactor::read(in);
  if (!in.at_end()) throw StoreError("merge: a spilled factor has the wrong size");
  return factors;
}

FactorStore::FactorStore(MemoryOptions options) : options_(std::move(options)) {
  if (!options_.scratch_directory.empty()) {
    std::error_code error;
    std::filesystem::create_directories(options_.scratch_directory, error);
    if (error)
      throw InputError("cannot make the scratch directory " + options_.scratch_directory + ": " + error.message());
  }
}

FactorStore::~FactorStore() { clear(); }

std::string FactorStore::scratch_path(std::int64_t node) const {
  return options_.scratch_directory + "/factor-" + std::to_string(::getpid()) + "-" +
         std::to_string(reinterpret_cast<std::uintptr_t>(this)) + "-" + std::to_string(node) + ".tmp";
}

void FactorStore::put(std::int64_t node, NodeFactors factors) {
  if (const auto old = kept_.find(node); old != kept_.end()) {
    bytes_ -= old->second.byte_count();
    node_by_time_.erase(time_of_node_[node]);
  }
  bytes_ += factors.byte_count();
  kept_[node] = std::move(factors);
  time_of_node_[node] = clock_;
  node_by_time_[clock_++] = node;
  ++statistics_.kept;
  while (bytes_ > options_.factor_bytes && kept_.size() > 1) evict_oldest();
  statistics_.peak_bytes = std::max(statistics_.peak_bytes, bytes_);
}

void FactorStore::evict_oldest() {
  const std::int64_t node = node_by_time_.begin()->second;
  const auto entry = kept_.find(node);
  if (options_.scratch_directory.empty()) {
    ++statistics_.dropped;
  } else if (!spilled_.contains(node)) {
    const std::string path = scratch_path(node);
    const Bytes bytes = entry->second.to_bytes();
    std::ofstream file(path, std::ios::binary);
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    file.close();
    if (!file) throw InputError("cannot write " + path + " (is the scratch directory full?)");
    spilled_[node] = path;
    ++statistics_.spilled;
  }
  bytes_ -= entry->second.byte_count();
  kept_.erase(entry);
  node_by_time_.erase(node_by_time_.begin());
  time_of_node_.erase(node);
}

const NodeFactors* FactorStore::get(std::int64_t node) {
  if (const auto entry = kept_.find(node); entry != kept_.end()) return &entry->second;
  const auto entry = spilled_.find(node);
  if (entry == spilled_.end()) return nullptr;
  std::ifstream file(entry->second, std::ios::binary | std::ios::ate);
  if (!file) throw StoreError("cannot read " + entry->second);
  Bytes bytes(static_cast<std::size_t>(file.tellg()));
  file.seekg(0);
  if (!file.read(bytes.data(), static_cast<std::streamsize>(bytes.size())))
    throw StoreError("cannot read " + entry->second);
  loaded_ = NodeFactors::from_bytes(bytes);
  return &loaded_;
}

void FactorStore::clear() {
  std::error_code ignored;
  for (const auto& [node, path] : spilled_) std::filesystem::remove(path, ignored);
  spilled_.clear();
  kept_.clear();
  node_by_time_.clear();
  time_of_node_.clear();
  bytes_ = 0;
  loaded_ = NodeFactors();
}

}  // namespace megablock
