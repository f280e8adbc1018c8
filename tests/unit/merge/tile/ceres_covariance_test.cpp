// Posterior covariances of a small block of several tiles equal those of ceres::Covariance over one problem with
// automatic derivatives: frames, cameras, mounts, points, separator unknowns with one another, and the residuals of
// positions.
#include <ceres/covariance.h>
#include <gtest/gtest.h>

#include "adjust/checks/prior_test.h"
#include "adjust/lanes/lane_kernels.h"
#include "adjust/orientation/position_offset.h"
#include "adjust/terms/terms.h"
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
  // Twelve positions have a shift, of which two and one other are set aside; one of these is alone in its group.
  bool shifts = false;
  bool receiver = false;  // lever arm and boresight are free
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
  // J C J' of a position's residual.
  void expect_position(const Eigen::Matrix3d& ours, const TileProblem& problem, const TileState& state,
                       const TileProblem::PositionTerm& term) {
    const LinearTerm position = linearise_position(term, state);
    const auto unknown_of = [&](const LinearTerm::Block& block) {
      const auto r = static_cast<std::size_t>(block.row);
      return block.by == LinearTerm::By::kFrame ? whole_->frame(row(whole_rows_->frames, problem.frames[r]))
                                                : whole_->mount(row(whole_rows_->mounts, problem.mounts[r]));
    };
    Eigen::MatrixXd theirs = Eigen::Matrix3d::Zero();
    for (int i = 0; i < position.block_count; ++i)
      for (int j = 0; j < position.block_count; ++j) {
        const auto &a = position.blocks[static_cast<std::size_t>(i)], &b = position.blocks[static_cast<std::size_t>(j)];
        theirs += a.jacobian * of(unknown_of(a), unknown_of(b)) * b.jacobian.transpose();
      }
    EXPECT_LE((ours - theirs).cwiseAbs().maxCoeff<Eigen::PropagateNaN>(), 1e-6 * theirs.diagonal().maxCoeff())
        << "position of frame " << problem.frames[static_cast<std::size_t>(term.frame.value)].value;
    ++positions_;
  }
  template <typename Value>
  static std::int64_t row(const std::vector<Value>& table, const Value& value) {
    return static_cast<std::int64_t>(TiledBlock::row(table, value));
  }

  std::unique_ptr<CeresTile> whole_;
  std::unique_ptr<ceres::Covariance> covariance_;
  const TileProblem* whole_rows_ = nullptr;
  double largest_ = 0;
  int compared_ = 0, positions_ = 0;
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
  if (GetParam().shifts) {
    std::vector<FrameIndex> group;
    for (std::int64_t f = 5; f < 15; ++f) group.emplace_back(f);
    add_position_group(group, {0.1, -0.2, 0.3}, {1, 1, 1}, simulated.block, simulated.truth);
    add_position_group({FrameIndex(1), FrameIndex(23)}, {0, 0, 3}, {0, 0, 1}, simulated.block, simulated.truth);
  }
  if (GetParam().receiver) {
    Mount receiver;
    receiver.rotation_sigma_rad = 0.01;
    receiver.position_sigma_m = 0.1;
    simulated.block.rigs.front().mounts.push_back(receiver);
    simulated.truth.mounts.front().push_back(receiver.pose);
  }
  TiledBlock block(std::move(simulated), 8, {}, 0.01);
  ASSERT_GE(block.tiles.tile_count, 3);
  if (GetParam().shifts) {
    const std::vector<PriorId> aside{{1, 0}, {2, 0}, {8, 0}};
    for (TileProblem& problem : block.problems) set_aside(aside, problem);
    set_aside(aside, block.whole);
  }
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  EXPECT_TRUE(runner.final_up().sums.held.empty());
  const std::vector<TileCovariance> tiles = runner.covariances();

  whole_rows_ = &block.whole;
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
    for (std::size_t p = 0; p < problem.positions.size(); ++p)
      expect_position(tiles[t].positions[p], problem, block.states[t], problem.positions[p]);
    for (std::size_t p = 0; p < problem.positions_aside.size(); ++p)
      // Without another position of its group in the tile, nothing is known of the two together.
      if (const std::int32_t group = problem.positions_aside[p].group;
          group >= 0 && plan.unknown_of_mount[static_cast<std::size_t>(group)] < 0)
        EXPECT_TRUE(tiles[t].positions_aside[p].isZero(0)), ++positions_;
      else
        expect_position(tiles[t].positions_aside[p], problem, block.states[t], problem.positions_aside[p]);
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
      if (plan.unknown_of_mount[m] >= 0) expect(tiles[t].mounts[m], mount, mount, "mount");
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
  EXPECT_EQ(positions_, 24);
  RecordProperty("largest_relative_difference", std::to_string(largest_));
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, CeresCovariance,
    testing::Values(CovarianceCase{"AerialSharedCamera", SimulationOptions::Scene::kAerial},
                    CovarianceCase{"AerialShifts", SimulationOptions::Scene::kAerial, true, false, 2, true},
                    CovarianceCase{"AerialShiftsAndReceiver", SimulationOptions::Scene::kAerial, true, false, 2, true,
                                   true},
                    CovarianceCase{"StreetReceiver", SimulationOptions::Scene::kStreet, true, true, 2, false, true},
                    CovarianceCase{"AerialHeldCamera", SimulationOptions::Scene::kAerial, false},
                    CovarianceCase{"StreetSharedCameras", SimulationOptions::Scene::kStreet},
                    CovarianceCase{"StreetFreeMounts", SimulationOptions::Scene::kStreet, true, true},
                    CovarianceCase{"StreetTenCameras", SimulationOptions::Scene::kStreet, true, true, 10}),
    [](const auto& p) { return std::string(p.param.name); });

}  // namespace
}  // namespace megablock
