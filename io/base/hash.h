// Computes 64-bit hashes by XXH3: fingerprints of units of work, checksums of files, digests of results.
//
// XXH3 is fast (gigabytes per second) and no cryptographic hash: it finds damage and changes, not forgery. Among n
// different values, two share a hash of 64 bits with a probability of about n^2 / 2^65, which is 3e-8 for a million
// units.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace megablock {

// Hash of a sequence of values. Values are hashed by their bytes. The length of a string or vector is hashed before its
// contents, so that the contents of neighbouring fields cannot be confused.
class Hasher {
 public:
  Hasher();
  ~Hasher();
  Hasher(const Hasher&) = delete;
  Hasher& operator=(const Hasher&) = delete;

  void bytes(const void* data, std::size_t size);
  template <typename T>
  requires(std::is_arithmetic_v<T> || std::is_enum_v<T>) Hasher& add(T value) {
    bytes(&value, sizeof value);
    return *this;
  }
  Hasher& add(std::string_view text) {
    add(text.size());
    bytes(text.data(), text.size());
    return *this;
  }
  template <typename T>
  requires(std::is_trivially_copyable_v<T>&& std::has_unique_object_representations_v<T>) Hasher& add(
      const std::vector<T>& values) {
    add(values.size());
    bytes(values.data(), values.size() * sizeof(T));
    return *this;
  }
  Hasher& add(const std::vector<double>& values) {
    add(values.size());
    bytes(values.data(), values.size() * sizeof(double));
    return *this;
  }
  std::uint64_t value() const;

 private:
  void* state_;
};

std::uint64_t hash_file(const std::string& path);  // throws StoreError if the file cannot be read
std::string hex(std::uint64_t value);              // 16 hexadecimal digits

}  // namespace megablock
