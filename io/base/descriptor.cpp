#include "io/base/descriptor.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

#include "io/base/file_error.h"

namespace megablock {

Descriptor::Descriptor(const std::string& path, int flags) : id_(::open(path.c_str(), flags | O_CLOEXEC, 0666)) {}

Descriptor::~Descriptor() {
  if (id_ >= 0) ::close(id_);
}

std::int64_t file_size(int file) {
  struct stat status {};
  return ::fstat(file, &status) == 0 && S_ISREG(status.st_mode) ? status.st_size : -1;
}

// The system may read less than asked for, or be interrupted by a signal; both are no errors.
bool read_fully(int file, void* data, std::size_t size, std::int64_t offset) {
  auto* bytes = static_cast<char*>(data);
  while (size > 0) {
    const ssize_t n = ::pread(file, bytes, size, offset);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    bytes += n;
    size -= static_cast<std::size_t>(n);
    offset += n;
  }
  return true;
}

void write_fully(int file, const std::string& path, const void* data, std::size_t size) {
  const auto* bytes = static_cast<const char*>(data);
  while (size > 0) {
    const ssize_t n = ::write(file, bytes, size);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) throw_file_error(path, "written", errno);
    bytes += n;
    size -= static_cast<std::size_t>(n);
  }
}

void flush_to_disk(int file, const std::string& path) {
  // Some network file systems cannot flush a directory and answer EINVAL. They would not keep the directory any safer.
  if (::fsync(file) != 0 && errno != EINVAL) throw_file_error(path, "flushed to disk", errno);
}

}  // namespace megablock
