#include "match/two_view.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <optional>
#include <random>

#include "match/relative_pose.h"

namespace megablock {

namespace {

// OpenCV's robust estimators expect pixels; normalised points are given a nominal focal length.
constexpr double kNominalFocal = 1000;

std::vector<cv::Point2d> nominal_pixels(const std::vector<Eigen::Vector2d>& points) {
  std::vector<cv::Point2d> result;
  result.reserve(points.size());
  for (const auto& p : points) result.emplace_back(p.x() * kNominalFocal, p.y() * kNominalFocal);
  return result;
}

Eigen::Matrix3d to_eigen(const cv::Mat& m) {
  Eigen::Matrix3d result;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) result(r, c) = m.at<double>(r, c);
  }
  return result;
}

cv::UsacParams usac_parameters(const TwoViewOptions& options) {
  cv::UsacParams p;
  p.randomGeneratorState = static_cast<int>(options.seed & 0x7FFFFFFF);
  p.confidence = 0.999;
  p.maxIterations = 3000;
  p.score = cv::SCORE_METHOD_MAGSAC;
  p.sampler = cv::SAMPLING_UNIFORM;
  p.loMethod = cv::LOCAL_OPTIM_INNER_LO;
  p.threshold = options.max_residual * kNominalFocal;
  p.isParallel = false;
  return p;
}

// Runs one of OpenCV's estimators; empty when it finds nothing.
template <typename Estimator>
std::optional<Eigen::Matrix3d> robust_matrix(Estimator estimator) {
  try {
    const cv::Mat m = estimator();
    if (m.rows != 3 || m.cols != 3 || !cv::checkRange(m)) return std::nullopt;
    return to_eigen(m);
  } catch (const cv::Exception&) {
    return std::nullopt;  // degenerate input
  }
}

std::optional<Eigen::Matrix3d> robust_essential(const PointPairs& points, const TwoViewOptions& options) {
  const auto a = nominal_pixels(points.a), b = nominal_pixels(points.b);
  const cv::Mat k = (cv::Mat_<double>(3, 3) << kNominalFocal, 0, 0, 0, kNominalFocal, 0, 0, 0, 1);
  return robust_matrix([&] {
    cv::Mat mask;
    return cv::findEssentialMat(a, b, k, k, cv::noArray(), cv::noArray(), mask, usac_parameters(options));
  });
}

const Eigen::Matrix3d kNominalCamera = Eigen::Vector3d(kNominalFocal, kNominalFocal, 1).asDiagonal();

std::optional<Eigen::Matrix3d> robust_fundamental(const PointPairs& points, const TwoViewOptions& options) {
  const auto a = nominal_pixels(points.a), b = nominal_pixels(points.b);
  auto f = robust_matrix([&] {
    cv::Mat mask;
    return cv::findFundamentalMat(a, b, mask, usac_parameters(options));
  });
  if (f) *f = kNominalCamera * *f * kNominalCamera;
  return f;
}

// x_b ~ H x_a in normalised coordinates.
std::optional<Eigen::Matrix3d> robust_homography(const PointPairs& points, const TwoViewOptions& options) {
  const auto a = nominal_pixels(points.a), b = nominal_pixels(points.b);
  auto h = robust_matrix([&] {
    cv::Mat mask;
    return cv::findHomography(a, b, mask, usac_parameters(options));
  });
  if (h) *h = kNominalCamera.inverse() * *h * kNominalCamera;
  return h;
}

int count_homography(const Eigen::Matrix3d& h, const PointPairs& points, double max_residual) {
  int count = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d moved = h * points.a[i].homogeneous();
    if ((moved.hnormalized() - points.b[i]).squaredNorm() <= max_residual * max_residual) ++count;
  }
  return count;
}

std::vector<RelativePoseEstimate> decompose_homography(const Eigen::Matrix3d& h) {
  cv::Mat matrix(3, 3, CV_64F);
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) matrix.at<double>(r, c) = h(r, c);
  }
  std::vector<cv::Mat> rotations, translations, normals;
  try {
    cv::decomposeHomographyMat(matrix, cv::Mat::eye(3, 3, CV_64F), rotations, translations, normals);
  } catch (const cv::Exception&) {
    return {};
  }
  std::vector<RelativePoseEstimate> poses;
  for (std::size_t i = 0; i < rotations.size(); ++i) {
    const Eigen::Vector3d t(translations[i].at<double>(0), translations[i].at<double>(1),
                            translations[i].at<double>(2));
    if (!(t.norm() > 1e-9)) continue;
    poses.push_back({Eigen::Quaterniond(to_eigen(rotations[i])).normalized(), t.normalized()});
  }
  return poses;
}

