#include "io/store/job/job_lock.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <ctime>
#include <sstream>

#include "io/base/error.h"
#include "io/base/file_error.h"
namespace megablock {

namespace {

constexpr int kPollMs = 50;

std::string own_host() {
  std::array<char, 256> name{};
  ::gethostname(name.data(), name.size() - 1);
  return name.data();
}

// The text in the lock: "process 1234 on host, started 2026-11-21T07:00:00Z".
std::string own_description() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  ::gmtime_r(&now, &utc);
  std::array<char, 32> start{};
  std::strftime(start.data(), start.size(), "%Y-%m-%dT%H:%M:%SZ", &utc);
  return "process " + std::to_string(::getpid()) + " on " + own_host() + ", started " + start.data();
}

// Reads the text that another process has written.
JobHolder holder(int file) {
  std::array<char, 1024> text{};
  const ssize_t n = ::pread(file, text.data(), text.size() - 1, 0);
  std::string line(text.data(), n > 0 ? static_cast<std::size_t>(n) : 0);
  line.erase(line.find_last_not_of('\n') + 1);
  JobHolder found;
  if (line.empty()) return found;
  found.who = line;
  std::istringstream words(line);
  std::string word, process, host;
  if (words >> word >> process >> word >> host && host.ends_with(',')) {
    host.pop_back();
    found.how_to_stop = "kill -USR1 " + process + (host == own_host() ? "" : " on " + host);
  }
  return found;
}

}  // namespace

std::optional<JobHolder> holder_of(const JobStore& store) {
  const int file = ::open(store.path("lock").c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return std::nullopt;
  std::optional<JobHolder> found;
  if (::flock(file, LOCK_SH | LOCK_NB) != 0) found = holder(file);
  ::close(file);
  return found;
}

JobLock::JobLock(const JobStore& store, double patience_s) {
  const std::string path = store.path("lock");
  file_ = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (file_ < 0) throw_file_error(path, "created", errno);
  // flock has no waiting time, so the lock is tried again and again. A signal does not end the waiting.
  const auto start = std::chrono::steady_clock::now();
  while (::flock(file_, LOCK_EX | LOCK_NB) != 0) {
    const int error = errno;
    const std::chrono::duration<double> waited = std::chrono::steady_clock::now() - start;
    if (error == EINTR || (error == EWOULDBLOCK && waited.count() < patience_s)) {
      ::poll(nullptr, 0, kPollMs);
      continue;
    }
    const JobHolder other = holder(file_);
    ::close(file_);
    if (error != EWOULDBLOCK) throw_file_error(path, "locked", error);
    throw InputError(store.directory() + ": the job is in use by " + other.who + "; wait until it ends, or stop it (" +
                     other.how_to_stop + ") and run again");
  }
  const std::string line = own_description() + "\n";
  if (::ftruncate(file_, 0) != 0 || ::pwrite(file_, line.data(), line.size(), 0) < 0) {
    const int error = errno;
    ::close(file_);
    throw_file_error(path, "written", error);
  }
}

JobLock::~JobLock() {
  // The file is emptied, not deleted, because a waiting process may have opened it already. If this fails, only an
  // outdated name remains in it.
  if (::ftruncate(file_, 0) != 0) errno = 0;
  ::close(file_);
}

}  // namespace megablock
