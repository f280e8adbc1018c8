// Tests whether two halves of the block agree about the unknowns that they share.
//
// For the condensed normal equations q_a, q_b of two children, at a common linearisation point and with lambda = 0,
//
//     T = 2 (min(q_a + q_b) - min q_a - min q_b) = s_a'S_a^+ s_a + s_b'S_b^+ s_b - (s_a + s_b)'(S_a + S_b)^+ (s_a +
//     s_b)
//
// is chi-square distributed with rank S_a + rank S_b - rank(S_a + S_b) degrees of freedom. Here q(x) = 1/2 x'S x - s'x
// + const, so that twice its minimum is -s'S^+ s, up to the constant. T is thus the growth of the weighted sum of
// squares when both halves must have the same values for the common unknowns; such a growth is chi-square distributed
// with as many degrees of freedom as conditions. This also holds for singular S (halves without a datum), and for
// unknowns that only one half has. Some of the common unknowns are eliminated at the node, and s'S^+ s = |z|^2 +
// s_p'S_p^+ s_p, with z and S_p of the front's factor and update matrix (front.h). The check of a node therefore takes
// a single further factorisation, that of its update matrix.
#pragma once

#include <array>
#include <vector>

#include "merge/datum/gauge.h"
#include "merge/front/front.h"

namespace megablock {

// The probability of a false alarm in the whole block. It is divided by the number of seams.
inline constexpr double kSeamAlarmProbability = 1e-3;

struct SeamReport {
  std::int64_t node = -1;    // of the merge tree
  double statistic = 0;      // T
  std::int64_t degrees = 0;  // degrees of freedom; 0: nothing in common, no check
  double threshold = 0;      // limit of T at the alarm probability
  bool alarm() const { return degrees > 0 && statistic > threshold; }
};

// The least squares of condensed normal equations alone. Their right-hand side lies in the range of their matrix.
LeastSquares least_squares(const UpdateMatrix& condensed);

// `left` and `right` are the least squares of the halves alone. `together` is the result of the front of their sum,
// with UpdateMatrix::alone filled in. `probability` is that of a false alarm at this seam. T is divided by
// `variance_factor` (1 = a priori).
SeamReport check_seam(std::int64_t node, const LeastSquares& left, const LeastSquares& right,
                      const Front::Result& together, double probability, double variance_factor = 1);

// T tests all common unknowns at once. One or two frames that a tile sees differently drown in hundreds of degrees of
// freedom. The information of a tile about a few scalar unknowns u is therefore tested alone. Suppose that u may differ
// by v between the tile and the rest of the block. At the optimum of the block, the score for v is g = b_u of the tile
// alone, and
//
//     T_u = g' A^+ g,   A = S_uu - S_u C S_u'   (normal equations of v after elimination of the block)
//
// is chi-square distributed with rank A degrees of freedom, and with non-centrality v'Av where u does differ. S_u are
// the rows of u in the condensed normal equations of the tile, and C is the covariance of the block. The neighbouring
// frames and the points of both sides are thus adjusted along with v. This is Baarda's test of a bias v; no test that
// does not know the direction of v has more power. Three kinds of u are tested, with a third of the alarm probability
// each:
//  * every separator or shared unknown as a whole,
//  * the rotation of every frame,
//  * the rotations of every two frames.
// The last two kinds leave out frames about whose rotation the tile has less than a quarter of its best information.
// They would only raise the limits.
struct UnknownCheck {
  UnknownId id, other;       // other.index < 0: one unknown
  bool turn = false;         // only the rotation of the frame is tested, not its position
  double statistic = 0;      // T_u
  std::int64_t degrees = 0;  // degrees of freedom; 0: no check
  double threshold = 0;      // limit of T_u at the alarm probability
  bool alarm() const { return degrees > 0 && statistic > threshold; }
  double excess() const { return statistic - threshold; }
  bool shares_unknown(const UnknownCheck& check) const;
};

// Whether a tile agrees with itself and with the rest of the block. It serves to name the tile behind an alarm.
struct TileCheck {
  std::int64_t tile = -1;
  double own_chi2 = 0;  // chi-square of the tile's residuals in its own adjustment
  std::int64_t own_degrees = 0;
  double statistic = 0;  // T of the tile against the rest
  std::int64_t degrees = 0;
  double threshold = 0;
  std::array<UnknownCheck, 4> worst;  // the worst ones by excess, the worst first; no two have an unknown in common
  bool alarm() const { return degrees > 0 && statistic > threshold; }
};
// Checks a tile from its condensed normal equations and from the covariance of its separator unknowns in the block,
// with lambda = 0 and at the optimum, where the gradient of the rest is minus that of the tile.
TileCheck check_tile(std::int64_t tile, const UpdateMatrix& condensed, const CovarianceMatrix& boundary,
                     double probability, double variance_factor = 1);

// A tile whose own residuals do not fit together is wrong, even if its neighbours agree with it. Its chi-square is
// compared with the variance factor of the other tiles, not with one. The sigma of the observations is only estimated,
// to 2 %, and losses and limits cut the tails of correct observations; with a million degrees of freedom, a comparison
// with one would raise an alarm for either reason. The ratio of the two factors has an F distribution. The photographs
// of one block are not all equally sharp, so that only a ratio above kUsualVarianceRatio counts.
inline constexpr double kUsualVarianceRatio = 1.5;
struct NoisyTile {
  std::int64_t tile = -1;
  double ratio = 1;  // its variance factor over that of the other tiles, without those that are worse
};
std::vector<NoisyTile> noisy_tiles(const std::vector<TileCheck>& tiles);  // the worst first

}  // namespace megablock
