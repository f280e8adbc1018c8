// Moves tables of the block out of memory. A table that does not change moves to a file of this process, which is
// mapped at the addresses of the table. A read of a row loads its page from the file, and release() takes the loaded
// pages out of memory again. A reader of such a table sees no difference; a writer gets a private copy of the page.
#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace megablock {

class PagedTables {
 public:
  // The file is made in this folder of the job. It has no name there, and disappears with the process.
  explicit PagedTables(std::string directory) : directory_(std::move(directory)) {}

  // A table below a megabyte stays in memory, as does a table for which the disk has no room.
  template <typename Value>
  void put(const std::vector<Value>& table) {
    put(table.data(), table.size() * sizeof(Value));
  }
  // Call it before a table is freed while others stay. Otherwise release() would move the data at its former addresses
  // to the swap space of the system. The bits are safe in either case.
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
