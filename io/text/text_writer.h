// Writes text and binary numbers through a buffer. A single check at the end reports every failure. Internal to io/.
#pragma once

#include <fmt/core.h>

#include <cstdio>
#include <cstring>
#include <iterator>
#include <string>
#include <type_traits>

#include "io/base/error.h"

namespace megablock {

class TextWriter {
 public:
  // Opens and empties the file. Throws InputError if that is impossible.
  explicit TextWriter(const std::string& path) : path_(path), file_(std::fopen(path.c_str(), "wb")) {
    if (!file_) fail();
  }
  ~TextWriter() {
    if (file_) std::fclose(file_);
  }
  TextWriter(const TextWriter&) = delete;
  TextWriter& operator=(const TextWriter&) = delete;

  // {} prints a double as the shortest text that reads back to the same bits.
  template <typename... Arguments>
  void print(fmt::format_string<Arguments...> format, Arguments&&... arguments) {
    fmt::vformat_to(std::back_inserter(buffer_), format, fmt::make_format_args(arguments...));
    if (buffer_.size() > kChunk) flush();
  }

  // The bytes of a number, little-endian, as on all supported machines.
  template <typename Value>
  requires std::is_arithmetic_v<Value>
  void bytes(Value value) {
    const char* data = reinterpret_cast<const char*>(&value);
    buffer_.append(data, sizeof value);
    if (buffer_.size() > kChunk) flush();
  }

  // Must be called at the end. Throws InputError if anything could not be written, for example to a full disk.
  void close() {
    flush();
    const bool failed = std::fclose(file_) != 0;
    file_ = nullptr;
    if (failed) fail();
  }

 private:
  static constexpr std::size_t kChunk = 1 << 20;

  [[noreturn]] void fail() const {
    throw InputError(path_ + ": cannot be written: " + std::strerror(errno) + "; check the folder and the disk");
  }
  void flush() {
    if (std::fwrite(buffer_.data(), 1, buffer_.size(), file_) != buffer_.size()) fail();
    buffer_.clear();
  }

  std::string path_;
  std::FILE* file_;
  std::string buffer_;
};

}  // namespace megablock
