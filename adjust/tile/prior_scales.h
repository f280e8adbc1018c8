// Decides when the losses of positions and control points may ignore gross errors, and finds stated sigmas that are far
// too small.
//
// A loss with Cauchy's tail ignores what is far off. It is right near the solution, where only outliers are far off,
// and as long as the stated sigmas are about right. Far from the solution it would ignore good observations, and with
// sigmas that are stated ten times too small it would ignore most of them. The block is therefore first adjusted with
// losses that pull from any distance (RobustLoss::from_afar), and then with those of the options. The residuals of this
// second solution tell whether the sigmas of a kind of observation are far too small:
//
//     factor = med |r| / (m sqrt(q)),   m = 1.1774 for two numbers, 0.6745 for one,   q = 1 - 7 / n
//
// with |r| the horizontal or vertical part of a residual in sigmas, and q the redundancy of the n numbers that place
// the block, of which a similarity takes seven (at least a half is left). Each group of positions with a shift is a
// kind of its own, whose shift takes one number of each axis: q - 1 / n_g with n_g positions. The median does not
// notice gross errors. In the first solution it would: there an outlier at the edge of a block bends it, until good
// points are off as well. A factor below three is left to the loss, which such sigmas do not mislead: of
// three-dimensional residuals a quarter is then beyond twice the corner. From three on the sigmas of this kind are
// multiplied by the factor, and the result says so.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "adjust/terms/terms.h"

namespace megablock {

// Counts lengths in bins of nine per cent in ratio. Sums of counts do not depend on their order, and the memory not on
// their number.
class LengthCounts {
 public:
  void add(double length);  // in sigmas
  void add(const LengthCounts& other);
  std::int64_t total() const;
  double median() const;                // middle of its bin; 0 where nothing was counted
  bool any_above(double length) const;  // in a bin above that of the length

 private:
  static std::size_t bin_of(double length);
  static constexpr int kBins = 200;  // eight for each doubling, from 1/32 to 2^20 sigmas
  std::array<std::int64_t, kBins> counts_{};
};

// The residuals of positions and control points in sigmas, without those that are held.
struct PriorLengths {
  struct OfGroup {
    RigIndex group;
    LengthCounts horizontal, height;
  };
  LengthCounts position_horizontal, position_height, control_horizontal, control_height;
  std::vector<OfGroup> groups;  // ascending; the positions above belong to none
  OfGroup& of(RigIndex group);
  void add(const PriorLengths& other);
};
// Those that the tile owns.
PriorLengths prior_lengths(const TileProblem& problem, const TileState& state);

// The factors by which the sigmas of positions and control points must be multiplied; the block was adjusted with `now`
// times the stated sigmas. The product of all factors is one, or three and more. Other kinds have the factor 1.
// Groups have factors of their own, as long as SigmaScales has place for them; those beyond count as positions without
// a group. A group with too few residuals for a median has the factors of positions without a group, and no say in
// them, because its shift takes up most of its residuals.
SigmaScales contradicted_sigma_scales(const SigmaScales& now, const PriorLengths& lengths);

// Sets the losses of positions and control points: those of the options, from afar or as they are.
void set_losses_from_afar(TileProblem& problem, const ObservationOptions& options);
// None: in least squares a single gross error is the observation that contradicts the rest most (prior_test.h), where a
// loss may have settled with it against good ones.
void set_no_losses(TileProblem& problem);
void set_last_losses(TileProblem& problem, const ObservationOptions& options);

}  // namespace megablock
