#include "cluster/outcome/result_tile.h"

#include <utility>

#include "adjust/checks/prior_test.h"
#include "adjust/terms/build_problem.h"
#include "adjust/tile/image_sigma.h"
#include "adjust/tile/sigma_scales.h"

namespace megablock {

ResultTile tile_of_result(const BlockResult& result, const ObservationOptions& options) {
  Tiles one = result.tiles;
  one.tile_count = 1;
  for (TileIndex& tile : one.tile_of_frame)
    if (tile.valid()) tile = TileIndex(0);
  ResultTile single;
  single.problem = make_tile_problem(result.block, result.state, one, TileIndex(0), result.tracks, options);
  TileProblem& problem = single.problem;
  set_image_sigma(problem, result.image_sigma_px);
  SigmaScales scales;
  for (std::size_t k = 0; k < kObservationKinds; ++k) scales.of[k] = result.observation_table.kinds[k].scale;
  for (const PositionScale& scale : result.position_scales) scales.set_positions(scale);
  scale_sigmas(problem, scales);
  std::vector<PriorId> aside;
  for (const FrameIndex frame : result.positions_aside) aside.push_back({frame.value, 0});
  for (const std::int64_t row : result.control_aside) aside.push_back({row, 1});
  set_aside(aside, problem);
  std::vector<Eigen::Vector3d> points = result.points;
  for (std::size_t row = 0; row < result.kept.size(); ++row) problem.kept[row] &= result.kept[row];
  for (std::size_t p = points.size(); p < problem.points.size(); ++p) {
    constexpr double kMaxSigmas = 4;
    const auto& control = result.control[static_cast<std::size_t>(problem.points[p].index)];
    points.push_back(control.adjusted);
    for (std::int64_t row = problem.begin[p]; row < problem.begin[p + 1]; ++row) {
      const double length = control.residual_px[static_cast<std::size_t>(row - problem.begin[p])].norm();
      problem.kept[static_cast<std::size_t>(row)] &=
          length * problem.inverse_sigma[static_cast<std::size_t>(row)] <= kMaxSigmas;
    }
  }
  single.state = make_tile_state(problem, result.state, std::move(points));
  return single;
}

}  // namespace megablock
