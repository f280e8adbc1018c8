// Every type of the table, in a block that has rows of all of them, against finite differences and against Ceres'
// automatic differentiation, which shares no code of ours with the linearisation.
#include "adjust/terms/terms.h"

#include <ceres/cost_function.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <random>

#include "adjust/terms/automatic_terms.h"
#include "adjust/terms/build_problem.h"
#include "io/block/frame_measurements.h"
#include "io/block/observed_poses.h"
#include "tests/support/adjust/known_lines.h"
#include "tests/support/adjust/seen_verticals.h"
#include "tests/support/adjust/single_tile.h"

namespace megablock {
namespace {

SimulatedBlock block_with_all_types() {
  SimulationOptions options;
  options.scene = SimulationOptions::Scene::kStreet;
  options.frames = 24;
  options.rig_cameras = 2;
  options.points_per_frame = 60;
  options.calibrate = true;
  options.attitude_sigma_deg = 0.5;
  options.relative_position_sigma_m = 0.02;
  options.control_points = 3;
  SimulatedBlock simulated = simulate_block(options);
  add_known_lines(simulated, 5, 1);
  add_seen_verticals(simulated, {.noise_deg = 0.1, .by_radial = 0.02, .every = 2});
  for (Rig& rig : simulated.block.rigs)
    for (std::size_t m = 1; m < rig.mounts.size(); ++m) {
      rig.mounts[m].rotation_sigma_rad = 0.01;
      rig.mounts[m].position_sigma_m = 0.05;
    }
  for (RigIndex rig(0); simulated.block.rigs.contains(rig); ++rig.value) {
    const Pose receiver{rotation_exp<double>(Eigen::Vector3d(0.2, -0.3, 0.1)), {0.3, 0.1, -0.5}};
    simulated.block.rigs[rig].mounts.push_back({CameraIndex(), receiver, 0.02, 0.1});
    simulated.truth.mounts[rig].push_back(receiver);
  }
  // Positions with a shift of their group, along all axes and along one.
  for (const bool all : {true, false}) {
    const RigIndex group = simulated.block.rigs.next_index();
    simulated.block.rigs.push_back(position_group("positions", {1, -2, 3}, 0.5));
    simulated.truth.mounts.push_back({simulated.block.rigs[group].mounts.front().pose});
    for (std::int64_t f = all ? 0 : 1; f < std::ssize(simulated.block.frames); f += 3) {
      simulated.block.frames[FrameIndex(f)].position_prior->group = group;
      simulated.block.frames[FrameIndex(f)].position_prior->shifted = {all, all, 1};
    }
  }
  for (Camera& camera : simulated.block.cameras) camera.prior_sigma[kFocal] = 5;
  for (const FrameMeasurementType& type : frame_measurement_types())
    for (std::int64_t f = 0; f + 7 < std::ssize(simulated.block.frames); f += 3)
      simulated.block.frame_measurements[type.key].push_back({FrameIndex(f), FrameIndex(f + 7), 20, 0.5});
  return simulated;
}

// The truth, but for noise, so that no residual is zero.
struct Scene : SingleTile {
  Scene() : SingleTile(block_with_all_types()) {
    state = truth();
    std::mt19937_64 random(7);
    std::normal_distribution<double> gauss(0, 1);
    const auto moved = [&](Pose& pose, double metres) {
      PoseIncrement d;
      for (int k = 0; k < 6; ++k) d[k] = gauss(random) * (k < 3 ? 0.01 : metres);
      pose = pose_update(pose, d);
    };
    for (Pose& frame : state.frames) moved(frame, 0.5);
    for (Pose& mount : state.mounts) moved(mount, 0.05);
  }
};

std::vector<LinearTerm> parts_of(const ObservationType& type, const TileProblem& problem, const TileState& state,
                                 std::size_t row) {
  std::vector<LinearTerm> parts;
  type.linearise(problem, state, row, [&](const LinearTerm& part) { parts.push_back(part); });
  return parts;
}

TileState moved(const TileState& state, const LinearTerm::Block& block, int column, double step) {
  TileState result = state;
  const auto row = static_cast<std::size_t>(block.row);
  PoseIncrement d = PoseIncrement::Zero();
  if (column < 6) d[column] = step;
  if (block.by == LinearTerm::By::kFrame) result.frames[row] = pose_update(state.frames[row], d);
  if (block.by == LinearTerm::By::kMount) result.mounts[row] = pose_update(state.mounts[row], d);
  if (block.by == LinearTerm::By::kCamera) result.cameras[row][static_cast<std::size_t>(column)] += step;
  return result;
}

TEST(ObservationTypes, AreAllInTheBlock) {
  const Scene scene;
  for (const ObservationType* type : observation_types()) EXPECT_GT(type->count(scene.problem), 0u);
  EXPECT_EQ(observation_types().size(), observation_types_of_cost().size());
}

// A receiver is a mount without images; positions and attitudes depend on it, and its prior is there once.
TEST(ObservationTypes, DependOnTheReceiverAndTheGroups) {
  const Scene scene;
  ASSERT_EQ(scene.problem.mounts.size(), 5u);  // two cameras, the receiver, two groups
  constexpr std::int32_t receiver = 2;
  for (const std::int32_t mount : {receiver, receiver + 1, receiver + 2}) {
    EXPECT_EQ(scene.problem.mounts[static_cast<std::size_t>(mount)].mount, mount == receiver ? 2 : 0);
    EXPECT_EQ(scene.problem.mount_free[static_cast<std::size_t>(mount)], 1);
    EXPECT_EQ(std::ranges::count(scene.problem.mount_priors, mount, &TileProblem::MountTerm::mount), 1);
  }
  EXPECT_FALSE(scene.problem.positions.empty() || scene.problem.attitudes.empty());
  for (const auto& term : scene.problem.positions) {
    EXPECT_EQ(term.receiver, receiver);
    const std::int64_t frame = scene.problem.frames[static_cast<std::size_t>(term.frame.value)].value;
    EXPECT_EQ(term.group, frame % 3 == 2 ? -1 : receiver + 1 + frame % 3);
  }
  for (const auto& term : scene.problem.attitudes) EXPECT_EQ(term.receiver, receiver);
  for (const TileImage& image : scene.problem.images) EXPECT_LT(image.mount, receiver);
}

TEST(ObservationTypes, HaveTheDerivativesOfFiniteDifferences) {
  const Scene scene;
  for (std::size_t t = 0; t < observation_types().size(); ++t) {
    const ObservationType& type = *observation_types()[t];
    for (std::size_t row = 0; row < std::min<std::size_t>(type.count(scene.problem), 12); ++row) {
      const std::vector<LinearTerm> parts = parts_of(type, scene.problem, scene.state, row);
      for (std::size_t part = 0; part < parts.size(); ++part) {
        for (int b = 0; b < parts[part].block_count; ++b) {
          const LinearTerm::Block& block = parts[part].blocks[static_cast<std::size_t>(b)];
          const double largest = block.jacobian.cwiseAbs().maxCoeff();
          for (int column = 0; column < block.jacobian.cols(); ++column) {
            constexpr double kStep = 1e-5;
            const auto residual = [&](double step) {
              return parts_of(type, scene.problem, moved(scene.state, block, column, step), row)[part].residual;
            };
            const Eigen::VectorXd slope = (residual(kStep) - residual(-kStep)) / (2 * kStep);
            EXPECT_LT((slope - block.jacobian.col(column)).norm(), 1e-6 * std::max(1.0, largest))
                << "type " << t << ", row " << row << ", block " << b << ", column " << column;
          }
        }
      }
    }
  }
}

// Blocks in the order that unknowns() states.
std::vector<std::vector<double>> blocks_of(const TermUnknowns& term, const TileState& state) {
  std::vector<std::vector<double>> blocks;
  const auto add_pose = [&](const Pose& pose) { to_block(pose, blocks.emplace_back(kPoseBlock).data()); };
  for (int f = 0; f < term.frame_count; ++f)
    add_pose(state.frames[static_cast<std::size_t>(term.frame[static_cast<std::size_t>(f)])]);
  for (const std::int32_t mount : term.mounts)
    if (mount >= 0) add_pose(state.mounts[static_cast<std::size_t>(mount)]);
  if (term.camera >= 0) {
    const Intrinsics& camera = state.cameras[static_cast<std::size_t>(term.camera)];
    blocks.emplace_back(camera.begin(), camera.end());
  }
  if (term.point >= 0) {
    const Eigen::Vector3d& point = state.points[static_cast<std::size_t>(term.point)];
    blocks.emplace_back(point.begin(), point.end());
  }
  return blocks;
}

TEST(ObservationTypes, HaveTheResidualsThatCeresHas) {
  const Scene scene;
  for (std::size_t t = 0; t < observation_types().size(); ++t) {
    const ObservationType& type = *observation_types()[t];
    for (std::size_t row = 0; row < type.count(scene.problem); ++row) {
      const TermUnknowns unknowns = type.unknowns(scene.problem, row);
      const std::vector<std::vector<double>> blocks = blocks_of(unknowns, scene.state);
      std::vector<const double*> pointers;
      for (const auto& block : blocks) pointers.push_back(block.data());
      const std::unique_ptr<ceres::CostFunction> cost(type.automatic(scene.problem, row));
      ASSERT_EQ(cost->parameter_block_sizes().size(), blocks.size());
      for (std::size_t b = 0; b < blocks.size(); ++b)
        ASSERT_EQ(cost->parameter_block_sizes()[b], static_cast<int>(blocks[b].size()));
      Eigen::VectorXd residual(cost->num_residuals());
      ASSERT_TRUE(cost->Evaluate(pointers.data(), residual.data(), nullptr));
      double squares = 0;
      for (const LinearTerm& part : parts_of(type, scene.problem, scene.state, row)) {
        squares += part.squares;
        EXPECT_NEAR(part.squares, part.residual.squaredNorm(), 1e-12 * (1 + part.squares));
        for (int b = 0; b < part.block_count; ++b) {
          const LinearTerm::Block& block = part.blocks[static_cast<std::size_t>(b)];
          const bool stated = block.by == LinearTerm::By::kMount    ? std::ranges::count(unknowns.mounts, block.row) > 0
                              : block.by == LinearTerm::By::kCamera ? block.row == unknowns.camera
                                                                    : std::ranges::count(unknowns.frame, block.row) > 0;
          EXPECT_TRUE(stated) << "type " << t << ": a derivative by what unknowns() does not list";
        }
      }
      EXPECT_NEAR(squares, residual.squaredNorm(), 1e-9 * (1 + squares)) << "type " << t << ", row " << row;
    }
  }
}

}  // namespace
}  // namespace megablock
