#include "merge/tile_store.h"

#include <filesystem>
#include <fstream>
#include <utility>

#include "io/error.h"
#include "merge/packed_columns.h"
#include "merge/scratch_file.h"

namespace megablock {

namespace {

// The tables of a tile that wait in scratch, but for the points' positions.
template <typename Visit, typename... Problems>
void visit_tables(Visit&& visit, Problems&... problems) {
  visit(problems.images...);
  visit(problems.positions...);
  visit(problems.attitudes...);
  visit(problems.relatives...);
  visit(problems.points...);
  visit(problems.begin...);
  visit(problems.image...);
  visit(problems.x...);
  visit(problems.y...);
  visit(problems.inverse_sigma...);
  visit(problems.kept...);
}

template <typename T>
std::int64_t byte_count(const std::vector<T>& values) {
  return static_cast<std::int64_t>(values.size() * sizeof(T));
}

// Of a tile as it takes part in a step: points twice.
std::int64_t byte_count(const RankTile& tile) {
  std::int64_t bytes = 2 * byte_count(tile.state.points);
  visit_tables([&](const auto& table) { bytes += byte_count(table); }, tile.problem);
  return bytes;
}

std::int64_t file_bytes(const std::string& path) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  return error ? 0 : static_cast<std::int64_t>(size);
}

template <typename ReadTables>
void read_file(const std::string& path, ReadTables&& read_tables) {
  std::ifstream file(path, std::ios::binary);
  read_tables(file);
  if (!file) throw StoreError("cannot read " + path + " of the scratch directory; run again to resume");
}

bool write_points(const std::string& path, const std::vector<Eigen::Vector3d>& points) {
  return write_scratch_file(path, [&](std::ofstream& file) { write_column(file, points); });
}

}  // namespace

TileStore::TileStore(const MemoryOptions& options) : options_(options) { make_scratch_directory(options_); }

TileStore::~TileStore() {
  for (const Slot& slot : slots_) remove_files(slot);
}

std::string TileStore::path(const Slot& slot, const char* what) const {
  return options_.scratch_directory + "/tile-" + std::to_string(slot.tile.tile) + "-" + what + ".bin";
}

std::string TileStore::points_path(const Slot& slot, int file) const {
  return path(slot, file == 0 ? "points-0" : "points-1");
}

void TileStore::remove_files(const Slot& slot) const {
  if (!slot.in_scratch) return;
  for (const std::string& file : {path(slot, "measurements"), points_path(slot, 0), points_path(slot, 1)})
    remove_scratch_file(file);
}

void TileStore::add(RankTile tile) {
  const std::int64_t bytes = byte_count(tile);
  Slot& slot = slots_.emplace_back();
  slot.tile = std::move(tile);
  const bool fits = kept_bytes_ + bytes <= options_.tile_bytes;
  const bool room = !options_.scratch_directory.empty() && scratch_bytes_ + bytes <= options_.scratch_bytes;
  if (fits || !room || !spill(slot)) {
    kept_bytes_ += bytes;
    return;
  }
  slot.in_scratch = true;
  ++spilled_;
  forget(slot);
}

bool TileStore::spill(Slot& slot) {
  const bool whole = write_scratch_file(path(slot, "measurements"), [&](std::ofstream& file) {
    visit_tables([&](const auto& table) { write_column(file, table); }, slot.tile.problem);
  });
  scratch_bytes_ -= std::exchange(slot.scratch_bytes, 0);
  if (whole && write_points(points_path(slot, slot.points_file), slot.tile.state.points)) {
    slot.scratch_bytes = file_bytes(path(slot, "measurements")) + 2 * byte_count(slot.tile.state.points);
    scratch_bytes_ += slot.scratch_bytes;
    return true;
  }
  remove_scratch_file(path(slot, "measurements"));  // room for others
  return false;
}

void TileStore::forget(Slot& slot) {
  visit_tables([](auto& table) { std::exchange(table, {}); }, slot.tile.problem);
  if (!slot.points_here) std::exchange(slot.tile.state.points, {});
}

RankTile& TileStore::load(std::size_t row) {
  Slot& slot = slots_[row];
  if (!slot.in_scratch || loaded_ == static_cast<std::int64_t>(row)) return slot.tile;
  if (loaded_ >= 0) {  // its memory goes on to the next one
    Slot& before = slots_[static_cast<std::size_t>(std::exchange(loaded_, -1))];
    visit_tables([](auto& from, auto& to) { to.swap(from); }, before.tile.problem, slot.tile.problem);
    if (!before.points_here && !slot.points_here) slot.tile.state.points.swap(before.tile.state.points);
    forget(before);
  }
  read_file(path(slot, "measurements"), [&](std::ifstream& file) {
    visit_tables([&](auto& table) { read_column(file, table); }, slot.tile.problem);
  });
  if (!slot.points_here)
    read_file(points_path(slot, slot.points_file),
              [&](std::ifstream& file) { read_column(file, slot.tile.state.points); });
  loaded_ = static_cast<std::int64_t>(row);
  return slot.tile;
}

const RankTile& TileStore::whole(std::size_t row) { return load(row); }

// A tile that has no room in scratch any more moves to memory.
void TileStore::save(std::size_t row) {
  Slot& slot = slots_[row];
  if (!slot.in_scratch) return;
  slot.points_here = false;
  if (spill(slot)) return;
  remove_files(slot);
  slot.in_scratch = false;
  loaded_ = -1;
  --spilled_;
  kept_bytes_ += byte_count(slot.tile);
}

void TileStore::put_trial(std::size_t row, TileState trial) {
  Slot& slot = slots_[row];
  slot.trial = std::move(trial);
  slot.trial_here = slot.in_scratch && !write_points(points_path(slot, 1 - slot.points_file), slot.trial.points);
  if (slot.in_scratch && !slot.trial_here) std::exchange(slot.trial.points, {});
}

void TileStore::accept() {
  if (loaded_ >= 0) forget(slots_[static_cast<std::size_t>(std::exchange(loaded_, -1))]);
  for (Slot& slot : slots_) {
    slot.tile.state = std::exchange(slot.trial, {});
    slot.points_here = std::exchange(slot.trial_here, false);
    if (slot.in_scratch && !slot.points_here) slot.points_file = 1 - slot.points_file;
  }
}

void TileStore::reject() {
  for (Slot& slot : slots_) {
    slot.trial = {};
    slot.trial_here = false;
  }
}

}  // namespace megablock
