// Computes what the adjusted block needs besides its state: the seam checks, the datum, the covariances, and the checks
// of the tiles.
//
// A sweep up with lambda = 0 makes the factors, with the seam checks on its way. Where the datum is free, this sweep
// has the right-hand sides W N of inner_constraints.h, and a sweep down of steps gives Z = C W N and the sums M and K.
// In a small block a sweep after it has the columns of all frames.
// The covariances then come down the tree: each front gets C_PP from its parent and gives C_EE and C_PE
// (front_covariance.cpp). The covariances of a tile are not kept after its visit, so that those of the whole block are
// never in memory together.
//
// The empirical covariances need a second sweep up and down, with the scores of the clusters. The first sweep down
// computes the contribution of whole images (cluster_scores.h).
#include <algorithm>
#include <utility>

#include "merge/tile/cluster_scores.h"
#include "merge/tree/gather_by_tile.h"
#include "merge/tree/merge_tree_runner.h"
#include "merge/tree/sweep_values.h"

namespace megablock {

void MergeTreeRunner::covariances_down(const VisitTileCovariance& before, const VisitCovariance& visit) {
  std::vector<TileStep> steps(tiles_.size());
  InnerSums inner_constraints;
  if (columns_ != DatumColumns::kNone) {
    steps = steps_down(0);
    inner_constraints = gather_inner_sums(steps);
  }
  for (std::int64_t n = plan_.root(); n >= 0; --n) {
    if (!mine(n)) continue;
    CovarianceMatrix separator = from_parent<CovarianceMatrix>(n);
    const PlanNode& node = plan_.nodes[static_cast<std::size_t>(n)];
    factors_.leave_room(pending_update_bytes() + front_bytes(n));
    const NodeFactors& factors = factors_of(n, 0);
    if (node.leaf < 0) {
      const FrontCovariance covariance = solver_.covariance(factors.front, std::move(separator));
      factors_.discard(n);
      send_down(n, covariance);
      continue;
    }
    const std::size_t row = row_of_leaf(n);
    const RankTile& tile = tiles_.whole(row);
    const TilePlan& plan = tile_plans_[row];
    const Step& step = steps[row].unknowns;
    // This comes before the covariances of the tile, which take over the memory of `separator`.
    before(row, factors, separator);
    TileCovariance covariance =
        covariance_tile(tile.problem, plan, tile.state, factors.tile, std::move(separator), datum_of(row), step);
    factors_.discard(n);
    if (columns_ != DatumColumns::kNone)
      to_inner_constraints(gauge_, inner_constraints, tile.tile, tile.problem, plan, tile.state, step, covariance);
    visit(tile, covariance);
  }
  ranks_.flush_sends();
}

MergeTreeRunner::Posterior MergeTreeRunner::posterior(const VisitCovariance& visit) {
  Posterior posterior;
  const SweepSeconds of_iterations = seconds_;
  check_seams_ = true;
  if (last_sweep_) {
    posterior.sums = *std::exchange(last_sweep_, std::nullopt);
  } else {
    find_gauges();  // frames, cameras and mounts may have moved with other tiles
    gauge_ = gather_gauge();
    if (gauge_.free()) columns_ = DatumColumns::kSimilarities;
    posterior.sums = condense_all(0).sums;
  }
  posterior.gauge = gauge_;

  std::vector<TileCheck> checks(tiles_.size());
  std::vector<ObservationTable> tables(tiles_.size());
  std::vector<ImageSpread> spreads(tiles_.size());
  std::size_t last = 0;
  covariances_down(
      [&](std::size_t row, const NodeFactors& factors, const CovarianceMatrix& separator) {
        last = row;
        checks[row] = check_tile(tiles_.number(row), factors.condensed, separator, seam_probability());
      },
      [&](const RankTile& tile, const TileCovariance& covariance) {
        tables[last] = covariance.observations;
        spreads[last] = covariance.spread;
        if (visit) visit(tile, covariance);
      });
  check_seams_ = false;
  columns_ = DatumColumns::kNone;
  const std::vector<SeamReport> seams = seams_;  // a further sweep clears them
  posterior.frames = frame_covariance_of_small_block();
  posterior.tile_checks = gather_by_tile(ranks_, plan_.node_of_leaf.size(), tiles_, checks);
  for (const ObservationTable& table : gather_by_tile(ranks_, plan_.node_of_leaf.size(), tiles_, tables))
    posterior.observations.add(table);
  for (const ImageSpread& spread : gather_by_tile(ranks_, plan_.node_of_leaf.size(), tiles_, spreads))
    posterior.spread.add(spread);
  cluster_weights_ = cluster_weights(posterior.spread);

  // Each rank knows the seams of its own nodes; all get all of them, in the order of the nodes.
  ByteWriter writer;
  writer.values(seams);
  for (const Bytes& bytes : ranks_.gather_all(writer.take())) {
    ByteReader reader(bytes);
    const std::vector<SeamReport> some = reader.values<SeamReport>();
    posterior.seams.insert(posterior.seams.end(), some.begin(), some.end());
  }
  std::sort(posterior.seams.begin(), posterior.seams.end(),
            [](const SeamReport& a, const SeamReport& b) { return a.node < b.node; });
  seconds_ = of_iterations;
  return posterior;
}

// Nothing is recorded of this sweep: a killed run repeats the posterior from its beginning.
CovarianceMatrix MergeTreeRunner::scored_posterior(const VisitCovariance& visit) {
  SweepRecorder* const recorder = std::exchange(recorder_, nullptr);
  const SweepSeconds of_iterations = seconds_;
  with_scores_ = true;
  CovarianceMatrix frames = frame_covariance_of_small_block();
  if (gauge_.free()) columns_ = DatumColumns::kSimilarities;
  condense_all(0);
  covariances_down([](std::size_t, const NodeFactors&, const CovarianceMatrix&) {}, visit);
  columns_ = DatumColumns::kNone;
  with_scores_ = false;
  seconds_ = of_iterations;
  recorder_ = recorder;
  return frames;
}

}  // namespace megablock
