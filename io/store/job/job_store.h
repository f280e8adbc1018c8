// Reads and writes the job directory, which has one sealed file for each unit of work (docs/reference/file-formats.md).
//
// A unit comes to its place in five steps. A process that is killed, or a machine that fails, loses at most the unit in
// work:
//
//     1  write the payload to a temporary file in the directory of the unit
//     2  read it back, and append the seal: a trailer of 64 bytes with magic, format version, length and XXH3 of the
//        payload, fingerprint and the trailer's own hash
//     3  flush the file to the disk, before any name refers to it
//     4  rename it: in one step, readers see either the old unit or the new one, and never a part
//     5  flush the directory, so that write() returns only when the new name is on the disk
//
// A unit has one writer and is never changed in place, so units need no locks; the only lock is that of the job
// (job_lock.h).
//
// Until step 4 the old unit is untouched. The temporary file of a killed run is deleted by the next one
// (remove_temporaries()). The seal finds what the file system may still do wrong: truncated or damaged files count as
// missing and are computed again. HDF5 ignores bytes after its own end of file, so every HDF5 reader can open a sealed
// unit.
//
// The fingerprint is the hash of everything that the unit was computed from: the options, the version of the algorithm
// and the content hashes of the units that were read. A unit is up to date when it exists, is complete, and has the
// requested fingerprint. So a run does not need to know what an earlier one has done, and a changed option makes
// exactly those units anew that depend on it. Content hashes, not times, stop the chain: if a unit is computed again
// with the same bytes, the units after it stay up to date.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace megablock {

inline constexpr const char* kResult = "result/block.h5";  // a unit of every finished job

struct UnitSeal {
  std::uint64_t length = 0;        // of the payload, bytes
  std::uint64_t content_hash = 0;  // XXH3 of the payload
  std::uint64_t fingerprint = 0;
};

// The units of one job directory.
class JobStore {
 public:
  // Refers to a job directory; creates nothing.
  explicit JobStore(std::string directory);

  const std::string& directory() const { return directory_; }
  std::string path(const std::string& unit) const;  // unit = "features/000003.h5", for example

  // Makes the directories of a job. Throws InputError if that is impossible (read-only file system, a file in the way).
  void create() const;

  // The seal of a unit. Empty if the file is missing, too short, or has no valid trailer. Reads 64 bytes.
  std::optional<UnitSeal> seal(const std::string& unit) const;
  // Whether the unit exists with this fingerprint and the right length. Does not read the payload.
  bool up_to_date(const std::string& unit, std::uint64_t fingerprint) const;
  // Reads the payload and compares its hash. Returns what is wrong with the unit, or an empty string.
  std::string problem(const std::string& unit) const;
  // Whether the unit exists, is complete and has this fingerprint. `damage` is set to the problem() of an incomplete
  // one.
  bool is_current(const std::string& unit, std::uint64_t fingerprint, std::string& damage) const;
  // Throws StoreError with the file, its problem() and the remedy.
  void verify(const std::string& unit) const;
  // The path of a unit after verify(). Each version of a file is verified once in a process.
  std::string verified_path(const std::string& unit) const;

  // Calls writer(temporary path), seals the file and renames it. Returns the new seal. If the writer throws, nothing
  // remains. A full disk and a read-only file system are InputErrors that say so.
  UnitSeal write(const std::string& unit, std::uint64_t fingerprint,
                 const std::function<void(const std::string& path)>& writer) const;

  // Writes a text file without a seal in one step (job.json, report.html, exports).
  void write_text(const std::string& name, const std::string& text) const;

  std::vector<std::string> list(const std::string& folder) const;  // the names of all units under a folder, sorted
  void remove(const std::string& unit) const;
  // Deletes the temporary files of killed runs, but not those of a process that still runs on this host. The caller
  // must hold the lock of the job: then files of other hosts belong to no living run.
  void remove_temporaries() const;

 private:
  std::string directory_;
  // For each unit (size, time of modification in ns).
  mutable std::map<std::string, std::pair<std::int64_t, std::int64_t>> verified_;
};

}  // namespace megablock
