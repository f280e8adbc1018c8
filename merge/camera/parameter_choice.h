// Chooses which parameters of a camera are estimated: those that the block determines, and without which its images
// would be predicted worse.
//
// The stated sigmas of an adjustment hold for independent errors. Errors of photographs are correlated within an image,
// so a parameter may seem to be many sigmas away from zero and yet change its sign in another half of the block. The
// choice therefore rests on what images say of each other. The frames of a sample are dealt into G groups. With k_g the
// parameters without group g, and m = mean(k_g), the jackknife (Efron 1982) gives the covariance
//
//     C_J = (G - 1) / G sum (k_g - m)(k_g - m)',
//
// which holds for any correlation inside of a group. k_g comes from one step from the common solution
// (camera_equations.h).
//
// Parameters form groups: f; cx and cy; k1; k2; k3; p1 and p2; b1; b2. All begin as estimated. Then, in this order,
//
// 1. a group is held that the block does not determine: the larger of the sigmas by C_J and by the normal equations is
//    more than `determined` of the prior sigma, or the parameter is correlated by more than `correlated` with one of a
//    group before it. The last of such groups goes first, then the others are tested again.
//    Then all poses and points are adjusted anew.
// 2. a group of q parameters other than f, cx and cy is held that is not significant. Hotelling's T^2 = e' C_J^-1 e of
//    its difference e from the start is compared with Fisher's distribution,
//
//        F = T^2 (G - q) / (q (G - 1)) with q and G - q degrees of freedom,
//
//    at `probability` shared among all tested groups (Bonferroni). The least significant goes first.
// 3. a group is held that predicts left-out images hardly better. With c and c_g the squares of the residuals of all
//    images and of those without group g (camera_equations.h), the sum of c(k_g) - c_g(k_g) is the squared error with
//    which the others predict the images of each group. A group must lower it by the share `least_gain`. What is left
//    out then has a root mean square of sqrt(least_gain) of the noise of an image coordinate. Photographs have errors
//    of this size that no parameter describes (keypoints that lie differently on surfaces seen from another side,
//    residues of a correction by the maker). A parameter that takes them up draws with it what it is correlated with,
//    and poses.
//
// Of radial terms a lower one is never held while a higher one is estimated. Held parameters keep their start values,
// and the others are those at these values. With fewer than `fewest_groups` groups nothing can be left out: the focal
// length alone is estimated, and only where its formal sigma, times `few_images`, is small enough.
//
// Everything follows from the forms, which do not depend on ranks, threads or tiles.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "geometry/camera/intrinsics.h"
#include "merge/camera/camera_equations.h"

namespace megablock {

struct ParameterChoiceOptions {
  double probability = 0.01;  // of estimating any parameter that is at its start in truth
  double determined = 0.25;   // largest sigma over prior sigma
  double least_gain = 0.001;  // share of the squared error of prediction
  double correlated = 0.97;   // largest correlation with a parameter of a group before
  int groups = 20;            // of frames that are left out in turn, at most
  int fewest_groups = 4;
  double few_images = 3;  // by which formal sigmas are enlarged with fewer groups
  void check() const;     // throws InputError
};

// The parameters of a camera among the rows of the forms.
struct ChoiceCamera {
  CameraModel model;
  std::vector<int> parameters;  // ascending, of the rows that follow each other
  Eigen::Index first = 0;       // row of the first
};

struct CameraChoice {
  ParameterMask estimated = 0;
  std::string reason;  // "estimated f, cx, cy; held k1, k2, k3 (1.9 sigma), ..."
};

// The forms of all images and of those without each group, over all rows. Poses and points are at the optimum of the
// rows that are marked `free` [rows], with the others at their start values: far from there a form means nothing.
struct CameraForms {
  CameraForm all;
  std::vector<CameraForm> without;
};
using MakeForms = std::function<CameraForms(const std::vector<std::uint8_t>& free)>;

// Calls `forms` for all rows first, and again when rows are held that are not determined. `start`, `prior_sigma`:
// [rows]
std::vector<CameraChoice> choose_parameters(const MakeForms& forms, const std::vector<ChoiceCamera>& cameras,
                                            const Eigen::VectorXd& start, const Eigen::VectorXd& prior_sigma,
                                            const ParameterChoiceOptions& options);

}  // namespace megablock
