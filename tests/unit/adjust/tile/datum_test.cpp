// Tests the free directions of rigs whose reference mount is not at the rig's origin, against the null space of the
// dense Jacobian that Ceres differentiates.
#include "adjust/tile/datum.h"

#include <ceres/ceres.h>
#include <gtest/gtest.h>

#include <limits>

#include "geometry/numbers/decompositions.h"
#include "tests/support/adjust/single_tile.h"

namespace megablock {
namespace {

constexpr double kFree = std::numeric_limits<double>::infinity();

// Streets without priors but that of the second mount, with exact observations.
struct Streets : SingleTile {
  Streets(const Eigen::Vector3d& reference, const Eigen::Vector3d& mount, double mount_sigma_m)
      : SingleTile(simulated_with(reference, mount, mount_sigma_m)) {
    state = truth();
    for (std::int64_t p = 0; p < problem.point_count(); ++p)
      for (std::int64_t row = problem.begin[p]; row < problem.begin[p + 1]; ++row) {
        const TileImage& image = problem.images[problem.image[row].value];
        const Eigen::Vector3d inside =
            to_camera(state.frames[image.frame.value], state.mounts[image.mount], state.points[p]);
        if (inside.z() < 1) problem.kept[row] = 0;
        redirect(row, inside);
      }
  }

 private:
  void redirect(std::int64_t row, const Eigen::Vector3d& inside) {
    const Eigen::Vector2d pixel = project(state.cameras[problem.images[problem.image[row].value].camera.value], inside);
    problem.x[row] = pixel.x();
    problem.y[row] = pixel.y();
  }
  // Both mounts get given places in the rig. The first camera stays where it was, and so the frames move.
  static SimulatedBlock simulated_with(const Eigen::Vector3d& reference, const Eigen::Vector3d& mount,
                                       double mount_sigma_m) {
    SimulationOptions options;
    options.scene = SimulationOptions::Scene::kStreet;
    options.frames = 12;
    options.points_per_frame = 25;
    options.rig_cameras = 2;
    options.gps_sigma_m = 0;
    options.calibrate = false;
    SimulatedBlock block = simulate_block(options);
    std::vector<Pose>& truth = block.truth.mounts[RigIndex(0)];
    Rig& rig = block.block.rigs[RigIndex(0)];
    const Eigen::Vector3d shift = reference - truth[0].centre;
    for (Pose& frame : block.truth.frames) frame.centre -= frame.rotation.conjugate() * shift;
    truth[0].centre = rig.mounts[0].pose.centre = reference;
    truth[1].centre = rig.mounts[1].pose.centre = mount;
    rig.mounts[1].rotation_sigma_rad = rig.mounts[1].position_sigma_m = mount_sigma_m;
    return block;
  }
};

// With columns of unit length.
Eigen::MatrixXd jacobian(const TileProblem& problem, const TileState& state) {
  CeresTile ceres(problem, state, {CeresOptions::Derivatives::kAutomatic, {}});
  ceres::Problem::EvaluateOptions options;
  options.parameter_blocks = ceres.unknown_blocks();
  ceres::CRSMatrix sparse;
  EXPECT_TRUE(ceres.problem().Evaluate(options, nullptr, nullptr, nullptr, &sparse));
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(sparse.num_rows, sparse.num_cols);
  for (std::size_t row = 0; row + 1 < sparse.rows.size(); ++row)
    for (auto i = static_cast<std::size_t>(sparse.rows[row]); i < static_cast<std::size_t>(sparse.rows[row + 1]); ++i)
      matrix(static_cast<Eigen::Index>(row), sparse.cols[i]) = sparse.values[i];
  matrix.colwise().normalize();
  return matrix;
}

int defect_of(const TileProblem& problem, const TileState& state) {
  int dimension = 0;
  for (const DatumDefect& defect : datum_defects(problem, state)) dimension += defect.dimension;
  return dimension;
}

TEST(DatumOfRig, DefectIsTheNullSpaceOfTheJacobian) {
  const Eigen::Vector3d reference(0.7, -0.4, 0.5), away(-0.3, 0.2, 0.9);
  struct Case {
    Eigen::Vector3d mount;
    double sigma_m;
    int defect;
    const char* name;
  };
  for (const Case& c : {Case{away, kFree, 7, "free mount"}, Case{away, 0.02, 6, "mount with a prior"},
                        Case{Eigen::Vector3d::Zero(), 0.02, 6, "mount with a prior at the origin of the rig"},
                        Case{reference, 0.02, 7, "mount with a prior at the reference"}}) {
    const Streets tile(reference, c.mount, c.sigma_m);
    const Eigen::MatrixXd j = jacobian(tile.problem, tile.state);
    const Eigen::VectorXd values = symmetric_eigen(j.transpose() * j).values;
    EXPECT_LT(values(c.defect - 1), 1e-11) << c.name;
    EXPECT_GT(values(c.defect), 1e-10) << c.name;
    EXPECT_EQ(defect_of(tile.problem, tile.state), c.defect) << c.name;
  }
}

// The constraints hold nothing that the observations determine. A mount that its prior puts three per cent farther from
// the reference makes the whole block three per cent larger, and all residuals are zero then.
TEST(DatumOfRig, ConstraintsShiftNothing) {
  const Eigen::Vector3d reference(0.7, -0.4, 0.5);
  Streets tile(reference, Eigen::Vector3d::Zero(), 0.02);
  ASSERT_EQ(tile.problem.mount_priors.size(), 1u);
  tile.problem.mount_priors[0].value.centre = -0.03 * reference;
  const AdjustSummary summary = solve_with_ceres(tile.problem, tile.state, 50, 1e-14);
  ASSERT_TRUE(summary.usable);
  EXPECT_GT(summary.initial_cost, 0.5);
  EXPECT_LT(summary.final_cost, 1e-9);
  EXPECT_LT((tile.state.mounts[1].centre + 0.03 * reference).norm(), 1e-6);
}

}  // namespace
}  // namespace megablock
