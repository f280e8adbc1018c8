#include "match/images/line_segments.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "io/base/error.h"

namespace megablock {

namespace {

constexpr int kReach = 3;           // pixels to either side of the detected edge
constexpr double kBlurSigma = 1.0;  // px
constexpr int kLags = 12;           // pixels over which the scatter of the edge points may be correlated

// Bilinear interpolation of the grey value; (0, 0) is the centre of the first pixel.
double grey_at(const cv::Mat& smooth, double x, double y) {
  const int column = static_cast<int>(std::floor(x)), row = static_cast<int>(std::floor(y));
  const double u = x - column, v = y - row;
  const float* upper = smooth.ptr<float>(row) + column;
  const float* lower = smooth.ptr<float>(row + 1) + column;
  return (1 - v) * ((1 - u) * upper[0] + u * upper[1]) + v * ((1 - u) * lower[0] + u * lower[1]);
}

// The measured edge points: positions along and across the detected segment, one per pixel of its length.
struct EdgePlaces {
  std::vector<double> along, across;
};

// A segment as detected: start point and unit directions in the reduced image.
struct DetectedEdge {
  Eigen::Vector2d start, along, across;
  double length = 0;
};

// Differences of grey values across the edge at a place along it, at whole pixels from -kReach to kReach.
void gradients_across(const cv::Mat& smooth, const Eigen::Vector2d& place, const Eigen::Vector2d& across,
                      double (&gradient)[2 * kReach + 1]) {
  double before = 0;
  for (int k = -kReach; k <= kReach + 1; ++k) {
    const Eigen::Vector2d p = place + (k - 0.5) * across;
    const double here = grey_at(smooth, p.x(), p.y());
    if (k > -kReach) gradient[k + kReach - 1] = here - before;
    before = here;
  }
}

// Measures the edge at every pixel of its length. Points without a clear gradient maximum are left out. Empty for an
// edge closer to the border than the search reaches.
EdgePlaces places_of(const cv::Mat& smooth, const DetectedEdge& edge) {
  EdgePlaces places;
  const int count = static_cast<int>(edge.length) + 1;
  const double margin = kReach + 2;
  const auto inside = [&](const Eigen::Vector2d& p) {
    return p.x() > margin && p.y() > margin && p.x() < smooth.cols - 1 - margin && p.y() < smooth.rows - 1 - margin;
  };
  if (!inside(edge.start) || !inside(edge.start + edge.length * edge.along)) return places;
  double gradient[2 * kReach + 1], rise = 0;
  for (int i = 0; i < count; ++i) {  // the edge is dark to bright or bright to dark; its sum tells
    gradients_across(smooth, edge.start + i * edge.along, edge.across, gradient);
    rise += gradient[kReach - 1] + gradient[kReach] + gradient[kReach + 1];
  }
  const double sign = rise < 0 ? -1 : 1, least = 0.2 * std::abs(rise) / (3 * count);
  for (int i = 0; i < count; ++i) {
    gradients_across(smooth, edge.start + i * edge.along, edge.across, gradient);
    int best = 1;
    for (int k = 2; k < 2 * kReach; ++k)
      if (sign * gradient[k] > sign * gradient[best]) best = k;
    const double left = sign * gradient[best - 1], peak = sign * gradient[best], right = sign * gradient[best + 1];
    if (!(peak > least) || !(left > 0) || !(right > 0) || !(peak > left && peak >= right)) continue;
    // Vertex of the parabola through the logarithms of three gradients.
    const double a = std::log(left), b = std::log(peak), c = std::log(right);
    places.along.push_back(i);
    places.across.push_back(best - kReach + 0.5 * (a - c) / (a - 2 * b + c));
  }
  return places;
}

// A straight line across = offset + slope * along, with its standard deviation and the points it was fitted to.
struct StraightFit {
  double offset = 0, slope = 0, sigma = 0;
  EdgePlaces kept;
};

// Fits a line and rejects outliers, three times: beyond three sigmas, and never farther than the detector's own half
// width.
StraightFit fit_places(const EdgePlaces& places) {
  StraightFit fit;
  fit.kept = places;
  double limit = kReach;
  for (int round = 0; round < 4 && fit.kept.along.size() >= 5; ++round) {
    // Linear regression about the centroid (t, d).
    const auto n = static_cast<double>(fit.kept.along.size());
    double t = 0, d = 0, tt = 0, td = 0;
    for (std::size_t i = 0; i < fit.kept.along.size(); ++i) {
      t += fit.kept.along[i] / n;
      d += fit.kept.across[i] / n;
    }
    for (std::size_t i = 0; i < fit.kept.along.size(); ++i) {
      tt += (fit.kept.along[i] - t) * (fit.kept.along[i] - t);
      td += (fit.kept.along[i] - t) * (fit.kept.across[i] - d);
    }
    fit.slope = td / tt;
    fit.offset = d - fit.slope * t;
    double squares = 0;
    for (std::size_t i = 0; i < fit.kept.along.size(); ++i)
      squares += std::pow(fit.kept.across[i] - fit.offset - fit.slope * fit.kept.along[i], 2);
    fit.sigma = std::sqrt(squares / (n - 2));
    if (round == 3) break;
    // The limit only shrinks, and the points are chosen anew from all, so that a point rejected by a bad first fit can
    // return.
    limit = std::clamp(3 * fit.sigma, 0.2, limit);
    fit.kept = {};
    for (std::size_t i = 0; i < places.along.size(); ++i) {
      if (std::abs(places.across[i] - fit.offset - fit.slope * places.along[i]) > limit) continue;
      fit.kept.along.push_back(places.along[i]);
      fit.kept.across.push_back(places.across[i]);
    }
  }
  return fit;
}

// How many neighbouring points are worth one independent point: 1 + 2 times the sum of the correlations of the scatter,
// pooled over all edges.
class Correlation {
 public:
  void add(const StraightFit& fit) {
    const std::size_t n = fit.kept.along.size();
    const auto residual = [&](std::size_t i) {
      return (fit.kept.across[i] - fit.offset - fit.slope * fit.kept.along[i]) / std::max(fit.sigma, 1e-9);
    };
    // Sums of products of normalised residuals, by their distance along the edge.
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = i; j < n; ++j) {
        const auto lag = static_cast<std::size_t>(std::lround(fit.kept.along[j] - fit.kept.along[i]));
        if (lag > kLags) break;
        products_[lag] += residual(i) * residual(j);
        ++pairs_[lag];
      }
  }
  double places_for_one() const {
    if (!(products_[0] > 0)) return 1;
    double sum = 1;
    for (std::size_t lag = 1; lag <= kLags && pairs_[lag] > 0; ++lag) {
      const double rho =
          products_[lag] / static_cast<double>(pairs_[lag]) * static_cast<double>(pairs_[0]) / products_[0];
      if (rho <= 0) break;
      sum += 2 * rho;
    }
    return sum;
  }

