#include "io/evaluation/evaluate.h"

#include <fmt/core.h>

#include <Eigen/Cholesky>
#include <array>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>
#include <unordered_map>

#include "io/base/error.h"
#include "io/block/crs.h"
#include "io/block/held_priors.h"
#include "io/evaluation/free_datum.h"
#include "io/evaluation/used_sigmas.h"
#include "io/project/inputs/image_lookup.h"
#include "io/result/result_option.h"
#include "io/store/units/state_file.h"

namespace megablock {

namespace {

namespace fs = std::filesystem;

struct Match {
  FrameIndex frame;
  Pose truth;
};

// Collects the normalised squares e'C^-1 e / 3 of errors. Errors whose covariance is not positive definite are left
// out.
class NormalisedError {
 public:
  void add(const Eigen::Vector3d& error, const Eigen::Matrix3d& covariance) {
    // e'C^-1 e has the mean 3 in three dimensions, so a third of it has the mean 1.
    const Eigen::LLT<Eigen::Matrix3d> factor(covariance);
    if (factor.info() != Eigen::Success) return;
    sum_ += error.dot(factor.solve(error)) / 3;
    ++count_;
  }
  double value() const { return count_ > 0 ? std::sqrt(sum_ / static_cast<double>(count_)) : Evaluation::kNone; }

 private:
  double sum_ = 0;
  std::int64_t count_ = 0;
};

class RootMeanSquare {
 public:
  void add(double squared) {
    sum_ += squared;
    ++count_;
  }
  double value() const { return count_ > 0 ? std::sqrt(sum_ / static_cast<double>(count_)) : Evaluation::kNone; }
  std::int64_t count() const { return count_; }

