// A result held against the truth: errors of the poses, and whether the stated precision is true.
//
// With e the error of a frame's position and C its posterior covariance, e'C^-1 e is chi-square distributed with three
// degrees of freedom: sqrt(mean over frames of e'C^-1 e / 3) is 1 when the stated sigmas are true. Likewise for the
// rotation increment w of R_true = R_adjusted Exp(w), and for check points, where C is the sum of the posterior
// covariance and that of the stated position.
#pragma once

#include <limits>
#include <string>

#include "io/project/inputs/pose_csv.h"
#include "io/result/result.h"

namespace megablock {

struct EvaluateOptions {
  // Similarity between result and truth removed first: kAuto = when nothing fixes the datum of the result.
  enum class Align { kAuto, kNever, kAlways } align = Align::kAuto;
  // Multiply posterior covariances by the a-posteriori variance factor, unless the job has done so.
  bool scale_sigma = false;
};

struct Evaluation {
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

  std::int64_t frames = 0;          // compared
  std::int64_t frames_missing = 0;  // of the truth, without a pose in the result
  bool aligned = false;             // a similarity was removed first
  double position_rms_m = kNone;    // root mean square length of the position errors
  double position_max_m = kNone;
  double rotation_rms_deg = kNone;         // root mean square rotation angle
  double relative_position_rms_m = kNone;  // errors of the vectors between successive frames of a pass
  bool with_sigmas = false;                // the result has covariances of its frames
  // sqrt of the mean of e'C^-1 e / 3 over the frames, and over those touched by one tile and by several. Without those
  // whose position or attitude is held, which have no sigma to compare with; none where that are all, or without
  // covariances.
  double normalised_error_position = kNone, normalised_error_rotation = kNone;
  double normalised_error_position_interior = kNone, normalised_error_rotation_interior = kNone;
  double normalised_error_position_boundary = kNone, normalised_error_rotation_boundary = kNone;
  std::int64_t check_points = 0, control_points = 0;  // with an adjusted position
  double check_rms_m = kNone, check_rms_horizontal_m = kNone, check_rms_vertical_m = kNone;
  double control_rms_m = kNone;
  double normalised_error_check = kNone;
};

// Frames are matched by name (a frame's own, else the name of its first image). A truth with another origin is brought
// into the result's ground frame. Check points are compared with the positions stated in the block. InputError when no
// frame matches, or fewer than three where a similarity is needed.
Evaluation evaluate(const BlockResult& result, const PoseTable& truth, const EvaluateOptions& options = {});
Evaluation evaluate(const BlockResult& result, const BlockState& truth, const EvaluateOptions& options = {});

// `path`: a pose CSV, a truth.h5 (write_state) of the same frames, or a folder with truth.csv.
Evaluation evaluate(const BlockResult& result, const std::string& path, const EvaluateOptions& options = {});

// Control and check points alone, which need no truth. Nothing of a block whose datum is free.
Evaluation evaluate_control(const BlockResult& result);

std::string to_text(
    const Evaluation& evaluation);  // lines for the terminal, the last one open; without unknown figures
std::string to_json(const Evaluation& evaluation);  // one object; figures that do not exist are null

}  // namespace megablock
