// Flat byte strings of plain values and vectors: what travels between ranks and to the scratch directory.
// Host byte order: a job's ranks and its scratch live on machines of one kind.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <type_traits>
#include <vector>

#include "io/error.h"

namespace megablock {

using Bytes = std::vector<char>;

class ByteWriter {
 public:
  template <typename T>
  requires std::is_trivially_copyable_v<T>
  void value(const T& v) { append(&v, sizeof v); }
  template <typename T>
  requires std::is_trivially_copyable_v<T>
  void values(const std::vector<T>& v) {
    value<std::uint64_t>(v.size());
    append(v.data(), v.size() * sizeof(T));
  }
  Bytes take() { return std::move(bytes_); }

 private:
  void append(const void* data, std::size_t size) {
    const std::size_t end = bytes_.size();
    bytes_.resize(end + size);
    if (size > 0) std::memcpy(bytes_.data() + end, data, size);
  }
  Bytes bytes_;
};

// Throws StoreError when the bytes end too early.
class ByteReader {
 public:
  explicit ByteReader(const Bytes& bytes) : bytes_(bytes) {}
  template <typename T>
  requires std::is_trivially_copyable_v<T> T value() {
    T v;
    copy(&v, sizeof v);
    return v;
  }
  template <typename T>
  requires std::is_trivially_copyable_v<T> std::vector<T> values() {
    const auto count = value<std::uint64_t>();
    if (count > (bytes_.size() - position_) / sizeof(T))
      throw StoreError("merge: a message or spill file is truncated");
    std::vector<T> v(count);
    copy(v.data(), count * sizeof(T));
    return v;
  }
  bool at_end() const { return position_ == bytes_.size(); }

 private:
  void copy(void* target, std::size_t size) {
    if (size > bytes_.size() - position_) throw StoreError("merge: a message or spill file is truncated");
    if (size > 0) std::memcpy(target, bytes_.data() + position_, size);
    position_ += size;
  }
  const Bytes& bytes_;
  std::size_t position_ = 0;
};

}  // namespace megablock
