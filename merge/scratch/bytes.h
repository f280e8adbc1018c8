// Writes plain values and vectors as a flat string of bytes, and reads them back. Messages between ranks and files in
// the scratch directory have this form. The byte order is that of the host, because the ranks of a job and its scratch
// are on machines of one kind.
#pragma once

#include <cstdint>
#include <cstring>
#include <istream>
#include <ostream>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "io/base/error.h"

namespace megablock {

using Bytes = std::string;

// Writes into memory, or straight into a file. The state of the file says whether everything was written.
class ByteWriter {
 public:
  ByteWriter() = default;
  explicit ByteWriter(std::ostream& file) : file_(&file) {}

  template <typename T>
  requires std::is_trivially_copyable_v<T>
  void value(const T& v) { append(&v, sizeof v); }
  template <typename T>
  requires std::is_trivially_copyable_v<T>
  void values(const std::vector<T>& v) {
    value<std::uint64_t>(v.size());
    append(v.data(), v.size() * sizeof(T));
  }
  template <typename T>
  requires std::is_trivially_copyable_v<T>
  void elements(const T* first, std::size_t count) { append(first, count * sizeof(T)); }  // without a count before them
  void bytes(const Bytes& b) {
    value<std::uint64_t>(b.size());
    append(b.data(), b.size());
  }
  void reserve(std::size_t size) { bytes_.reserve(size); }  // only for a writer into memory
  Bytes take() { return std::move(bytes_); }                // the bytes written so far

 private:
  void append(const void* data, std::size_t size) {
    if (file_)
      file_->write(static_cast<const char*>(data), static_cast<std::streamsize>(size));
    else
      bytes_.append(static_cast<const char*>(data), size);
  }
  Bytes bytes_;
  std::ostream* file_ = nullptr;
};

// Reads from memory, or from the first `size` bytes of a file. Throws StoreError when the bytes end too early.
class ByteReader {
 public:
  explicit ByteReader(const Bytes& bytes) : data_(bytes.data()), size_(bytes.size()) {}
  ByteReader(std::istream& file, std::size_t size) : file_(&file), size_(size) {}

  template <typename T>
  requires std::is_trivially_copyable_v<T> T value() {
    T v;
    copy(&v, sizeof v);
    return v;
  }
  template <typename T>
  requires std::is_trivially_copyable_v<T> std::vector<T> values() {
    std::vector<T> v(count_of(sizeof(T)));
    copy(v.data(), v.size() * sizeof(T));
    return v;
  }
  template <typename T>
  requires std::is_trivially_copyable_v<T>
  void elements(T* first, std::size_t count) { copy(first, count * sizeof(T)); }  // the caller knows their number
  Bytes bytes() {
    Bytes b(count_of(1), '\0');
    copy(b.data(), b.size());
    return b;
  }
  // A number of elements that follow with at least `size` bytes each.
  std::size_t count(std::size_t size) { return count_of(size); }
  bool at_end() const { return position_ == size_; }

 private:
  // A count is believed only when so many elements are left, so that a damaged file asks for no memory that it cannot
  // fill.
  std::size_t count_of(std::size_t size) {
    const auto count = value<std::uint64_t>();
    if (count > (size_ - position_) / size) fail();
    return count;
  }
  void copy(void* target, std::size_t size) {
    if (size > size_ - position_) fail();
    if (file_ && !file_->read(static_cast<char*>(target), static_cast<std::streamsize>(size))) fail();
    if (!file_ && size > 0) std::memcpy(target, data_ + position_, size);
    position_ += size;
  }
  [[noreturn]] static void fail() { throw StoreError("merge: a message or spill file is truncated"); }

  const char* data_ = nullptr;
  std::istream* file_ = nullptr;
  std::size_t size_ = 0, position_ = 0;
};

}  // namespace megablock
