// Every put() gets a number from `clock_`. The map from these numbers to nodes has the oldest factors first, and they
// leave memory in this order. Factors that went to scratch are read into `loaded_` when they are asked for, one node at
// a time, and do not come back to memory: in a sweep down each is needed once.
#include "merge/step/memory.h"

#include <algorithm>
#include <iterator>

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
  return factors;
}

FactorStore::FactorStore(MemoryOptions options) : options_(std::move(options)) {}

FactorStore::~FactorStore() {
  for (const std::int64_t node : written_) options_.scratch->remove(factor_file(node));
}

std::string factor_file(std::int64_t node) { return "factor-" + std::to_string(node) + ".bin"; }

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

// Moves factors to scratch, the oldest first, until the rest is within the budget. The newest always stays in memory.
void FactorStore::make_room() {
  for (auto oldest = node_by_time_.begin();
       bytes_ + others_ > options_.factor_bytes && std::next(oldest) != node_by_time_.end();) {
    // Factors that find no room in scratch and must not be lost are passed over, and the next younger ones go.
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
  // A factor in scratch is never written twice: its file keeps its contents while the node is in memory.
  if (spilled_.contains(node)) return true;
  const std::string name = factor_file(node);
  // The room is reserved before the factors are written, so that no time is lost on factors that find no room.
  if (scratch_full_ || !options_.scratch->reserve(name, factors.byte_count())) return false;
  const bool whole = options_.scratch->write(name, [&](std::ostream& file) {
    ByteWriter writer(file);
    factors.write(writer);
  });
  if (!whole) {  // the disk is full: later factors are computed again
    scratch_full_ = true;
    return false;
  }
  spilled_.insert(node);
  written_.insert(node);
  ++statistics_.spilled;
  return true;
}

const NodeFactors* FactorStore::get(std::int64_t node) {
  if (const auto entry = kept_.find(node); entry != kept_.end()) return &entry->second;
  if (!spilled_.contains(node)) return nullptr;
  loaded_ = NodeFactors();  // frees the memory of the last ones before more is read
  options_.scratch->read(factor_file(node), [&](std::istream& file, std::size_t size) {
    ByteReader reader(file, size);
    loaded_ = NodeFactors::read(reader);
  });
  return &loaded_;
}

void FactorStore::discard(std::int64_t node) {
  if (const auto entry = kept_.find(node); entry != kept_.end()) {
    bytes_ -= entry->second.byte_count();
    node_by_time_.erase(time_of_node_[node]);
    time_of_node_.erase(node);
    kept_.erase(entry);
  }
  // The file stays, and the next sweep writes over it.
  if (spilled_.erase(node) > 0) loaded_ = NodeFactors();
}

void FactorStore::leave_room(std::int64_t bytes) {
  others_ = bytes;
  if (!node_by_time_.empty()) make_room();
}

void FactorStore::clear() {
  for (const std::int64_t node : written_) options_.scratch->spare(factor_file(node));
  spilled_.clear();
  kept_.clear();
  node_by_time_.clear();
  time_of_node_.clear();
  never_lost_.clear();
  bytes_ = others_ = 0;
  scratch_full_ = false;  // the disk may have room in the next sweep
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

std::vector<std::int64_t> FactorStore::nodes_in_scratch() const { return {spilled_.begin(), spilled_.end()}; }

void FactorStore::adopt(const std::vector<std::int64_t>& nodes) {
  spilled_.insert(nodes.begin(), nodes.end());
  written_.insert(nodes.begin(), nodes.end());
}

}  // namespace megablock
