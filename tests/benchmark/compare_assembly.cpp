// Initial orientation of simulated blocks without positions, as a whole and in parts that are then assembled; and tiles
// without a common datum, aligned and assembled.
//
//   compare_assembly [--scene aerial|street] [--frames 400] [--part-frames 0 100 200] [--wrong-pairs 0.1]
//   compare_assembly --scene tiles
//
// aerial: rows of 14 m by 30 m, 80 m above the ground; street: a frame each 3 m, looking ahead; 60 points a frame, 0.5
// px, one observation of a tenth of the tracks wrong. 0 part frames: as a whole. Prints processor time, frames
// oriented, and errors after the best similarity, in m and degrees.
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <random>

#include "adjust/model_assembly.h"
#include "merge/tile_alignment.h"
#include "tests/unit/adjust/orientation_scene.h"

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

constexpr int kTiles = 12, kFrames = 30, kCommon = 10, kWrong = 2;  // the last: row of the wrong frame

Pose true_pose(std::int64_t frame) {
  const double f = static_cast<double>(frame);
  return {rotation_exp<double>({0.02 * std::sin(f), 0.03 * std::cos(2 * f), 0.01 * f}),
          {5 * f, 20 * std::sin(0.4 * f), 3 * std::cos(f)}};
}

// Largest error of a centre after the best similarity, the wrong frames left out.
double error_of(const std::vector<AlignmentTile>& tiles, const std::vector<Similarity>& moves) {
  std::vector<Eigen::Vector3d> from, to;
  for (std::size_t t = 0; t < tiles.size(); ++t)
    for (std::size_t i = 0; i < tiles[t].poses.size(); ++i) {
      if (i == kWrong) continue;
      from.push_back(moves[t](tiles[t].poses[i].centre));
      to.push_back(true_pose(tiles[t].frames[i].value).centre);
    }
  const Similarity fitted = fit_similarity(from, to).value();
  double largest = 0;
  for (std::size_t i = 0; i < from.size(); ++i) largest = std::max(largest, (fitted(from[i]) - to[i]).norm());
  return largest;
}

void compare_tiles(double apart_m, double noise_m, bool wrong) {
  std::mt19937_64 random(3);
  std::vector<AlignmentTile> tiles(kTiles);
  std::vector<Model> models(kTiles);
  for (std::size_t t = 0; t < kTiles; ++t) {
    Similarity moved;
    moved.rotation = rotation_exp<double>(0.01 * apart_m * normal_vector(random));
    moved.scale = std::exp(0.002 * apart_m * normal_vector(random).x());
    const auto first = static_cast<std::int64_t>(t) * (kFrames - kCommon);
    const Eigen::Vector3d middle = true_pose(first + kFrames / 2).centre;
    moved.translation = middle - moved.scale * (moved.rotation * middle) + apart_m * normal_vector(random);
    models[t].number = static_cast<std::int64_t>(t);
    for (std::int64_t f = first; f < first + kFrames; ++f) {
      Pose pose = moved(true_pose(f));
      pose.centre += noise_m * moved.scale * normal_vector(random);
      pose.rotation = pose.rotation * rotation_exp<double>(noise_m / 100 * normal_vector(random));
      if (wrong && f == first + kWrong) pose.centre += moved.scale * Eigen::Vector3d(15, -8, 20);
      tiles[t].frames.emplace_back(f);
      tiles[t].poses.push_back(pose);
      tiles[t].observations.push_back(100 + f % 50);
      models[t].images.push_back({f, pose, 1e-3 * moved.scale, 1e-5});
    }
  }
  AssemblyOptions options;
  options.covariances = false;
  options.links.scale_sigmas = true;
  std::printf("apart %6.1f m, noise %.2f m, wrong frames: %s; largest error aligned %9.4f m, assembled %9.4f m\n",
              apart_m, noise_m, wrong ? "yes" : "no ", error_of(tiles, align_tiles(tiles)),
              error_of(tiles, assemble_models(models, options).similarity));
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Initial orientation as a whole and in parts");
  std::string scene = "aerial";
  int frames = 400;
  std::vector<int> part_frames = {0, 100, 200};
  PairNoise noise;
  app.add_option("--scene", scene)->check(CLI::IsMember({"aerial", "street", "tiles"}));
  app.add_option("--frames", frames);
  app.add_option("--part-frames", part_frames);
  app.add_option("--wrong-pairs", noise.wrong_share);
  CLI11_PARSE(app, argc, argv);
  if (scene == "tiles") {
    for (const double apart : {0.1, 1.0, 10.0, 100.0})
      for (const double tile_noise : {0.0, 0.02})
        for (const bool wrong : {false, true}) compare_tiles(apart, tile_noise, wrong);
    return 0;
  }
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
