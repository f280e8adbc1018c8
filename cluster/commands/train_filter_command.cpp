#include "cluster/commands/train_filter_command.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "cluster/job/given_tracks.h"
#include "cluster/job/stage.h"
#include "cluster/process/exit_codes.h"
#include "cluster/terminal/option_checks.h"
#include "cluster/terminal/output_check.h"
#include "io/base/error.h"
#include "io/project/project.h"
#include "io/simulate/blocks/simulate.h"
#include "io/simulate/files/write.h"
#include "io/store/job/job_store.h"
#include "match/filter/filter_training.h"

namespace megablock {

namespace {

namespace fs = std::filesystem;

struct TrainFilterOptions {
  std::string project, labels, output;
  int samples = 466, repetitions = 5;
  std::uint64_t seed = 1;
};

struct Row {
  const char* name;
  std::vector<MatchFeature> features;
};

// Prints the share of correct classifications by features and number of samples. Each figure is the mean over several
// trainings, with samples drawn anew.
void print_table(const std::vector<LabelledMatch>& matches, const TrainFilterOptions& options) {
  using enum MatchFeature;
  const std::vector<Row> rows = {{"r_im", {kReprojection}},
                                 {"r_im, d", {kReprojection, kDistance}},
                                 {"r_im, d, alpha", {kReprojection, kDistance, kAngle}},
                                 {"r_im, d, alpha, r_M", {kReprojection, kDistance, kAngle, kRayDistance}}};
  const int sizes[] = {186, 278, 372, 466};
  std::printf("classified rightly, %%, by number of training samples (half of them right), mean of %d trainings\n%-22s",
              options.repetitions, "features");
  for (const int size : sizes) std::printf("%8d", size);
  std::printf("\n");
  for (const Row& row : rows) {
    std::printf("%-22s", row.name);
    for (const int size : sizes) {
      double sum = 0;
      for (int k = 0; k < options.repetitions; ++k)
        sum += train_filter(matches, {row.features, size, options.seed + static_cast<std::uint64_t>(k)}).correct;
      std::printf("%8.1f", 100 * sum / options.repetitions);
      std::fflush(stdout);
    }
    std::printf("\n");
  }
}

int train(const TrainFilterOptions& options) {
  const Project project = read_project(options.project, settings_sections());
  if (project.tie_points.empty())
    throw InputError(options.project +
                     ": no 'tie_points'; the filter is trained on given tracks, as 'megablock simulate' writes them");
  const std::string labels =
      !options.labels.empty() ? options.labels : (fs::path(project.file).parent_path() / "truth_tracks.h5").string();
  if (!fs::exists(labels))
    throw InputError(labels + ": no such file; --labels names a file that says which observations are wrong");
  std::vector<std::string> inputs = inputs_of(options.project, "filter_model");
  inputs.push_back(labels);
  check_output(options.output, inputs);
  const TrackSet tracks = read_given_tracks(project.tie_points, project.block);
  const std::vector<LabelledMatch> matches =
      labelled_matches(project.block, tracks, read_truth_tracks(labels).outlier, {}, options.seed);
  const auto right = std::count_if(matches.begin(), matches.end(), [](const LabelledMatch& m) { return m.right; });
  std::printf("%zu labelled matches, %zu of them wrong\n", matches.size(),
              matches.size() - static_cast<std::size_t>(right));
  if (options.repetitions > 0) print_table(matches, options);
  TrainingOptions training;
  training.samples = options.samples;
  training.seed = options.seed;
  const TrainedFilter filter = train_filter(matches, training);
  std::printf("%s: %d samples, %.1f %% of %lld others right (%.1f %% of the right, %.1f %% of the wrong ones)\n",
              options.output.c_str(), options.samples, 100 * filter.correct, static_cast<long long>(filter.tested),
              100 * filter.correct_of[1], 100 * filter.correct_of[0]);
  const fs::path path = fs::absolute(options.output);
  JobStore(path.parent_path().string()).write_text(path.filename().string(), filter.yaml);
  return kExitDone;
}

}  // namespace

void add_train_filter(CLI::App& app, std::function<int()>& action) {
  auto options = std::make_shared<TrainFilterOptions>();
  CLI::App* command =
      app.add_subcommand("train-filter", "Train the match filter on a block whose wrong matches are known");
  command->footer(
      "Example: megablock simulate --scene stereopolis --frames 800 --outliers 0.1 -o street\n"
      "         megablock train-filter street/block.yaml -o filter.yaml\n"
      "         and in a project: matching: {filter: true, filter_model: filter.yaml}");
  command->add_option("project", options->project, "Project file with tie points")->required();
  command->add_option("-o,--output", options->output, "Model to write (YAML)")->check(named())->required();
  command->add_option("--labels", options->labels,
                      "HDF5 with observations/outlier, 0 = right [truth_tracks.h5 beside the project]");
  command->add_option("--samples", options->samples, "Training samples of the model, half of them right")
      ->capture_default_str();
  command->add_option("--repetitions", options->repetitions, "Trainings per figure of the table; 0: no table")
      ->capture_default_str();
  command->add_option("--seed", options->seed, "Of the choice of samples")->capture_default_str();
  command->callback([=, &action] { action = [options] { return train(*options); }; });
}

}  // namespace megablock