 private:
  double sum_ = 0;
  std::int64_t count_ = 0;
};

// The rows of the truth by frame, by the name of the frame or of its first image; -1: none. Where no name is the same,
// names of images may have other folders, case and ending, as in other lists (image_lookup.h).
std::vector<std::int64_t> rows_by_frame(const Block& block, const std::vector<std::string>& names) {
  std::unordered_map<std::string, std::int64_t> row;
  for (std::size_t i = 0; i < names.size(); ++i) row.emplace(names[i], static_cast<std::int64_t>(i));
  std::vector<std::int64_t> rows(block.frames.size(), -1);
  std::vector<ImageIndex> first_image(block.frames.size());
  bool any = false;
  const auto take = [&](std::int64_t& of_frame, const std::string& name) {
    const auto found = row.find(name);
    if (of_frame >= 0 || found == row.end()) return;
    of_frame = found->second;
    any = true;
  };
  for (std::size_t f = 0; f < rows.size(); ++f)
    take(rows[f], block.frames[FrameIndex(static_cast<std::int64_t>(f))].name);
  for (ImageIndex i(0); block.images.contains(i); ++i.value) {
    const auto f = static_cast<std::size_t>(block.images[i].frame.value);
    if (first_image[f].valid()) continue;
    first_image[f] = i;
    take(rows[f], block.name_of(i));
  }
  if (any) return rows;
  const ImageLookup lookup(block, {});
  for (std::size_t i = 0; i < names.size(); ++i) {
    const ImageLookup::Found found = lookup.find(names[i]);
    if (found.kind != ImageLookup::Kind::kImage) continue;
    const auto f = static_cast<std::size_t>(block.images[found.image].frame.value);
    if (first_image[f] == found.image && rows[f] < 0) rows[f] = static_cast<std::int64_t>(i);
  }
  return rows;
}

// The oriented frames of the result with their true poses, in the order of the block.
std::vector<Match> match_by_name(const BlockResult& result, const PoseTable& truth) {
  const std::vector<std::int64_t> rows = rows_by_frame(result.block, truth.names);
  std::vector<Match> matches;
  for (std::size_t f = 0; f < rows.size(); ++f) {
    const FrameIndex frame(static_cast<std::int64_t>(f));
    if (result.state.oriented[frame] && rows[f] >= 0)
      matches.push_back({frame, truth.poses[static_cast<std::size_t>(rows[f])]});
  }
  if (matches.empty())
    throw InputError("no oriented frame of the result has a true pose of the same name; the truth begins with '" +
                     (truth.names.empty() ? std::string() : truth.names.front()) +
                     "'; give a truth whose names are those of frames or images");
  return matches;
}

// Whether nothing except the images determines the datum.
bool is_free(const BlockResult& result) {
  // The words of the adjustment decide. A file without them is judged by its observations.
  if (!result.gauge.empty()) return result.gauge.starts_with("free");
  for (std::size_t f = 0; f < result.block.frames.size(); ++f) {
    const FrameIndex frame(static_cast<std::int64_t>(f));
    if (result.state.oriented[frame] && result.block.frames[frame].position_prior) return false;
  }
  for (const ControlPoint& point : result.block.control_points)
    if (point.role == PointRole::kControl && point.measurements.size() >= 2) return false;
  return true;
}

// The similarity that stands for a free datum, and the covariances of the matched frames after it.
struct Aligned {
  Similarity similarity;
  DatumCovariances covariances, empirical;
};

std::vector<FrameIndex> frames_of(const std::vector<Match>& matches) {
  std::vector<FrameIndex> frames;
  for (const Match& m : matches) frames.push_back(m.frame);
  return frames;
}

Aligned as_it_is(const BlockResult& result, const std::vector<Match>& matches) {
  const std::vector<FrameIndex> frames = frames_of(matches);
  return {Similarity(), stated_covariances(result, frames), stated_covariances(result, frames, SigmaKind::kEmpirical)};
}

Aligned align(const BlockResult& result, const std::vector<Match>& matches) {
  std::vector<Pose> from, to;
  const std::vector<FrameIndex> frames = frames_of(matches);
  for (const Match& m : matches) {
    from.push_back(result.state.frames[m.frame]);
    to.push_back(m.truth);
  }
  const DatumFit fit = matches.size() < 3 || determine_similarity(from) ? DatumFit::kPositions : DatumFit::kPoses;
  const auto similarity = fit_datum(from, to, fit);
  if (!similarity)
    throw InputError(
        "the datum of the result is free, and fewer than three of its frames at different places have a true pose; "
        "give a truth with at least three");
  return {*similarity, covariances_after_fit(result, frames, fit),
          covariances_after_fit(result, frames, fit, SigmaKind::kEmpirical)};
}

// The truth in the ground frame of the result, if both frames are known; otherwise the truth as it is.
PoseTable in_ground_of(const GroundFrame& ground, const PoseTable& truth) {
  // 1e-12 degrees are 0.1 micrometres on the ground.
  const auto same = [](double a, double b, double tolerance) { return std::abs(a - b) <= tolerance; };
  if (!truth.ground || !truth.ground->georeferenced || !ground.georeferenced) return truth;
  if (same(ground.latitude_deg, truth.ground->latitude_deg, 1e-12) &&
      same(ground.longitude_deg, truth.ground->longitude_deg, 1e-12) &&
      same(ground.height_m, truth.ground->height_m, 1e-9))
    return truth;
  const Georeference of_result(ground), of_truth(*truth.ground);
  const Eigen::Quaterniond turn =
      of_result.own_from_block({truth.ground->latitude_deg, truth.ground->longitude_deg, truth.ground->height_m});
  PoseTable moved = truth;
  moved.ground = ground;
  // R_truth maps axes of the truth's frame to the camera, so R_truth turn maps axes of the result's frame.
  for (Pose& pose : moved.poses)
    pose = {(pose.rotation * turn).normalized(), of_result.to_local(of_truth.to_geodetic(pose.centre))};
  return moved;
}

void evaluate_frames(const BlockResult& result, const std::vector<Match>& matches, const Aligned& aligned,
                     double variance_factor, const EvaluateOptions& options, Evaluation& evaluation) {
  const Similarity& similarity = aligned.similarity;
  const double truth_angle = options.truth_rotation_sigma_deg * std::numbers::pi / 180;
  const Eigen::Matrix3d truth_position = std::pow(options.truth_position_sigma_m, 2) * Eigen::Matrix3d::Identity(),
                        truth_rotation = truth_angle * truth_angle * Eigen::Matrix3d::Identity();
  RootMeanSquare position, rotation, relative;
  NormalisedError normalised_position, normalised_rotation, empirical_position, empirical_rotation;
  std::array<NormalisedError, 2> position_by_place, rotation_by_place;  // interior, boundary
  double largest = 0;
  const bool positions_used = option_of(result, "adjustment.use_position_priors") != "false",
             attitudes_used = option_of(result, "adjustment.use_attitude_priors") != "false";
  // A covariance C of a vector v becomes A C A' for A v: A = R for rotation vectors, A = s R for positions.
  const Eigen::Matrix3d turn = similarity.rotation.toRotationMatrix();
  const Eigen::Matrix3d stretch = similarity.scale * turn;
  Eigen::Vector3d previous_error = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const Match& m = matches[i];
    const Pose pose = similarity(result.state.frames[m.frame]);
    const Eigen::Vector3d error = pose.centre - m.truth.centre;
    // w of R_true = R_adjusted Exp(w), in axes of the ground, as the covariances are (rotation_update).
    const Eigen::Vector3d angle = rotation_log<double>(pose.rotation.conjugate() * m.truth.rotation);
    position.add(error.squaredNorm());
    rotation.add(angle.squaredNorm());
    largest = std::max(largest, error.norm());
    // Successive frames of one pass are neighbours. Their errors share the slow bending of the block, which cancels in
    // the difference; local accuracy remains.
    const auto& frames = result.block.frames;
    if (i > 0 && matches[i - 1].frame.value == m.frame.value - 1 &&
        frames[matches[i - 1].frame].pass == frames[m.frame].pass)
      relative.add((error - previous_error).squaredNorm());
    previous_error = error;
    if (aligned.covariances.frames.empty()) continue;
    // Order of the increment: rotation, centre.
    const auto of_rotation = [&](const BlockResult::Matrix6& c) -> Eigen::Matrix3d {
      return turn * c.topLeftCorner<3, 3>() * turn.transpose() + truth_rotation;
    };
    const auto of_position = [&](const BlockResult::Matrix6& c) -> Eigen::Matrix3d {
      return stretch * c.bottomRightCorner<3, 3>() * stretch.transpose() + truth_position;
    };
    const BlockResult::Matrix6 covariance = variance_factor * aligned.covariances.frames[i];
    const Eigen::Matrix3d rotation_covariance = of_rotation(covariance), position_covariance = of_position(covariance);
    const bool empirical = !aligned.empirical.frames.empty();
    const Frame& frame = frames[m.frame];
    const bool by_place = !result.boundary.empty();
    const std::size_t place = by_place && result.boundary[m.frame] != 0;
    if (!(attitudes_used && frame.attitude_prior && held(*frame.attitude_prior))) {
      normalised_rotation.add(angle, rotation_covariance);
      if (empirical) empirical_rotation.add(angle, of_rotation(aligned.empirical.frames[i]));
      if (by_place) rotation_by_place[place].add(angle, rotation_covariance);
    }
    if (!(positions_used && frame.position_prior && held(*frame.position_prior))) {
      normalised_position.add(error, position_covariance);
      if (empirical) empirical_position.add(error, of_position(aligned.empirical.frames[i]));
      if (by_place) position_by_place[place].add(error, position_covariance);
    }
  }
  evaluation.frames = position.count();
  evaluation.with_sigmas = !aligned.covariances.frames.empty();
  evaluation.sigma_note = aligned.covariances.note;
  evaluation.position_rms_m = position.value();
  evaluation.position_max_m = largest;
  evaluation.rotation_rms_deg = rotation.value() * 180 / std::numbers::pi;
  evaluation.relative_position_rms_m = relative.value();
  evaluation.normalised_error_position = normalised_position.value();
  evaluation.normalised_error_rotation = normalised_rotation.value();
  evaluation.empirical_error_position = empirical_position.value();
  evaluation.empirical_error_rotation = empirical_rotation.value();
  evaluation.normalised_error_position_interior = position_by_place[0].value();
  evaluation.normalised_error_rotation_interior = rotation_by_place[0].value();
  evaluation.normalised_error_position_boundary = position_by_place[1].value();
  evaluation.normalised_error_rotation_boundary = rotation_by_place[1].value();
}

void evaluate_control(const BlockResult& result, double variance_factor, Evaluation& evaluation) {
  RootMeanSquare control, check, horizontal, vertical;
  NormalisedError normalised, empirical;
  for (std::size_t i = 0; i < result.control.size(); ++i) {
    const ControlPoint& point = result.block.control_points[i];
    const BlockResult::ControlResult& found = result.control[i];
    const Eigen::Vector3d error = found.adjusted - point.position;
    const bool known = !found.residual_px.empty();  // whether the result tells which measurements take part
    if (!error.allFinite() || (known && !found.takes_part())) continue;
    (point.role == PointRole::kCheck ? check : control).add(error.squaredNorm());
    if (point.role != PointRole::kCheck) continue;
    horizontal.add(error.head<2>().squaredNorm());
    vertical.add(error.z() * error.z());
    // Block and given position have independent errors, so the variances add. A control point took part, so its
    // difference is no error, and it has no normalised one here.
    const Eigen::Matrix3d stated = used_sigma(result, point).cwiseAbs2().asDiagonal();
    normalised.add(error, variance_factor * found.covariance + stated);
    if (i < result.empirical.control.size()) empirical.add(error, result.empirical.control[i] + stated);
  }
  evaluation.check_points = check.count();
  evaluation.control_points = control.count();
  evaluation.check_rms_m = check.value();
  evaluation.check_rms_horizontal_m = horizontal.value();
  evaluation.check_rms_vertical_m = vertical.value();
  evaluation.control_rms_m = control.value();
  evaluation.normalised_error_check = normalised.value();
  evaluation.empirical_error_check = empirical.value();
}

}  // namespace

