// Posterior covariances of a small block of several tiles equal those of ceres::Covariance over one problem with
// automatic derivatives: frames, cameras, mounts, points, and separator unknowns with one another.
#include <ceres/covariance.h>
#include <gtest/gtest.h>

#include "adjust/lanes/lane_kernels.h"
#include "adjust/tile/ceres_problem.h"
#include "merge/tile/pair_blocks.h"
#include "tests/support/merge/tiled_block.h"

namespace megablock {
namespace {

struct CovarianceCase {
  const char* name;
  SimulationOptions::Scene kind;
  bool calibrate = true, free_mounts = false;
  int rig_cameras = 2;
};

class CeresCovariance : public testing::TestWithParam<CovarianceCase> {
 protected:
  // Of two blocks of parameters, in their tangent spaces.
  Eigen::MatrixXd of(double* a, double* b) const {
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> block(
        whole_->problem().ParameterBlockTangentSize(a), whole_->problem().ParameterBlockTangentSize(b));
    EXPECT_TRUE(covariance_->GetCovarianceBlockInTangentSpace(a, b, block.data()));
    return block;
  }
  void expect(const Eigen::MatrixXd& ours, double* a, double* b, const std::string& what) {
    const Eigen::VectorXd row = of(a, a).diagonal().cwiseSqrt(), column = of(b, b).diagonal().cwiseSqrt();
    const Eigen::MatrixXd error = (ours - of(a, b)).cwiseQuotient(row * column.transpose());
    EXPECT_LE(error.cwiseAbs().maxCoeff<Eigen::PropagateNaN>(), 1e-6) << what;
    largest_ = std::max(largest_, error.cwiseAbs().maxCoeff());
    ++compared_;
  }
  double* unknown(const TiledBlock& block, const UnknownId& id) const {
    if (id.kind == UnknownKind::kFrame) return whole_->frame(row(block.whole.frames, FrameIndex(id.index)));
    if (id.kind == UnknownKind::kCamera) return whole_->camera(row(block.whole.cameras, CameraIndex(id.index)));
    return whole_->mount(row(block.whole.mounts, MountId{RigIndex(id.index), id.part}));
  }
  template <typename Value>
  static std::int64_t row(const std::vector<Value>& table, const Value& value) {
    return static_cast<std::int64_t>(TiledBlock::row(table, value));
  }

  std::unique_ptr<CeresTile> whole_;
  std::unique_ptr<ceres::Covariance> covariance_;
  double largest_ = 0;
  int compared_ = 0;
};

TEST_P(CeresCovariance, EqualsOurs) {
  SimulationOptions options;
  options.scene = GetParam().kind;
  options.frames = 24;
  options.points_per_frame = 30;
  options.rig_cameras = GetParam().rig_cameras;
  options.control_points = 3;
  options.calibrate = GetParam().calibrate;
  if (options.scene == SimulationOptions::Scene::kStreet) options.relative_position_sigma_m = 0.02;
  SimulatedBlock simulated = simulate_block(options);
  if (GetParam().free_mounts)
    for (Rig& rig : simulated.block.rigs) {
      rig.mounts[1].rotation_sigma_rad = 0.01;
      rig.mounts[1].position_sigma_m = 0.05;
    }
  const TiledBlock block(std::move(simulated), 8, {}, 0.01);
  ASSERT_GE(block.tiles.tile_count, 3);
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  EXPECT_TRUE(runner.final_up().sums.held.empty());
  const std::vector<TileCovariance> tiles = runner.covariances();

  whole_ = std::make_unique<CeresTile>(block.whole, block.whole_state);
  ceres::Covariance::Options settings;
  settings.algorithm_type = ceres::SPARSE_QR;
  settings.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
  covariance_ = std::make_unique<ceres::Covariance>(settings);
  std::vector<std::pair<const double*, const double*>> pairs;
  const std::vector<double*> all = whole_->unknown_blocks(), others = whole_->unknown_blocks_without_points();
  for (double* a : all) pairs.emplace_back(a, a);
  for (std::size_t i = 0; i < others.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) pairs.emplace_back(others[i], others[j]);
  ASSERT_TRUE(covariance_->Compute(pairs, &whole_->problem()));

  for (std::size_t t = 0; t < tiles.size(); ++t) {
    const TileProblem& problem = block.problems[t];
    const TilePlan& plan = runner.tile_plans()[t];
    for (std::size_t f = 0; f < problem.frames.size(); ++f) {
      if (plan.unknown_of_frame[f] < 0) continue;
      double* frame = whole_->frame(row(block.whole.frames, problem.frames[f]));
      expect(tiles[t].frames[f], frame, frame, "frame " + std::to_string(problem.frames[f].value));
    }
    for (std::size_t p = 0; p < problem.points.size(); ++p) {
      if (!problem.active(static_cast<std::int64_t>(p))) continue;
      double* point = whole_->point(static_cast<std::int64_t>(block.point_row(problem.points[p])));
      expect(tiles[t].points[p], point, point, "point " + std::to_string(problem.points[p].index));
    }
    for (std::size_t c = 0; c < problem.cameras.size(); ++c) {
      std::vector<int> free;
      for (int k = 0; k < tiles[t].cameras[c].rows(); ++k)
        if (contains(problem.camera_free[c], k)) free.push_back(k);
      double* camera = whole_->camera(row(block.whole.cameras, problem.cameras[c]));
      if (!free.empty()) expect(tiles[t].cameras[c](free, free), camera, camera, "camera");
    }
    for (std::size_t m = 0; m < problem.mounts.size(); ++m) {
      double* mount = whole_->mount(row(block.whole.mounts, problem.mounts[m]));
      if (problem.mount_free[m]) expect(tiles[t].mounts[m], mount, mount, "mount");
    }
    const CovarianceMatrix& boundary = tiles[t].boundary;
    for (const Unknown& a : boundary.unknowns)
      for (const Unknown& b : boundary.unknowns) {
        Eigen::MatrixXd ours(a.dimension, b.dimension);
        ASSERT_TRUE(boundary.block(a.id, b.id, ours.data()));
        expect(ours, unknown(block, a.id), unknown(block, b.id), describe(a.id) + " with " + describe(b.id));
      }
  }
  EXPECT_GT(compared_, 300);
  RecordProperty("largest_relative_difference", std::to_string(largest_));
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, CeresCovariance,
    testing::Values(CovarianceCase{"AerialSharedCamera", SimulationOptions::Scene::kAerial},
                    CovarianceCase{"AerialHeldCamera", SimulationOptions::Scene::kAerial, false},
                    CovarianceCase{"StreetSharedCameras", SimulationOptions::Scene::kStreet},
                    CovarianceCase{"StreetFreeMounts", SimulationOptions::Scene::kStreet, true, true},
                    CovarianceCase{"StreetTenCameras", SimulationOptions::Scene::kStreet, true, true, 10}),
    [](const auto& p) { return std::string(p.param.name); });

}  // namespace
}  // namespace megablock