struct Hypothesis {
  RelativePoseEstimate pose;
  Support support;
};

// Best of the candidates by score; the first two are refined (the twisted pair of a plane may start ahead).
std::optional<Hypothesis> best_hypothesis(const std::vector<RelativePoseEstimate>& candidates, const PointPairs& points,
                                          double max_residual) {
  std::vector<Hypothesis> all;
  for (const auto& pose : candidates) all.push_back({pose, support_of(pose, points, max_residual)});
  std::stable_sort(all.begin(), all.end(),
                   [](const Hypothesis& p, const Hypothesis& q) { return p.support.score > q.support.score; });
  std::optional<Hypothesis> best;
  for (std::size_t i = 0; i < all.size() && i < 2; ++i) {
    const RelativePoseEstimate pose = refine(all[i].pose, points, 0.5 * max_residual);
    Hypothesis refined{pose, support_of(pose, points, max_residual)};
    Hypothesis& better = refined.support.score > all[i].support.score ? refined : all[i];
    if (!best || better.support.score > best->support.score) best = std::move(better);
  }
  return best;
}

std::vector<std::size_t> rows_of(const std::vector<std::uint8_t>& inlier) {
  std::vector<std::size_t> rows;
  for (std::size_t i = 0; i < inlier.size(); ++i) {
    if (inlier[i]) rows.push_back(i);
  }
  return rows;
}

struct RotationHypothesis {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Support support;
};

// Samples of two matches, then least squares over the inliers until their number stops growing.
RotationHypothesis robust_rotation(const PointPairs& points, const TwoViewOptions& options) {
  constexpr int kSamples = 60;
  std::mt19937_64 generator(options.seed);
  RotationHypothesis best;
  best.support = support_of_rotation(best.rotation, points, options.max_residual);
  const auto improve = [&](const Eigen::Quaterniond& rotation) {
    Support support = support_of_rotation(rotation, points, options.max_residual);
    if (!(support.score > best.support.score)) return false;
    best = {rotation, std::move(support)};
    return true;
  };
  for (int s = 0; s < kSamples; ++s) {
    const std::size_t i = generator() % points.size(), j = generator() % points.size();
    if (i != j) improve(fit_rotation(points, {i, j}));
  }
  for (int round = 0; round < 10 && best.support.count >= 2; ++round) {
    if (!improve(fit_rotation(points, rows_of(best.support.inlier)))) break;
  }
  return best;
}

double median_angle_deg(const Eigen::Quaterniond& rotation, const PointPairs& points,
                        const std::vector<std::uint8_t>& inlier) {
  std::vector<double> angles;
  for (const std::size_t i : rows_of(inlier)) angles.push_back(intersection_angle(rotation, points.a[i], points.b[i]));
  if (angles.empty()) return 0;
  const auto middle = angles.begin() + static_cast<std::ptrdiff_t>(angles.size() / 2);
  std::nth_element(angles.begin(), middle, angles.end());
  return *middle * 180 / std::numbers::pi;
}

// Inliers that chance would give: random matches fall into the residual's band along the epipolar line with the share
// of the image that the band covers, and the unknowns of the model adapt to them.
int inliers_needed(const PointPairs& points, const TwoViewOptions& options) {
  constexpr double kAdaptation = 4;
  Eigen::AlignedBox2d box;
  for (const auto& p : points.b) box.extend(p);
  const Eigen::Vector2d size = box.sizes().cwiseMax(options.max_residual);
  const double share = std::min(1.0, 2 * options.max_residual * size.norm() / size.prod());
  const double by_chance = std::max(options.by_chance, kAdaptation * share) * static_cast<double>(points.size());
  // Matches crowded into a corner all lie in the band: never ask for more than a half.
  return options.min_inliers + static_cast<int>(std::min(by_chance, 0.5 * static_cast<double>(points.size())));
}

