// Manages the scratch directory of a rank and its budget. Tiles, their plans, factors and records of sweeps share the
// budget, which bounds the bytes of all files in the directory at any time.
//
// The same files are written again and again with nearly the same length, and to get new pages and blocks from the
// system costs more than the copy. A file that is not needed any more therefore stays as a spare one until others need
// its room.
//
// A write that would exceed the budget fails as on a full disk. The owner then keeps the data in memory.
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

// Only one thread at a time may use it.
class ScratchSpace {
 public:
  ScratchSpace() = default;  // no directory: every write fails
  // Makes the directory. Files that an earlier run left there count towards the budget. Throws InputError.
  explicit ScratchSpace(std::string directory, std::int64_t budget = std::numeric_limits<std::int64_t>::max());
  ScratchSpace(const ScratchSpace&) = delete;
  ScratchSpace& operator=(const ScratchSpace&) = delete;

  std::string path(const std::string& name) const { return directory_ + "/" + name; }
  std::int64_t bytes() const { return bytes_; }  // of all files, with the reserved bytes
  std::int64_t bytes_of(const std::string& name) const;
  std::int64_t budget() const { return budget_; }

  // Makes a file with the bytes that `write` writes. Returns false, and leaves no file, when the disk is full or the
  // budget is spent.
  using Write = std::function<void(std::ostream&)>;
  bool write(const std::string& name, const Write& write);
  // Calls `read` with a file and its size. Throws StoreError naming the file when it is missing, ends too early or is
  // longer than the bytes that were read. The file is then removed, so that a resumed run does not meet it again.
  using Read = std::function<void(std::istream&, std::size_t)>;
  void read(const std::string& name, const Read& read);
  // Reserves so many bytes of the budget for a file, or its present size when that is larger. Returns false, and
  // removes the file, when there is no room.
  bool reserve(const std::string& name, std::int64_t bytes);
  // Replaces `to`. Returns false, and leaves both files, when the system refuses.
  bool rename(const std::string& from, const std::string& to);
  void spare(const std::string& name);  // its contents are not needed any more
  void remove(const std::string& name);
  void keep_only(const std::set<std::string>& names);  // removes all other files

 private:
  // Takes a file off the list of spare ones.
  void need(const std::string& name);
  // Sets the size of a file in the sums.
  void count(const std::string& name, std::int64_t bytes);

  std::string directory_;
  std::int64_t budget_ = 0, bytes_ = 0, spare_bytes_ = 0;
  std::map<std::string, std::int64_t> bytes_of_;  // all files
  std::set<std::string> spare_;                   // the spare ones of these
};

}  // namespace megablock
