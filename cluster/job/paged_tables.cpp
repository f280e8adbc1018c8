#include "cluster/job/paged_tables.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>

namespace megablock {

namespace {

constexpr std::size_t kLeastBytes = 1 << 20;

// A temporary file that has no name in any folder.
class ScratchFile {
 public:
  explicit ScratchFile(const std::string& directory) {
    std::string path = directory + "/tables-XXXXXX";  // mkostemp replaces the Xs
    descriptor_ = mkostemp(path.data(), O_CLOEXEC);
    if (descriptor_ >= 0) unlink(path.c_str());
  }
  ~ScratchFile() {
    if (descriptor_ >= 0) close(descriptor_);  // the mapped pages keep the file
  }
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;

  // Writes to the disk itself, because pages of a file that wait to be written stay in memory.
  bool write(const char* from, std::size_t bytes) const {
    for (std::size_t done = 0; done < bytes;) {
      const ssize_t written = pwrite(descriptor_, from + done, bytes - done, static_cast<off_t>(done));
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) return false;
      done += static_cast<std::size_t>(written);
    }
    return fdatasync(descriptor_) == 0;
  }
  int descriptor() const { return descriptor_; }

 private:
  int descriptor_ = -1;
};

}  // namespace

void PagedTables::put(const void* table, std::size_t bytes) {
  const auto page = static_cast<std::uintptr_t>(sysconf(_SC_PAGESIZE));
  const auto begin = reinterpret_cast<std::uintptr_t>(table);
  const std::uintptr_t first = (begin + page - 1) / page * page, last = (begin + bytes) / page * page;
  if (bytes < kLeastBytes || last <= first) return;
  void* const at = reinterpret_cast<void*>(first);
  const ScratchFile file(directory_);
  if (file.descriptor() < 0 || !file.write(static_cast<const char*>(at), last - first)) return;
  // Replaces the pages that are there, either all at once or not at all.
  if (mmap(at, last - first, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_FIXED, file.descriptor(), 0) != at) return;
  pages_.push_back({at, last - first});
}

void PagedTables::forget(const void* table, std::size_t bytes) {
  const char* const begin = static_cast<const char*>(table);
  std::erase_if(pages_, [&](const Pages& pages) { return pages.first >= begin && pages.first < begin + bytes; });
}

void PagedTables::release() const {
  for (const Pages& pages : pages_) madvise(pages.first, pages.bytes, MADV_PAGEOUT);
}

}  // namespace megablock
