// Holds an open file of the operating system, and reads and writes it completely. It is used where std::fstream says
// too little about errors, or cannot flush to the disk.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace megablock {

// Closes the file at the end of its scope. id() is negative, and errno set, when the file could not be opened.
class Descriptor {
 public:
  Descriptor(const std::string& path, int flags);  // `flags` as in open(2)
  ~Descriptor();
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int id() const { return id_; }

 private:
  int id_;
};

std::int64_t file_size(int file);  // size of a regular file in bytes; -1 for anything else

// Reads exactly `size` bytes at `offset`. Returns false at the end of the file and on an error.
bool read_fully(int file, void* data, std::size_t size, std::int64_t offset);

// Write all bytes, or flush the file to the disk. `path` is for messages; they throw as throw_file_error does.
void write_fully(int file, const std::string& path, const void* data, std::size_t size);
void flush_to_disk(int file, const std::string& path);

}  // namespace megablock
