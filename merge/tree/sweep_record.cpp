#include "merge/tree/sweep_record.h"

#include <filesystem>
#include <fstream>
#include <numeric>
#include <set>
#include <system_error>

#include "merge/step/memory.h"

namespace megablock {

namespace {

constexpr std::uint64_t kFormat = 1;

// An identifier that Linux draws anew at each start of the machine; empty on other systems. Files that were not forced
// to the disk may be damaged after the machine has stopped.
std::string start_of_machine() {
  std::string id;
  std::getline(std::ifstream("/proc/sys/kernel/random/boot_id"), id);
  return id;
}

constexpr const char* kRecord = "pass.bin";

std::string update_file(std::int64_t node) { return "update-" + std::to_string(node) + ".bin"; }

// The files that the record names.
std::vector<std::string> files_of(const SweepRecord& record) {
  std::vector<std::string> files;
  for (const std::int64_t node : record.subtrees) files.push_back(update_file(node));
  for (const std::int64_t node : record.factors) files.push_back(factor_file(node));
  return files;
}

}  // namespace

bool SweepRecordFiles::write_update(std::int64_t node, const UpdateMatrix& update) const {
  return scratch_->write(update_file(node), [&](std::ostream& file) {
    ByteWriter writer(file);
    update.write(writer);
  });
}

UpdateMatrix SweepRecordFiles::read_update(std::int64_t node) const {
  UpdateMatrix update;
  scratch_->read(update_file(node), [&](std::istream& file, std::size_t size) {
    ByteReader reader(file, size);
    update = UpdateMatrix::read(reader);
  });
  return update;
}

void SweepRecordFiles::remove_update(std::int64_t node) const { scratch_->remove(update_file(node)); }

std::vector<std::int64_t> SweepRecordFiles::sizes_of(const SweepRecord& record) const {
  std::vector<std::int64_t> sizes;
  for (const std::string& file : files_of(record)) {
    std::error_code error;
    const auto size = std::filesystem::file_size(scratch_->path(file), error);
    if (error) return {};
    sizes.push_back(static_cast<std::int64_t>(size));
  }
  return sizes;
}

bool SweepRecordFiles::write(const SweepRecord& record) const {
  const std::string start = start_of_machine();
  const std::vector<std::int64_t> sizes = sizes_of(record);
  if (start.empty() || sizes.empty()) return false;
  // A new record replaces the old one only when it is whole: renaming is atomic.
  const std::string next = std::string(kRecord) + ".next";
  const bool whole = scratch_->write(next, [&](std::ostream& file) {
    ByteWriter writer(file);
    writer.value(kFormat);
    writer.bytes(start);
    writer.value(record.state);
    writer.value(record.sweep);
    writer.bytes(record.position);
    writer.value(record.tiles);
    writer.values(record.subtrees);
    writer.values(record.factors);
    writer.values(record.seams);
    writer.values(sizes);
  });
  return whole && scratch_->rename(next, kRecord);
}

std::optional<SweepRecord> SweepRecordFiles::read() const {
  std::error_code error;
  const auto size = std::filesystem::file_size(scratch_->path(kRecord), error);
  std::ifstream file(scratch_->path(kRecord), std::ios::binary);
  if (error || !file) return std::nullopt;
  try {
    ByteReader reader(file, size);
    if (reader.value<std::uint64_t>() != kFormat || reader.bytes() != start_of_machine()) return std::nullopt;
    SweepRecord record;
    record.state = reader.value<std::uint64_t>();
    record.sweep = reader.value<std::uint64_t>();
    record.position = reader.bytes();
    record.tiles = reader.value<std::int64_t>();
    record.subtrees = reader.values<std::int64_t>();
    record.factors = reader.values<std::int64_t>();
    record.seams = reader.values<SeamReport>();
    const auto sizes = reader.values<std::int64_t>();
    if (!reader.at_end() || sizes.empty() || sizes != sizes_of(record)) return std::nullopt;
    // The budget may be smaller than in the run that was killed.
    if (std::accumulate(sizes.begin(), sizes.end(), static_cast<std::int64_t>(size)) > scratch_->budget())
      return std::nullopt;
    return record;
  } catch (const StoreError&) {  // the record ends too early
    return std::nullopt;
  }
}

void SweepRecordFiles::remove() const { scratch_->remove(kRecord); }

void SweepRecordFiles::remove_files_of(const SweepRecord& record) const {
  for (const std::string& file : files_of(record)) scratch_->remove(file);
}

void SweepRecordFiles::keep_only(const std::optional<SweepRecord>& record) const {
  if (!record) return scratch_->keep_only({});
  const std::vector<std::string> files = files_of(*record);
  std::set<std::string> kept(files.begin(), files.end());
  kept.insert(kRecord);
  scratch_->keep_only(kept);
}

}  // namespace megablock
