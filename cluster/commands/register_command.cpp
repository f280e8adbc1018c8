#include "cluster/commands/register_command.h"

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "adjust/registration/frame_resection.h"
#include "cluster/job/stage.h"
#include "cluster/process/exit_codes.h"
#include "cluster/stages/pipeline.h"
#include "cluster/terminal/option_checks.h"
#include "cluster/terminal/output_check.h"
#include "geometry/numbers/angles.h"
#include "io/base/error.h"
#include "io/project/project.h"
#include "io/text/csv_row.h"

namespace megablock {

namespace {

struct ResectOptions {
  std::string project, output;
  bool without_trajectory = false;
  RigResectionOptions resection;
};

std::vector<Pose> starts_of(const Block& block, const TrajectoryOptions& options) {
  return trajectory_of(block, options).input.start;
}

int resect(const ResectOptions& options) {
  options.resection.check();
  check_output(options.output, inputs_of(options.project));
  const Project project = read_project(options.project, settings_sections());
  const Block& block = project.block;
  if (std::none_of(block.control_points.begin(), block.control_points.end(), [](const ControlPoint& point) {
        return point.role == PointRole::kControl && !point.measurements.empty();
      }))
    throw InputError(options.project + ": no measured control points; give 'control' in the project file");
  const std::vector<Pose> start = options.without_trajectory ? std::vector<Pose>() : starts_of(block, {});
  std::string csv = "name,qw,qx,qy,qz,x,y,z,position_sigma_m,rotation_sigma_deg,points,seen,angle_deg,rms_px,note\n";
  int resected = 0, refused = 0, warned = 0;
  for (const FrameResection& r : resect_frames(block, start, {}, options.resection)) {
    const std::string& name = block.frames[r.frame].name;
    if (!r.refused.empty()) {
      ++refused;
      std::printf("%s: refused: %s\n", name.c_str(), r.refused.c_str());
      continue;
    }
    ++resected;
    const RigResection& s = r.resection;
    for (const std::string& warning : s.warnings) std::printf("%s: warning: %s\n", name.c_str(), warning.c_str());
    warned += !s.warnings.empty();
    const Eigen::Quaterniond& q = s.pose.rotation;
    const Eigen::Vector3d& c = s.pose.centre;
    csv += fmt::format("{},{},{},{},{},{},{},{},{:.5f},{:.5f},{},{},{:.1f},{:.3f},{}\n", csv_field(name), q.w(), q.x(),
                       q.y(), q.z(), c.x(), c.y(), c.z(), std::sqrt(s.covariance.bottomRightCorner<3, 3>().trace()),
                       std::sqrt(s.covariance.topLeftCorner<3, 3>().trace()) / kDegree, s.points, r.points, s.angle_deg,
                       s.rms_px, csv_field(s.warnings.empty() ? "" : s.warnings.front()));
  }
  std::printf("%d frames resected (%d with a warning), %d refused\n", resected, warned, refused);
  const std::filesystem::path path = std::filesystem::absolute(options.output);
  JobStore(path.parent_path().string()).write_text(path.filename().string(), csv);
  return kExitDone;
}

}  // namespace

void add_resect(CLI::App& app, std::function<int()>& action) {
  auto options = std::make_shared<ResectOptions>();
  RigResectionOptions& r = options->resection;
  CLI::App* command = app.add_subcommand("resect", "Poses of frames from the control points that their cameras see");
  command->footer("Example: megablock resect block.yaml -o resected.csv");
  command->add_option("project", options->project, "Project file with control points and rigs")->required();
  command->add_option("-o,--output", options->output, "CSV to write: poses, sigmas, warnings")
      ->check(named())
      ->required();
  command->add_flag("--without-trajectory", options->without_trajectory,
                    "Without approximate poses: three points are then ambiguous");
  command->add_option("--min-points", r.min_points, "Fewest inlier points")->capture_default_str();
  command->add_option("--max-error", r.max_error_sigmas, "Largest residual of an inlier, sigmas")
      ->capture_default_str();
  command->add_option("--max-sigma", r.max_position_sigma_m, "Sigma of the position above which a pose is refused, m")
      ->capture_default_str();
  command->callback([=, &action] { action = [options] { return resect(*options); }; });
}

void add_register(CLI::App& app, std::function<int()>& action, Communicator& ranks) {
  struct Options {
    RunOptions run;
    RegistrationSettings settings;
    std::string check_points = "tie";
  };
  auto options = std::make_shared<Options>();
  RegistrationSettings& s = options->settings;
  CLI::App* command = app.add_subcommand(
      "register",
      "Register the passes of a trajectory with one another and adjust it with positions, attitudes and control");
  command->footer(
      "Example: megablock register block.yaml -j job\n"
      "         mpirun --bind-to none -n 2 megablock register block.yaml -j job\n"
      "         megablock run job/register/block.yaml -j job2      (bundle adjustment from there)");
  command->add_option("project", options->run.project, "Project file")->required();
  command->add_option("-j,--job", options->run.directory, "Job directory; an unfinished one is resumed")
      ->check(named())
      ->required();
  command->add_option("--threads", options->run.threads, "Threads per rank; 0 = cores of the host / ranks on it")
      ->check(threads());
  add_log_level(*command, options->run.log.level);
  command->add_flag("-q,--quiet", options->run.quiet, "Do not show progress");
  command->add_flag_callback(
      "--hold-rig", [options] { options->settings.estimate_rig = false; },
      "Cameras and mounts as given; else free ones are estimated first");
  command->add_option("--alpha", s.places.alpha_m, "Radius of the alpha shape, m")
      ->check(positive())
      ->capture_default_str();
  command->add_option("--z-stretch", s.places.z_stretch, "Stretch of heights in it")
      ->check(positive())
      ->capture_default_str();
  command->add_option("--d-cons", s.places.registration_spacing, "Frames between two registrations of a pass pair")
      ->check(positive())
      ->capture_default_str();
  command->add_option("--places-per-unit", s.units_places, "2x2: places that a rank registers at a time")
      ->check(positive())
      ->capture_default_str();
  command->add_option("--iterations", s.pairs.iterations, "2x2: iterations")->capture_default_str();
  command->add_option("--first-threshold", s.pairs.first_threshold_px, "2x2: threshold of the published start, px")
      ->capture_default_str();
  command->add_option("--last-threshold", s.pairs.last_threshold_px, "2x2: last threshold, px")->capture_default_str();
  command->add_flag_callback(
      "--published-start", [options] { options->settings.pairs.robust_start = false; },
      "2x2: start from the trajectory, not from a resection");
  command->add_option("--min-frames", s.pairs.min_frames, "2x2: frames of the four that must see a point, 3 or 4")
      ->capture_default_str();
  command->add_option("--min-measurements", s.pairs.min_measurements, "2x2: measurements that must stay")
      ->capture_default_str();
  command->add_option("--max-sigma", s.pairs.max_position_sigma_m, "2x2: sigma above which a place is refused, m")
      ->capture_default_str();
  command
      ->add_option(
          "--chain-sigma", s.trajectory.chain_position_sigma_m,
          "Sigma of the relative positions of successive frames, m; 0: as stated, with --chain-rotation-sigma 0")
      ->capture_default_str();
  command
      ->add_option("--chain-rotation-sigma", s.trajectory.chain_rotation_sigma_deg,
                   "Sigma of the relative rotations of successive frames, degrees")
      ->capture_default_str();
  command->add_flag_callback(
      "--no-registrations", [options] { options->settings.use_registrations = false; },
      "Chain and absolute data alone");
  command->add_flag_callback(
      "--no-positions", [options] { options->settings.joint.use_positions = false; },
      "Positions of the trajectory take no part");
  command->add_flag_callback(
      "--no-control", [options] { options->settings.trajectory.use_control = false; },
      "Image measurements of control points take no part");
  command->add_flag("--resections", s.use_resections,
                    "Frames that see three control points are resected and held to it");
  command->add_option("--check-points", options->check_points, "tie: measurements take part | ignore")
      ->check(CLI::IsMember({"tie", "ignore"}))
      ->capture_default_str();
  command->add_option("--check-prefix", s.trajectory.check_prefix,
                      "Control points whose names begin so are check points (leave one zone out)");
  command->callback([=, &action, &ranks] {
    action = [options, &ranks] {
      using Use = TrajectoryOptions::CheckPoints;
      options->settings.trajectory.check_points = options->check_points == "tie" ? Use::kTie : Use::kIgnore;
      return register_job(options->run, options->settings, ranks);
    };
  });
}

}  // namespace megablock
