#include "cluster/stages/pipeline.h"

#include <fmt/core.h>
#include <omp.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "adjust/calibration/rig_observations.h"
#include "cluster/job/given_tracks.h"
#include "cluster/job/job_json.h"
#include "cluster/job/messages.h"
#include "cluster/job/stage.h"
#include "cluster/job/work_queue.h"
#include "cluster/mpi/collective.h"
#include "cluster/process/arithmetic.h"
#include "cluster/process/exit_codes.h"
#include "cluster/process/process_memory.h"
#include "cluster/process/version.h"
#include "cluster/stages/common/block_tables.h"
#include "cluster/stages/pipeline/orientation.h"
#include "cluster/stages/stages.h"
#include "io/base/error.h"
#include "io/base/hash.h"
#include "io/block/track_rows.h"
#include "io/project/append.h"
#include "io/project/project.h"
#include "io/result/check.h"
#include "io/result/measurement_index.h"
#include "io/result/measurements.h"
#include "io/store/job/job_lock.h"
#include "io/store/units/block_file.h"
#include "io/store/units/tracks_file.h"
#include "io/text/counted.h"

namespace megablock {

namespace {

using Json = nlohmann::json;

void check_job_json(const JobStore& store, const JobJson& job) {
  job.check_version();
  const std::string level = job.value<std::string>("arithmetic", "");
  if (level != arithmetic_level())
    throw InputError(store.path("job.json") + ": job of arithmetic level '" + level + "', this run computes '" +
                     arithmetic_level() + "'; give " + kArithmeticOption + " " + level +
                     " on a processor that has it, or start a new job directory");
}

// Two images are the same if their files are or, where there is no file, their names.
std::uint64_t identity(const Block& block, ImageIndex image) {
  const std::uint64_t hash = block.images[image].file_hash;
  return hash != 0 ? hash : Hasher().add(block.image_names[image]).value();
}

// Refuses to replace a job by that of another block, which is usually a mistake in -j.
void refuse_another_block(const JobStore& store, const Block& previous, const Project& project) {
  std::vector<std::uint64_t> own;
  own.reserve(previous.images.size());
  for (ImageIndex i(0); previous.images.contains(i); ++i.value) own.push_back(identity(previous, i));
  std::sort(own.begin(), own.end());
  for (ImageIndex i(0); project.block.images.contains(i); ++i.value)
    if (std::binary_search(own.begin(), own.end(), identity(project.block, i))) return;
  throw InputError(store.directory() + ": is the job of another block: " + project.file + " has none of its " +
                   std::to_string(previous.images.size()) +
                   " images; name another folder with -j, or delete this one to begin anew");
}

// The block of the job's last run; nothing if there is none or it is damaged.
std::optional<Block> previous_block(const JobStore& store, const JobLog& log) {
  if (!std::filesystem::exists(store.path("block.h5"))) return std::nullopt;
  const std::string damage = store.problem("block.h5");
  if (damage.empty()) return read_block(store.path("block.h5"));
  warn_of_damage(store, log, "", "block.h5", damage);
  return std::nullopt;
}

// Gives the images of an earlier run their former indices; new images follow. Records when the block grew.
std::vector<std::int64_t> merge_with_previous(const JobStore& store, const JobLog& log,
                                              const std::optional<JobJson>& job, PagedTables& tables,
                                              Project& project) {
  Block& block = project.block;
  std::vector<std::int64_t> generations;
  if (const std::optional<Block> previous = job ? previous_block(store, log) : std::nullopt) {
    PagedTables older(store.directory());
    page_tables(*previous, older);
    const auto release = [&] {  // only one of the two blocks' tables is in memory at a time
      tables.release();
      older.release();
    };
    refuse_another_block(store, *previous, project);
    release();
    // If images were removed or changed, a new block starts; if images were only added, the existing data are kept.
    const bool grown = has_all_images_of(*previous, block);
    release();
    if (grown) {
      block = append_to(*previous, std::move(block), release);
      generations = job->at<std::vector<std::int64_t>>("generations");
    }
  }
  const auto images = static_cast<std::int64_t>(block.images.size());
  if (generations.empty() || generations.back() > images) generations = {images};
  if (generations.back() < images) generations.push_back(images);
  return generations;
}

// Reads the project before anything is written, so that its errors are reported here, once.
Project read_whole_project(const RunOptions& options) {
  if (!std::filesystem::exists(options.project))
    throw InputError(options.project + ": no such project file; write one with 'megablock init IMAGES -o block.yaml'");
  Project project = read_project(options.project, settings_sections());
  check_environment(read_options(project.settings).environment, project.block);
  return project;
}

// A folder that holds other files than those of a job (photographs, say) does not become one.
void refuse_other_folders(const JobStore& store) {
  const std::filesystem::path folder(store.directory());
  std::error_code error;
  if (!std::filesystem::is_directory(folder, error) || std::filesystem::is_empty(folder, error)) return;
  if (holds_job(store)) return;
  throw InputError(store.directory() + ": the folder holds other files and no job; name a new folder with -j");
}

// Rank 0 writes block.h5 and job.json. Returns the further data that the other ranks need.
std::string prepare(const RunOptions& options, const JobStore& store, const JobLog& log, Project project) {
  store.remove_temporaries();
  PagedTables tables(store.directory());
  page_tables(project.block, tables);
  const std::optional<JobJson> before = JobJson::read(store);
  if (before) check_job_json(store, *before);
  if (project.block.images.empty())
    throw InputError(options.project + ": no readable image in the block; check the images folder");
  const std::vector<std::int64_t> generations = merge_with_previous(store, log, before, tables, project);
  check(project.block);
  tables.release();
  Hasher fingerprint;
  fingerprint.add(hash_file(options.project)).add(generations);
  store.write("block.h5", fingerprint.value(),
              [&](const std::string& path) { write_block(path, project.block, [&tables] { tables.release(); }); });

  Json settings = Json::array();
  for (const auto& e : project.settings.entries) settings.push_back({e.section, e.key, e.value, e.where});
  Json effective = Json::object();
  for (const OptionValue& option : option_values(read_options(project.settings)))
    effective[option.section][option.key] = option.value;
  Json job{{"version", JobJson::kVersion},
           {"program", kProgram},
           {"arithmetic", arithmetic_level()},
           {"project", project.file},
           {"generations", generations},
           {"settings", settings},
           {"options", effective},
           {"tie_points", project.tie_points},
           {"unreadable", project.unreadable},
           {"warnings", project.warnings}};
  std::string text = job.dump(1, ' ', false, Json::error_handler_t::replace);
  store.write_text("job.json", text);
  return text;
}

// With the threads and the memory that a rank has unless it is told otherwise.
RunOptions completed(RunOptions options, const Communicator& ranks) {
  if (options.threads <= 0) options.threads = std::max(1, host_cores() / ranks.ranks_on_host());
  if (options.memory_mib <= 0) options.memory_mib = host_memory_mib() / 2 / ranks.ranks_on_host();
  return options;
}

// Removes unit files of an earlier state of the block that no stage uses any more (rank 0, when all stages are done).
void remove_surplus(const Job& job, const JobRecord& record, const std::vector<std::string>& tracks) {
  if (!job.is_first_rank()) return;
  std::set<std::string> wanted(tracks.begin(), tracks.end());
  for (const StageRecord& stage : record.stages)
    for (const auto& unit : stage.units) wanted.insert(unit.first);
  for (const std::string& folder : unit_folders())
    for (const std::string& name : job.store.list(folder))
      if (!wanted.contains(name)) job.store.remove(name);
}

// The block as it was written, for a run from images with the names of the images.
JobBlock open_block(const JobStore& store, const std::string& tie_points) {
  JobBlock own{read_block_without_names(store.verified_path("block.h5")), PagedTables(store.directory())};
  page_tables(own.block, own.tables);
  if (tie_points.empty()) restore_names(store, own);
  return own;
}

// As far as the command `last` says; empty: all of them, unless the run begins again. Returns whether the last of all
// has run.
bool run_stages(const Job& job, JobRecord& record, const std::string& last, StageResults& results) {
  const bool given_tie_points = !results.tie_points.empty();
  for (const Stage& stage : all_stages()) {
    if (!stage.runs(given_tie_points)) continue;
    stage.run(stage, job, record, results);
    if (results.begins_again) return false;
    if (stage.ends(last, given_tie_points)) return &stage == &all_stages().back();
  }
  return true;
}

// Stages change the block of the job. A run that begins again needs it as it was.
void run_all(const Job& job, JobRecord& record, JobBlock& own, const std::string& tie_points) {
  const std::size_t notes = record.notes.size(), failures = record.failures.size();
  while (true) {
    StageResults results(own);
    results.tie_points = tie_points;
    if (run_stages(job, record, job.options.last_stage, results)) remove_surplus(job, record, results.tracks);
    if (!results.begins_again) return;
    own = open_block(job.store, tie_points);
    record.stages.clear();
    record.notes.resize(notes);
    record.failures.resize(failures);
  }
}

// The tracks of all tiles, in the order of their indices.
TrackSet read_all_tracks(const Job& job, const std::vector<std::string>& units) {
  std::vector<TrackSet> parts;
  std::vector<std::pair<TrackIndex, std::pair<std::size_t, std::size_t>>> order;  // id, part and row
  for (const std::string& unit : units) {
    parts.push_back(read_tracks(job.store.verified_path(unit)));
    for (std::size_t t = 0; t < parts.back().id.size(); ++t)
      order.push_back({parts.back().id[t], {parts.size() - 1, t}});
  }
  std::sort(order.begin(), order.end());
  TrackSet all;
  all.begin.push_back(0);
  for (const auto& [id, place] : order) {
    const auto row = static_cast<std::int64_t>(place.second);
    append_tracks(parts[place.first], row, row + 1, all);
  }
  return all;
}

TrackSource track_source(const Job& job, JobRecord& record, JobBlock& own, const std::string& tie_points) {
  if (!tie_points.empty()) {
    TrackSource source{tie_points, 0, [&job, tie_points] { return read_given_tracks(tie_points, job.block); }, {}};
    source.fingerprint = std::stoull(on_first_rank(job.ranks, [&] { return std::to_string(hash_file(tie_points)); }));
    return source;
  }
  StageResults results(own);
  results.needs_tiles = false;
  run_stages(job, record, "match", results);
  restore_names(job.store, own);
  Hasher hasher;
  for (const std::string& unit : results.tracks) hasher.add(job.store.seal(unit)->content_hash);
  return {"", hasher.value(), [&job, tracks = results.tracks] { return read_all_tracks(job, tracks); },
          results.matches};
}

// Prepares the tracks and start poses of a calibration. An off-line calibration needs no matching.
void calibrate_rigs(const Job& job, JobRecord& record, JobBlock& own, const std::string& tie_points,
                    const CalibrationSettings& settings) {
  const bool targets_alone = settings.rig.mode == CalibrationMode::kOffLine;
  const TrackSource source = targets_alone ? TrackSource() : track_source(job, record, own, tie_points);
  BlockState start =
      source.matches.empty()
          ? initial_state(job.block)
          : run_orientation(*find_stage(kOrientationStage), job, record, source.matches, own.block).state;
  if (settings.rig.mode != CalibrationMode::kOnLine) resect_missing(job.block, start);
  TrackSet tracks;
  tracks.begin.push_back(0);
  if (source.read) tracks = source.read();
  if (std::none_of(start.oriented.begin(), start.oriented.end(), [](std::uint8_t o) { return o != 0; }))
    throw AgreedError<InputError>(job.options.project +
                                  ": no frame has a pose and none sees three control points; give 'poses' in the "
                                  "project file");
  run_calibration(job, record.notes, start, tracks, settings);
}

// Opens the log of this rank. A log that cannot be written is reported once and stops nothing.
JobLog open_log(const RunOptions& options, int rank) {
  JobLog log(options.directory, rank, options.log);
  if (!log.problem().empty())
    std::fprintf(stderr, "megablock: warning: no log is written for rank %d: %s\n", rank, log.problem().c_str());
  return log;
}

// The job.json of a job.
std::string job_text(const JobStore& store) {
  std::ifstream file(store.path("job.json"));
  return {std::istreambuf_iterator<char>(file), {}};
}

// Runs the stages. An error that ends the run is written as the last line of the log.
void run_logged(const Job& job, const JobRecord& record, const std::function<void()>& stages) {
  try {
    stages();
    job.log.write(LogLevel::kInfo, "", "", "done, " + counted(std::ssize(record.failures), "failed unit"));
  } catch (const Interrupted& stop) {
    job.log.write(LogLevel::kInfo, "", "", stop.what());
    throw;
  } catch (const std::exception& error) {
    job.log.write(LogLevel::kError, "", "", error.what());
    throw;
  }
}

using Stages = std::function<void(const Job& job, JobRecord& record, JobBlock& own, const std::string& tie_points)>;

// Opens the job, runs the stages and returns the exit code.
int with_job(const RunOptions& run_options, Communicator& ranks, const Stages& stages) {
  // The tables of the block then lie in memory that can be given back as a whole (page_tables), apart from blocks that
  // stay.
  use_memory_sparingly();
  JobStore store(run_options.directory);
  std::optional<JobLock> lock;
  JobLog log;
  const std::string text = on_first_rank(ranks, [&] {
    if (run_options.half.half != Half::kNone) {  // the job is a copy of a finished one (cluster/stages/split_test.h)
      lock.emplace(store);
      log = open_log(run_options, ranks.rank());
      return job_text(store);
    }
    Project project = read_whole_project(run_options);
    refuse_other_folders(store);
    store.create();
    lock.emplace(store);
    log = open_log(run_options, ranks.rank());
    return prepare(run_options, store, log, std::move(project));
  });
  if (ranks.rank() != 0) log = open_log(run_options, ranks.rank());
  const JobJson written(store.path("job.json"), text);
  const auto tie_points = written.at<std::string>("tie_points");
  if (tie_points.empty())
    keep_freed_memory();  // features of images come next
  else
    use_memory_sparingly();  // gives back the heap that the preparation has freed, too
  JobBlock own = open_block(store, tie_points);
  JobOptions settings = read_options(written.settings());
  settings.adjustment.observations.half = run_options.half;
  const Job job{.options = completed(run_options, ranks),
                .ranks = ranks,
                .store = store,
                .settings = std::move(settings),
                .log = std::move(log),
                .block = own.block,
                .tables = own.tables,
                .generations = written.at<std::vector<std::int64_t>>("generations")};
  omp_set_num_threads(job.options.threads);  // the default inside tiles
  JobRecord record{.events = EventLog(store, ranks.rank()),
                   .stages = {},
                   .failures = {},
                   .notes = written.at<std::vector<std::string>>("warnings")};
  for (const auto& [file, reason] : written.at<std::vector<std::pair<std::string, std::string>>>("unreadable"))
    record.failures.push_back({"init", file, reason});
  job.log.write(LogLevel::kInfo, "", "",
                fmt::format("{} works on {} as rank {} of {} with {}", kProgram, run_options.project, ranks.rank(),
                            ranks.size(), counted(job.options.threads, "thread")));
  for (const std::string& warning : record.notes) job.log.write(LogLevel::kWarning, "init", "", warning);
  run_logged(job, record, [&] { stages(job, record, own, tie_points); });
  ranks.barrier();  // the lock is held until all ranks are done
  return record.failures.empty() ? kExitDone : kExitFailedUnits;
}

}  // namespace

int run_job(const RunOptions& options, Communicator& ranks) { return with_job(options, ranks, run_all); }

namespace {

void refuse_environment(const Job& job, const std::string& command) {
  on_first_rank(job.ranks, [&] {
    megablock::refuse_environment(job.settings.environment, command);
    return std::string();
  });
}

// All ranks get the same settings, and all of them refuse wrong ones together.
void check_once(Communicator& ranks, const auto& settings) {
  on_first_rank(ranks, [&] {
    settings.check();
    return std::string();
  });
}

}  // namespace

int register_job(const RunOptions& options, const RegistrationSettings& settings, Communicator& ranks) {
  check_once(ranks, settings);
  return with_job(options, ranks, [&](const Job& job, JobRecord& record, JobBlock& own, const std::string& tie_points) {
    refuse_environment(job, "register");
    if (!tie_points.empty()) restore_names(job.store, own);
    const TrackSource source = track_source(job, record, own, tie_points);
    const RegistrationSummary summary = run_registration(job, record, own.block, source, settings);
    if (job.is_first_rank()) std::printf("%s", to_text(summary).c_str());
  });
}

int calibrate_job(const RunOptions& options, const CalibrationSettings& settings, Communicator& ranks) {
  check_once(ranks, settings.rig);
  return with_job(options, ranks, [&](const Job& job, JobRecord& record, JobBlock& own, const std::string& tie_points) {
    refuse_environment(job, "calibrate");
    on_first_rank(ranks, [&] {  // before hours of matching
      calibration_block(job.block, settings.rig);
      return std::string();
    });
    if (!tie_points.empty()) restore_names(job.store, own);
    CalibrationSettings with_options = settings;
    with_options.rig.adjustment = job.settings.adjustment;
    calibrate_rigs(job, record, own, tie_points, with_options);
  });
}

}  // namespace megablock
