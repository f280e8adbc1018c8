// Describes a section of the project file with options of a stage.
//
// One description of the options serves the project file, job.json and the fingerprints, so that no option can be read
// without being hashed.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace megablock {

struct JobOptions;

// Visits every option of a section: reads it, writes it down or hashes it. A visitor may set the value.
class OptionVisitor {
 public:
  virtual ~OptionVisitor() = default;
  virtual void number(const std::string& key, double& value) = 0;
  virtual void integer(const std::string& key, int& value) = 0;
  virtual void integer(const std::string& key, std::int64_t& value) = 0;
  virtual void flag(const std::string& key, bool& value) = 0;
  virtual void text(const std::string& key, std::string& value) = 0;
  // `value`: position in `names`.
  virtual void choice(const std::string& key, const std::vector<std::string>& names, int& value) = 0;
};

// A section describes a struct of JobOptions. If only the stage reads its options, the section is defined in the
// stage's file and describes JobOptions::numbers:
//
//     visitor.number("min_share", options.numbers.try_emplace("coverage.min_share", 0.25).first->second);
struct OptionSection {
  const char* name;                                               // in the project file
  const char* file_key;                                           // the key that names a file; nullptr: none
  void (*describe)(OptionVisitor& visitor, JobOptions& options);  // visits the options of this section
  void (*check)(const JobOptions& options);                       // throws InputError
};

}  // namespace megablock
