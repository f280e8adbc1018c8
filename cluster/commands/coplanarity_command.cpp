#include "cluster/commands/coplanarity_command.h"

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "adjust/coplanarity/coplanarity_block.h"
#include "cluster/job/job_options.h"
#include "cluster/job/job_so_far.h"
#include "cluster/process/exit_codes.h"
#include "cluster/terminal/option_checks.h"
#include "cluster/terminal/output_check.h"
#include "geometry/numbers/angles.h"
#include "io/base/error.h"
#include "io/project/inputs/pose_csv.h"
#include "io/report/figures_json.h"
#include "io/text/counted.h"

namespace megablock {

namespace {

using Solver = CoplanarityOptions::Solver;
const std::map<std::string, Solver> kSolvers = {{"lsqr", Solver::kLsqr}, {"direct", Solver::kDirect}};

// The normal equations of all angles are one full matrix. For this many frames it has 3 million numbers and takes a few
// seconds.
constexpr std::size_t kMostFrames = 600;

struct CoplanarityCommand {
  std::string job, output, hold = "none", solver = "lsqr";
  double forcing = 0.02;       // the published value
  double angle_sigma_deg = 0;  // 0: that of the observed attitudes
  double image_sigma_px = 0;   // 0: that of the job
  int steps = 1;
  bool json = false;
};

CoplanarityOptions options_of(const CoplanarityCommand& command, const JobOptions& job, const CoplanarityBlock& block) {
  CoplanarityOptions options;
  options.solver = kSolvers.at(command.solver);
  options.forcing_angles = options.forcing_images = command.forcing;
  options.steps = command.steps;
  options.image_sigma_px =
      command.image_sigma_px > 0 ? command.image_sigma_px : job.adjustment.observations.image_sigma_px;
  options.angle_sigma_rad = command.angle_sigma_deg > 0 ? command.angle_sigma_deg * kDegree : block.angle_sigma_rad;
  if (!(options.angle_sigma_rad > 0))
    throw InputError(
        "coplanarity: no attitudes were observed; give the sigma of the start attitudes with --angle-sigma");
  return options;
}

void write_poses(const CoplanarityBlock& block, const CoplanarityNetwork& network, const Block& names,
                 const std::string& output) {
  PoseTable table;
  if (names.ground.georeferenced) table.ground = names.ground;
  for (std::size_t i = 0; i < block.frames.size(); ++i) {
    table.names.push_back(names.frames[block.frames[i]].name);
    table.poses.push_back(block.frame_pose(i, network.angles[i]));
  }
  write_pose_csv(std::filesystem::absolute(output).string(), table);
}

double rms_turn(const CoplanarityNetwork& before, const CoplanarityNetwork& after) {
  double squares = 0;
  for (std::size_t i = 0; i < before.angles.size(); ++i)
    squares += std::pow(rotation_angle(rotation_from(before.angles[i]), rotation_from(after.angles[i])), 2);
  return std::sqrt(squares / static_cast<double>(before.angles.size()));
}

double rms_shift(const CoplanarityNetwork& before, const CoplanarityNetwork& after) {
  double squares = 0;
  for (std::size_t o = 0; o < before.image.size(); ++o) squares += (before.image[o] - after.image[o]).squaredNorm() / 2;
  return std::sqrt(squares / static_cast<double>(before.image.size()));
}

// The figures as JSON; an infinite condition becomes null.
std::string figures_json(const CoplanarityBlock& block, const CoplanaritySolution& found) {
  const CoplanarityDiagnosis& d = found.diagnosis;
  const double condition = d.angle_condition();
  return nlohmann::ordered_json{
      {"frames", block.frames.size()},
      {"frames_left_out", block.frames_left_out},
      {"points", block.network.point_count()},
      {"points_left_out", block.points_left_out},
      {"equations", d.rows},
      {"parameters", d.columns},
      {"rank", d.rank},
      {"open_directions", found.open_directions},
      {"angle_condition", std::isfinite(condition) ? nlohmann::ordered_json(condition) : nlohmann::ordered_json()},
      {"collinear", d.collinear},
      {"held_contradicted", found.held_contradicted},
      {"mean_determinant_before_m", found.mean_before},
      {"mean_determinant_after_m", found.mean_after},
      {"iterations", found.iterations},
      {"rms_turn_deg", rms_turn(block.network, found.network) * kDegreesPerRadian},
      {"rms_image_correction_px", rms_shift(block.network, found.network)},
      {"remarks", found.remarks()}}
      .dump(1);
}

std::string figures_text(const CoplanarityBlock& block, const CoplanaritySolution& found) {
  const CoplanarityDiagnosis& d = found.diagnosis;
  std::string text =
      fmt::format("{} frames ({} left out), {} points ({} left out), {} equations\n", block.frames.size(),
                  block.frames_left_out, block.network.point_count(), block.points_left_out, d.rows);
  text += fmt::format("they determine {} of {} parameters; condition of the angles {:.3g}\n", d.rank, d.columns,
                      d.angle_condition());
  text += fmt::format("mean |F| {:.4g} m before, {:.4g} m after; {}\n", found.mean_before, found.mean_after,
                      counted(found.iterations, "iteration"));
  text +=
      fmt::format("attitudes turned by {:.4g} degrees, images moved by {:.3g} px (rms)\n",
                  rms_turn(block.network, found.network) * kDegreesPerRadian, rms_shift(block.network, found.network));
  for (const std::string& line : found.remarks()) text += "note: " + line + "\n";
  return text;
}

int adjust(const CoplanarityCommand& command) {
  const JobStore store(command.job);
  check_output(command.output, inputs_of(command.job, "poses"));
  const JobOptions settings = options_of_job(store);
  const JobSoFar job = read_job_so_far(store);
  std::vector<TrackSet> tracks;
  visit_tracks(store, [&](TrackSet&& set) { tracks.push_back(std::move(set)); });
  if (tracks.empty()) throw InputError(command.job + ": the job has no tie points yet; run 'megablock match' first");
  CoplanarityBlock block = coplanarity_block(job.block, job.state, tracks);
  if (block.frames.size() > kMostFrames)
    throw InputError(
        fmt::format("{}: {} frames; the determinant method, a comparison, takes up to {}: 'megablock run' "
                    "adjusts them",
                    command.job, block.frames.size(), kMostFrames));
  if (command.hold == "angles") block.network.angles_held.assign(3 * block.network.angles.size(), 1);
  if (command.hold == "images") block.network.images_held.assign(2 * block.network.image.size(), 1);
  const CoplanaritySolution found = adjust_by_coplanarity(block.network, options_of(command, settings, block));
  write_poses(block, found.network, job.block, command.output);
  std::printf("%s", command.json ? (figures_json(block, found) + "\n").c_str() : figures_text(block, found).c_str());
  if (!command.json) std::printf("%s\n", command.output.c_str());
  return kExitDone;
}

}  // namespace

void add_coplanarity(CLI::App& app, std::function<int()>& action) {
  auto options = std::make_shared<CoplanarityCommand>();
  CLI::App* command = app.add_subcommand(
      "coplanarity", "Attitudes from known positions by the determinant method, without ground points, for comparison");
  command->footer(
      "Example: megablock match block.yaml -j job && megablock coplanarity job -o attitudes.csv\n"
      "         megablock coplanarity job -o attitudes.csv --forcing 0 --hold images --solver direct --steps 3");
  command->add_option("job", options->job, "Job directory, with tie points")->required();
  command->add_option("-o,--output", options->output, "Pose CSV to write")->check(named())->required();
  command
      ->add_option("--forcing", options->forcing,
                   "Weight that keeps angles and images near their start; 0: no weight; the system is singular unless "
                   "some are held")
      ->check(not_negative())
      ->capture_default_str();
  command->add_option("--hold", options->hold, "What is held at its start: none | angles | images")
      ->check(CLI::IsMember({"none", "angles", "images"}))
      ->capture_default_str();
  command
      ->add_option("--solver", options->solver, "lsqr: as published; direct: sparse QR, refuses what is not determined")
      ->check(CLI::IsMember({"lsqr", "direct"}))
      ->capture_default_str();
  command->add_option("--steps", options->steps, "Linearisations")->check(positive())->capture_default_str();
  command->add_option("--angle-sigma", options->angle_sigma_deg, "Of the start, degrees [of the observed attitudes]")
      ->check(positive());
  command->add_option("--image-sigma", options->image_sigma_px, "px [adjustment.image_sigma_px of the job]")
      ->check(positive());
  command->add_flag("--json", options->json, "Figures as JSON");
  command->callback([=, &action] { action = [options] { return adjust(*options); }; });
}

}  // namespace megablock
