#include "io/images/header_fields.h"

#include <cctype>
#include <charconv>
#include <limits>

namespace megablock {

namespace {

constexpr double kNoHeaderValue = std::numeric_limits<double>::quiet_NaN();

std::string trimmed_exif(std::string text) {
  while (!text.empty() && (text.back() == ' ' || text.back() == '\0' || text.back() == '\n')) text.pop_back();
  text.erase(0, text.find_first_not_of(' ') == std::string::npos ? text.size() : text.find_first_not_of(' '));
  return text;
}

// The parser of XMP gives a namespace another prefix ("Camera_1_") where an earlier file of the process has used the
// prefix for another namespace. Which one comes first depends on the order of files, so the addition is cut off.
std::string usual_prefix(std::string prefix) {
  std::size_t end = prefix.size();
  if (end < 4 || prefix[end - 1] != '_') return prefix;
  for (--end; end > 0 && std::isdigit(static_cast<unsigned char>(prefix[end - 1])) != 0; --end) {
  }
  if (end > 0 && end < prefix.size() - 1 && prefix[end - 1] == '_') prefix.resize(end - 1);
  return prefix;
}

// Reads the number at the beginning of the text and removes it. NaN if there is none.
double take_number(std::string_view& text) {
  while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  if (text.size() > 1 && text.front() == '+') text.remove_prefix(1);
  double value = kNoHeaderValue;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc()) return kNoHeaderValue;
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return value;
}

}  // namespace

std::string ExifFields::text(const char* key) const {
  const auto* value = find(key);
  return value != nullptr ? trimmed_exif(value->toString()) : "";
}

double ExifFields::number(const char* key, long n) const {
  const auto* value = find(key);
  if (value == nullptr || n >= value->count()) return kNoHeaderValue;
  const Exiv2::TypeId type = value->typeId();
  // Exiv2 returns both kinds as signed numbers, so unsigned values above 2^31 are converted back.
  if (type == Exiv2::unsignedRational || type == Exiv2::signedRational) {
    const Exiv2::Rational r = value->toRational(n);
    const bool is_unsigned = type == Exiv2::unsignedRational;
    const double top = is_unsigned ? static_cast<std::uint32_t>(r.first) : r.first;
    const double bottom = is_unsigned ? static_cast<std::uint32_t>(r.second) : r.second;
    return bottom != 0 ? top / bottom : kNoHeaderValue;
  }
  return static_cast<double>(value->toFloat(n));
}

const Exiv2::Exifdatum* ExifFields::find(const char* key) const {
  const auto found = data_.findKey(Exiv2::ExifKey(key));
  return found != data_.end() ? &*found : nullptr;
}

std::string XmpFields::text(const std::string& prefix, const std::string& name) const {
  for (const auto& property : data_)
    if (property.tagName() == name && usual_prefix(property.groupName()) == prefix) return property.toString();
  return "";
}

double XmpFields::number(const std::string& prefix, const std::string& name) const {
  const std::string value = text(prefix, name);
  std::string_view rest = value;
  const double first = take_number(rest);
  if (!rest.starts_with('/')) return first;
  rest.remove_prefix(1);
  const double second = take_number(rest);
  return second != 0 ? first / second : kNoHeaderValue;
}

}  // namespace megablock