TwoView finish(PairModel model, const RelativePoseEstimate& pose, Support support, const PointPairs& points) {
  TwoView result;
  result.model = model;
  result.rotation = pose.rotation;
  result.translation = pose.translation;
  result.inlier_count = support.count;
  result.inlier = std::move(support.inlier);
  result.median_angle_deg = median_angle_deg(pose.rotation, points, result.inlier);
  return result;
}

// Last refinement, with the weights' reach taken from the inliers' own scatter.
Hypothesis polish(const Hypothesis& start, const PointPairs& points, double max_residual) {
  const Eigen::Matrix3d essential = essential_matrix(start.pose);
  std::vector<double> residuals;
  for (const std::size_t i : rows_of(start.support.inlier)) {
    residuals.push_back(std::abs(sampson_residual(essential, points.a[i], points.b[i])));
  }
  if (residuals.empty()) return start;
  const auto middle = residuals.begin() + static_cast<std::ptrdiff_t>(residuals.size() / 2);
  std::nth_element(residuals.begin(), middle, residuals.end());
  const double sigma = 1.4826 * *middle;
  const RelativePoseEstimate pose =
      refine(start.pose, points, std::clamp(2 * sigma, 1e-3 * max_residual, 0.5 * max_residual));
  Hypothesis polished{pose, support_of(pose, points, max_residual)};
  return polished.support.score > 0.98 * start.support.score ? polished : start;
}

// Focal lengths far off: the fundamental matrix holds where no essential does. Its orientation is approximate.
std::optional<TwoView> uncalibrated(const PointPairs& points, const TwoViewOptions& options, int needed) {
  const auto f = robust_fundamental(points, options);
  if (!f) return std::nullopt;
  Support support = support_of_fundamental(*f, points, options.max_residual);
  if (support.count < needed) return std::nullopt;
  const auto pose = best_hypothesis(decompose_essential(*f), points, 4 * options.max_residual);
  if (!pose || pose->support.count < needed / 2) return std::nullopt;
  return finish(PairModel::kEssential, pose->pose, std::move(support), points);
}

}  // namespace

TwoView estimate_two_view(const PointPairs& points, const TwoViewOptions& options) {
  // A simpler model is chosen when it explains this share of the matches of the richer one.
  constexpr double kRotationShare = 0.9, kPlaneShare = 0.8;
  // The fundamental matrix is tried below the first share of all matches and chosen by the second factor of gain.
  constexpr double kDoubtfulShare = 0.4, kFocalGain = 1.3;
  TwoView none;
  none.inlier.assign(points.size(), 0);
  if (points.size() < static_cast<std::size_t>(options.min_inliers)) return none;
  const int needed = inliers_needed(points, options);

  std::vector<RelativePoseEstimate> candidates;
  if (const auto e = robust_essential(points, options)) candidates = decompose_essential(*e);
  const auto h = robust_homography(points, options);
  if (h) std::ranges::copy(decompose_homography(*h), std::back_inserter(candidates));
  const auto best = best_hypothesis(candidates, points, options.max_residual);
  const int best_count = best ? best->support.count : 0;

  const RotationHypothesis rotation = robust_rotation(points, options);
  if (rotation.support.count >= needed && rotation.support.count >= kRotationShare * best_count) {
    return finish(PairModel::kRotationOnly, {rotation.rotation, Eigen::Vector3d::Zero()}, rotation.support, points);
  }
  // A plane leaves the fundamental matrix undetermined.
  const int plane_count = h ? count_homography(*h, points, options.max_residual) : 0;
  const bool planar = plane_count >= kPlaneShare * best_count;
  if (best_count < needed || (!planar && best_count < kDoubtfulShare * static_cast<double>(points.size()))) {
    auto found = uncalibrated(points, options, needed);
    if (found && found->inlier_count > kFocalGain * best_count) return *std::move(found);
  }
  if (best_count < needed) return none;
  Hypothesis polished = polish(*best, points, options.max_residual);
  return finish(planar ? PairModel::kHomography : PairModel::kEssential, polished.pose, std::move(polished.support),
                points);
}

}  // namespace megablock
