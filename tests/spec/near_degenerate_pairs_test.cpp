// Tests how much the covariance and the twin of a pair improve a block (Kalantari 2009, M41, M43). The ground is flat;
// images follow one another closely, from changing heights, some nearly from the same place. In narrow views of a
// plane, both its orientations fit nearly all pairs.
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "adjust/orientation/steps/orientation_graph.h"
#include "adjust/orientation/steps/rotation_averaging.h"
#include "match/verification/two_view.h"
#include "reached.h"
#include "tests/support/adjust/orientation_scene.h"

namespace megablock {
namespace {

using namespace orientation_scene;

// Two flight lines of 12 images, 100 m up, 6 m (base over height 0.06) and half the image's width apart; every fourth
// image has another one half a metre beside it. Ground rises and falls by `relief`.
SimulatedBlock close_block(double relief, double focal_px, unsigned seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const double height = 100, width = 1000 / focal_px * height;
  std::vector<Pose> poses;
  for (int line = 0; line < 2; ++line)
    for (int i = 0; i < 12; ++i) {
      const Eigen::Vector3d centre(6.0 * i, 0.5 * width * line, height + 4 * uniform(random));
      const auto add = [&](const Eigen::Vector3d& at) {
        const Eigen::Quaterniond down = looking({0, 0, -1}, {0, line == 0 ? -1.0 : 1.0, 0});
        poses.push_back({rotation_update(down, 3 * kDegree * normal_vector(random)), at});
      };
      add(centre);
      if (i % 4 == 1) add(centre + 0.5 * normal_vector(random));
    }
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 1500; ++i)
    points.emplace_back(33 + (33 + 0.75 * width) * uniform(random), 0.25 * width + width * uniform(random),
                        relief * uniform(random));
  SceneOptions options;
  options.noise_px = 0.5;
  options.focal_px = focal_px;
  options.wrong_tracks = 0.15;
  options.seed = seed;
  return make_scene(poses, points, options);
}

// Verified pairs of the tracks' observations, as matching makes them.
std::vector<VerifiedPair> verified(const SimulatedBlock& scene) {
  const Intrinsics& camera = scene.block.cameras[CameraIndex(0)].intrinsics;
  const TrackSet& tracks = scene.tracks;
  std::map<std::pair<std::int64_t, std::int64_t>, PointPairs> common;
  for (std::size_t t = 0; t < tracks.id.size(); ++t)
    for (auto i = static_cast<std::size_t>(tracks.begin[t]); i < static_cast<std::size_t>(tracks.begin[t + 1]); ++i)
      for (auto j = i + 1; j < static_cast<std::size_t>(tracks.begin[t + 1]); ++j) {
        PointPairs& points = common[{tracks.image[i].value, tracks.image[j].value}];
        const auto at = [&](std::size_t o) {
          return *unproject(camera, {from_fixed_pixel(tracks.x[o]), from_fixed_pixel(tracks.y[o])});
        };
        points.a.push_back(at(i));
        points.b.push_back(at(j));
      }
  std::vector<VerifiedPair> pairs;
  for (const auto& [key, points] : common) {
    if (points.size() < 100) continue;
    const TwoView found = estimate_two_view(
        points,
        {.max_residual = 3 / camera[kFocal], .seed = static_cast<std::uint64_t>(1000 * key.first + key.second)});
    if (found.model == PairModel::kNone) continue;
    VerifiedPair pair;
    pair.a = ImageIndex(key.first);
    pair.b = ImageIndex(key.second);
    set_orientation(pair, found);
    pair.feature_a.resize(static_cast<std::size_t>(found.inlier_count));
    pair.feature_b.resize(pair.feature_a.size());
    pairs.push_back(std::move(pair));
  }
  return pairs;
}

// The same pairs as a program knows them that keeps the orientation alone.
std::vector<VerifiedPair> orientations_alone(std::vector<VerifiedPair> pairs) {
  for (VerifiedPair& pair : pairs) {
    pair.rotation_covariance = pair.base_covariance = {};
    pair.twin.reset();
  }
  return pairs;
}

// Root mean square of the averaged rotations' errors, but for a common one, degrees.
double averaging_error_deg(const SimulatedBlock& scene, const std::vector<VerifiedPair>& pairs) {
  const OrientationGraph graph =
      make_orientation_graph(scene.block, initial_state(scene.block), all_frames(scene.block), pairs, scene.tracks, {});
  std::vector<RelativeRotation> edges;
  for (const auto& edge : graph.edges)
    edges.push_back({graph.images[row(edge.a)].frame, graph.images[row(edge.b)].frame, edge.rotation, edge.inliers,
                     edge.rotation_sigma});
  const auto found = average_rotations(graph.frame_count(), edges,
                                       std::vector<std::optional<RotationPrior>>(graph.frames.size()), 10 * kDegree);
  std::vector<Eigen::Quaterniond> gauges;  // found -> truth
  for (std::size_t f = 0; f < graph.frames.size(); ++f)
    if (found.rotation[f])
      gauges.push_back(found.rotation[f]->conjugate() * scene.truth.frames[graph.frames[f].index].rotation);
  Eigen::Quaterniond mean = gauges.front();
  double rms = 0;
  for (int iteration = 0; iteration < 5; ++iteration) {
    Eigen::Vector3d step = Eigen::Vector3d::Zero();
    rms = 0;
    for (const Eigen::Quaterniond& g : gauges) {
      const Eigen::Vector3d e = rotation_log<double>((mean.conjugate() * g).normalized());
      step += e / static_cast<double>(gauges.size());
      rms += e.squaredNorm();
    }
    mean = rotation_update(mean, step);
  }
  return std::sqrt(rms / static_cast<double>(gauges.size())) / kDegree;
}

// The averaged rotations' error is to be less than `gain` of what it is without covariance and twin. Returns the share
// of the pairs that are ill-conditioned.
double compare(double relief, double focal_px, double gain, const std::string& name, unsigned blocks) {
  double averaged = 0, averaged_alone = 0, adjusted = 0, adjusted_alone = 0, oriented = 0, oriented_alone = 0,
         planes = 0, ill = 0, twins = 0, pairs = 0;
  for (unsigned seed = 1; seed <= blocks; ++seed) {
    const SimulatedBlock scene = close_block(relief, focal_px, seed);
    const std::vector<VerifiedPair> all = verified(scene), alone = orientations_alone(all);
    for (const VerifiedPair& pair : all) {
      ++pairs;
      planes += pair.model == PairModel::kHomography;
      ill += pair.ill_conditioned;
      twins += pair.twin.has_value();
    }
    averaged += averaging_error_deg(scene, all) / blocks;
    averaged_alone += averaging_error_deg(scene, alone) / blocks;
    const Errors with = errors_of(scene, orient(scene, all), true),
                 without = errors_of(scene, orient(scene, alone), true);
    adjusted += with.position_m / blocks;
    adjusted_alone += without.position_m / blocks;
    oriented += static_cast<double>(with.oriented);
    oriented_alone += static_cast<double>(without.oriented);
  }
  std::printf("[ reached  ] %s: %.0f pairs, %.0f planes, %.0f ill-conditioned, %.0f with a twin\n", name.c_str(), pairs,
              planes, ill, twins);
  std::printf("[ reached  ] %s: averaged rotations %.3f deg rms, %.3f without covariance and twin\n", name.c_str(),
              averaged, averaged_alone);
  std::printf("[ reached  ] %s: oriented %.0f and %.0f frames, largest position error %.3f and %.3f m\n", name.c_str(),
              oriented, oriented_alone, adjusted, adjusted_alone);
  expect_at_most(averaged, gain * averaged_alone, name + ": averaged rotations, deg rms");
  expect_at_least(oriented, oriented_alone, name + ": frames oriented");
  // Rotations are free again in the adjustment.
  expect_at_most(adjusted, 1.15 * adjusted_alone, name + ": largest position error, m");
  return ill / pairs;
}

TEST(Spec, M43CovarianceAndTwinInABlockOverFlatGround) {
  // A plane is no reason to mark a pair.
  expect_at_most(compare(0, 1200, 1, "flat", 4), 0.05, "flat: share of ill-conditioned pairs");
}
TEST(Spec, M43CovarianceAndTwinInANarrowViewOfFlatGround) { compare(0, 4800, 0.3, "flat, narrow", 12); }
// Over hills the matches themselves tell twins apart: there is next to nothing to be gained, and nothing to be lost.
TEST(Spec, M43CovarianceAndTwinInANarrowViewOfHills) { compare(1, 4800, 1, "hills of 1 m, narrow", 12); }

}  // namespace
}  // namespace megablock
