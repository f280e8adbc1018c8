// The job directory: one sealed file per unit of work (architecture.md section 4, docs/job-format.md).
//
// A unit file is written under a temporary name in its final directory, sealed by a 64-byte trailer (magic, format
// version, payload length, XXH3 of the payload, fingerprint), fsynced, renamed, and its directory fsynced. HDF5 ignores
// bytes behind its own end of file, so a sealed unit opens in any HDF5 reader. The fingerprint is the hash of
// everything the unit was computed from; a unit is up to date when it is there, whole, and has the fingerprint asked
// for.
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

class JobStore {
 public:
  // Names a job directory; creates nothing.
  explicit JobStore(std::string directory);

  const std::string& directory() const { return directory_; }
  std::string path(const std::string& unit) const;  // e.g. unit = "features/000003.h5"

  // Makes the directories of a job. Throws InputError when that is not possible (read-only, a file in the way).
  void create() const;

  // The seal of a unit, empty when the file is missing, too short or carries no valid trailer. Reads 64 bytes.
  std::optional<UnitSeal> seal(const std::string& unit) const;
  // There, sealed with this fingerprint, and its payload's length right. Does not read the payload.
  bool up_to_date(const std::string& unit, std::uint64_t fingerprint) const;
  // Reads the payload and compares its hash; says what is wrong with the unit, empty: nothing.
  std::string problem(const std::string& unit) const;
  // There, whole and with this fingerprint. `damage` gets the problem() of one that is there and not whole.
  bool is_current(const std::string& unit, std::uint64_t fingerprint, std::string& damage) const;
  // Throws StoreError naming the file, its problem() and the remedy.
  void verify(const std::string& unit) const;
  // Path of a unit after verify(); verified once per process and file version.
  std::string verified_path(const std::string& unit) const;

  // Runs writer(temporary path), seals, renames. Nothing is left behind when the writer throws. ENOSPC and EROFS become
  // InputError that say so. Returns the new seal.
  UnitSeal write(const std::string& unit, std::uint64_t fingerprint,
                 const std::function<void(const std::string& path)>& writer) const;

  // Atomic text file without a seal (job.json, report.html, exports).
  void write_text(const std::string& name, const std::string& text) const;

  std::vector<std::string> list(const std::string& folder) const;  // sorted unit names under a folder
  void remove(const std::string& unit) const;
  // Deletes leftover temporaries of killed runs (never those of a living process on this host).
  void remove_temporaries() const;

 private:
  std::string directory_;
  mutable std::map<std::string, std::pair<std::int64_t, std::int64_t>> verified_;  // unit -> (size, mtime in ns)
};

}  // namespace megablock
