#include "io/evaluation/halves.h"

#include <fmt/core.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "geometry/camera/models/models.h"
#include "io/base/error.h"
#include "io/evaluation/free_datum.h"
#include "io/text/counted.h"

namespace megablock {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr const char* kInsteadOfHalves =
    "; compare it with known poses ('megablock evaluate JOB POSES') or check points";

// Sums d'C^-1 d over differences. One whose covariance is not positive definite is held in both halves, and is left
// out.
class Ratio {
 public:
  void add(const Eigen::VectorXd& difference, const Eigen::MatrixXd& covariance) {
    if (!covariance.allFinite()) return;
    const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
    if (factor.info() != Eigen::Success) return;
    chi2_ += difference.dot(factor.solve(difference).eval());
    unknowns_ += difference.size();
  }
  double value() const { return unknowns_ > 0 ? std::sqrt(chi2_ / static_cast<double>(unknowns_)) : kNone; }

 private:
  double chi2_ = 0;
  std::int64_t unknowns_ = 0;
};

class Differences {
 public:
  // `empirical` is empty where it is not known.
  void add(const Eigen::VectorXd& difference, const Eigen::MatrixXd& formal, const Eigen::MatrixXd& empirical) {
    squares_ += difference.squaredNorm();
    ++count_;
    formal_.add(difference, formal);
    if (empirical.size() > 0) empirical_.add(difference, empirical);
  }
  HalfDifferences result(double unit = 1) const {
    if (count_ == 0) return {};
    return {count_, unit * std::sqrt(squares_ / static_cast<double>(count_)), formal_.value(), empirical_.value()};
  }

 private:
  double squares_ = 0;
  std::int64_t count_ = 0;
  Ratio formal_, empirical_;
};

// The covariances of the differences of the common frames, in the ground frame of the first result.
struct CommonFrames {
  std::vector<FrameIndex> frames;
  Similarity similarity;  // from the second result to the first one
  std::vector<BlockResult::Matrix6> formal, empirical;
  std::string note;
};

// Collects the sums of the covariances of both results.
void add_covariances(const BlockResult& first, const BlockResult& second, bool aligned, SigmaKind kind,
                     CommonFrames& common) {
  const auto of = [&](const BlockResult& result) {
    return aligned ? covariances_after_fit(result, common.frames, DatumFit::kPoses, kind)
                   : stated_covariances(result, common.frames, kind);
  };
  const DatumCovariances one = of(first), other = of(second);
  BlockResult::Matrix6 turn = BlockResult::Matrix6::Zero();
  turn.topLeftCorner<3, 3>() = common.similarity.rotation.toRotationMatrix();
  turn.bottomRightCorner<3, 3>() = common.similarity.scale * turn.topLeftCorner<3, 3>();
  auto& sums = kind == SigmaKind::kFormal ? common.formal : common.empirical;
  for (std::size_t i = 0; i < one.frames.size() && i < other.frames.size(); ++i)
    sums.emplace_back(one.frames[i] + turn * other.frames[i] * turn.transpose());
  if (common.note.empty()) common.note = one.note.empty() ? other.note : one.note;
}

CommonFrames common_frames(const BlockResult& first, const BlockResult& second, bool aligned) {
  CommonFrames common;
  for (FrameIndex f(0); first.block.frames.contains(f); ++f.value)
    if (first.state.oriented[f] && second.state.oriented[f]) common.frames.push_back(f);
  if (common.frames.size() < 3)
    throw InputError("the two halves have " + counted(std::ssize(common.frames), "oriented image") +
                     " in common, and a comparison needs 3: the block has too few tie points to be divided" +
                     kInsteadOfHalves);
  if (aligned) {
    std::vector<Pose> from, to;
    for (const FrameIndex f : common.frames) {
      from.push_back(second.state.frames[f]);
      to.push_back(first.state.frames[f]);
    }
    const auto similarity = fit_datum(from, to, DatumFit::kPoses);
    if (!similarity) throw InputError("the two halves cannot be compared: all images are at one place");
    common.similarity = *similarity;
  }
  add_covariances(first, second, aligned, SigmaKind::kFormal, common);
  add_covariances(first, second, aligned, SigmaKind::kEmpirical, common);
  return common;
}

// The sum of two matrices, or an empty one where one of them is missing.
template <typename Matrices>
Eigen::MatrixXd sum_at(const Matrices& first, const Matrices& second, std::int64_t row) {
  if (row >= std::ssize(first) || row >= std::ssize(second)) return {};
  return first.begin()[row] + second.begin()[row];
}

void compare_poses(const BlockResult& first, const BlockResult& second, const CommonFrames& common,
                   HalfDifferences& of_positions, HalfDifferences& of_rotations) {
  Differences positions, rotations;
  for (std::size_t i = 0; i < common.formal.size(); ++i) {
    const Pose& one = first.state.frames[common.frames[i]];
    const Pose other = common.similarity(second.state.frames[common.frames[i]]);
    const bool known = i < common.empirical.size();
    const auto part = [&](Eigen::Index row) -> Eigen::MatrixXd {
      return known ? Eigen::MatrixXd(common.empirical[i].block<3, 3>(row, row)) : Eigen::MatrixXd();
    };
    positions.add(other.centre - one.centre, common.formal[i].bottomRightCorner<3, 3>(), part(3));
    rotations.add(rotation_log<double>(one.rotation.conjugate() * other.rotation),
                  common.formal[i].topLeftCorner<3, 3>(), part(0));
  }
  of_positions = positions.result();
  of_rotations = rotations.result(180 / std::numbers::pi);
}

bool has_joint(const BlockResult& result, const std::vector<FrameIndex>& frames) {
  return std::ranges::includes(result.joint_covariance.frames, frames);
}

}  // namespace

