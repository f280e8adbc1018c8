// Compares a result with the true poses: the errors of the poses, and whether the posterior sigmas are true.
//
// With e the error of a frame's position and C its posterior covariance, e'C^-1 e is chi-square distributed with three
// degrees of freedom. The normalised error sqrt(mean over frames of e'C^-1 e / 3) is therefore 1 if the posterior
// sigmas are true. The same holds for the rotation increment w of R_true = R_adjusted Exp(w), and for check points,
// where C is the sum of the posterior covariance and the covariance of the given position.
//
// Alignment: if nothing but the images determines the datum, the result is known up to a similarity X -> s R X + t. The
// similarity that fits the projection centres of the result to those of the truth by least squares takes its place.
// Positions and their covariances are then transformed with s R, and rotations with R. The fit takes seven parameters
// of the errors. The covariances are those after such a fit as well (free_datum.h), so that the ratios are right in
// blocks of a few frames, too.
//
// A truth in another ground frame (another origin) is first transformed exactly, through geodetic coordinates: its axes
// differ from those of the result by the rotation of the local vertical between the two origins.
#pragma once

#include <limits>
#include <string>

#include "io/project/inputs/pose_csv.h"
#include "io/result/result.h"

namespace megablock {

struct EvaluateOptions {
  // Whether the result is first aligned to the truth by a similarity. kAuto: only if nothing determines its datum.
  enum class Align { kAuto, kNever, kAlways } align = Align::kAuto;
  // Multiplies posterior covariances by the a-posteriori variance factor, unless the job has done so.
  bool scale_sigma = false;
  // Sigmas of the true poses themselves, per axis. Their squares are added to the covariances of the result.
  double truth_position_sigma_m = 0, truth_rotation_sigma_deg = 0;
};

struct Evaluation {
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

  std::int64_t frames = 0;          // number of frames that were compared
  std::int64_t frames_missing = 0;  // frames of the truth that have no pose in the result
  bool aligned = false;             // the result was aligned by a similarity
  double position_rms_m = kNone;    // root mean square length of the position errors
  double position_max_m = kNone;
  double rotation_rms_deg = kNone;         // root mean square rotation angle
  double relative_position_rms_m = kNone;  // errors of the vectors between successive frames of a pass
  bool with_sigmas = false;                // the result has covariances of its frames
  // Of an aligned block: why there are no ratios, or what is wrong with their datum. Empty: nothing.
  std::string sigma_note = {};
  // Normalised errors of all frames, of those touched by one tile (interior), and of those touched by several
  // (boundary). Held positions and attitudes do not count, because they have no sigma to compare with. kNone without
  // such frames or without covariances.
  double normalised_error_position = kNone, normalised_error_rotation = kNone;
  double normalised_error_position_interior = kNone, normalised_error_rotation_interior = kNone;
  double normalised_error_position_boundary = kNone, normalised_error_rotation_boundary = kNone;
  // The same with the empirical sigmas (docs/reference/methods.md, "Sigmas").
  double empirical_error_position = kNone, empirical_error_rotation = kNone;
  std::int64_t check_points = 0, control_points = 0;  // number of those with an adjusted position
  double check_rms_m = kNone, check_rms_horizontal_m = kNone, check_rms_vertical_m = kNone;
  double control_rms_m = kNone;
  double normalised_error_check = kNone, empirical_error_check = kNone;
};

// Frames are matched by name (that of the frame, else that of its first image). A truth with another origin is
// transformed into the ground frame of the result. Check points are compared with their given positions. Throws
// InputError if no frame matches, or fewer than three where a similarity is needed.
Evaluation evaluate(const BlockResult& result, const PoseTable& truth, const EvaluateOptions& options = {});
Evaluation evaluate(const BlockResult& result, const BlockState& truth, const EvaluateOptions& options = {});

// `path` is a CSV file of poses, a truth.h5 (write_state) of the same frames, or a folder with truth.csv.
Evaluation evaluate(const BlockResult& result, const std::string& path, const EvaluateOptions& options = {});

// Evaluates control and check points only, which needs no truth. Empty for a block whose datum is free.
Evaluation evaluate_control(const BlockResult& result);

std::string to_text(
    const Evaluation& evaluation);  // lines for the terminal, the last one without its end; no unknown figures
std::string to_json(const Evaluation& evaluation);  // one object; unknown figures are null

}  // namespace megablock
