// Seals a unit by a trailer of 64 bytes, little-endian, after the payload:
//
//     0  magic "MBUNIT\r\n"      8  u32 format version     12  u32 zero
//    16  u64 payload length     24  u64 XXH3 of payload    32  u64 fingerprint
//    40  16 bytes zero          56  u64 XXH3 of bytes 0..55
//
// Magic, version and the trailer's own hash have the same place in every version.
#include "io/store/job/job_store.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "io/base/descriptor.h"
#include "io/base/error.h"
#include "io/base/file_error.h"
#include "io/base/hash.h"
#include "io/store/hdf5/hdf5_file.h"

namespace megablock {

namespace fs = std::filesystem;

namespace {

static_assert(std::endian::native == std::endian::little, "unit files are little-endian");

constexpr std::array<char, 8> kMagic = {'M', 'B', 'U', 'N', 'I', 'T', '\r', '\n'};
constexpr const char* kTemporarySuffix = ".tmp";

struct Trailer {
  std::array<char, 8> magic = kMagic;
  std::uint32_t version = kFormatVersion;
  std::uint32_t reserved = 0;
  UnitSeal seal;
  std::array<std::uint64_t, 2> spare{};
  std::uint64_t own_hash = 0;

  std::uint64_t hash() const {
    Hasher hasher;
    hasher.bytes(this, offsetof(Trailer, own_hash));
    return hasher.value();
  }
};
static_assert(sizeof(Trailer) == 64);

void flush_directory(const std::string& path) {
  const Descriptor directory(path, O_RDONLY | O_DIRECTORY);
  if (directory.id() < 0) throw_file_error(path, "opened", errno);
  flush_to_disk(directory.id(), path);
}

std::uint64_t hash_payload(int file, const std::string& path, std::uint64_t length) {
  Hasher hasher;
  // A buffer of at most 1 MiB: units may be larger than memory.
  std::vector<char> buffer(static_cast<std::size_t>(std::min<std::uint64_t>(length, 1 << 20)));
  for (std::uint64_t done = 0; done < length;) {
    const auto size = static_cast<std::size_t>(std::min<std::uint64_t>(buffer.size(), length - done));
    if (!read_fully(file, buffer.data(), size, static_cast<std::int64_t>(done)))
      throw StoreError(path + ": read error; check the disk, or delete the file and run again");
    hasher.bytes(buffer.data(), size);
    done += size;
  }
  return hasher.value();
}

// Reads the trailer of an open unit. Where there is no valid one, `problem` tells the reason.
std::optional<Trailer> read_trailer(int file, std::string& problem) {
  const std::int64_t size = file_size(file);
  Trailer trailer;
  if (size < static_cast<std::int64_t>(sizeof trailer)) {
    problem = "has no valid seal: with " + std::to_string(std::max<std::int64_t>(size, 0)) +
              " bytes it is truncated, or no unit of a job";
  } else if (!read_fully(file, &trailer, sizeof trailer, size - static_cast<std::int64_t>(sizeof trailer))) {
    problem = "cannot be read";
  } else if (trailer.magic != kMagic || trailer.hash() != trailer.own_hash) {
    problem = "has no valid seal: it is truncated, damaged or no unit of a job";
  } else if (trailer.version != kFormatVersion) {
    problem = "has format version " + std::to_string(trailer.version) + ", this program reads version " +
              std::to_string(kFormatVersion);
  } else if (trailer.seal.length + sizeof trailer != static_cast<std::uint64_t>(size)) {
    problem =
        "has " + std::to_string(size) + " bytes, its seal says " + std::to_string(trailer.seal.length + sizeof trailer);
  } else {
    return trailer;
  }
  return std::nullopt;
}

std::string host_name() {
  std::array<char, 256> name{};
  ::gethostname(name.data(), name.size() - 1);
  return name.data();
}

// The start time of a process in clock ticks since the machine started; empty if there is no such process. Process
// numbers are reused, but this pair is unique.
std::string process_start(const std::string& pid) {
  std::ifstream file("/proc/" + pid + "/stat");
  std::string text;
  std::getline(file, text);
  const auto name_end = text.rfind(')');  // the program's name may contain spaces and brackets
  if (name_end == std::string::npos) return {};
  std::istringstream fields(text.substr(name_end + 1));
  std::string field;
  for (int i = 3; i <= 22; ++i) fields >> field;
  return field;
}

// Path of the temporary file: "<directory>/.<name>~<host>~<pid>~<start>.tmp".
std::string temporary_path(const fs::path& target) {
  const std::string pid = std::to_string(::getpid());
  // The name tells who writes it. Two processes never share a file, and a later run knows whether its writer still
  // lives.
  std::string name = ".";
  for (const std::string& part : {target.filename().string(), host_name(), pid}) name += part + "~";
  name += process_start(pid) + kTemporarySuffix;
  return (target.parent_path() / name).string();
}

bool is_temporary(const fs::path& path) { return path.extension() == kTemporarySuffix; }

// Whether the process that wrote a temporary file still runs on this machine.
bool belongs_to_living_process(const fs::path& path) {
  std::vector<std::string> parts;
  std::istringstream name(path.stem().string());
  for (std::string part; std::getline(name, part, '~');) parts.push_back(part);
  if (parts.size() < 4) return false;
  const std::string start = parts.back(), pid = parts[parts.size() - 2], host = parts[parts.size() - 3];
  return host == host_name() && !start.empty() && process_start(pid) == start;
}

// A temporary file beside the target. It is removed unless rename() was reached.
class Temporary {
 public:
  explicit Temporary(const std::string& target) : target_(target), path_(temporary_path(target)) {
    make_folder(fs::path(target).parent_path().string());
  }
  ~Temporary() {
    if (!done_) ::unlink(path_.c_str());
  }
  Temporary(const Temporary&) = delete;
  Temporary& operator=(const Temporary&) = delete;
  const std::string& path() const { return path_; }
  // Puts the file, which must be flushed, in place of the target.
  void rename() {
    // POSIX: if the target exists, it is replaced in one step. Both are in one directory, so in one file system.
    if (::rename(path_.c_str(), target_.c_str()) != 0) throw_file_error(target_, "replaced", errno);
    done_ = true;
    flush_directory(fs::path(target_).parent_path().string());
  }

