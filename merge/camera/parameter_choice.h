// Chooses which parameters of a camera are estimated: those without which left-out images would be predicted worse.
//
// The stated sigmas of an adjustment hold for independent errors. Errors of photographs are correlated within an image,
// so a parameter may seem to be many sigmas away from zero and yet change its sign in another half of the block. The
// choice therefore rests on what images say of each other. The frames of a sample are dealt into G groups. Let k_g be
// the cameras as all images but those of group g give them, with some parameters held, and c(k), c_g(k) the squares of
// the residuals of all images and of those without group g (camera_equations.h). Then
//
//     e_g = c(k_g) - c_g(k_g)
//
// is the squared error with which the other images predict those of group g (cross-validation, Stone 1974).
//
// Parameters form groups: f; cx and cy; k1; k2; k3; p1 and p2; b1; b2 where they are asked for. All begin as estimated,
// with their priors. The group that raises sum e_g least when it is held is held, again and again, as long as the raise
// over the best choice so far is below a limit. The limit is the larger of
//
// * one standard error of the raise (Breiman et al. 1984), from its scatter over the groups of images, and
// * the share `least_gain` of sum e_g. What is left out then has a root mean square of sqrt(least_gain) of the noise of
//   an image coordinate. Photographs have errors of this size that no parameter describes (keypoints that lie
//   differently on surfaces seen from another side, residues of a correction by the maker). A parameter that
//   absorbs them distorts the parameters correlated with it, and the poses. Errors of single images cancel each other
//   less in fewer images, so with n < `groups` images the share is groups / n times as large.
//
// But the limit is never more than `certain` standard errors: what all groups of images ask for alike is no chance, and
// to hold it would bend the poses by more than their sigmas say, however little it is in one image coordinate.
//
// So no choice predicts left-out images worse than all parameters would, beyond that limit. How well the block
// determines a parameter, and with what it is correlated, is part of e_g, because k_g scatters accordingly.
//
// f, cx and cy are not held, however weakly the block determines them: their start values are guesses, and their
// priors say how good these are. To hold one would be to state that the guess is true. Of radial terms a lower one is
// never held while a higher one is estimated. Held parameters keep their start values. In the end poses and points are
// adjusted anew with this choice, and what proves useful then is released again.
//
// With fewer than `fewest_images` images no image can be left out. Groups of tie points are left out instead, and f, cx
// and cy must show their use like all others. b1 and b2 are held: images that are not turned against each other do not
// tell an affinity of the camera from one of the scene. So two images release nothing that two images cannot tell.
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
  double least_gain = 0.001;  // share of the squared error of prediction, with `groups` images or more
  double certain = 4;         // standard errors of the raise beyond which a parameter counts in any case
  int groups = 20;            // of frames, or of tie points, that are left out in turn, at most
  int fewest_images = 4;      // with fewer, groups of tie points are left out
  double weak = 0.5;          // sigma over prior sigma from which the reason says that the prior determines a parameter
  void check() const;         // throws InputError
};

// The parameters of a camera among the rows of the forms.
struct ChoiceCamera {
  CameraModel model;
  std::vector<int> parameters;  // ascending, of the rows that follow each other
  Eigen::Index first = 0;       // row of the first
};

struct CameraChoice {
  ParameterMask estimated = 0;
  std::string reason;  // "estimated: f; cx, cy; k1 (3.1 %); held: k2 (0.02 %); ..."
  // The images contradict the known focal length by more than three sigmas of its prior, which must not pull any more.
  bool focal_contradicted = false;
  // Of the adjusted sample, pixels. 0: no image of the camera in the sample. The sigma is the larger of the formal one
  // and `focal_scatter_px`, that from the scatter over the groups.
  double focal_px = 0, focal_sigma_px = 0, focal_scatter_px = 0;
};

// The forms of all images and of those without each group, over all rows. Poses and points are at the optimum of the
// rows that are marked `free` [rows], with the others at their start values: far from there a form means nothing.
struct CameraForms {
  CameraForm all;
  std::vector<CameraForm> without;
  std::int64_t images = 0;
};
using MakeForms = std::function<CameraForms(const std::vector<std::uint8_t>& free)>;

// Calls `forms` for all rows first, and again for those of the choice. `start`, `prior_sigma`: [rows]
std::vector<CameraChoice> choose_parameters(const MakeForms& forms, const std::vector<ChoiceCamera>& cameras,
                                            const Eigen::VectorXd& start, const Eigen::VectorXd& prior_sigma,
                                            const ParameterChoiceOptions& options);

}  // namespace megablock
