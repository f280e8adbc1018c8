// Declares the table of the stages of a job: a row for each stage, in the order in which they run.
//
// A row says what a stage needs and makes, what a unit of its work is, how it runs and what it reports. The pipeline,
// the commands, the project file, the options, `status`, `check` and the folders of a job ask the table. The rows stand
// in cluster/stages/stages.cpp, which knows the functions of all stages; this header lets the folders below it ask.
// docs/developer/add-stage.md tells how to add a stage.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "cluster/job/option_section.h"
#include "io/text/stage_settings.h"

namespace megablock {

class JobStore;
struct Job;
struct JobRecord;     // cluster/job/job_record.h
struct StageResults;  // cluster/stages/stages.h

// The names of stages of which others speak: in messages, events and records.
inline constexpr const char *kFeatureStage = "features", *kFocalLengthStage = "focal_lengths",
                            *kMatchingStage = "matching", *kTrackStage = "tracks", *kCoverageStage = "coverage",
                            *kOrientationStage = "orientation", *kMergeStage = "merge";

struct Stage {
  const char* name = "";        // in records, events, progress and `status`
  const char* needs = "";       // what it is made from: earlier stages, or what the project names
  const char* makes = "";       // its files: "tracks/<tile>.h5", in a folder for them alone, or the one file "tiles.h5"
  const char* unit = "";        // what one unit of its work is
  const char* parts = "units";  // what progress counts
  int algorithm = 1;            // in the fingerprints of its units; raised when its results change
  const char* command = "";     // the command that ends with it in a job of images; "": none
  const char* command_given = nullptr;  // the same in a job of given tie points; nullptr: it does not run there
  const char* help = nullptr;           // of the command; nullptr: none ends here in a job of images
  bool optional = false;                // a job may do without it: `status` leaves it out then
  bool iterates = false;  // it adjusts the whole block: an event for each iteration, then one for the result
  std::array<const OptionSection*, 2> sections = {};     // of the project file; nullptr: none
  const char* kind = nullptr;                            // of its HDF5 files; nullptr: `check` only verifies them
  void (*read_file)(const std::string& path) = nullptr;  // reads a file of this kind; throws what is wrong with it
  void (*check)(const JobStore& store) = nullptr;        // throws what is wrong with its files that have no seal
  void (*run)(const Stage& stage, const Job& job, JobRecord& record,
              StageResults& results) = nullptr;  // collective; throws alike on every rank

  // Whether it runs in a job that starts from images, or from given tie points.
  bool runs(bool given_tie_points) const { return !given_tie_points || command_given != nullptr; }
  // Whether the command `last` ends with this stage.
  bool ends(const std::string& last, bool given_tie_points) const {
    return !last.empty() && runs(given_tie_points) && last == (given_tie_points ? command_given : command);
  }
  std::string folder() const;  // of its files: "tracks"; empty: it has no folder for them alone
  std::string ending() const;  // of their names: ".h5"
  bool makes_file_by_tile() const;
};

std::span<const Stage> all_stages();
// Returns nullptr for a name that is not in the table, such as those of the stages of `register`.
const Stage* find_stage(const std::string& name);
// The stages that a job runs.
std::vector<Stage> stages_of_job(bool given_tie_points);

// The folders of the unit files.
std::vector<std::string> unit_folders();
// The sections of all stages.
std::vector<const OptionSection*> option_sections();
// The same, for the reader of the project file.
std::vector<SettingsSection> settings_sections();

}  // namespace megablock