 private:
  std::string target_, path_;
  bool done_ = false;
};

// The errors of writers name the temporary file; the user knows only the unit.
[[noreturn]] void rethrow_for(const std::string& target, const std::string& temporary, const std::string& message,
                              bool input) {
  std::string text = message;
  if (const auto at = text.find(temporary); at != std::string::npos) text.replace(at, temporary.size(), target);
  if (input) throw InputError(text);
  throw StoreError(text);
}

UnitSeal append_seal(const std::string& path, std::uint64_t fingerprint) {
  const Descriptor file(path, O_RDWR | O_APPEND);
  if (file.id() < 0) throw_file_error(path, "opened", errno);
  Trailer trailer;
  // The payload is read back from the file, so the seal also covers what was actually written.
  trailer.seal.length = static_cast<std::uint64_t>(std::max<std::int64_t>(file_size(file.id()), 0));
  trailer.seal.content_hash = hash_payload(file.id(), path, trailer.seal.length);
  trailer.seal.fingerprint = fingerprint;
  trailer.own_hash = trailer.hash();
  write_fully(file.id(), path, &trailer, sizeof trailer);
  flush_to_disk(file.id(), path);
  return trailer.seal;
}

}  // namespace

JobStore::JobStore(std::string directory) : directory_(std::move(directory)) {}

std::string JobStore::path(const std::string& unit) const { return (fs::path(directory_) / unit).string(); }

void JobStore::create() const {  // the folder of a stage comes with its first file
  for (const char* folder : {"", "result", "events"}) make_folder(fs::absolute(path(folder)).string());
}

std::optional<UnitSeal> JobStore::seal(const std::string& unit) const {
  const Descriptor file(path(unit), O_RDONLY);
  if (file.id() < 0) return std::nullopt;
  std::string problem;
  const std::optional<Trailer> trailer = read_trailer(file.id(), problem);
  return trailer ? std::optional(trailer->seal) : std::nullopt;
}

bool JobStore::up_to_date(const std::string& unit, std::uint64_t fingerprint) const {
  const std::optional<UnitSeal> found = seal(unit);
  return found && found->fingerprint == fingerprint;
}

std::string JobStore::problem(const std::string& unit) const {
  const std::string name = path(unit);
  const Descriptor file(name, O_RDONLY);
  if (file.id() < 0) {
    if (errno == ENOENT) return "is missing";
    throw_file_error(name, "opened", errno);
  }
  std::string problem;
  const std::optional<Trailer> trailer = read_trailer(file.id(), problem);
  if (!trailer) return problem;
  try {
    if (hash_payload(file.id(), name, trailer->seal.length) == trailer->seal.content_hash) return "";
  } catch (const StoreError&) {
    return "cannot be read to its end; check the disk";
  }
  return "is damaged (its contents do not have the hash of its seal)";
}

bool JobStore::is_current(const std::string& unit, std::uint64_t fingerprint, std::string& damage) const {
  damage.clear();
  if (!fs::exists(path(unit))) return false;
  const std::optional<UnitSeal> found = seal(unit);
  // The trailer is read first, because it is cheap. The payload is read only if the unit would be used.
  if (found && found->fingerprint != fingerprint) return false;
  damage = problem(unit);
  return damage.empty();
}

void JobStore::verify(const std::string& unit) const {
  if (const std::string found = problem(unit); !found.empty())
    throw StoreError(path(unit) + ": " + found + "; run the job again, which computes it anew");
}

std::string JobStore::verified_path(const std::string& unit) const {
  std::string name = path(unit);
  struct stat status {};
  std::pair<std::int64_t, std::int64_t> version(-1, -1);
  if (::stat(name.c_str(), &status) == 0)
    version = {status.st_size, status.st_mtim.tv_sec * std::int64_t{1000000000} + status.st_mtim.tv_nsec};
  // Size and time of modification identify the version of the file; a unit is never changed in place.
  const auto known = verified_.find(unit);
  if (known != verified_.end() && known->second == version && version.first >= 0) return name;
  verify(unit);
  verified_[unit] = version;
  return name;
}

UnitSeal JobStore::write(const std::string& unit, std::uint64_t fingerprint,
                         const std::function<void(const std::string& path)>& writer) const {
  Temporary temporary(fs::absolute(path(unit)).string());
  try {
    writer(temporary.path());
    const UnitSeal seal = append_seal(temporary.path(), fingerprint);
    temporary.rename();
    verified_.erase(unit);
    return seal;
  } catch (const InputError& error) {
    rethrow_for(path(unit), temporary.path(), error.what(), true);
  } catch (const StoreError& error) {
    rethrow_for(path(unit), temporary.path(), error.what(), false);
  }
}

void JobStore::write_text(const std::string& name, const std::string& text) const {
  Temporary temporary(fs::absolute(path(name)).string());
  try {
    const Descriptor file(temporary.path(), O_WRONLY | O_CREAT | O_TRUNC);
    if (file.id() < 0) throw_file_error(temporary.path(), "created", errno);
    write_fully(file.id(), temporary.path(), text.data(), text.size());
    flush_to_disk(file.id(), temporary.path());
    temporary.rename();
  } catch (const InputError& error) {
    rethrow_for(path(name), temporary.path(), error.what(), true);
  } catch (const StoreError& error) {
    rethrow_for(path(name), temporary.path(), error.what(), false);
  }
}

std::vector<std::string> JobStore::list(const std::string& folder) const {
  std::vector<std::string> units;
  std::error_code error;
  for (fs::recursive_directory_iterator entry(path(folder), error), end; !error && entry != end; entry.increment(error))
    if (entry->is_regular_file() && !is_temporary(entry->path()))
      units.push_back(entry->path().lexically_relative(directory_).string());
  if (error && error != std::errc::no_such_file_or_directory) throw_file_error(path(folder), "listed", error.value());
  std::sort(units.begin(), units.end());
  return units;
}

void JobStore::remove(const std::string& unit) const {
  if (::unlink(path(unit).c_str()) != 0 && errno != ENOENT) throw_file_error(path(unit), "removed", errno);
  verified_.erase(unit);
}

void JobStore::remove_temporaries() const {
  std::vector<fs::path> leftovers;
  std::error_code error;
  for (fs::recursive_directory_iterator entry(directory_, error), end; !error && entry != end; entry.increment(error))
    if (entry->is_regular_file() && is_temporary(entry->path()) && !belongs_to_living_process(entry->path()))
      leftovers.push_back(entry->path());
  // First all names, then the deletions: removing entries while a directory is read may skip others.
  for (const fs::path& leftover : leftovers)
    if (::unlink(leftover.c_str()) != 0 && errno != ENOENT) throw_file_error(leftover.string(), "removed", errno);
}

}  // namespace megablock
