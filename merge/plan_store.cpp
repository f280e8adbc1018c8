#include "merge/plan_store.h"

#include <filesystem>
#include <fstream>
#include <utility>

#include "merge/bytes.h"
#include "merge/scratch_file.h"

namespace megablock {

PlanStore::~PlanStore() {
  for (const Slot& slot : slots_)
    if (slot.in_scratch) remove_scratch_file(path(slot));
}

std::string PlanStore::path(const Slot& slot) const {
  return directory_ + "/tile-" + std::to_string(slot.tile) + "-plan.bin";
}

void PlanStore::add(std::int64_t tile, TilePlan plan, bool to_scratch) {
  Slot& slot = slots_.emplace_back();
  slot.tile = tile;
  slot.in_scratch = to_scratch && write_scratch_file(path(slot), [&](std::ofstream& file) {
                      ByteWriter writer(file);
                      plan.write(writer);
                    });
  if (!slot.in_scratch) slot.plan = std::move(plan);
}

const TilePlan& PlanStore::operator[](std::size_t row) const {
  const Slot& slot = slots_[row];
  if (!slot.in_scratch) return slot.plan;
  if (loaded_row_ == static_cast<std::int64_t>(row)) return loaded_;
  std::ifstream file(path(slot), std::ios::binary);
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(path(slot), error);
  ByteReader reader(file, error ? 0 : size);
  loaded_row_ = -1;
  loaded_ = TilePlan::read(reader);
  loaded_row_ = static_cast<std::int64_t>(row);
  return loaded_;
}

}  // namespace megablock