Evaluation evaluate(const BlockResult& result, const PoseTable& truth, const EvaluateOptions& options) {
  const std::vector<Match> matches = match_by_name(result, in_ground_of(result.block.ground, truth));
  Evaluation evaluation;
  evaluation.frames_missing = static_cast<std::int64_t>(truth.names.size() - matches.size());
  evaluation.aligned = options.align == EvaluateOptions::Align::kAlways ||
                       (options.align == EvaluateOptions::Align::kAuto && is_free(result));
  const Aligned aligned = evaluation.aligned ? align(result, matches) : as_it_is(result, matches);
  // Never twice.
  const double variance_factor = options.scale_sigma && !result.sigma_scaled ? result.variance_factor : 1;
  evaluate_frames(result, matches, aligned, variance_factor, options, evaluation);
  // The given positions of check points are in the ground frame of the block. A free block is in another frame, so they
  // cannot be compared.
  if (!evaluation.aligned) evaluate_control(result, variance_factor, evaluation);
  return evaluation;
}

Evaluation evaluate_control(const BlockResult& result) {
  Evaluation evaluation;
  if (!is_free(result)) evaluate_control(result, 1, evaluation);
  return evaluation;
}

Evaluation evaluate(const BlockResult& result, const BlockState& truth, const EvaluateOptions& options) {
  if (truth.frames.size() != result.block.frames.size())
    throw InputError("the truth has " + std::to_string(truth.frames.size()) + " frames, but the result has " +
                     std::to_string(result.block.frames.size()) + "; give the truth as a CSV file of poses instead");
  PoseTable table = pose_table(result.block, truth);
  return evaluate(result, table, options);
}

