#include "merge/plan/plan_store.h"

#include <string>

#include "merge/scratch/bytes.h"

namespace megablock {

namespace {

std::string plan_of(std::int64_t tile) { return "tile-" + std::to_string(tile) + "-plan.bin"; }

}  // namespace

PlanStore::~PlanStore() {
  for (const Slot& slot : slots_)
    if (slot.in_scratch) scratch_->remove(plan_of(slot.tile));
}

void PlanStore::add(std::int64_t tile, TilePlan plan, bool to_scratch) {
  Slot& slot = slots_.emplace_back();
  slot.tile = tile;
  slot.in_scratch = to_scratch && scratch_->write(plan_of(tile), [&](std::ostream& file) {
    ByteWriter writer(file);
    plan.write(writer);
  });
  if (!slot.in_scratch) slot.plan = std::move(plan);
}

const TilePlan& PlanStore::operator[](std::size_t row) const {
  const Slot& slot = slots_[row];
  if (!slot.in_scratch) return slot.plan;
  if (loaded_row_ == static_cast<std::int64_t>(row)) return loaded_;
  loaded_row_ = -1;
  scratch_->read(plan_of(slot.tile), [&](std::istream& file, std::size_t size) {
    ByteReader reader(file, size);
    loaded_ = TilePlan::read(reader);
  });
  loaded_row_ = static_cast<std::int64_t>(row);
  return loaded_;
}

}  // namespace megablock
