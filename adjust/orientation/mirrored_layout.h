// Tells whether given coordinates fit the points of a block only as a mirror image, as those of a list do that has east
// and north exchanged.
//
// Images give the shape of a block up to a similarity, and no rotation turns a shape into its mirror image. With X_i in
// the model of the images and G_i as given, two hypotheses are fitted,
//
//     G_i = S X_i      and      M G_i = S' X_i,      M: x and y exchanged,      S, S': similarities,
//
// by least trimmed squares, which tolerate gross errors at nearly half of the points. With e the rms of the
// h = floor((n + 4) / 2) smallest distances, the layout is a mirror image where
//
//     e > k e',   e > 3 sigma,   e > 0.002 d,   e' < 0.02 d,      k = 5, or 10 for four or five points,
//
// with d the median distance of the G_i from their middle. All reflections of the plan (x and y exchanged, or one of
// them with the opposite sign) differ by a rotation, so that a similarity cannot tell them apart.
//
// A plane is its own mirror image: turned over, it fits every reflection, and what the points have of relief decides
// alone. Turned over, the images look up, or stand on their heads. S' must therefore leave them as upright as S does
// or more, and not on their heads: right coordinates have the upright block in S, whatever their gross errors.
//
// A model that has its place from observed positions is known up to a shift. Three points then suffice, also of a
// plane, the three reflections are told apart, and e > 0.1 d takes the place of the limits on sigma and side.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "adjust/orientation/steps/levelling.h"

namespace megablock {

enum class Reflection { kExchanged, kFirstReversed, kSecondReversed };  // x and y; the sign of x; that of y

struct MirroredLayout {
  Reflection reflection = Reflection::kExchanged;
  double mirrored_m = 0, given_m = 0;  // e' and e, metres
};

// The model is free up to a similarity. `axes`: of the images, in the model; `sigma_m`: of a given coordinate. Empty
// for coordinates that fit as they are, fewer than four points, and points on a line. Deterministic.
std::optional<MirroredLayout> find_mirrored_layout(std::span<const Eigen::Vector3d> model,
                                                   std::span<const Eigen::Vector3d> given, double sigma_m,
                                                   const MeanAxes& axes);

// The model lies in the ground frame, but for a shift. Empty for fewer than three points.
std::optional<MirroredLayout> find_mirrored_layout_in_place(std::span<const Eigen::Vector3d> model,
                                                            std::span<const Eigen::Vector3d> given);

}  // namespace megablock
