#include "merge/tree/merge_in_memory.h"

#include <limits>
#include <utility>

#include "merge/tile/cluster_scores.h"

namespace megablock {

namespace {

// Keeps all tiles in memory.
MemoryOptions with_all_tiles(MemoryOptions memory) {
  memory.tile_bytes = std::numeric_limits<std::int64_t>::max();
  return memory;
}

void add_tiles(const std::vector<TileProblem>& problems, const std::vector<TileState>& states, TileStore& tiles) {
  for (std::size_t t = 0; t < problems.size(); ++t) tiles.add({static_cast<std::int64_t>(t), problems[t], states[t]});
}

TileStore& filled(TileStore& tiles, const std::vector<TileProblem>& problems, const std::vector<TileState>& states) {
  add_tiles(problems, states, tiles);
  return tiles;
}

}  // namespace

MergeInMemory::MergeInMemory(const MergeTree& tree, std::vector<TileProblem> problems, std::vector<TileState> states,
                             MemoryOptions memory, const NodeSolver& solver)
    : tiles_(with_all_tiles(memory)),
      runner_(process_, tree, std::vector<int>(problems.size(), 0), filled(tiles_, problems, states), memory, solver),
      problems_(std::move(problems)),
      states_(std::move(states)),
      unknown_steps_(problems_.size()) {
  for (std::size_t t = 0; t < problems_.size(); ++t) tile_plans_.push_back(runner_.tile_plan(t));
  runner_.expect_scores(1);
  runner_.on_step([this](std::size_t row, const Step& step) { unknown_steps_[row] = step; });
}

void MergeInMemory::read_states() {
  for (std::size_t t = 0; t < states_.size(); ++t) states_[t] = tiles_.outline(t).state;
}

DownReport MergeInMemory::down(const Sweep& sweep) {
  sweep_ = sweep;
  steps_.clear();
  return runner_.down(sweep);
}

void MergeInMemory::accept() {
  runner_.accept();
  read_states();
}

UpReport MergeInMemory::final_up() {
  covariances_.assign(problems_.size(), {});
  posterior_ = runner_.posterior([this](const RankTile& tile, const TileCovariance& covariance) {
    covariances_[static_cast<std::size_t>(tile.tile)] = covariance;
  });
  gauge_ = judge_gauge(posterior_.sums, posterior_.gauge);
  return {posterior_.sums};
}

void MergeInMemory::final_scores() {
  empirical_.assign(problems_.size(), {});
  empirical_frames_ = posterior_.frames;
  const CovarianceMatrix scored =
      runner_.scored_posterior([this](const RankTile& tile, const TileCovariance& of_scores) {
        const auto t = static_cast<std::size_t>(tile.tile);
        TileCovariance& empirical = empirical_[t] = covariances_[t];
        const double ratio = cluster_weights(posterior_.spread).ratio;
        const auto change = [&](auto& formal, const auto& with_scores) {
          for (std::size_t i = 0; i < formal.size(); ++i)
            formal[i] = empirical_covariance(formal[i], with_scores[i], ratio);
        };
        change(empirical.frames, of_scores.frames);
        change(empirical.aligned_frames, of_scores.aligned_frames);
        change(empirical.cameras, of_scores.cameras);
        change(empirical.mounts, of_scores.mounts);
        for (std::size_t p = 0; p < empirical.points.size(); ++p)
          if (problems_[t].points[p].role != PointRole::kTie)
            empirical.points[p] = empirical_covariance(empirical.points[p], of_scores.points[p], ratio);
      });
  for (std::size_t i = 0; i < scored.matrix.size(); ++i)
    empirical_frames_.matrix[i] = empirical_difference(empirical_frames_.matrix[i], scored.matrix[i]);
}

const std::vector<TileStep>& MergeInMemory::steps() const {
  for (std::size_t t = steps_.size(); t < problems_.size(); ++t)
    steps_.push_back(solve_tile_down(problems_[t], tile_plans_[t], states_[t], sweep_, TileFactor(),
                                     unknown_steps_[t].restricted_to(tile_plans_[t].boundary), runner_.datum_of(t)));
  return steps_;
}

}  // namespace megablock
