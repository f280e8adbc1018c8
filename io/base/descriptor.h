// An open file of the operating system and whole reads and writes on it, where std::fstream tells too little of errors.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace megablock {

// Closed at the end of its scope; id() < 0 (and errno set) when the file could not be opened.
class Descriptor {
 public:
  Descriptor(const std::string& path, int flags);  // flags of open(2)
  ~Descriptor();
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int id() const { return id_; }

 private:
  int id_;
};

std::int64_t file_size(int file);  // of a regular file, bytes; -1 otherwise

// Reads exactly `size` bytes; false at the end of the file or on an error.
bool read_fully(int file, void* data, std::size_t size, std::int64_t offset);

// `path` is for messages; errors as throw_file_error.
void write_fully(int file, const std::string& path, const void* data, std::size_t size);
void flush_to_disk(int file, const std::string& path);

}  // namespace megablock
