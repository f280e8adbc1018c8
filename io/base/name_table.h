// The names of a table's rows, one behind the other in one text: of a million images they take a third of what as many
// strings take, and they can be away while nobody asks for one.
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

  // Of all names, one behind the other, and where each ends in it.
  const std::vector<char>& text() const { return text_; }
  const std::vector<std::int64_t>& ends() const { return end_; }

  // Valid until the table changes. Throws std::out_of_range where there is no such row, so of a table that is away.
  std::string_view operator[](Index row) const {
    const auto i = static_cast<std::size_t>(row.value);
    const auto end = static_cast<std::size_t>(end_.at(i)), begin = i == 0 ? 0 : static_cast<std::size_t>(end_[i - 1]);
    return {text_.data() + begin, end - begin};
  }

 private:
  std::vector<std::int64_t> end_;  // [rows] in text_
  std::vector<char> text_;         // no string, which would keep its memory where an empty one is assigned
};

}  // namespace megablock
