#include "cluster/commands/command_line.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <thread>

#include "cluster/commands/calibrate_command.h"
#include "cluster/commands/coplanarity_command.h"
#include "cluster/commands/diagnose_command.h"
#include "cluster/commands/masks_command.h"
#include "cluster/commands/measurements_command.h"
#include "cluster/commands/register_command.h"
#include "cluster/commands/simulate_command.h"
#include "cluster/commands/train_filter_command.h"
#include "cluster/commands/verticals_command.h"
#include "cluster/job/stage.h"
#include "cluster/mpi/collective.h"
#include "cluster/mpi/communicator.h"
#include "cluster/outcome/diagnostics.h"
#include "cluster/outcome/monolithic_comparison.h"
#include "cluster/process/arithmetic.h"
#include "cluster/process/exit_codes.h"
#include "cluster/process/version.h"
#include "cluster/stages/pipeline.h"
#include "cluster/stages/split_test.h"
#include "cluster/status/status.h"
#include "cluster/terminal/help_text.h"
#include "cluster/terminal/option_checks.h"
#include "cluster/terminal/output_check.h"
#include "cluster/terminal/terminal_text.h"
#include "cluster/terminal/wrong_usage.h"
#include "io/base/error.h"
#include "io/base/file_error.h"
#include "io/evaluation/evaluate.h"
#include "io/exchange/export.h"
#include "io/exchange/import.h"
#include "io/project/project.h"
#include "io/project/project_init.h"
#include "io/report/report.h"
#include "io/result/check.h"
#include "io/store/job/job_lock.h"

