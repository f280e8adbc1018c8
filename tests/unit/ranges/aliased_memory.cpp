#include "tests/unit/ranges/aliased_memory.h"

#include <sys/mman.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdlib>
#include <mutex>
#include <new>

namespace megablock {

namespace {

struct Range {
  char* first = nullptr;
  std::size_t size = 0;
};
std::mutex ranges_mutex;
std::array<Range, 64> ranges;
std::atomic<int> range_count{0};

void* map_aliased(std::size_t size) {
  const std::size_t rounded = (size + kAliasPeriod - 1) / kAliasPeriod * kAliasPeriod;
  const int file = ::memfd_create("aliased", 0);
  if (file < 0 || ::ftruncate(file, static_cast<off_t>(kAliasPeriod)) != 0) throw std::bad_alloc();
  void* reserved = ::mmap(nullptr, rounded, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (reserved == MAP_FAILED) throw std::bad_alloc();
  auto* first = static_cast<char*>(reserved);
  for (std::size_t at = 0; at < rounded; at += kAliasPeriod)
    if (::mmap(first + at, kAliasPeriod, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_FIXED | MAP_POPULATE, file, 0) ==
        MAP_FAILED)
      throw std::bad_alloc();
  ::close(file);
  const std::lock_guard<std::mutex> lock(ranges_mutex);
  for (Range& range : ranges) {
    if (range.first != nullptr) continue;
    range = {first, rounded};
    ++range_count;
    return first;
  }
  throw std::bad_alloc();
}

bool unmap_aliased(void* pointer) {
  if (range_count == 0) return false;
  const std::lock_guard<std::mutex> lock(ranges_mutex);
  for (Range& range : ranges) {
    if (range.first == nullptr || range.first != pointer) continue;
    ::munmap(range.first, range.size);
    range = {};
    --range_count;
    return true;
  }
  return false;
}

}  // namespace

}  // namespace megablock

void* operator new(std::size_t size) {
  if (size >= megablock::kAliasedFrom) return megablock::map_aliased(size);
  if (void* memory = std::malloc(size > 0 ? size : 1)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* pointer) noexcept {
  if (!megablock::unmap_aliased(pointer)) std::free(pointer);
}
void operator delete(void* pointer, std::size_t) noexcept { operator delete(pointer); }