Evaluation evaluate(const BlockResult& result, const std::string& path, const EvaluateOptions& options) {
  if (fs::is_directory(path)) return evaluate(result, (fs::path(path) / "truth.csv").string(), options);
  if (fs::path(path).extension() == ".h5") return evaluate(result, read_state(path), options);
  return evaluate(result, read_pose_csv(path), options);
}

std::string to_text(const Evaluation& e) {
  std::string text = fmt::format("frames compared             {} ({} of the truth have no pose){}", e.frames,
                                 e.frames_missing, e.aligned ? ", after a similarity" : "");
  text +=
      fmt::format("\nposition                    rms {:.4f} m, largest {:.4f} m", e.position_rms_m, e.position_max_m);
  if (std::isfinite(e.relative_position_rms_m))
    text += fmt::format("; between neighbours rms {:.4f} m", e.relative_position_rms_m);
  text += fmt::format("\nrotation                    rms {:.5f} deg", e.rotation_rms_deg);
  if (e.check_points > 0)
    text += fmt::format("\ncheck points                {}, rms {:.4f} m horizontal, {:.4f} m vertical", e.check_points,
                        e.check_rms_horizontal_m, e.check_rms_vertical_m);
  std::string ratios;
  bool some_held = false;
  const auto add = [&](bool known, const char* name, double ratio) {
    if (!known) return;
    some_held = some_held || !std::isfinite(ratio);
    ratios += fmt::format("{}{} {}", ratios.empty() ? "" : ", ", name,
                          std::isfinite(ratio) ? fmt::format("{:.3f}", ratio) : "-");
  };
  add(e.with_sigmas, "position", e.normalised_error_position);
  add(e.with_sigmas, "rotation", e.normalised_error_rotation);
  add(std::isfinite(e.normalised_error_check), "check points", e.normalised_error_check);
  if (!ratios.empty())
    text += "\nerror / formal sigma        " + ratios + " (1: the sigmas are true" + (some_held ? "; -: held)" : ")");
  ratios.clear();
  add(std::isfinite(e.empirical_error_position), "position", e.empirical_error_position);
  add(std::isfinite(e.empirical_error_rotation), "rotation", e.empirical_error_rotation);
  add(std::isfinite(e.empirical_error_check), "check points", e.empirical_error_check);
  if (!ratios.empty()) text += "\nerror / empirical sigma     " + ratios;
  if (!e.sigma_note.empty()) text += "\n" + e.sigma_note;
  return text;
}