namespace megablock {

namespace {

// The path of a finished job's result. Warns when the result is older than the last request to the job.
std::string finished_result(const std::string& job) {
  const JobStore store(job);
  if (!std::filesystem::exists(store.path("job.json")))
    throw InputError(job + ": is not a job directory (no job.json); name the folder given to 'run -j'");
  if (!store.seal(kResult)) throw InputError(job + ": the job has no result yet; run it to the end first");
  for (const std::string& line : unfinished_stages(store))
    std::fprintf(stderr, "megablock: warning: %s: this is an older result; %s\n", job.c_str(), line.c_str());
  return store.verified_path(kResult);
}

void add_init(CLI::App& app, Action& action) {
  auto options = std::make_shared<InitOptions>();
  CLI::App* command = app.add_subcommand("init", "Scan images (EXIF, XMP) and write the project file");
  command->footer("Example: megablock init images -o block.yaml");
  command->add_option("images", options->images, "Folder of images, searched recursively")->required();
  command->add_option("-o,--output", options->output, "Project file to write")->check(named())->capture_default_str();
  command->add_option("--control", options->gcp_file, "Control points: gcp_list.txt, OpenSfM JSON or CSV");
  command->add_option("--masks", options->mask_folder, "Folder of PNG masks, one per camera: <camera>.png");
  command->add_option("--cameras", options->camera_grouping, "How images share a camera")
      ->check(CLI::IsMember({"exif", "folder", "one"}))
      ->capture_default_str();
  command->callback([=, &action] {
    action = [options] {
      check_output(options->output);
      std::printf("%s\n", init_project(*options).c_str());
      return kExitDone;
    };
  });
}

void print_result(const RunOptions& options) {
  const JobStore store(options.directory);
  std::printf("%s", for_terminal(status_text(store)).c_str());
  if (store.seal(kResult)) std::printf("report: %s\n", store.path(kReportPage).c_str());
}

// `last`: the stage that the command ends with; nullptr: it runs all of them.
void add_run(CLI::App& app, Action& action, Communicator& ranks, const std::string& name, const Stage* last,
             const std::string& help) {
  auto options = std::make_shared<RunOptions>();
  if (last != nullptr) options->last_stage = name;
  CLI::App* command = app.add_subcommand(name, help);
  command->footer("Example: megablock " + name + " block.yaml -j job\n         mpirun --bind-to none -n 2 megablock " +
                  name + " block.yaml -j job");
  command->add_option("project", options->project, "Project file")->required();
  command->add_option("-j,--job", options->directory, "Job directory; an unfinished one is resumed")
      ->check(named())
      ->required();
  command->add_option("--threads", options->threads, "Threads per rank; 0 = cores of the host / ranks on it")
      ->check(threads());
  command
      ->add_option("--memory", options->memory_mib,
                   "Memory per rank for tiles and factors of the merge, MiB; beyond it they go to the job's scratch")
      ->check(mebibytes(kMostMib));
  command
      ->add_option(
          "--scratch", options->scratch_mib,
          "Most disk space per rank in the job's scratch during the merge, MiB; when it is used up (0: at once) tiles "
          "stay in memory, factors are computed again, sweeps are not recorded")
      ->check(mebibytes(kMostMib));
  command
      ->add_option(
          "--record", options->record_s,
          "Seconds of work in a sweep of the merge between two records in the job's scratch, from which a killed "
          "run resumes; 0: a record after every tile")
      ->check(not_negative());
  auto level = std::make_shared<std::string>();  // read before there is a parser
  command
      ->add_option(kArithmeticOption, *level,
                   "Instructions of the whole job, avx2 or avx512: the latter is faster and gives other last digits. "
                   "Default: avx2")
      ->check(CLI::IsMember(std::vector<std::string>(std::begin(kArithmeticLevels), std::end(kArithmeticLevels))));
  command->add_flag("--strict", options->strict, "End at the first failed unit");
  add_log_level(*command, options->log.level);
  command->add_flag("-q,--quiet", options->quiet, "Do not show progress");
  auto monolithic = std::make_shared<bool>(false);
  if (last != nullptr && last->iterates)
    command->add_flag("--monolithic", *monolithic,
                      "Then compare with one monolithic adjustment of the same observations (JSON)");
  command->callback([=, &action, &ranks] {
    action = [options, monolithic, level, &ranks] {
      const int code = run_job(*options, ranks);
      if (ranks.rank() != 0) return code;
      print_result(*options);
      if (*monolithic) std::printf("%s\n", compare_with_monolithic(JobStore(options->directory)).c_str());
      return code;
    };
  });
}

int watch(const JobStore& store) {
  const bool terminal = isatty(STDOUT_FILENO) != 0;
  for (;;) {
    const bool done = job_is_done(store);  // asked before the text, so that the text shows the end
    std::printf("%s%s", terminal ? "\033[H\033[J" : "", for_terminal(status_text(store)).c_str());
    std::fflush(stdout);
    if (done) return kExitDone;
    if (!holder_of(store)) {
      std::printf("  no run is working on this job\n");
      return kExitDone;
    }
    std::this_thread::sleep_for(std::chrono::seconds(2));
  }
}

void add_status(CLI::App& app, Action& action) {
  struct Options {
    std::string job;
    bool json = false, digest = false, watch = false;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("status", "Show the progress and the figures of a job");
  command->footer("Example: megablock status job --json");
  command->add_option("job", options->job, "Job directory")->required();
  command->add_flag("--json", options->json, "All figures as JSON");
  command->add_flag("--digest", options->digest, "Hash of the exact bits of the result");
  command->add_flag("--watch", options->watch, "Repeat every two seconds until the job is done or its run has ended");
  command->callback([=, &action] {
    action = [options] {
      const JobStore store(options->job);
      if (options->watch) return watch(store);
      const std::string text = options->digest ? status_digest(store) + "\n"
                               : options->json ? status_json(store) + "\n"
                                               : for_terminal(status_text(store));
      std::printf("%s", text.c_str());
      return kExitDone;
    };
  });
}

std::vector<StageFiles> files_of_stages() {
  std::vector<StageFiles> files;
  for (const Stage& stage : all_stages())
    files.push_back({stage.kind == nullptr ? "" : stage.kind, stage.read_file,
                     stage.makes_file_by_tile() ? stage.folder() : "", stage.folder(), stage.ending(), stage.check});
  return files;
}

void add_check(CLI::App& app, Action& action) {
  auto job = std::make_shared<std::string>();
  CLI::App* command = app.add_subcommand("check", "Verify every file of a job");
  command->footer("Example: megablock check job");
  command->add_option("job", *job, "Job directory")->required();
  command->callback([=, &action] {
    action = [job] {
      const JobStore store(*job);
      std::vector<std::string> problems = check_job(store, files_of_stages());
      if (std::filesystem::exists(store.path("job.json")))
        for (const std::string& line : unfinished_stages(store)) problems.push_back(*job + ": " + line);
      for (const std::string& problem : problems) std::printf("%s\n", problem.c_str());
      if (problems.empty()) std::printf("%s: every file is whole\n", job->c_str());
      return problems.empty() ? kExitDone : kExitFailedUnits;
    };
  });
}

void add_export(CLI::App& app, Action& action) {
  struct Options {
    std::string job, format, output;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("export", "Write the result in another format");
  command->footer("Example: megablock export job --format colmap-text -o model");
  command->add_option("job", options->job, "Job directory")->required();
  command->add_option("--format", options->format, "Format")->required()->check(CLI::IsMember(export_formats()));
  command->add_option("-o,--output", options->output, "File or folder to write")->check(named())->required();
  command->callback([=, &action] {
    action = [options] {
      check_parent(options->output);
      const std::vector<std::string> inputs = inputs_of(options->job);
      for (const std::string& file : export_files(options->format, options->output)) check_output(file, inputs);
      const BlockResult result = read_result(finished_result(options->job));
      export_result(result, options->format, options->output);
      if (const std::string note = export_note(result, options->format); !note.empty())
        std::printf("Note: %s.\n", note.c_str());
      return kExitDone;
    };
  });
}

void add_import(CLI::App& app, Action& action) {
  struct Options {
    std::string format, path, output;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("import", "Make a project of another program's model");
  command->footer(
      "Example: megablock import colmap-bin sparse/0 -o imported\n"
      "         megablock run imported/block.yaml -j job");
  command->add_option("format", options->format, "Format")->required()->check(CLI::IsMember(import_formats()));
  command->add_option("path", options->path, "COLMAP: folder of the model; BAL, Bundler: file")->required();
  command->add_option("-o,--output", options->output, "Folder of the project to write")->check(named())->required();
  command->callback([=, &action] {
    action = [options] {
      check_output(options->output);
      const ImportedBlock imported = import_block(options->format, options->path);
      write_imported(imported, options->output);
      std::printf("%s/block.yaml: %zu images, %zu cameras, %lld points, %lld observations\n", options->output.c_str(),
                  imported.block.images.size(), imported.block.cameras.size(),
                  static_cast<long long>(imported.tracks.track_count()),
                  static_cast<long long>(imported.tracks.observation_count()));
      return kExitDone;
    };
  });
}

void add_report(CLI::App& app, Action& action) {
  struct Options {
    std::string job, output;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("report", "Write the report page of a finished job again");
  command->footer("Example: megablock report job");
  command->add_option("job", options->job, "Job directory")->required();
  command->add_option("-o,--output", options->output, "Page to write; default: result/report.html of the job")
      ->check(named());
  command->callback([=, &action] {
    action = [options] {
      if (!options->output.empty()) {
        check_parent(options->output);
        check_output(options->output, inputs_of(options->job), kReportPage);
      }
      const JobStore store(options->job);
      const std::string result = finished_result(options->job);
      const auto written =
          std::filesystem::file_time_type::clock::to_sys(std::filesystem::last_write_time(store.path(kResult)));
      BlockResult block = read_result_without_tracks(result);
      const StoredTracks tracks(result);
      const BlockDiagnostics diagnostics = diagnose_result(block, tracks, options_of_job(store).diagnostics);
      const std::string json = to_json(diagnostics, block.block);
      const std::string page =
          report_html(std::move(block), tracks,
                      {options->job, std::chrono::duration<double>(written.time_since_epoch()).count(), &diagnostics});
      if (options->output.empty()) {
        store.write_text(kDiagnostics, json);
        store.write_text(kReportPage, page);
      } else {
        JobStore(std::filesystem::absolute(options->output).parent_path().string())
            .write_text(std::filesystem::path(options->output).filename().string(), page);
      }
      std::printf("%s\n", (options->output.empty() ? store.path(kReportPage) : options->output).c_str());
      return kExitDone;
    };
  });
}

int print_split_test(const RunOptions& run, const SplitTestOptions& test, bool json, Communicator& ranks) {
  on_first_rank(ranks, [&] {
    require_halves(read_result_without_tracks(finished_result(run.directory)));
    return std::string();
  });
  const HalvesComparison halves = run_split_test(run, test, ranks);
  if (ranks.rank() == 0) std::printf("%s\n", (json ? to_json(halves) : to_text(halves)).c_str());
  return kExitDone;
}

void add_evaluate(CLI::App& app, Action& action, Communicator& ranks) {
  struct Options {
    std::string truth;
    bool json = false, halves = false;
    EvaluateOptions evaluation;
    RunOptions run;
    SplitTestOptions test;
  };
  auto options = std::make_shared<Options>();
  options->run.quiet = true;
  CLI::App* command = app.add_subcommand("evaluate", "Compare a job with known poses, or halves of it with each other");
  command->footer("Example: megablock evaluate job truth.csv --json\n         megablock evaluate job --halves");
  command->add_option("job", options->run.directory, "Job directory")->required();
  auto* truth = command->add_option("truth", options->truth,
                                    "Poses: truth.csv of 'simulate', or a CSV file name,qw,qx,qy,qz,x,y,z");
  command
      ->add_flag(
          "--halves", options->halves,
          "Adjust the job again from two halves of its tie points, then of its images for the cameras, and print "
          "the differences over their sigmas")
      ->excludes(truth);
  command
      ->add_option("--divisions", options->test.divisions,
                   "Divisions of the tie points for --halves; default: 16 for up to 50 images, else 4")
      ->check(CLI::Range(1, 1000));
  command->add_option("--threads", options->run.threads, "Threads per rank for --halves; 0 = cores of the host / ranks")
      ->check(threads());
  EvaluateOptions& of_truth = options->evaluation;
  command->add_option("--truth-sigma", of_truth.truth_position_sigma_m, "Sigma of the true positions, m per axis")
      ->check(CLI::NonNegativeNumber);
  command
      ->add_option("--truth-sigma-rotation", of_truth.truth_rotation_sigma_deg, "Sigma of the true attitudes, degrees")
      ->check(CLI::NonNegativeNumber);
  command->add_flag("--scale-sigma", options->evaluation.scale_sigma,
                    "Multiply the posterior sigmas by the a-posteriori sigma");
  command->add_flag("--json", options->json, "Figures as JSON");
  command->add_flag("-q,--quiet", options->test.quiet, "No line for each half");
  command->callback([=, &action, &ranks] {
    if (options->truth.empty() && !options->halves)
      throw CLI::ValidationError("evaluate", "give known poses, or --halves");
    action = [options, &ranks] {
      if (options->halves) return print_split_test(options->run, options->test, options->json, ranks);
      return exit_code_on_first_rank(ranks, [&] {
        const Evaluation evaluation = evaluate(read_result_without_tracks(finished_result(options->run.directory)),
                                               options->truth, options->evaluation);
        std::printf("%s\n", (options->json ? to_json(evaluation) : to_text(evaluation)).c_str());
        return kExitDone;
      });
    };
  });
}

// Answers 'help', no command at all, and an unknown command. Returns the exit code, the same on every rank; only one
// rank writes the message.
std::optional<int> answer_without_command(const CLI::App& app, int argc, char** argv, bool speaks) {
  const std::string name = argc > 1 ? argv[1] : "";
  if (name.empty() || name == "help") {
    if (speaks) std::fprintf(name.empty() ? stderr : stdout, "%s", app.help().c_str());
    return name.empty() ? kExitBadInput : kExitDone;
  }
  if (!is_unknown_command(app, name)) return std::nullopt;
  if (speaks) std::fprintf(stderr, "%s\n", unknown_command_message(app, name).c_str());
  return kExitBadInput;
}

int exit_code_of(const std::exception& error) {
  if (dynamic_cast<const Interrupted*>(&error)) return kExitInterrupted;
  return dynamic_cast<const InputError*>(&error) ? kExitBadInput : kExitFailedUnits;
}

// Runs the action. An error that all ranks agree on is reported once. An error of a single rank ends the others, which
// would wait for it.
int run_action(const CLI::App& app, const Action& action, Communicator& ranks) {
  try {
    return action();
  } catch (const std::exception& error) {
    const bool agreed = dynamic_cast<const Agreed*>(&error) != nullptr;
    const bool input = dynamic_cast<const InputError*>(&error) != nullptr;
    if (!agreed || ranks.rank() == 0)
      std::fprintf(stderr, "megablock: %s\n", input ? with_given_value(app, error.what()).c_str() : error.what());
    if (!agreed && ranks.size() > 1) ranks.abort(exit_code_of(error));
    return exit_code_of(error);
  }
}

}  // namespace

int command_line(int argc, char** argv) {
  CLI::App app{
      "megablock orients image blocks of any size: it adjusts them in tiles on several processes, exactly and "
      "resumably."};
  app.name("megablock");
  app.formatter(std::make_shared<HelpText>());
  app.set_version_flag("--version", std::string(kProgram) + " (arithmetic level " + arithmetic_level() + ")");
  app.require_subcommand(1);
  app.failure_message([](const CLI::App* command, const CLI::Error& error) {
    for (const CLI::App* chosen : command->get_subcommands())
      return usage_message(*chosen, "megablock " + chosen->get_name(), error);
    return usage_message(*command, command->get_name(), error);
  });
  app.footer(
      "Exit codes: 0 done, 1 finished with failed units, 2 usage or bad input,\n"
      "            75 interrupted and resumable.\n"
      "Forms:\n  megablock init IMAGES -o block.yaml\n  megablock run block.yaml -j JOB      (again = resume)\n"
      "  mpirun --bind-to none -n N megablock run block.yaml -j JOB\n  megablock status JOB [--json|--digest]\n");
  try {
    pin_arithmetic(argc, argv);
    limit_libraries_to_one_thread();
    Communicator ranks(&argc, &argv);
    Action action;  // of all ranks together
    Action by_one;  // of a command that knows nothing of ranks; only the first rank runs it
    add_init(app, by_one);
    add_run(app, action, ranks, "run", nullptr, "Run all stages; the same command again resumes");
    for (const Stage& stage : all_stages())
      if (stage.help != nullptr) add_run(app, action, ranks, stage.command, &stage, stage.help);
    add_calibrate(app, action, ranks);
    add_masks(app, by_one);
    add_verticals(app, by_one);
    add_train_filter(app, by_one);
    add_resect(app, by_one);
    add_register(app, action, ranks);
    add_status(app, by_one);
    add_report(app, by_one);
    add_diagnose(app, by_one);
    add_coplanarity(app, by_one);
    add_export(app, by_one);
    add_measurements(app, by_one);
    add_import(app, by_one);
    add_evaluate(app, action, ranks);
    add_simulate(app, by_one);
    add_check(app, by_one);
    if (const std::optional<int> code = answer_without_command(app, argc, argv, ranks.rank() == 0)) return *code;
    try {
      app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
      const int code = ranks.rank() == 0 ? app.exit(error) : error.get_exit_code();
      return code == 0 ? kExitDone : kExitBadInput;
    }
    if (by_one) action = [&] { return exit_code_on_first_rank(ranks, by_one); };
    return run_action(app, action, ranks);
  } catch (const std::exception& error) {  // before there are ranks
    std::fprintf(stderr, "megablock: %s\n", error.what());
    return exit_code_of(error);
  }
}

}  // namespace megablock
