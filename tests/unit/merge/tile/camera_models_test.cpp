// Blocks with cameras of other models than Brown's: self-calibration over tiles ends at the optimum of one Ceres
// problem with automatic derivatives, and at the true cameras.
#include <gtest/gtest.h>

#include <algorithm>

#include "adjust/lanes/tile_cost.h"
#include "adjust/terms/linearise.h"
#include "merge/checks/monolithic.h"
#include "merge/tree/global_adjustment.h"
#include "tests/support/geometry/camera_samples.h"
#include "tests/support/merge/ceres_cost.h"
#include "tests/support/merge/tiled_block.h"

namespace megablock {
namespace {

struct Case {
  const char* model;
  double turn_deg;  // the first camera looks so far aside of where the points are
};

// A street rig of two cameras: the first of the model, the second as simulated (Brown). Observations anew, 0.3 px.
SimulatedBlock with_model(const Case& c) {
  SimulationOptions options;
  options.scene = SimulationOptions::Scene::kStreet;
  options.frames = 24;
  options.points_per_frame = 60;
  options.rig_cameras = 2;
  options.image_noise_px = 0.3;
  SimulatedBlock s = simulate_block(options);
  const CameraIndex index = s.block.rigs[RigIndex(0)].mounts[0].camera;
  Camera& camera = s.block.cameras[index];
  const CameraModel model = *find_model(c.model);
  s.truth.cameras[index] = sample_camera(model, camera.intrinsics[kFocal], camera.width, camera.height);
  camera.intrinsics = start_intrinsics(model, camera.intrinsics[kFocal], camera.width, camera.height);
  if (model.kind == CameraModelKind::kEquirectangular) s.truth.cameras[index] = camera.intrinsics;  // cx is held
  camera.prior_sigma = weak_sigmas(camera.intrinsics, 50, camera.width);
  if (model.kind == CameraModelKind::kBrown)  // with affinity and skew
    camera.prior_sigma = weak_sigmas(camera.intrinsics, 50, camera.width, free_parameters(model));

  Pose& mount = s.truth.mounts[RigIndex(0)][0];
  mount.rotation = rotation_exp<double>(Eigen::Vector3d(0, c.turn_deg * 0.017453292519943295, 0)) * mount.rotation;
  s.block.rigs[RigIndex(0)].mounts[0].pose = mount;
  std::mt19937_64 random(7);
  std::normal_distribution<double> noise(0, 0.3);
  TrackSet& tracks = s.tracks;
  for (std::int64_t t = 0; t < tracks.track_count(); ++t)
    for (std::int64_t o = tracks.begin[t]; o < tracks.begin[t + 1]; ++o) {
      const Image& image = s.block.images[tracks.image[o]];
      if (image.mount != 0) continue;
      const Eigen::Vector2d pixel =
          project(s.truth.cameras[index], to_camera(s.truth.frames[image.frame], mount, s.points[t]));
      EXPECT_TRUE(pixel.allFinite());
      tracks.x[o] = to_fixed_pixel(pixel.x() + noise(random));
      tracks.y[o] = to_fixed_pixel(pixel.y() + noise(random));
    }
  return s;
}

class CameraModels : public testing::TestWithParam<Case> {};

TEST_P(CameraModels, AdjustAsOneCeresProblem) {
  ObservationOptions observations;
  observations.image_sigma_px = 0.3;
  observations.image_loss = {};
  const TiledBlock block(with_model(GetParam()), 8, observations, 0.05);
  ASSERT_GE(block.tiles.tile_count, 3);
  GlobalOptions options;
  options.max_decrement = 1e-7;
  options.max_iterations = 80;
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  GlobalState state = start_global(options);
  adjust_globally(runner, options, state);
  EXPECT_EQ(state.outcome, GlobalOutcome::kConverged) << describe(state);
  const TileState solution = block.gathered(runner.problems(), runner.states());
  EXPECT_LE(max_pose_difference_sigmas(block.whole, solution), 1e-6);
  const double cost = evaluate_cost(block.whole, solution);
  EXPECT_NEAR(cost_after_ceres(block.whole, solution, 50), cost, 1e-9 * cost);

  // It explains the observations, with the true parameters.
  const double redundancy = static_cast<double>(2 * block.whole.observation_count() - 3 * block.whole.point_count() -
                                                6 * std::ssize(block.whole.frames));
  EXPECT_NEAR(2 * cost / redundancy, 1, 0.15);
  const Intrinsics& truth = block.simulated.truth.cameras[CameraIndex(0)];
  const Intrinsics& found = solution.cameras[0];
  ASSERT_EQ(block.whole.cameras[0], CameraIndex(0));
  EXPECT_EQ(found.model(), truth.model());
  const Camera& camera = block.simulated.block.cameras[CameraIndex(0)];
  runner.final_up();
  const std::vector<TileCovariance>& covariances = runner.covariances();
  for (std::size_t t = 0; t < runner.problems().size(); ++t) {
    if (runner.problems()[t].cameras.front() != CameraIndex(0)) continue;
    const Eigen::MatrixXd& covariance = covariances[t].cameras.front();
    ASSERT_EQ(covariance.rows(), found.size());
    for (int p = 0; p < found.size(); ++p) {
      const double sigma = std::sqrt(covariance(p, p));
      EXPECT_EQ(sigma > 0, camera.prior_sigma[static_cast<std::size_t>(p)] > 0);
      EXPECT_LE(std::abs(found[p] - truth[p]), 4.5 * sigma) << parameter_name(found.model(), p);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Models, CameraModels,
                         testing::Values(Case{"brown", 0}, Case{"pinhole", 0}, Case{"ign-radial", 0},
                                         Case{"odd-radial-2", 0}, Case{"even-radial-3", 0}, Case{"opencv-fisheye", 50},
                                         Case{"equirectangular", 120}, Case{"polynomial-3", 0}, Case{"legendre-4", 0},
                                         Case{"fourier-1", 0}),
                         [](const auto& p) {
                           std::string name = p.param.model;
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

}  // namespace
}  // namespace megablock