std::vector<CameraDifference> compare_cameras(const BlockResult& first, const BlockResult& second) {
  std::vector<CameraDifference> cameras;
  if (first.camera_covariance.empty() || second.camera_covariance.empty()) return cameras;
  for (CameraIndex c(0); first.block.cameras.contains(c); ++c.value) {
    const Eigen::MatrixXd formal = first.camera_covariance[c] + second.camera_covariance[c];
    const Eigen::MatrixXd empirical =
        sum_at(first.empirical.camera_covariance, second.empirical.camera_covariance, c.value);
    std::vector<Eigen::Index> free;
    for (Eigen::Index k = 0; k < formal.rows(); ++k)
      if (first.camera_covariance[c](k, k) > 0 && second.camera_covariance[c](k, k) > 0) free.push_back(k);
    if (free.empty()) continue;
    CameraDifference camera;
    camera.camera = first.block.cameras[c].name;
    const Intrinsics &one = first.state.cameras[c], &other = second.state.cameras[c];
    Eigen::VectorXd difference(static_cast<Eigen::Index>(free.size()));
    for (std::size_t i = 0; i < free.size(); ++i) {
      const int k = static_cast<int>(free[i]);
      const double d = difference[static_cast<Eigen::Index>(i)] = other[k] - one[k];
      camera.each.push_back({parameter_name(one.model(), k), d, d / std::sqrt(formal(k, k)),
                             empirical.size() > 0 ? d / std::sqrt(empirical(k, k)) : kNone});
    }
    Differences all;
    all.add(difference, formal(free, free), empirical.size() > 0 ? empirical(free, free).eval() : empirical);
    camera.parameters = all.result();
    camera.parameters.count = std::ssize(free);
    cameras.push_back(std::move(camera));
  }
  return cameras;
}

void require_halves(const BlockResult& result) {
  constexpr std::int64_t kNeeded = 4;
  const std::int64_t oriented = std::ranges::count_if(result.state.oriented, [](auto value) { return value != 0; });
  if (oriented >= kNeeded) return;
  throw InputError(
      fmt::format("halves need {} oriented images, and more if few tie points connect them; the block has "
                  "{}{}",
                  kNeeded, oriented, kInsteadOfHalves));
}

