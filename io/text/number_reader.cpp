// The file is read as a whole and parsed in place by std::from_chars, which is exact and does not depend on the locale.
#include "io/text/number_reader.h"

#include <charconv>
#include <cmath>
#include <sstream>

#include "io/base/error.h"
#include "io/base/file_error.h"

namespace megablock {

namespace {

bool blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

}  // namespace

NumberReader::NumberReader(const std::string& path) : path_(path) {
  const std::ifstream stream = open_input(path);
  std::ostringstream text;
  text << stream.rdbuf();
  text_ = std::move(text).str();
}

void NumberReader::fail(const std::string& message) const {
  throw InputError(path_ + ":" + std::to_string(last_line_) + ": " + message);
}

bool NumberReader::line_has_more() {
  while (at_ < text_.size() && blank(text_[at_])) ++at_;
  return at_ < text_.size() && text_[at_] != '\n';
}

// last_line_ is set here, so that messages name the line of the word that follows.
bool NumberReader::at_end() {
  while (!line_has_more() && at_ < text_.size()) {
    ++at_;
    ++line_;
  }
  last_line_ = line_;
  return at_ == text_.size();
}

std::string_view NumberReader::word(const char* what) {
  if (at_end()) fail(std::string("the file ends before ") + what);
  const std::size_t begin = at_;
  while (at_ < text_.size() && !blank(text_[at_]) && text_[at_] != '\n') ++at_;
  return std::string_view(text_).substr(begin, at_ - begin);
}

double NumberReader::number(const char* what, double largest) {
  const std::string_view text = word(what);
  const char* begin = text.data() + (text.size() > 1 && text[0] == '+' ? 1 : 0);
  double value = 0;
  const auto [end, error] = std::from_chars(begin, text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value))
    fail(std::string(what) + ": '" + std::string(text) + "' is not a number");
  if (std::abs(value) > largest) fail(std::string(what) + ": " + std::string(text) + " is too large to be right");
  return value;
}

std::int64_t NumberReader::integer(const char* what, std::int64_t low, std::int64_t high) {
  const std::string_view text = word(what);
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size())
    fail(std::string(what) + ": '" + std::string(text) + "' is not a whole number");
  if (value < low || value > high)
    fail(std::string(what) + ": " + std::string(text) + " is outside " + std::to_string(low) + ".." +
         std::to_string(high));
  return value;
}

std::string_view NumberReader::rest_of_line() {
  line_has_more();
  last_line_ = line_;
  const std::size_t begin = at_;
  while (at_ < text_.size() && text_[at_] != '\n') ++at_;
  std::string_view rest = std::string_view(text_).substr(begin, at_ - begin);
  while (!rest.empty() && blank(rest.back())) rest.remove_suffix(1);
  if (at_ < text_.size()) {
    ++at_;
    ++line_;
  }
  return rest;
}

}  // namespace megablock
