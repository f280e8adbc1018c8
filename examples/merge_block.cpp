// Adjusts a block with the merge of the library, in one process.
//
// The block is simulated, so that its truth is known: 30 aerial images with positions of 5 cm. The block is one tile
// here; a larger one would have several, and MergeInMemory takes them all. The program ends with 1 when the error of
// the adjusted positions does not agree with their standard deviations.
#include <megablock/adjust/terms/build_problem.h>
#include <megablock/io/simulate/blocks/simulate.h>
#include <megablock/merge/tree/merge_in_memory.h>

#include <cmath>
#include <cstdio>

using namespace megablock;

int main() {
  SimulationOptions scene;
  scene.frames = 30;
  scene.calibrate = false;  // the camera is held
  const SimulatedBlock simulated = simulate_block(scene);

  // The start: the poses that the block states, which are metres and degrees off, and the true points.
  const BlockState start = initial_state(simulated.block);
  const Tiles tiles = single_tile(simulated.block);
  const TileProblem problem =
      make_tile_problem(simulated.block, start, tiles, TileIndex(0), simulated.tracks, ObservationOptions());
  const TileState state = make_tile_state(problem, start, simulated.points);

  MergeInMemory merge(tiles.tree, {problem}, {state});
  GlobalState progress = start_global({});
  adjust_globally(merge, {}, progress);
  const SubtreeSums sums = merge.final_up().sums;  // and covariances

  double squares = 0;
  for (std::size_t row = 0; row < problem.frames.size(); ++row) {
    const Eigen::Vector3d error =
        merge.states().front().frames[row].centre - simulated.truth.frames[problem.frames[row]].centre;
    const Eigen::Matrix3d covariance = merge.covariances().front().frames[row].bottomRightCorner<3, 3>();
    squares += error.dot(covariance.inverse() * error) / 3;
  }
  const double ratio = std::sqrt(squares / static_cast<double>(problem.frames.size()));
  std::printf("%s\n%lld observations, errors of positions %.2f times their standard deviations\n",
              describe(progress).c_str(), static_cast<long long>(sums.observations), ratio);
  return ratio > 0.5 && ratio < 1.7 ? 0 : 1;
}
