#include "io/text/text_lines.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <sstream>

#include "io/base/file_error.h"

namespace megablock {

namespace {

void append_utf8(std::uint32_t code, std::string& text) {
  const auto byte = [&](std::uint32_t value) { text += static_cast<char>(value); };
  if (code < 0x80) return byte(code);
  if (code < 0x800) {
    byte(0xC0 | (code >> 6));
  } else {
    if (code < 0x10000) {
      byte(0xE0 | (code >> 12));
    } else {
      byte(0xF0 | (code >> 18));
      byte(0x80 | ((code >> 12) & 0x3F));
    }
    byte(0x80 | ((code >> 6) & 0x3F));
  }
  byte(0x80 | (code & 0x3F));
}

// UTF-16 after its byte order mark. Two code units, the first of them in [0xD800, 0xDC00), make one character.
std::string utf8_of_utf16(const std::string& bytes, bool big_endian) {
  const auto unit = [&](std::size_t at) {
    const auto first = static_cast<unsigned char>(bytes[at]), second = static_cast<unsigned char>(bytes[at + 1]);
    return static_cast<std::uint32_t>(big_endian ? first << 8 | second : second << 8 | first);
  };
  std::string text;
  for (std::size_t at = 2; at + 1 < bytes.size(); at += 2) {
    std::uint32_t code = unit(at);
    if (code >= 0xD800 && code < 0xDC00 && at + 3 < bytes.size()) {
      at += 2;
      code = 0x10000 + ((code - 0xD800) << 10) + (unit(at) - 0xDC00);
    }
    append_utf8(code, text);
  }
  return text;
}

char character_of(Separator separator) {
  switch (separator) {
    case Separator::kTab:
      return '\t';
    case Separator::kComma:
      return ',';
    case Separator::kSemicolon:
      return ';';
    case Separator::kBlanks:
      break;
  }
  return ' ';
}

std::vector<std::string> split_at_blanks(const std::string& line) {
  std::vector<std::string> fields;
  bool in_quotes = false, in_field = false;
  for (const char c : line) {
    if (c == '"') in_quotes = !in_quotes;
    if (!in_quotes && (c == ' ' || c == '\t')) {
      in_field = false;
      continue;
    }
    if (!in_field) fields.emplace_back();
    in_field = true;
    if (c != '"') fields.back() += c;
  }
  return fields;
}

}  // namespace

std::string read_text(const std::string& path) {
  const std::ifstream stream = open_input(path);
  std::ostringstream buffer;
  buffer << stream.rdbuf();
  std::string text = std::move(buffer).str();
  if (text.starts_with("\xef\xbb\xbf")) text.erase(0, 3);
  if (text.starts_with("\xff\xfe")) text = utf8_of_utf16(text, false);
  if (text.starts_with("\xfe\xff")) text = utf8_of_utf16(text, true);
  if (text.find('\n') == std::string::npos) std::replace(text.begin(), text.end(), '\r', '\n');
  return text;
}

char csv_separator(const std::string& header) {
  const Separator separator = separator_of(header);
  return separator == Separator::kBlanks ? ',' : character_of(separator);
}

std::string trimmed(const std::string& text) {
  const auto first = text.find_first_not_of(" \t\r\n"), last = text.find_last_not_of(" \t\r\n");
  return first == std::string::npos ? "" : text.substr(first, last - first + 1);
}

std::string lower_case(const std::string& text) {
  std::string lower = text;
  for (char& c : lower)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return lower;
}

std::vector<TextLine> read_text_lines(const std::string& path) {
  const std::string text = read_text(path);
  std::vector<TextLine> lines;
  std::int64_t number = 0;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find_first_of("\r\n", at), text.size());
    ++number;
    // A separator at an end encloses an empty field, so tabs are not cut off there.
    std::string line = text.substr(at, end - at);
    while (!line.empty() && line.back() == ' ') line.pop_back();
    line.erase(0, std::min(line.find_first_not_of(' '), line.size()));
    if (!trimmed(line).empty()) lines.push_back({std::move(line), number});
    at = end + (text.compare(end, 2, "\r\n") == 0 ? 2 : 1);
  }
  return lines;
}

std::vector<std::string> split_fields(const std::string& line, Separator separator) {
  if (separator == Separator::kBlanks) return split_at_blanks(line);
  std::vector<std::string> fields(1);
  bool in_quotes = false;
  for (const char c : line) {
    if (c == '"')
      in_quotes = !in_quotes;
    else if (c == character_of(separator) && !in_quotes)
      fields.emplace_back();
    else
      fields.back() += c;
  }
  for (std::string& field : fields) field = trimmed(field);
  return fields;
}

Separator separator_of(const std::string& line) {
  Separator best = Separator::kBlanks;
  std::size_t most = 1;
  for (const Separator separator : {Separator::kTab, Separator::kSemicolon, Separator::kComma}) {
    const std::size_t fields = split_fields(line, separator).size();
    if (fields <= most) continue;
    most = fields;
    best = separator;
  }
  return best;
}

std::string with_decimal_point(const std::string& text, Separator separator) {
  const std::size_t comma = text.find(',');
  if (separator == Separator::kComma || comma == std::string::npos) return text;
  std::string number = text;
  number[comma] = '.';
  return is_number(number) ? number : text;
}

bool is_number(const std::string& text) {
  const char* begin = text.data() + (text.size() > 1 && text[0] == '+' ? 1 : 0);
  double value = 0;
  const auto [end, error] = std::from_chars(begin, text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() && std::isfinite(value);
}

}  // namespace megablock
