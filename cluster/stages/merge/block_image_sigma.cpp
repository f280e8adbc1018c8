#include "cluster/stages/merge/block_image_sigma.h"

#include <algorithm>
#include <cmath>

#include "adjust/tile/image_sigma.h"
#include "io/store/units/adjustment_file.h"
#include "merge/scratch/bytes.h"
#include "merge/tree/gather_by_tile.h"

namespace megablock {

namespace {

std::int64_t orientation_unknowns(const Block& block, const BlockState& state) {
  std::int64_t count = 6 * std::count(state.oriented.begin(), state.oriented.end(), std::uint8_t{1});
  for (const Camera& camera : block.cameras)
    count += std::count_if(camera.prior_sigma.begin(), camera.prior_sigma.begin() + camera.intrinsics.size(),
                           [](double sigma) { return sigma != 0; });
  for (const Rig& rig : block.rigs)
    count += 6 * std::count_if(rig.mounts.begin(), rig.mounts.end(), [](const Mount& mount) { return !mount.held(); });
  return count;
}

// Sums the residuals in tile order, so that the bits do not depend on the ranks.
ImageResiduals block_image_residuals(const Job& job, TileStore& own, std::size_t tile_count) {
  std::vector<ImageResiduals> residuals;  // [own]
  for (std::size_t row = 0; row < own.size(); ++row) {
    const RankTile& tile = own.whole(row);
    residuals.push_back(image_residuals(tile.problem, tile.state, job.settings.adjustment));
  }
  const std::vector<ImageResiduals> by_tile = gather_by_tile(job.ranks, tile_count, own, residuals);
  ImageResiduals sum;
  for (const ImageResiduals& tile : by_tile) sum.add(tile);
  return sum;
}

}  // namespace

double start_image_sigma(const Job& job, const std::vector<std::string>& adjusted) {
  const AdjustOptions& options = job.settings.adjustment;
  if (!options.estimate_image_sigma) return options.observations.image_sigma_px;
  double sum = 0, weight = 0;
  for (const std::string& name : adjusted) {
    if (name.empty()) continue;
    const TileAdjustment tile = read_adjustment(job.store.verified_path(name));
    const auto kept = static_cast<double>(std::count(tile.kept.begin(), tile.kept.end(), std::uint8_t{1}));
    sum += kept * tile.image_sigma_px * tile.image_sigma_px;
    weight += kept;
  }
  return weight > 0 ? std::sqrt(sum / weight) : options.observations.image_sigma_px;
}

bool adopt_image_sigma(const Job& job, TileStore& own, std::size_t tile_count, const BlockState& oriented) {
  constexpr double kSettled = 0.02;
  if (!job.settings.adjustment.estimate_image_sigma) return false;
  const auto sigma =
      image_sigma(block_image_residuals(job, own, tile_count), orientation_unknowns(job.block, oriented));
  if (!sigma) return false;
  bool changed = false;
  for (std::size_t row = 0; row < own.size(); ++row) {
    if (std::abs(*sigma / own.outline(row).problem.image_sigma_px - 1) < kSettled) continue;
    own.change(row, [&](RankTile& tile) { set_image_sigma(tile.problem, *sigma); });
    changed = true;
  }
  return job.ranks.any(changed);
}

double common_image_sigma(const Job& job, const TileStore& own) {
  ByteWriter writer;
  writer.value(own.size() == 0 ? 0.0 : own.outline(0).problem.image_sigma_px);
  double sigma = 0;
  for (const Bytes& bytes : job.ranks.gather_all(writer.take())) {
    sigma = std::max(sigma, ByteReader(bytes).value<double>());
  }
  return sigma;
}

}  // namespace megablock
