// What lies in a rank's scratch directory, and how much of it may: tiles, their plans, factors and records of passes
// share one budget, the bytes of all files there at any time.
//
// Files are written over again and again with much the same length: pages and blocks fetched anew cost more than the
// copy. So one that is not needed any more stays, as a spare one, until others need its room.
//
// Where the budget ends a file fails as on a full disk: what it should have held stays with its owner.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <istream>
#include <limits>
#include <map>
#include <ostream>
#include <set>
#include <string>

namespace megablock {

// One thread at a time.
class ScratchSpace {
 public:
  ScratchSpace() = default;  // nowhere: takes nothing
  // Makes the directory; what an earlier run left there counts. Throws InputError.
  explicit ScratchSpace(std::string directory, std::int64_t budget = std::numeric_limits<std::int64_t>::max());
  ScratchSpace(const ScratchSpace&) = delete;
  ScratchSpace& operator=(const ScratchSpace&) = delete;

  std::string path(const std::string& name) const { return directory_ + "/" + name; }
  std::int64_t bytes() const { return bytes_; }  // of all files, and reserved
  std::int64_t bytes_of(const std::string& name) const;
  std::int64_t budget() const { return budget_; }

  // Leaves a file of what `write` writes. False, and no file: the disk is full, or the budget spent.
  using Write = std::function<void(std::ostream&)>;
  bool write(const std::string& name, const Write& write);
  // Calls `read` with a file and its size. Throws StoreError, which names it, where it is not there, ends too early or
  // has more than was read; and removes it then, so that a resumed run does without.
  using Read = std::function<void(std::istream&, std::size_t)>;
  void read(const std::string& name, const Read& read);
  // Holds so many bytes of the budget for a file, or what it has if that is more. False, and no file: there is no room.
  bool reserve(const std::string& name, std::int64_t bytes);
  bool rename(const std::string& from, const std::string& to);
  void spare(const std::string& name);  // its content is not needed any more
  void remove(const std::string& name);
  void keep_only(const std::set<std::string>& names);  // of all files that count

 private:
  void need(const std::string& name);
  void count(const std::string& name, std::int64_t bytes);

  std::string directory_;
  std::int64_t budget_ = 0, bytes_ = 0, spare_bytes_ = 0;
  std::map<std::string, std::int64_t> bytes_of_;  // all files
  std::set<std::string> spare_;                   // of them
};

}  // namespace megablock
