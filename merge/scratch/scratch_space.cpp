#include "merge/scratch/scratch_space.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <system_error>
#include <utility>

#include "io/base/error.h"

namespace megablock {

namespace {

// The buffer of a file that may grow to `granted` bytes. For more it asks before each write. A refused write reports
// zero bytes, which the stream takes for a full disk.
class BoundedBuffer : public std::filebuf {
 public:
  BoundedBuffer(std::int64_t granted, std::function<bool(std::int64_t)> ask)
      : granted_(granted), ask_(std::move(ask)) {}

 protected:
  std::streamsize xsputn(const char* from, std::streamsize count) override {
    written_ += count;
    return written_ <= granted_ || ask_(written_) ? std::filebuf::xsputn(from, count) : 0;
  }

 private:
  std::int64_t granted_, written_ = 0;
  std::function<bool(std::int64_t)> ask_;
};

}  // namespace

ScratchSpace::ScratchSpace(std::string directory, std::int64_t budget)
    : directory_(std::move(directory)), budget_(budget) {
  std::error_code error;
  std::filesystem::create_directories(directory_, error);
  if (error) throw InputError("cannot make the scratch directory " + directory_ + ": " + error.message());
  for (const auto& entry : std::filesystem::directory_iterator(directory_))
    if (entry.is_regular_file()) count(entry.path().filename().string(), static_cast<std::int64_t>(entry.file_size()));
}

std::int64_t ScratchSpace::bytes_of(const std::string& name) const {
  const auto entry = bytes_of_.find(name);
  return entry == bytes_of_.end() ? 0 : entry->second;
}

void ScratchSpace::count(const std::string& name, std::int64_t bytes) {
  bytes_ += bytes - bytes_of(name);
  bytes_of_[name] = bytes;
}

void ScratchSpace::spare(const std::string& name) {
  if (bytes_of_.contains(name) && spare_.insert(name).second) spare_bytes_ += bytes_of(name);
}

// The file is wanted again: its bytes are no longer to be had for others.
void ScratchSpace::need(const std::string& name) {
  if (spare_.erase(name) > 0) spare_bytes_ -= bytes_of(name);
}

// Spare files go in the order of their names, and only as many as are in the way.
bool ScratchSpace::reserve(const std::string& name, std::int64_t bytes) {
  need(name);
  const std::int64_t more = std::max<std::int64_t>(0, bytes - bytes_of(name));
  if (more > budget_ - (bytes_ - spare_bytes_)) {
    remove(name);
    return false;
  }
  while (more > budget_ - bytes_) remove(std::string(*spare_.begin()));
  count(name, bytes_of(name) + more);
  return true;
}

bool ScratchSpace::write(const std::string& name, const Write& write) {
  if (directory_.empty() || !reserve(name, 0)) return false;
  // A file may grow to its present size without asking; for every further write the buffer asks for the room, and spare
  // files give way.
  BoundedBuffer buffer(bytes_of(name), [&](std::int64_t bytes) { return reserve(name, bytes); });
  // An existing file is overwritten, not truncated. At the end it is cut to its new length.
  if (!buffer.open(path(name), std::ios::binary | std::ios::in | std::ios::out))
    buffer.open(path(name), std::ios::binary | std::ios::out);
  std::ostream file(&buffer);
  write(file);
  const std::ostream::pos_type end = file.tellp();
  std::error_code error;
  const bool whole = buffer.close() != nullptr && file && end >= 0;
  if (whole) std::filesystem::resize_file(path(name), static_cast<std::uintmax_t>(end), error);
  if (!whole || error) {
    remove(name);
    return false;
  }
  count(name, end);
  return true;
}

void ScratchSpace::read(const std::string& name, const Read& read) {
  std::ifstream file(path(name), std::ios::binary | std::ios::ate);
  const std::streamoff size = file.tellg();
  file.seekg(0);
  try {
    if (file) read(file, static_cast<std::size_t>(size));
    if (file && file.tellg() == size) return;
  } catch (const StoreError&) {  // its message does not name the file; the error below does
  }
  remove(name);
  throw StoreError("cannot read " + path(name) + " of the scratch directory; run again to resume");
}

bool ScratchSpace::rename(const std::string& from, const std::string& to) {
  std::error_code error;
  std::filesystem::rename(path(from), path(to), error);
  if (error) return false;
  const std::int64_t bytes = bytes_of(from);
  count(from, 0);
  bytes_of_.erase(from);
  need(to);
  count(to, bytes);
  return true;
}

void ScratchSpace::remove(const std::string& name) {
  need(name);
  count(name, 0);
  bytes_of_.erase(name);
  std::error_code ignored;
  if (!directory_.empty()) std::filesystem::remove(path(name), ignored);
}

void ScratchSpace::keep_only(const std::set<std::string>& names) {
  // The loop goes over a copy, because remove() changes the table.
  for (const auto& [name, bytes] : std::map(bytes_of_))
    if (!names.contains(name)) remove(name);
}

}  // namespace megablock
