// Seam check: do two halves of the block agree about the unknowns they share?
//
// For the condensed normal equations q_a, q_b of two children at a common linearisation point with lambda = 0,
//
//     T = 2 (min(q_a + q_b) - min q_a - min q_b) = s_a'S_a^+ s_a + s_b'S_b^+ s_b - (s_a + s_b)'(S_a + S_b)^+ (s_a +
//     s_b)
//
// is chi-square distributed with rank S_a + rank S_b - rank(S_a + S_b) degrees of freedom; it holds for singular S too
// (halves without a datum), and for unknowns that only one half has. What both have together has been eliminated in
// part: s'S^+ s = |z|^2 + s_p'S_p^+ s_p with z and S_p of the front's factor and update matrix (front.h), so that each
// node of the tree takes one factorisation, of what it passes on.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "io/block/image_graph.h"
#include "merge/datum/gauge.h"
#include "merge/front/front.h"

namespace megablock {

inline constexpr double kSeamAlarmProbability = 1e-3;  // of the whole block, divided by the number of seams

struct SeamReport {
  std::int64_t node = -1;    // of the merge tree
  double statistic = 0;      // T
  std::int64_t degrees = 0;  // of freedom; 0: nothing in common, no check
  double threshold = 0;      // of T at the alarm probability
  bool alarm() const { return degrees > 0 && statistic > threshold; }
};

// Of condensed normal equations by themselves; their right-hand side lies in the range of their matrix.
LeastSquares least_squares(const UpdateMatrix& condensed);

// `left`, `right`: of the halves alone; `together`: the front of their sum, its update matrix with what it is alone.
// `probability`: of a false alarm at this seam. variance_factor: T is divided by it (1 = a priori).
SeamReport check_seam(std::int64_t node, const LeastSquares& left, const LeastSquares& right,
                      const Front::Result& together, double probability, double variance_factor = 1);

// T asks all common unknowns at once, and one or two frames that a tile sees differently drown in hundreds of degrees
// of freedom. So what a tile says of a few scalar unknowns u is tested by itself: were they free to differ by v between
// the tile and the rest, the block's optimum would have the score g = b_u of the tile alone for v, and
//
//     T_u = g' A^+ g,   A = S_uu - S_u C S_u'   (v's normal equations after elimination of the block)
//
// is chi-square distributed with rank A degrees of freedom, and with non-centrality v'Av where they do differ. S_u:
// rows of the tile's condensed normal equations. All else, the neighbouring frames and the points of both sides, is
// adjusted with it: this is Baarda's test of a bias v, and of tests that do not know v's direction none has more power.
// Only what u is remains open. It is, with a third of the alarm probability each,
//   * every boundary or shared unknown as a whole,
//   * the turn of every frame,
//   * the turns of every two frames,
// turns of those frames alone that show half as well as the best of the tile: the others would only raise the limits.
struct UnknownCheck {
  UnknownId id, other;       // other.index < 0: one unknown
  bool turn = false;         // of a frame, without its position
  double statistic = 0;      // T_u
  std::int64_t degrees = 0;  // of freedom; 0: no check
  double threshold = 0;      // of T_u at the alarm probability
  bool alarm() const { return degrees > 0 && statistic > threshold; }
  double excess() const { return statistic - threshold; }
  bool shares_unknown(const UnknownCheck& check) const;
};

// A tile's own consistency and its agreement with the rest of the block, used to name the tile behind an alarm.
struct TileCheck {
  std::int64_t tile = -1;
  double own_chi2 = 0;  // of the tile's residuals in its own adjustment
  std::int64_t own_degrees = 0;
  double statistic = 0;  // T of the tile against the rest
  std::int64_t degrees = 0;
  double threshold = 0;
  std::array<UnknownCheck, 4> worst;  // by excess, the worst first; no two share an unknown
  bool alarm() const { return degrees > 0 && statistic > threshold; }
};
// From the tile's condensed normal equations and the block's covariance of its boundary unknowns (lambda = 0, at the
// optimum, where the rest's gradient is minus the tile's).
TileCheck check_tile(std::int64_t tile, const UpdateMatrix& condensed, const CovarianceMatrix& boundary,
                     double probability, double variance_factor = 1);

// A tile whose residuals do not fit together even by themselves is wrong whatever its neighbours say. The measure of
// its own chi-square is the variance factor of the other tiles, not one: the sigma of the measurements is estimated
// from all of them, to 2 %, and losses and limits take from the tails of what is right; with a million degrees of
// freedom any of that would fail. The ratio of both factors has an F distribution; and photographs of one block are not
// all equally sharp, so that only what exceeds kUsualVarianceRatio counts.
inline constexpr double kUsualVarianceRatio = 1.5;
struct NoisyTile {
  std::int64_t tile = -1;
  double ratio = 1;  // of its variance factor to that of the others, those left out that are worse
};
std::vector<NoisyTile> noisy_tiles(const std::vector<TileCheck>& tiles);  // the worst first

// One line per disagreement, the three worst of each kind. First of tiles with themselves (noisy_tiles). Then of tiles
// with the rest: the unknowns, the figures, and the tile. Where other tiles explain it
// about as well, they are named too: of a frame that two tiles alone see, either may be wrong. Since 2 ln of the ratio
// of likelihoods is the difference of T, a tile is named alone at 1 : kSeamAlarmProbability.
std::vector<std::string> describe_disagreements(
    const std::vector<TileCheck>& tiles, const UnknownName& name = [](const UnknownId& id) { return describe(id); });

// One line per alarm: the seam, its figures, and the tile under it that explains it: one of noisy_tiles, else the one
// that clears most alarms when it is taken out, of seams above it and of its own against the rest, of equals the one
// whose T is the largest part of its limit; then the same for the alarms that are left. All tiles, in tile order.
std::vector<std::string> describe_seams(const MergeTree& tree, const std::vector<SeamReport>& seams,
                                        const std::vector<TileCheck>& tiles);

}  // namespace megablock
