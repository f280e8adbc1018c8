#include <fcntl.h>
#include <poll.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <ctime>

#include "io/error.h"
#include "io/file_error.h"
#include "io/job_store.h"

namespace megablock {

namespace {

constexpr int kPollMs = 50;

// "process 1234 on host, started 2026-11-21T07:00:00Z"
std::string own_description() {
  std::array<char, 256> host{};
  ::gethostname(host.data(), host.size() - 1);
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  ::gmtime_r(&now, &utc);
  std::array<char, 32> start{};
  std::strftime(start.data(), start.size(), "%Y-%m-%dT%H:%M:%SZ", &utc);
  return "process " + std::to_string(::getpid()) + " on " + host.data() + ", started " + start.data();
}

std::string holder(int file) {
  std::array<char, 1024> text{};
  const ssize_t n = ::pread(file, text.data(), text.size() - 1, 0);
  std::string line(text.data(), n > 0 ? static_cast<std::size_t>(n) : 0);
  line.erase(line.find_last_not_of('\n') + 1);
  return line.empty() ? "another process" : line;
}

}  // namespace

bool is_in_use(const JobStore& store) {
  const int file = ::open(store.path("lock").c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return false;
  const bool free = ::flock(file, LOCK_SH | LOCK_NB) == 0;
  ::close(file);
  return !free;
}

JobLock::JobLock(const JobStore& store, double patience_s) {
  const std::string path = store.path("lock");
  file_ = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (file_ < 0) throw_file_error(path, "created", errno);
  const auto start = std::chrono::steady_clock::now();
  while (::flock(file_, LOCK_EX | LOCK_NB) != 0) {
    const int error = errno;
    const std::chrono::duration<double> waited = std::chrono::steady_clock::now() - start;
    if (error == EINTR || (error == EWOULDBLOCK && waited.count() < patience_s)) {
      ::poll(nullptr, 0, kPollMs);
      continue;
    }
    const std::string who = holder(file_);
    ::close(file_);
    if (error != EWOULDBLOCK) throw_file_error(path, "locked", error);
    throw InputError(store.directory() + ": the job is in use by " + who +
                     "; wait until it ends, or stop it (kill -USR1 <process>) and run again");
  }
  const std::string line = own_description() + "\n";
  if (::ftruncate(file_, 0) != 0 || ::pwrite(file_, line.data(), line.size(), 0) < 0) {
    const int error = errno;
    ::close(file_);
    throw_file_error(path, "written", error);
  }
}

JobLock::~JobLock() {
  // Emptied, not deleted: a waiting process may have opened it already. A failure only leaves a stale name in it.
  if (::ftruncate(file_, 0) != 0) errno = 0;
  ::close(file_);
}

}  // namespace megablock