std::string to_json(const Evaluation& e) {
  nlohmann::ordered_json json;  // NaN is written as null
  json["frames"] = e.frames;
  json["frames_missing"] = e.frames_missing;
  json["aligned"] = e.aligned;
  json["position_rms_m"] = e.position_rms_m;
  json["position_max_m"] = e.position_max_m;
  json["rotation_rms_deg"] = e.rotation_rms_deg;
  json["relative_position_rms_m"] = e.relative_position_rms_m;
  json["normalised_error_position"] = e.normalised_error_position;
  json["normalised_error_rotation"] = e.normalised_error_rotation;
  json["empirical_error_position"] = e.empirical_error_position;
  json["empirical_error_rotation"] = e.empirical_error_rotation;
  json["normalised_error_position_interior"] = e.normalised_error_position_interior;
  json["normalised_error_rotation_interior"] = e.normalised_error_rotation_interior;
  json["normalised_error_position_boundary"] = e.normalised_error_position_boundary;
  json["normalised_error_rotation_boundary"] = e.normalised_error_rotation_boundary;
  json["sigma_note"] = e.sigma_note;
  json["check_points"] = e.check_points;
  json["check_rms_m"] = e.check_rms_m;
  json["check_rms_horizontal_m"] = e.check_rms_horizontal_m;
  json["check_rms_vertical_m"] = e.check_rms_vertical_m;
  json["normalised_error_check"] = e.normalised_error_check;
  json["empirical_error_check"] = e.empirical_error_check;
  json["control_points"] = e.control_points;
  json["control_rms_m"] = e.control_rms_m;
  return json.dump(2);
}

}  // namespace megablock
