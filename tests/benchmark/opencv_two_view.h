// Computes the relative orientation by OpenCV's robust estimators (USAC: MAGSAC scores, uniform samples, inner local
// optimisation, p = 0.999, 3000 draws), which match/ used before it had its own. compare_two_view compares the two.
// Models are selected and refined as in match/verification/two_view.cpp.
#pragma once

#include <Eigen/Geometry>
#include <opencv2/calib3d.hpp>
#include <optional>
#include <random>

#include "geometry/estimation/ransac.h"
#include "geometry/transform/rotation_fit.h"
#include "geometry/two_view/pair_estimators.h"
#include "match/verification/two_view.h"

namespace megablock {

class OpencvTwoView {
 public:
  OpencvTwoView(const PointPairs& points, const TwoViewOptions& options)
      : points_(points), options_(options), estimator_(points, options.max_residual) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      a_.emplace_back(kFocal * points.a[i].x(), kFocal * points.a[i].y());
      b_.emplace_back(kFocal * points.b[i].x(), kFocal * points.b[i].y());
    }
  }

  TwoView estimate() const {
    const cv::Mat k = (cv::Mat_<double>(3, 3) << kFocal, 0, 0, 0, kFocal, 0, 0, 0, 1);
    cv::Mat mask;
    std::vector<RelativeOrientation> candidates;
    const auto e =
        matrix([&] { return cv::findEssentialMat(a_, b_, k, k, cv::noArray(), cv::noArray(), mask, parameters()); });
    if (e)
      for (const RelativeOrientation& o : orientations_of_essential(*e)) candidates.push_back(o);
    auto h = matrix([&] { return cv::findHomography(a_, b_, mask, parameters()); });
    int plane = 0;
    if (h) {
      const Eigen::Matrix3d camera = Eigen::Vector3d(kFocal, kFocal, 1).asDiagonal();
      *h = camera.inverse() * *h * camera;
      plane = consensus_of(HomographyEstimator(points_), *h, options_.max_residual).count;
      add_decomposition(*h, candidates);
    }
    const Scored best = best_of(candidates);
    const auto [rotation, turned] = best_rotation();
    TwoView result;
    result.inlier.assign(points_.size(), 0);
    const int needed = options_.min_inliers;
    if (turned.count >= needed && turned.count >= 0.9 * best.support.count) {
      result.model = PairModel::kRotationOnly;
      result.rotation = rotation;
      result.inlier = turned.inlier;
      result.inlier_count = turned.count;
      return result;
    }
    const bool planar = plane >= 0.8 * best.support.count;
    if (best.support.count < needed || (!planar && best.support.count < 0.4 * static_cast<double>(points_.size())))
      matrix(
          [&] { return cv::findFundamentalMat(a_, b_, mask, parameters()); });  // none of those simulated gains by it
    if (best.support.count < needed) return result;
    result.model = planar ? PairModel::kHomography : PairModel::kEssential;
    const RelativeOrientation last = polished(best);
    result.rotation = last.rotation;
    result.translation = last.base;
    Consensus support = consensus_of(estimator_, last, options_.max_residual);
    result.inlier = std::move(support.inlier);
    result.inlier_count = support.count;
    return result;
  }

 private:
  static constexpr double kFocal = 1000;  // OpenCV's estimators expect pixels
  struct Scored {
    RelativeOrientation orientation;
    Consensus support;
  };

  cv::UsacParams parameters() const {
    cv::UsacParams p;
    p.randomGeneratorState = static_cast<int>(options_.seed & 0x7FFFFFFF);
    p.confidence = 0.999;
    p.maxIterations = 3000;
    p.score = cv::SCORE_METHOD_MAGSAC;
    p.sampler = cv::SAMPLING_UNIFORM;
    p.loMethod = cv::LOCAL_OPTIM_INNER_LO;
    p.threshold = options_.max_residual * kFocal;
    p.isParallel = false;
    return p;
  }

  template <typename Estimator>
  static std::optional<Eigen::Matrix3d> matrix(const Estimator& estimator) {
    try {
      const cv::Mat m = estimator();
      if (m.rows != 3 || m.cols != 3 || !cv::checkRange(m)) return std::nullopt;
      Eigen::Matrix3d result;
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c) result(r, c) = m.at<double>(r, c);
      return result;
    } catch (const cv::Exception&) {
      return std::nullopt;  // degenerate input
    }
  }

  static void add_decomposition(const Eigen::Matrix3d& h, std::vector<RelativeOrientation>& to) {
    cv::Mat m(3, 3, CV_64F);
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) m.at<double>(r, c) = h(r, c);
    std::vector<cv::Mat> rotations, bases, normals;
    try {
      cv::decomposeHomographyMat(m, cv::Mat::eye(3, 3, CV_64F), rotations, bases, normals);
    } catch (const cv::Exception&) {
      return;
    }
    for (std::size_t i = 0; i < rotations.size(); ++i) {
      const Eigen::Vector3d t(bases[i].at<double>(0), bases[i].at<double>(1), bases[i].at<double>(2));
      const auto rotation = matrix([&] { return rotations[i]; });
      if (t.norm() > 1e-9 && rotation) to.push_back({Eigen::Quaterniond(*rotation).normalized(), t.normalized()});
    }
  }

  Scored scored(const RelativeOrientation& o) const { return {o, consensus_of(estimator_, o, options_.max_residual)}; }

  Scored best_of(const std::vector<RelativeOrientation>& candidates) const {
    std::vector<Scored> all;
    for (const RelativeOrientation& o : candidates) all.push_back(scored(o));
    std::stable_sort(all.begin(), all.end(),
                     [](const Scored& p, const Scored& q) { return p.support.score > q.support.score; });
    Scored best;
    for (std::size_t i = 0; i < all.size() && i < 2; ++i)
      for (const Scored& s :
           {all[i], scored(adjust_orientation(all[i].orientation, points_, {0.5 * options_.max_residual}))})
        if (s.support.score > best.support.score) best = s;
    return best;
  }

  RelativeOrientation polished(const Scored& start) const {
    std::vector<double> residuals;
    const Eigen::Matrix3d essential = essential_from(start.orientation);
    for (std::size_t i = 0; i < points_.size(); ++i)
      if (start.support.inlier[i])
        residuals.push_back(std::sqrt(squared_sampson(essential, points_.a[i], points_.b[i])));
    std::nth_element(residuals.begin(), residuals.begin() + std::ssize(residuals) / 2, residuals.end());
    const double limit = options_.max_residual, sigma = 1.4826 * residuals[residuals.size() / 2];
    const Scored last =
        scored(adjust_orientation(start.orientation, points_, {std::clamp(2 * sigma, 1e-3 * limit, 0.5 * limit)}));
    return last.support.score > 0.98 * start.support.score ? last.orientation : start.orientation;
  }

  std::pair<Eigen::Quaterniond, Consensus> best_rotation() const {
    const RotationPairEstimator estimator(points_);
    std::mt19937_64 random(options_.seed);
    std::pair<Eigen::Quaterniond, Consensus> best{Eigen::Quaterniond::Identity(), {}};
    best.second = consensus_of(estimator, best.first, options_.max_residual);
    const auto improve = [&](const std::vector<std::size_t>& rows) {
      std::vector<Eigen::Vector3d> from, to;
      for (const std::size_t i : rows) {
        from.push_back(points_.a[i].homogeneous().normalized());
        to.push_back(points_.b[i].homogeneous().normalized());
      }
      const Eigen::Quaterniond q = fit_rotation(from, to);
      Consensus support = consensus_of(estimator, q, options_.max_residual);
      if (!(support.score > best.second.score)) return false;
      best = {q, std::move(support)};
      return true;
    };
    for (int sample = 0; sample < 60; ++sample) improve({random() % points_.size(), random() % points_.size()});
    for (int round = 0; round < 10 && best.second.count >= 2; ++round) {
      std::vector<std::size_t> rows;
      for (std::size_t i = 0; i < points_.size(); ++i)
        if (best.second.inlier[i]) rows.push_back(i);
      if (!improve(rows)) break;
    }
    return best;
  }

  const PointPairs& points_;
  const TwoViewOptions& options_;
  FivePointEstimator estimator_;
  std::vector<cv::Point2d> a_, b_;
};

}  // namespace megablock