HalvesComparison compare_halves(const BlockResult& first, const BlockResult& second) {
  HalvesComparison halves;
  halves.aligned = first.gauge.starts_with("free");
  const CommonFrames common = common_frames(first, second, halves.aligned);
  halves.note = common.note;
  compare_poses(first, second, common, halves.positions, halves.rotations);
  if (!halves.aligned && has_joint(first, common.frames) && has_joint(second, common.frames)) {
    const CommonFrames inner = common_frames(first, second, true);
    compare_poses(first, second, inner, halves.inner_positions, halves.inner_rotations);
  }
  for (FrameIndex f(0); first.block.frames.contains(f); ++f.value)
    halves.missing += first.state.oriented[f] != second.state.oriented[f];
  Differences points;
  for (std::size_t p = 0; !halves.aligned && p < first.control.size() && p < second.control.size(); ++p)
    if (first.control[p].takes_part() && second.control[p].takes_part())
      points.add(second.control[p].adjusted - first.control[p].adjusted,
                 first.control[p].covariance + second.control[p].covariance,
                 sum_at(first.empirical.control, second.empirical.control, static_cast<std::int64_t>(p)));
  halves.points = points.result();
  halves.cameras = compare_cameras(first, second);
  return halves;
}

namespace {

// The root mean square of one member of several items; items without a figure do not count.
template <typename Item>
double root_mean_square(const std::vector<Item>& items, double Item::*member) {
  double squares = 0;
  int count = 0;
  for (const Item& item : items)
    if (const double value = item.*member; std::isfinite(value)) {
      squares += value * value;
      ++count;
    }
  return count > 0 ? std::sqrt(squares / count) : kNone;
}

HalfDifferences mean_of(const std::vector<HalfDifferences>& all) {
  HalfDifferences mean = all.front();
  for (double HalfDifferences::*member : {&HalfDifferences::rms, &HalfDifferences::formal, &HalfDifferences::empirical})
    mean.*member = root_mean_square(all, member);
  for (const HalfDifferences& d : all) mean.count = std::min(mean.count, d.count);
  return mean;
}

using OfDivisions = const std::vector<HalvesComparison>&;

// Only cameras and parameters that all divisions have, in the order of the first one.
std::vector<CameraDifference> mean_of_cameras(OfDivisions divisions) {
  std::vector<CameraDifference> cameras;
  for (const CameraDifference& first : divisions.front().cameras) {
    std::vector<HalfDifferences> parameters;
    std::vector<std::vector<CameraDifference::Parameter>> each(first.each.size());
    for (const HalvesComparison& division : divisions)
      for (const CameraDifference& camera : division.cameras)
        if (camera.camera == first.camera && camera.each.size() == each.size()) {
          parameters.push_back(camera.parameters);
          for (std::size_t k = 0; k < each.size(); ++k) each[k].push_back(camera.each[k]);
        }
    if (parameters.size() < divisions.size()) continue;
    CameraDifference mean{first.camera, mean_of(parameters), first.each};
    using Parameter = CameraDifference::Parameter;
    for (std::size_t k = 0; k < each.size(); ++k)
      for (double Parameter::*member : {&Parameter::difference, &Parameter::formal, &Parameter::empirical})
        mean.each[k].*member = root_mean_square(each[k], member);
    cameras.push_back(std::move(mean));
  }
  return cameras;
}

}  // namespace

HalvesComparison mean_of(const std::vector<HalvesComparison>& divisions) {
  HalvesComparison mean = divisions.front();
  if (divisions.size() == 1) return mean;
  mean.divisions = std::ssize(divisions);
  for (HalfDifferences HalvesComparison::*member :
       {&HalvesComparison::positions, &HalvesComparison::rotations, &HalvesComparison::inner_positions,
        &HalvesComparison::inner_rotations, &HalvesComparison::points}) {
    std::vector<HalfDifferences> all;
    for (const HalvesComparison& division : divisions) all.push_back(division.*member);
    mean.*member = mean_of(all);
  }
  for (const HalvesComparison& division : divisions) {
    mean.missing = std::max(mean.missing, division.missing);
    if (mean.note.empty()) mean.note = division.note;
  }
  mean.cameras = mean_of_cameras(divisions);
  return mean;
}

