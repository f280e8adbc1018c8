#include "merge/step/tile_store.h"

#include <string>
#include <utility>

#include "merge/scratch/packed_columns.h"

namespace megablock {

namespace {

// Visits the tables of a tile that are stored in scratch, except the positions of the points. These have files of their
// own, because they change in every iteration, and the tables do not. With two tiles, `visit` gets both tables at once.
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

// The memory of a tile in an iteration, which holds the points twice: the present ones and those of the trial.
std::int64_t byte_count(const RankTile& tile) {
  std::int64_t bytes = 2 * byte_count(tile.state.points);
  visit_tables([&](const auto& table) { bytes += byte_count(table); }, tile.problem);
  return bytes;
}

// The names of a tile's files. There are two files of points, one for the present ones and one for those of a trial.
std::string file_of(std::int64_t tile, const std::string& what) {
  return "tile-" + std::to_string(tile) + "-" + what + ".bin";
}
std::string measurements_of(std::int64_t tile) { return file_of(tile, "measurements"); }
std::string points_of(std::int64_t tile, int file) { return file_of(tile, "points-" + std::to_string(file)); }

bool write_points(ScratchSpace& scratch, const std::string& name, const std::vector<Eigen::Vector3d>& points) {
  return scratch.write(name, [&](std::ostream& file) { write_column(file, points); });
}

}  // namespace

TileStore::TileStore(const MemoryOptions& options) : options_(options) {}

TileStore::~TileStore() {
  for (const Slot& slot : slots_)
    if (slot.in_scratch) remove_files(slot);
}

void TileStore::remove_files(const Slot& slot) const {
  const std::int64_t tile = slot.tile.tile;
  for (const std::string& file : {measurements_of(tile), points_of(tile, 0), points_of(tile, 1)})
    options_.scratch->remove(file);
}

void TileStore::add(RankTile tile) {
  const std::int64_t bytes = byte_count(tile);
  Slot& slot = slots_.emplace_back();
  slot.tile = std::move(tile);
  // The packed size is not known before the tile is packed, so room is asked for with the unpacked one.
  const bool fits = kept_bytes_ + bytes <= options_.tile_bytes;
  if (fits || !options_.scratch->reserve(measurements_of(slot.tile.tile), bytes) || !spill(slot)) {
    kept_bytes_ += bytes;
    return;
  }
  slot.in_scratch = true;
  ++spilled_;
  forget(slot);
}

bool TileStore::spill(Slot& slot) {
  const std::int64_t tile = slot.tile.tile;
  const std::string points = points_of(tile, slot.points_file);
  slot.sizes.clear();
  visit_tables([&](const auto& table) { slot.sizes.push_back(table.size()); }, slot.tile.problem);
  const auto write_tables = [&](std::ostream& file) {
    visit_tables([&](const auto& table) { write_column(file, table); }, slot.tile.problem);
  };
  if (options_.scratch->write(measurements_of(tile), write_tables) &&
      write_points(*options_.scratch, points, slot.tile.state.points) &&
      options_.scratch->reserve(points_of(tile, 1 - slot.points_file), options_.scratch->bytes_of(points)))
    return true;
  remove_files(slot);  // room for others
  return false;
}

void TileStore::forget(Slot& slot) {
  visit_tables([](auto& table) { std::exchange(table, {}); }, slot.tile.problem);
  if (!slot.points_here) std::exchange(slot.tile.state.points, {});
}

RankTile& TileStore::load(std::size_t row) {
  Slot& slot = slots_[row];
  if (!slot.in_scratch || loaded_ == static_cast<std::int64_t>(row)) return slot.tile;
  if (loaded_ >= 0) {  // frees its memory for the next one
    Slot& before = slots_[static_cast<std::size_t>(std::exchange(loaded_, -1))];
    // The tables of the next tile take over the memory of the last one.
    visit_tables([](auto& from, auto& to) { to.swap(from); }, before.tile.problem, slot.tile.problem);
    if (!before.points_here && !slot.points_here) slot.tile.state.points.swap(before.tile.state.points);
    forget(before);
  }
  const std::int64_t tile = slot.tile.tile;
  options_.scratch->read(measurements_of(tile), [&](std::istream& file, std::size_t) {
    auto size = slot.sizes.begin();
    visit_tables([&](auto& table) { read_column(file, *size++, table); }, slot.tile.problem);
  });
  if (!slot.points_here)
    options_.scratch->read(points_of(tile, slot.points_file), [&](std::istream& file, std::size_t) {
      read_column(file, slot.tile.problem.points.size(), slot.tile.state.points);
    });
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
  slot.in_scratch = false;
  loaded_ = -1;
  --spilled_;
  kept_bytes_ += byte_count(slot.tile);
}

void TileStore::put_trial(std::size_t row, TileState trial) {
  Slot& slot = slots_[row];
  slot.trial = std::move(trial);
  slot.trial_here = slot.in_scratch && !write_points(*options_.scratch, points_of(slot.tile.tile, 1 - slot.points_file),
                                                     slot.trial.points);
  if (slot.in_scratch && !slot.trial_here) std::exchange(slot.trial.points, {});
}

void TileStore::accept() {
  if (loaded_ >= 0) forget(slots_[static_cast<std::size_t>(std::exchange(loaded_, -1))]);
  for (Slot& slot : slots_) {
    slot.tile.state = std::exchange(slot.trial, {});
    slot.points_here = std::exchange(slot.trial_here, false);
    // The file of the trial becomes that of the present points; the other one takes the next trial. Nothing is copied.
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
