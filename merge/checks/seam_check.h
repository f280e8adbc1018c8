// The seam check tests whether two halves of the block agree about the unknowns that they share.
//
// For the condensed normal equations q_a, q_b of two children at a common linearisation point with lambda = 0,
//
//     T = 2 (min(q_a + q_b) - min q_a - min q_b) = s_a'S_a^+ s_a + s_b'S_b^+ s_b - (s_a + s_b)'(S_a + S_b)^+ (s_a +
//     s_b)
//
// is chi-square distributed with rank S_a + rank S_b - rank(S_a + S_b) degrees of freedom. This also holds for singular
// S (halves without a datum), and for unknowns that only one half has. Part of the common unknowns has been eliminated:
// s'S^+ s = |z|^2 + s_p'S_p^+ s_p with z and S_p of the front's factor and update matrix (front.h), so that each node
// of the tree takes one factorisation, that of its separator.
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

// The least squares of condensed normal equations by themselves. Their right-hand side lies in the range of their
// matrix.
LeastSquares least_squares(const UpdateMatrix& condensed);

// `left`, `right`: least squares of the halves alone; `together`: the front of their sum, with UpdateMatrix::alone.
// `probability`: of a false alarm at this seam. variance_factor: T is divided by it (1 = a priori).
SeamReport check_seam(std::int64_t node, const LeastSquares& left, const LeastSquares& right,
                      const Front::Result& together, double probability, double variance_factor = 1);

// T tests all common unknowns at once, and one or two frames that a tile sees differently drown in hundreds of degrees
// of freedom. The information of a tile on a few scalar unknowns u is therefore tested by itself. If u could differ by
// v between the tile and the rest, the score for v at the block's optimum would be g = b_u of the tile alone, and
//
//     T_u = g' A^+ g,   A = S_uu - S_u C S_u'   (v's normal equations after elimination of the block)
//
// is chi-square distributed with rank A degrees of freedom, and with non-centrality v'Av where they do differ. S_u:
// rows of the tile's condensed normal equations. The neighbouring frames and the points of both sides are adjusted
// along with v. This is Baarda's test of a bias v; no test that does not know the direction of v has more power. The
// choice of u remains. It is, with a third of the alarm probability each,
//   * every boundary or shared unknown as a whole,
//   * the rotation of every frame,
//   * the rotations of every two frames,
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
// Checks a tile from its condensed normal equations and the block's covariance of its boundary unknowns, with lambda =
// 0 and at the optimum, where the gradient of the rest is minus that of the tile.
TileCheck check_tile(std::int64_t tile, const UpdateMatrix& condensed, const CovarianceMatrix& boundary,
                     double probability, double variance_factor = 1);

// A tile whose own residuals do not fit together is wrong whatever its neighbours say. Its chi-square is compared with
// the variance factor of the other tiles, not with one: the sigma of the observations is estimated from all of them, to
// 2 %, and losses and limits cut the tails of correct observations; with a million degrees of freedom either would
// raise an alarm. The ratio of the two factors has an F distribution. The photographs of one block are not all equally
// sharp, so that only a ratio above kUsualVarianceRatio counts.
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
