// Reads the words of a large text file one after the other, with line numbers for messages. Internal to io/.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace megablock {

// More than a file can count.
inline constexpr std::int64_t kMany = std::int64_t{1} << 40;
// Beyond these no coordinate or parameter can be meant, and no image coordinate, be it about the middle of an image as
// wide, has its place in fixed-point pixels (less than 2^21).
inline constexpr double kLargestNumber = 1e12, kFarthestPixel = (1 << 20) - 1;

class NumberReader {
 public:
  explicit NumberReader(const std::string& path);  // InputError when it cannot be read

  // Next word behind white space; InputError "file:line: ends before <what>" at the end of the file.
  std::string_view word(const char* what);
  double number(const char* what, double largest = kLargestNumber);  // in [-largest, largest]
  // Whole number in [low, high].
  std::int64_t integer(const char* what, std::int64_t low, std::int64_t high);
  // The rest of the line without blanks at its ends; the next word is on the next line.
  std::string_view rest_of_line();
  bool line_has_more();                                      // another word before the end of the line
  bool at_end();                                             // nothing but white space is left
  [[noreturn]] void fail(const std::string& message) const;  // InputError at the line of what was read last

 private:
  std::string path_, text_;
  std::size_t at_ = 0;
  std::int64_t line_ = 1, last_line_ = 1;  // of what is read next, of what was read last
};

}  // namespace megablock
