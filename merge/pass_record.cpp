#include "merge/pass_record.h"

#include <filesystem>
#include <fstream>
#include <system_error>

#include "merge/memory.h"
#include "merge/scratch_file.h"

namespace megablock {

namespace {

constexpr std::uint64_t kFormat = 1;

// What Linux draws anew each time the machine starts; empty elsewhere.
std::string start_of_machine() {
  std::string id;
  std::getline(std::ifstream("/proc/sys/kernel/random/boot_id"), id);
  return id;
}

}  // namespace

std::string PassRecordFiles::update_path(std::int64_t node) const {
  return directory_ + "/update-" + std::to_string(node) + ".bin";
}

bool PassRecordFiles::write_update(std::int64_t node, const UpdateMatrix& update) const {
  return write_scratch_file(update_path(node), [&](std::ofstream& file) {
    ByteWriter writer(file);
    update.write(writer);
  });
}

UpdateMatrix PassRecordFiles::read_update(std::int64_t node) const {
  const std::string path = update_path(node);
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  if (!file) throw StoreError("cannot read " + path + " of the scratch directory; remove it and run again to resume");
  const auto size = static_cast<std::size_t>(file.tellg());
  file.seekg(0);
  ByteReader reader(file, size);
  return UpdateMatrix::read(reader);
}

void PassRecordFiles::remove_update(std::int64_t node) const { remove_scratch_file(update_path(node)); }

std::vector<std::int64_t> PassRecordFiles::sizes_of(const PassRecord& record) const {
  std::vector<std::int64_t> sizes;
  const auto add = [&](const std::string& path) {
    std::error_code error;
    const auto size = std::filesystem::file_size(path, error);
    if (!error) sizes.push_back(static_cast<std::int64_t>(size));
  };
  for (const std::int64_t node : record.subtrees) add(update_path(node));
  for (const std::int64_t node : record.factors) add(factor_path(directory_, node));
  if (sizes.size() != record.subtrees.size() + record.factors.size()) sizes.clear();
  return sizes;
}

bool PassRecordFiles::write(const PassRecord& record) const {
  const std::string start = start_of_machine();
  const std::vector<std::int64_t> sizes = sizes_of(record);
  if (start.empty() || sizes.empty()) return false;
  const std::string next = record_path() + ".next";
  const bool whole = write_scratch_file(next, [&](std::ofstream& file) {
    ByteWriter writer(file);
    writer.value(kFormat);
    writer.bytes(start);
    writer.value(record.state);
    writer.value(record.pass);
    writer.bytes(record.position);
    writer.value(record.tiles);
    writer.values(record.subtrees);
    writer.values(record.factors);
    writer.values(record.seams);
    writer.values(sizes);
  });
  std::error_code error;
  if (whole) std::filesystem::rename(next, record_path(), error);
  return whole && !error;
}

std::optional<PassRecord> PassRecordFiles::read() const {
  std::error_code error;
  const auto size = std::filesystem::file_size(record_path(), error);
  std::ifstream file(record_path(), std::ios::binary);
  if (error || !file) return std::nullopt;
  try {
    ByteReader reader(file, size);
    if (reader.value<std::uint64_t>() != kFormat || reader.bytes() != start_of_machine()) return std::nullopt;
    PassRecord record;
    record.state = reader.value<std::uint64_t>();
    record.pass = reader.value<std::uint64_t>();
    record.position = reader.bytes();
    record.tiles = reader.value<std::int64_t>();
    record.subtrees = reader.values<std::int64_t>();
    record.factors = reader.values<std::int64_t>();
    record.seams = reader.values<SeamReport>();
    const auto sizes = reader.values<std::int64_t>();
    if (!reader.at_end() || sizes.empty() || sizes != sizes_of(record)) return std::nullopt;
    return record;
  } catch (const StoreError&) {  // cut short
    return std::nullopt;
  }
}

void PassRecordFiles::remove() const { remove_scratch_file(record_path()); }

}  // namespace megablock
