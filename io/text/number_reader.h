// Reads the words of a large text file one after the other, with line numbers for messages. Internal to io/.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace megablock {

// More objects than any file has.
inline constexpr std::int64_t kMany = std::int64_t{1} << 40;
// No coordinate or parameter can exceed the first limit. No image coordinate, even one about the centre of an image,
// can exceed the second; positions up to 2^21 pixels fit into their fixed-point representation.
inline constexpr double kLargestNumber = 1e12, kFarthestPixel = (1 << 20) - 1;

class NumberReader {
 public:
  explicit NumberReader(const std::string& path);  // throws InputError if the file cannot be read

  // The next word after white space. Throws InputError "file:line: ends before <what>" at the end of the file.
  std::string_view word(const char* what);
  double number(const char* what, double largest = kLargestNumber);  // in [-largest, largest]
  // The next word as a whole number in [low, high].
  std::int64_t integer(const char* what, std::int64_t low, std::int64_t high);
  // The rest of the line without blanks at both ends. The next word is then on the next line.
  std::string_view rest_of_line();
  bool line_has_more();                                      // whether there is another word before the end of the line
  bool at_end();                                             // whether only white space remains
  [[noreturn]] void fail(const std::string& message) const;  // throws InputError for the line of the last word

 private:
  std::string path_, text_;
  std::size_t at_ = 0;
  std::int64_t line_ = 1, last_line_ = 1;  // line of the next word, and of the last one
};

}  // namespace megablock
