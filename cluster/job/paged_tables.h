// Tables of the block out of memory. A table that stays as it is moves to a file of this process, mapped under the
// table's own addresses: what asks for a row reads its page from there, and release() takes the pages that were read
// out of memory again. Whoever reads a paged table sees no difference, whoever writes to it gets a page of his own.
#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace megablock {

class PagedTables {
 public:
  // In a folder of the job: its file has no name there and is gone with the process.
  explicit PagedTables(std::string directory) : directory_(std::move(directory)) {}

  // Memory below a megabyte stays where it is, and so does a table for which the disk has no room.
  template <typename Value>
  void put(const std::vector<Value>& table) {
    put(table.data(), table.size() * sizeof(Value));
  }
  // Before a table is freed while others stay: what comes to its place would be taken out of memory, to where the
  // system swaps. Its bits are safe either way.
  template <typename Value>
  void forget(const std::vector<Value>& table) {
    forget(table.data(), table.size() * sizeof(Value));
  }
  void release() const;

 private:
  void put(const void* table, std::size_t bytes);
  void forget(const void* table, std::size_t bytes);

  struct Pages {
    void* first;
    std::size_t bytes;
  };
  std::string directory_;
  std::vector<Pages> pages_;
};

}  // namespace megablock
