// What the command 'verticals' has found so far, in a file beside its table, so that a run after a kill, or one with
// more images, looks at the other pictures only.
//
// A sealed text file (io/store/job/job_store.h): per picture a line "key found roll segments length", then as many
// bytes, its row of the table. The key is the hash of all that the row follows from. Pictures that could not be read
// are not in it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cluster/process/save_times.h"
#include "io/store/job/job_store.h"

namespace megablock {

struct PictureVertical {
  std::string row;      // of the table, with its line's end
  std::string failure;  // of reading the picture
  bool found = false;   // there is a vertical
  double roll = 0;      // ImageVertical::roll
  std::int64_t segments = 0;
};

class FoundVerticals {
 public:
  // One key per picture. What a file there says of other keys is forgotten with the next save, a damaged file
  // altogether.
  FoundVerticals(const JobStore& store, std::string file, std::vector<std::uint64_t> keys);

  std::size_t count() const;  // that are there
  bool has(std::size_t picture) const { return pictures_[picture].has_value(); }
  std::vector<PictureVertical> pictures() const;  // once all are there
  // One thread at a time.
  void add(std::size_t picture, PictureVertical vertical);
  void save_now_and_then();
  void save();

 private:
  const JobStore& store_;
  std::string file_;
  std::vector<std::uint64_t> keys_;
  std::vector<std::optional<PictureVertical>> pictures_;  // [keys]
  bool saved_ = true;
  SaveTimes times_;
};

}  // namespace megablock
