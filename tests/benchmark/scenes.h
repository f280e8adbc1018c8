// Makes the simulated blocks for benchmarks of whole adjustments, and runs the program on them.
//
// street: a grid of 100 m whose streets are driven twice, a frame of ten cameras every 4 m, 1 000 observations per
// frame, five per point, 0.5 px; position priors of 0.5 m for half of the frames, relative poses of 1 cm and 0.01
// degrees; calibration held. The start values are the relative poses, integrated over whole passes and off by up to 2
// m. aerial: overlaps of 80 % and 60 %, 300 points per image, GNSS of 0.05 m, attitudes of 0.02 degrees; the camera is
// calibrated.
//
// With shared calibration, a street has eight free intrinsics of every camera, and six unknowns with weak priors (1
// degree, 0.1 m) of every mount except the first one; an aerial block has seven free intrinsics. A free block has no
// positions and attitudes, but a street keeps its relative poses.
#pragma once

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>

#include "io/base/error.h"
#include "io/store/units/block_file.h"

namespace megablock {

struct SceneOptions {
  std::string scene = "street";
  std::int64_t frames = 1000;
  std::uint64_t seed = 1;
  std::filesystem::path folder;  // empty: a temporary one, removed at the end
  std::string calibration;       // "held", "shared"; empty: as the scene says
  bool free = false;
};

inline void add_scene_options(CLI::App& app, SceneOptions& options) {
  app.add_option("--scene", options.scene, "street or aerial")->check(CLI::IsMember({"street", "aerial"}));
  app.add_option("--frames", options.frames, "Frames")->check(CLI::Range(10, 10'000'000));
  app.add_option("--seed", options.seed, "Seed of the simulation");
  app.add_option("--folder", options.folder, "Where block and job go and stay; by default nothing stays");
}

inline void run_command(const std::string& command) {
  std::fprintf(stderr, "%s\n", command.c_str());
  if (const int status = std::system((command + " >&2").c_str()); status != 0)
    throw ComputeError("'" + command + "' ended with " + std::to_string(status));
}

inline std::string on_ranks(int ranks) {
  const std::string as_root = "OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 ";
  return (::geteuid() == 0 ? as_root : "") + "mpirun --bind-to none --oversubscribe -n " + std::to_string(ranks) + " ";
}

inline std::string program() {
  const std::filesystem::path here = std::filesystem::canonical("/proc/self/exe").parent_path();
  return "'" + (here / "../../megablock").string() + "' ";
}

inline std::string block_of(const std::filesystem::path& folder) {
  return "'" + (folder / "block.yaml").string() + "' ";
}

// And what the simulator holds of cameras that are estimated, their third radial parameter.
inline void free_cameras_and_mounts(const std::filesystem::path& given) {
  Block block = read_block(given.string());
  for (Camera& camera : block.cameras) camera.prior_sigma[kRadial3] = std::numeric_limits<double>::infinity();
  for (Rig& rig : block.rigs)
    for (std::size_t m = 1; m < rig.mounts.size(); ++m) {
      rig.mounts[m].rotation_sigma_rad = std::numbers::pi / 180;
      rig.mounts[m].position_sigma_m = 0.1;
    }
  write_block(given.string(), block);
}

inline bool calibration_held(const SceneOptions& options) {
  return options.calibration.empty() ? options.scene == "street" : options.calibration == "held";
}

// What a folder's block was made of, and what once was otherwise. Streets with shared calibration had seven free
// intrinsics.
inline nlohmann::json description_of(const SceneOptions& options, const std::string& project_lines) {
  nlohmann::json description{{"scene", options.scene}, {"frames", options.frames},
                             {"seed", options.seed},   {"calibration", options.calibration},
                             {"free", options.free},   {"project_lines", project_lines}};
  if (options.scene == "street") description["start"] = "whole passes";  // once over stretches of 1 km
  if (options.scene == "street" && !calibration_held(options)) description["intrinsics"] = 8;
  return description;
}

// Unless the folder holds this very block. `project_lines` are added to its project file.
inline void simulate_scene(const SceneOptions& options, const std::filesystem::path& folder,
                           const std::string& project_lines = {}) {
  const std::string description = description_of(options, project_lines).dump();
  if (std::filesystem::exists(folder / "block.yaml")) {
    std::string there;
    std::getline(std::ifstream(folder / "scene.json"), there);
    if (there == description) return;
    throw InputError(folder.string() + ": holds another block (" + (there.empty() ? "no scene.json" : there) +
                     ", not " + description + "); name another folder, or delete this one");
  }
  const bool street = options.scene == "street";
  std::string scene = street ? "--scene street --rig-cameras 10 --points-per-frame 1000 --relative-position-sigma 0.01 "
                               "--relative-rotation-sigma 0.01 --start-offset 2"
                             : "--scene aerial --points-per-frame 300";
  if (options.free)
    scene += " --gps-sigma 0";
  else
    scene += street ? " --gps-sigma 0.5 --gps-share 0.5" : " --gps-sigma 0.05 --attitude-sigma 0.02";
  const bool held = calibration_held(options);
  if (held) scene += " --no-calibration";
  run_command(program() + "simulate " + scene + " --frames " + std::to_string(options.frames) + " --seed " +
              std::to_string(options.seed) + " -o '" + folder.string() + "'");
  if (street && !held) free_cameras_and_mounts(folder / "given.h5");
  std::ofstream(folder / "block.yaml", std::ios::app) << project_lines;
  std::ofstream(folder / "scene.json") << description << "\n";
}

// Its job, from the beginning.
inline void run_scene(const std::filesystem::path& folder, const std::filesystem::path& job, int ranks, int threads,
                      const std::string& further_options = {}) {
  std::filesystem::remove_all(job);
  run_command(on_ranks(ranks) + program() + "run " + block_of(folder) + "-j '" + job.string() + "' --quiet --threads " +
              std::to_string(threads) + " " + further_options);
}

}  // namespace megablock