 private:
  double products_[kLags + 1] = {};
  std::int64_t pairs_[kLags + 1] = {};
};

bool is_masked(const cv::Mat& mask, const Eigen::Vector2d& p) {
  const int x = std::clamp(static_cast<int>(p.x()), 0, mask.cols - 1);
  const int y = std::clamp(static_cast<int>(p.y()), 0, mask.rows - 1);
  return mask.at<unsigned char>(y, x) == 0;
}

}  // namespace

void SegmentOptions::check() const {
  if (!(min_length_px >= 10)) throw InputError("min_length_px must be at least 10");
  if (!(max_megapixels > 0)) throw InputError("max_megapixels must be greater than 0");
  if (!(straightness_px >= 0)) throw InputError("straightness_px must not be negative");
}

std::vector<LineSegment> find_line_segments(const cv::Mat& grey, const cv::Mat& mask, const SegmentOptions& options) {
  std::vector<LineSegment> segments;
  if (grey.empty() || grey.cols < 4 * kReach || grey.rows < 4 * kReach) return segments;
  cv::Mat image = grey;
  const double pixels = static_cast<double>(grey.total());
  if (pixels > 1e6 * options.max_megapixels) {
    const double factor = std::sqrt(1e6 * options.max_megapixels / pixels);
    cv::resize(grey, image, {}, factor, factor, cv::INTER_AREA);
  }
  const Eigen::Vector2d scale(static_cast<double>(grey.cols) / image.cols, static_cast<double>(grey.rows) / image.rows);
  std::vector<cv::Vec4f> detected;
  cv::createLineSegmentDetector(cv::LSD_REFINE_STD)->detect(image, detected);
  cv::Mat smooth;
  image.convertTo(smooth, CV_32F);
  cv::GaussianBlur(smooth, smooth, {}, kBlurSigma, kBlurSigma, cv::BORDER_REPLICATE);

  std::vector<DetectedEdge> edges;
  std::vector<StraightFit> fits;
  Correlation correlation;
  for (const cv::Vec4f& ends : detected) {
    const Eigen::Vector2d a(ends[0], ends[1]), b(ends[2], ends[3]);
    DetectedEdge edge{a, {}, {}, (b - a).norm()};
    if (!(edge.length >= options.min_length_px)) continue;
    edge.along = (b - a) / edge.length;
    edge.across = {-edge.along.y(), edge.along.x()};
    const EdgePlaces places = places_of(smooth, edge);
    StraightFit fit = fit_places(places);
    // If half of the edge shows no gradient, it is two edges, or texture.
    if (fit.kept.along.size() < 5 || static_cast<double>(fit.kept.along.size()) < 0.5 * edge.length) continue;
    if (fit.kept.along.back() - fit.kept.along.front() < options.min_length_px) continue;
    correlation.add(fit);
    edges.push_back(edge);
    fits.push_back(std::move(fit));
  }
  const double per_place = correlation.places_for_one();
  std::vector<Eigen::Vector2d> points;
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const DetectedEdge& edge = edges[e];
    const StraightFit& fit = fits[e];
    const auto to_full = [&](double along) -> Eigen::Vector2d {
      const Eigen::Vector2d p = edge.start + along * edge.along + (fit.offset + fit.slope * along) * edge.across;
      return (p + Eigen::Vector2d::Constant(0.5)).cwiseProduct(scale);
    };
    LineSegment segment;
    segment.first = to_full(fit.kept.along.front());
    segment.second = to_full(fit.kept.along.back());
    if (!mask.empty() && (is_masked(mask, segment.first) || is_masked(mask, segment.second) ||
                          is_masked(mask, 0.5 * (segment.first + segment.second))))
      continue;
    points.clear();
    for (const double along : fit.kept.along) points.push_back(to_full(along));
    const double size = std::sqrt(scale.prod());
    segment.sigma_px = fit.sigma * size;
    // A few points may lie straight by accident.
    const double sigma = std::max(fit.sigma, 0.02) * size;
    const auto line = fit_image_line(points, sigma * std::sqrt(per_place));
    if (!line) continue;
    segment.line = *line;
    if (options.straightness_px > 0) {
      const Eigen::Vector2d ends[2] = {segment.first, segment.second};
      const auto bent = fit_image_line(ends, options.straightness_px * size);
      if (!bent) continue;
      segment.line.covariance += bent->covariance;
    }
    segments.push_back(segment);
  }
  return segments;
}

}  // namespace megablock
