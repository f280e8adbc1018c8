// Stores the names of the rows of a table in one text, one after the other. A million image names need a third of the
// memory of as many strings. The table can also be unloaded while no name is needed.
#pragma once

#include <cstdint>
#include <iterator>
#include <string_view>
#include <vector>

namespace megablock {

template <typename Index>
class NameTable {
 public:
  std::size_t size() const { return end_.size(); }
  bool empty() const { return end_.empty(); }
  void reserve(std::size_t rows) { end_.reserve(rows); }

  void push_back(std::string_view name) {
    text_.insert(text_.end(), name.begin(), name.end());
    end_.push_back(std::ssize(text_));
  }

  // The text of all names, and the position in it where each name ends.
  const std::vector<char>& text() const { return text_; }
  const std::vector<std::int64_t>& ends() const { return end_; }

  // The name of a row, valid until the table changes. Throws std::out_of_range for a row that does not exist, so also
  // for an unloaded table.
  std::string_view operator[](Index row) const {
    const auto i = static_cast<std::size_t>(row.value);
    const auto end = static_cast<std::size_t>(end_.at(i)), begin = i == 0 ? 0 : static_cast<std::size_t>(end_[i - 1]);
    return {text_.data() + begin, end - begin};
  }

 private:
  std::vector<std::int64_t> end_;  // [rows] end of each name in text_
  std::vector<char> text_;         // a vector, because a string keeps its memory when an empty one is assigned
};

}  // namespace megablock
