// Compares the initial orientation of simulated blocks without positions as a whole with that in parts, which are then
// assembled.
//
//   compare_assembly [--scene aerial|street] [--frames 400] [--part-frames 0 100 200] [--wrong-pairs 0.1]
//
// aerial: images every 14 m in rows 30 m apart, 80 m above the ground; street: a frame every 3 m that looks ahead.
// There are 60 points per frame with 0.5 px of noise, and a tenth of the tracks has an outlier. 0 part frames stands
// for the orientation as a whole. Prints processor time, number of oriented frames, and errors after the best
// similarity, in metres and degrees.
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <random>

#include "tests/support/adjust/orientation_scene.h"

namespace {

using namespace megablock;
using namespace orientation_scene;

double uniform(std::mt19937_64& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

SimulatedBlock aerial_block(int frames) {
  const int columns = static_cast<int>(std::sqrt(2.0 * frames)), rows = frames / columns;
  std::mt19937_64 random(3);
  std::vector<Pose> poses;
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) {
      const Eigen::Quaterniond tilt = rotation_exp<double>(2 * kDegree * normal_vector(random));
      poses.push_back({(tilt * looking({0, 0, -1}, {0, r % 2 ? -1.0 : 1.0, 0})).normalized(),
                       Eigen::Vector3d(14 * c, 30 * r, 80) + 0.5 * normal_vector(random)});
    }
  std::vector<Eigen::Vector3d> points;
  for (int p = 0; p < 60 * rows * columns; ++p)
    points.emplace_back(uniform(random, -50, 14.0 * columns + 50), uniform(random, -50, 30.0 * rows + 50),
                        uniform(random, -5, 5));
  return make_scene(poses, points, {});
}

SimulatedBlock street_block(int frames) {
  std::mt19937_64 random(4);
  std::vector<Pose> poses;
  for (int i = 0; i < frames; ++i) {
    // A wide bend, so that the images do not stand on one line.
    const double along = 3.0 * i, heading = 0.001 * along;
    const Eigen::Quaterniond sway = rotation_exp<double>(1 * kDegree * normal_vector(random));
    const Eigen::Vector3d ahead(std::cos(heading), std::sin(heading), 0);
    poses.push_back(
        {(sway * looking(ahead, {0, 0, -1})).normalized(),
         Eigen::Vector3d(1000 * std::sin(heading), 1000 * (1 - std::cos(heading)), 2) + 0.05 * normal_vector(random)});
  }
  std::vector<Eigen::Vector3d> points;
  for (int p = 0; p < 60 * frames; ++p) {
    const double heading = uniform(random, 0, 0.003 * frames + 0.05), side = uniform(random, 8, 12);
    const double radius = 1000 + (random() % 2 == 0 ? side : -side);
    points.emplace_back(radius * std::sin(heading), 1000 - radius * std::cos(heading), uniform(random, 0, 12));
  }
  SceneOptions near;
  near.max_distance_m = 45;
  return make_scene(poses, points, near);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Initial orientation as a whole and in parts");
  std::string scene = "aerial";
  int frames = 400;
  std::vector<int> part_frames = {0, 100, 200};
  PairNoise noise;
  app.add_option("--scene", scene)->check(CLI::IsMember({"aerial", "street"}));
  app.add_option("--frames", frames);
  app.add_option("--part-frames", part_frames);
  app.add_option("--wrong-pairs", noise.wrong_share);
  CLI11_PARSE(app, argc, argv);
  const SimulatedBlock block = scene == "aerial" ? aerial_block(frames) : street_block(frames);
  const std::vector<VerifiedPair> pairs = pairs_of(block, noise);
  std::printf("%zu frames, %zu pairs, %lld tracks\n", block.block.frames.size(), pairs.size(),
              static_cast<long long>(block.tracks.track_count()));
  for (const int part : part_frames) {
    OrientationOptions options;
    options.part_frames = part;
    const std::clock_t start = std::clock();
    const OrientationResult result = orient_component(block.block, initial_state(block.block), all_frames(block.block),
                                                      pairs, block.tracks, options);
    const double seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    const Errors errors = errors_of(block, result, true);
    std::printf("part_frames %5d: %7.1f s, %zu oriented, largest errors %.3f m, %.4f deg; %s\n", part, seconds,
                errors.oriented, errors.position_m, errors.rotation_deg, result.summary.c_str());
  }
}
