#include "match/two_view.h"

#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <optional>
#include <random>

#include "match/relative_pose.h"

namespace megablock {

namespace {

// OpenCV's robust estimators expect pixels; normalised points are given a nominal focal length.
constexpr double kNominalFocal = 1000;

std::vector<cv::Point2d> nominal_pixels(const std::vector<Eigen::Vector2d>& points,
                                        const std::vector<std::uint8_t>* chosen = nullptr) {
  std::vector<cv::Point2d> result;
  result.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!chosen || (*chosen)[i]) result.emplace_back(points[i].x() * kNominalFocal, points[i].y() * kNominalFocal);
  }
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

// Homography of the chosen matches, normalised coordinates, x_b ~ H x_a.
std::optional<Eigen::Matrix3d> robust_homography(const PointPairs& points, const std::vector<std::uint8_t>* chosen,
                                                 const TwoViewOptions& options) {
  const auto a = nominal_pixels(points.a, chosen), b = nominal_pixels(points.b, chosen);
  if (a.size() < 8) return std::nullopt;
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
    const Eigen::Vector3d t(translations[i].at<double>(0), translations[i].at<double>(1), translations[i].at<double>(2));
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
    const RelativePoseEstimate pose = refine(all[i].pose, points, max_residual);
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
RotationHypothesis robust_rotation(const PointPairs& points, const std::vector<std::size_t>& rows,
                                   const TwoViewOptions& options) {
  constexpr int kSamples = 50;
  PointPairs chosen;
  for (const std::size_t i : rows) {
    chosen.a.push_back(points.a[i]);
    chosen.b.push_back(points.b[i]);
  }
  std::mt19937_64 generator(options.seed);
  RotationHypothesis best;
  best.support = support_of_rotation(best.rotation, chosen, options.max_residual);
  for (int s = 0; s < kSamples; ++s) {
    const std::size_t i = generator() % chosen.size(), j = generator() % chosen.size();
    if (i == j) continue;
    const Eigen::Quaterniond rotation = fit_rotation(chosen, {i, j});
    Support support = support_of_rotation(rotation, chosen, options.max_residual);
    if (support.score > best.support.score) best = {rotation, std::move(support)};
  }
  for (int round = 0; round < 10 && best.support.count >= 2; ++round) {
    const Eigen::Quaterniond rotation = fit_rotation(chosen, rows_of(best.support.inlier));
    Support support = support_of_rotation(rotation, chosen, options.max_residual);
    if (!(support.score > best.support.score)) break;
    best = {rotation, std::move(support)};
  }
  best.support = support_of_rotation(best.rotation, points, options.max_residual);
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

TwoView finish(PairModel model, const RelativePoseEstimate& pose, Support support, const PointPairs& points,
               const TwoViewOptions& options) {
  TwoView result;
  result.inlier.assign(points.size(), 0);
  if (support.count < options.min_inliers) return result;
  result.model = model;
  result.rotation = pose.rotation;
  result.translation = pose.translation;
  result.inlier_count = support.count;
  result.inlier = std::move(support.inlier);
  result.median_angle_deg = median_angle_deg(pose.rotation, points, result.inlier);
  return result;
}

}  // namespace

TwoView estimate_two_view(const PointPairs& points, const TwoViewOptions& options) {
  constexpr double kRotationShare = 0.9, kPlaneShare = 0.8, kFocalGain = 1.3;
  TwoView none;
  none.inlier.assign(points.size(), 0);
  if (points.size() < static_cast<std::size_t>(options.min_inliers)) return none;

  std::optional<Hypothesis> best;
  if (const auto e = robust_essential(points, options)) {
    best = best_hypothesis(decompose_essential(*e), points, options.max_residual);
  }
  const bool essential_holds = best && best->support.count >= options.min_inliers;

  // Focal lengths that are far off: the fundamental matrix holds where the essential does not.
  if (!essential_holds || best->support.count < 0.5 * static_cast<double>(points.size())) {
    if (const auto f = robust_fundamental(points, options)) {
      Support support = support_of_fundamental(*f, points, options.max_residual);
      const auto pose = best_hypothesis(decompose_essential(*f), points, options.max_residual * 4);
      const int count = best ? best->support.count : 0;
      if (pose && support.count >= options.min_inliers && support.count > kFocalGain * count) {
        return finish(PairModel::kEssential, pose->pose, std::move(support), points, options);
      }
    }
  }
  if (!essential_holds) return none;

  const auto rotation = robust_rotation(points, rows_of(best->support.inlier), options);
  if (rotation.support.count >= kRotationShare * best->support.count) {
    return finish(PairModel::kRotationOnly, {rotation.rotation, Eigen::Vector3d::Zero()}, rotation.support, points,
                  options);
  }
  PairModel model = PairModel::kEssential;
  const auto h = robust_homography(points, &best->support.inlier, options);
  if (h && count_homography(*h, points, options.max_residual) >= kPlaneShare * best->support.count) {
    model = PairModel::kHomography;
    auto planar = best_hypothesis(decompose_homography(*h), points, options.max_residual);
    if (planar && planar->support.score > best->support.score) best = std::move(planar);
  }
  return finish(model, best->pose, std::move(best->support), points, options);
}

}  // namespace megablock