namespace {

// " over sigma: formal 1.204, empirical 1.011"
std::string ratios_of(const HalfDifferences& d) {
  std::string text = fmt::format("over sigma: formal {:.3f}", d.formal);
  if (std::isfinite(d.empirical)) text += fmt::format(", empirical {:.3f}", d.empirical);
  return text;
}

std::string line_of(const char* what, const HalfDifferences& d, const char* unit, int digits) {
  if (d.count == 0) return "";
  return fmt::format("\n{:<28}{}, rms {:.{}f} {}; {}", what, d.count, d.rms, digits, unit, ratios_of(d));
}

std::string lines_of(const std::vector<CameraDifference>& cameras) {
  std::string text;
  for (const CameraDifference& camera : cameras) {
    text += fmt::format("\n{:<27} {}", "camera " + camera.camera, ratios_of(camera.parameters));
    for (const CameraDifference::Parameter& p : camera.each)
      text += fmt::format("\n  {:<26}{:.4g}; over sigma: formal {:.2f}", p.name, p.difference, p.formal) +
              (std::isfinite(p.empirical) ? fmt::format(", empirical {:.2f}", p.empirical) : "");
  }
  return text;
}

nlohmann::ordered_json json_of(const HalfDifferences& d, const char* unit) {
  nlohmann::ordered_json json;
  json["count"] = d.count;
  json[std::string("rms_") + unit] = d.rms;
  json["over_formal_sigma"] = d.formal;
  json["over_empirical_sigma"] = d.empirical;
  return json;
}

nlohmann::ordered_json json_of(const std::vector<CameraDifference>& cameras) {
  auto list = nlohmann::ordered_json::array();
  for (const CameraDifference& camera : cameras) {
    nlohmann::ordered_json json;
    json["camera"] = camera.camera;
    json["over_formal_sigma"] = camera.parameters.formal;
    json["over_empirical_sigma"] = camera.parameters.empirical;
    for (const CameraDifference::Parameter& p : camera.each)
      json["parameters"][p.name] = {
          {"difference", p.difference}, {"over_formal_sigma", p.formal}, {"over_empirical_sigma", p.empirical}};
    list.push_back(std::move(json));
  }
  return list;
}

}  // namespace

std::string to_text(const HalvesComparison& h) {
  std::string text = fmt::format("differences of two adjustments, each with half of the tie points{}{}",
                                 h.divisions > 1 ? fmt::format(", {} divisions", h.divisions) : "",
                                 h.aligned ? ", after a similarity" : "");
  text += line_of("positions", h.positions, "m", 5) + line_of("rotations", h.rotations, "deg", 6) +
          line_of("positions, similarity", h.inner_positions, "m", 5) +
          line_of("rotations, similarity", h.inner_rotations, "deg", 6) +
          line_of("control and check points", h.points, "m", 5) + lines_of(h.cameras);
  if (!h.cameras_of_images.empty())
    text += "\ndifferences of two adjustments, each with half of the images" + lines_of(h.cameras_of_images);
  text += "\n1: the sigmas hold. Errors that both halves share, such as those of the lens model, are not seen.";
  if (h.missing > 0)
    text +=
        fmt::format("\n{} {} oriented in one half alone", counted(h.missing, "image"), h.missing == 1 ? "is" : "are");
  if (!h.note.empty()) text += "\n" + h.note;
  return text;
}

std::string to_json(const HalvesComparison& h) {
  nlohmann::ordered_json json;  // NaN is written as null
  json["divisions"] = h.divisions;
  json["aligned"] = h.aligned;
  json["frames_missing"] = h.missing;
  json["positions"] = json_of(h.positions, "m");
  json["rotations"] = json_of(h.rotations, "deg");
  json["inner_positions"] = json_of(h.inner_positions, "m");
  json["inner_rotations"] = json_of(h.inner_rotations, "deg");
  json["points"] = json_of(h.points, "m");
  json["cameras"] = json_of(h.cameras);
  json["cameras_of_images"] = json_of(h.cameras_of_images);
  json["note"] = h.note;
  return json.dump(2);
}

}  // namespace megablock
