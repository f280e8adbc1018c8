// Keeps the verticals that the command `verticals` has found so far in a file beside its table. A run after a kill, or
// one with more images, reads only the images that are not in the file.
//
// The file is a sealed text file (io/store/job/job_store.h). For each image it has a line "key found roll segments
// length", and then its row of the table, of `length` bytes. The key is the hash of everything on which the row
// depends. Images that could not be read are not in the file.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cluster/process/save_times.h"
#include "io/store/job/job_store.h"

namespace megablock {

struct FoundVertical {
  std::string row;      // of the table, with the end of the line
  std::string failure;  // why the image could not be read; empty when it could
  bool found = false;   // there is a vertical
  double roll = 0;      // ImageVertical::roll
  std::int64_t segments = 0;
};

class FoundVerticals {
 public:
  // One key for each image. Entries of an existing file with other keys disappear with the next save. A damaged file is
  // ignored.
  FoundVerticals(const JobStore& store, std::string file, std::vector<std::uint64_t> keys);

  std::size_t count() const;  // number of images that are done
  bool has(std::size_t image) const { return found_[image].has_value(); }
  std::vector<FoundVertical> all() const;  // when all are done
  // Only one thread at a time may call it.
  void add(std::size_t image, FoundVertical vertical);
  void save_now_and_then();
  void save();

 private:
  const JobStore& store_;
  std::string file_;
  std::vector<std::uint64_t> keys_;
  std::vector<std::optional<FoundVertical>> found_;  // [keys]
  bool saved_ = true;
  SaveTimes times_;
};

}  // namespace megablock
