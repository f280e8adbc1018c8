#include "merge/checks/seam_text.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ranges>
#include <set>

namespace megablock {

namespace {

constexpr std::size_t kLines = 3;  // lines of one kind; the rest is only counted

std::vector<std::string> describe_noise(const std::vector<TileCheck>& tiles) {
  const std::vector<NoisyTile> noisy = noisy_tiles(tiles);
  std::vector<std::string> lines;
  for (const NoisyTile& tile : noisy | std::views::take(kLines)) {
    char line[120];
    std::snprintf(line, sizeof line, "tile %lld disagrees with itself: residuals %.1f times those of the other tiles",
                  static_cast<long long>(tile.tile), std::sqrt(tile.ratio));
    lines.emplace_back(line);
  }
  if (noisy.size() > kLines)
    lines.push_back(std::to_string(noisy.size() - kLines) + " more tiles that disagree with themselves");
  return lines;
}

// For each node of the tree, the tile that explains its alarm; -1: no alarm.
std::vector<std::int64_t> explain(const MergeTree& tree, const std::vector<SeamReport>& seams,
                                  const std::vector<TileCheck>& tiles) {
  std::vector<std::int64_t> explained(tree.nodes.size(), -1), leaf(tiles.size(), -1);
  std::vector<bool> alarm(tree.nodes.size(), false);
  for (const SeamReport& seam : seams) alarm[at(seam.node)] = seam.alarm();
  for (std::size_t n = 0; n < tree.nodes.size(); ++n)
    if (tree.nodes[n].tile.valid()) leaf[at(tree.nodes[n].tile.value)] = static_cast<std::int64_t>(n);

  const auto alarms_above = [&](std::int64_t tile) {
    std::int64_t count = 0;
    for (std::int64_t n = leaf[at(tile)]; n >= 0; n = tree.nodes[at(n)].parent) count += alarm[at(n)];
    return count;
  };
  const auto take_out = [&](std::int64_t tile) {
    for (std::int64_t n = leaf[at(tile)]; n >= 0; n = tree.nodes[at(n)].parent) {
      if (alarm[at(n)]) explained[at(n)] = tile;
      alarm[at(n)] = false;
    }
  };
  for (const NoisyTile& noisy : noisy_tiles(tiles)) take_out(noisy.tile);
  for (;;) {
    const TileCheck* best = nullptr;
    std::pair<std::int64_t, double> most;
    for (const TileCheck& tile : tiles) {
      const std::int64_t seams_cleared = alarms_above(tile.tile);
      if (seams_cleared == 0) continue;
      const std::pair cleared(seams_cleared + tile.alarm(), tile.degrees > 0 ? tile.statistic / tile.threshold : 0);
      if (best == nullptr || cleared > most) best = &tile, most = cleared;
    }
    if (best == nullptr) return explained;
    take_out(best->tile);
  }
}

}  // namespace

std::vector<std::string> describe_disagreements(const std::vector<TileCheck>& tiles, const UnknownName& name) {
  std::vector<std::pair<std::int64_t, UnknownCheck>> all;  // a tile, and an unknown about which it disagrees
  for (const TileCheck& tile : tiles)
    for (const UnknownCheck& check : tile.worst)
      if (check.degrees > 0) all.emplace_back(tile.tile, check);
  std::stable_sort(all.begin(), all.end(),
                   [](const auto& a, const auto& b) { return a.second.excess() > b.second.excess(); });

  // This is twice the logarithm of the likelihood ratio at which a tile is named alone.
  const double decisive = -2 * std::log(kSeamAlarmProbability);
  std::vector<std::string> lines;
  std::size_t more = 0;
  // Of checks with an unknown in common only the worst is reported.
  std::vector<UnknownCheck> said;
  for (const auto& [tile, check] : all) {
    if (!check.alarm()) break;
    if (std::any_of(said.begin(), said.end(), [&](const UnknownCheck& s) { return s.shares_unknown(check); })) continue;
    said.push_back(check);
    if (lines.size() == kLines) {
      ++more;
      continue;
    }
    std::set<std::int64_t> suspects{tile};
    for (const auto& [rival, other] : all)
      if (other.shares_unknown(check) && other.excess() > check.excess() - decisive) suspects.insert(rival);
    std::string who, what = name(check.id);
    for (const std::int64_t suspect : suspects) who += (who.empty() ? "" : " and ") + std::to_string(suspect);
    if (check.other.index >= 0) what += " and " + name(check.other);
    if (check.turn) what = "the turn of " + what;
    char figures[120];
    std::snprintf(figures, sizeof figures, ": T = %.0f with %lld degrees of freedom (limit %.0f)", check.statistic,
                  static_cast<long long>(check.degrees), check.threshold);
    lines.push_back((suspects.size() > 1
                         ? "tiles " + who + " see " + what + " differently, one of them wrongly"
                         : "tile " + who + " sees " + what + " differently from the rest of the block") +
                    figures);
  }
  if (more > 0) lines.push_back(std::to_string(more) + " more unknowns that tiles see differently");
  const std::vector<std::string> first = describe_noise(tiles);
  lines.insert(lines.begin(), first.begin(), first.end());
  return lines;
}

std::vector<std::string> describe_seams(const MergeTree& tree, const std::vector<SeamReport>& seams,
                                        const std::vector<TileCheck>& tiles) {
  const std::vector<std::int64_t> explained = explain(tree, seams, tiles);
  const std::vector<NoisyTile> noisy = noisy_tiles(tiles);
  std::vector<std::string> lines;
  for (const SeamReport& seam : seams) {
    if (!seam.alarm()) continue;
    char line[240];
    std::snprintf(
        line, sizeof line,
        "seam at node %lld: T = %.0f with %lld degrees of freedom (limit %.0f), its sides differ %.1f times what "
        "their sigmas explain",
        static_cast<long long>(seam.node), seam.statistic, static_cast<long long>(seam.degrees), seam.threshold,
        std::sqrt(seam.statistic / static_cast<double>(seam.degrees)));
    lines.emplace_back(line);
    const std::int64_t tile = explained[at(seam.node)];
    if (tile < 0) continue;
    const bool by_itself = std::ranges::find(noisy, tile, &NoisyTile::tile) != noisy.end();
    lines.back() += "; tile " + std::to_string(tile) +
                    (by_itself ? " does not even agree with itself" : " disagrees most with the rest of the block");
  }
  return lines;
}

}  // namespace megablock
