// The simulated blocks of the benchmarks of whole adjustments, and how to run the program on them.
//
// street: grid of 100 m, every street driven twice, a frame of ten cameras each 4 m, 1 000 observations per frame, five
// per point, 0.5 px; position priors of 0.5 m on half of the frames, relative poses of 1 cm and 0.01 degrees;
// calibration held; start = these integrated over stretches of 1 km, each off by up to 2 m. aerial: 80 % and 60 %
// overlap, 300 points per image, GNSS of 0.05 m, attitudes of 0.02 degrees; the camera is calibrated.
#pragma once

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "io/error.h"

namespace megablock {

struct SceneOptions {
  std::string scene = "street";
  std::int64_t frames = 1000;
  std::uint64_t seed = 1;
  std::filesystem::path folder;  // empty: a temporary one, removed at the end
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

// Unless the folder holds a block.
inline void simulate_scene(const SceneOptions& options, const std::filesystem::path& folder) {
  if (std::filesystem::exists(folder / "block.yaml")) return;
  const std::string scene =
      options.scene == "street"
          ? "--scene street --rig-cameras 10 --points-per-frame 1000 --gps-sigma 0.5 --gps-share 0.5 "
            "--relative-position-sigma 0.01 --relative-rotation-sigma 0.01 --start-offset 2 --no-calibration"
          : "--scene aerial --points-per-frame 300 --gps-sigma 0.05 --attitude-sigma 0.02";
  run_command(program() + "simulate " + scene + " --frames " + std::to_string(options.frames) + " --seed " +
              std::to_string(options.seed) + " -o '" + folder.string() + "'");
}

// Its job, from the beginning.
inline void run_scene(const std::filesystem::path& folder, const std::filesystem::path& job, int ranks, int threads) {
  std::filesystem::remove_all(job);
  run_command(on_ranks(ranks) + program() + "run " + block_of(folder) + "-j '" + job.string() + "' --quiet --threads " +
              std::to_string(threads));
}

}  // namespace megablock
