#include "match/images/static_regions.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <string>

#include "io/base/error.h"

namespace megablock {

namespace {

constexpr double kUnit = 1.0 / 8192;  // unit in which gradients are stored
constexpr double kDark = 16;          // c; below this grey value, sensor noise would count as change
constexpr double kLeastVariation = 0.012, kMostVariation = 0.05;  // limits of t; sensor noise is about 0.008

// The value that a share of the values does not exceed. Reorders the values.
template <typename Value>
Value quantile(std::vector<Value>& values, double share) {
  const auto place = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), values.begin() + place, values.end());
  return values[static_cast<std::size_t>(place)];
}

struct Variation {
  cv::Mat usual, high;  // v_0.5 and v_0.8, CV_32F
  cv::Mat structure;    // |m|, CV_32F
};

// m, v_0.5 and v_0.8 at every pixel.
Variation variation_of(const std::vector<cv::Mat>& gradients) {
  const cv::Size size = gradients.front().size();
  Variation v{cv::Mat(size, CV_32F), cv::Mat(size, CV_32F), cv::Mat(size, CV_32F)};
  std::vector<std::int16_t> x(gradients.size()), y(gradients.size());
  std::vector<float> change(gradients.size());
  for (int r = 0; r < size.height; ++r)
    for (int c = 0; c < size.width; ++c) {
      for (std::size_t k = 0; k < gradients.size(); ++k) {
        const auto& g = gradients[k].at<cv::Vec2s>(r, c);
        x[k] = g[0], y[k] = g[1];
      }
      // The median of each component: a passing object in a minority of the images does not change it.
      const float mx = quantile(x, 0.5), my = quantile(y, 0.5);
      for (std::size_t k = 0; k < gradients.size(); ++k) {
        const auto& g = gradients[k].at<cv::Vec2s>(r, c);
        change[k] = std::hypot(static_cast<float>(g[0]) - mx, static_cast<float>(g[1]) - my);
      }
      constexpr auto kScale = static_cast<float>(kUnit);
      v.usual.at<float>(r, c) = kScale * quantile(change, 0.5);
      v.high.at<float>(r, c) = kScale * quantile(change, 0.8);
      v.structure.at<float>(r, c) = kScale * std::hypot(mx, my);
    }
  return v;
}

cv::Mat disc(int radius) { return cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * radius + 1, 2 * radius + 1}); }

// The connected pieces of `candidates` that have at least a share of their rim, one to three pixels outside, in `firm`.
cv::Mat pieces_with_firm_rim(const cv::Mat& candidates, const cv::Mat& firm, double share) {
  cv::Mat labels, boxes, centres, kept = cv::Mat::zeros(candidates.size(), CV_8U);
  const int count = cv::connectedComponentsWithStats(candidates, labels, boxes, centres, 4);
  const cv::Rect whole({}, candidates.size());
  for (int label = 1; label < count; ++label) {
    constexpr int kRim = 3;
    const int* b = boxes.ptr<int>(label);
    const cv::Rect box = cv::Rect(b[cv::CC_STAT_LEFT] - kRim, b[cv::CC_STAT_TOP] - kRim,
                                  b[cv::CC_STAT_WIDTH] + 2 * kRim, b[cv::CC_STAT_HEIGHT] + 2 * kRim) &
                         whole;
    const cv::Mat piece = labels(box) == label;
    cv::Mat near, rim;
    cv::dilate(piece, near, disc(1));
    cv::dilate(piece, rim, disc(kRim));
    rim = rim & ~near;
    // A rim of length zero is the border of the image all around; nothing speaks against such a piece.
    const int length = cv::countNonZero(rim);
    if (length > 0 && cv::countNonZero(rim & firm(box)) < share * length) continue;
    kept(box).setTo(255, piece);
  }
  return kept;
}

// The regions without those smaller than `area` pixels.
cv::Mat without_specks(const cv::Mat& regions, double area) {
  cv::Mat labels, boxes, centres, kept = cv::Mat::zeros(regions.size(), CV_8U);
  const int count = cv::connectedComponentsWithStats(regions, labels, boxes, centres, 8);
  for (int label = 1; label < count; ++label)
    if (boxes.ptr<int>(label)[cv::CC_STAT_AREA] >= area) kept.setTo(255, labels == label);
  return kept;
}

}  // namespace

void StaticRegionOptions::check() const {
  const auto require = [](bool ok, const char* message) {
    if (!ok) throw InputError(message);
  };
  require(width_px >= 64, "width of the reduced images must be at least 64 px");
  require(min_images >= 10, "min_images must be at least 10");
  require(max_images >= min_images, "max_images must be at least min_images");
  require(min_distance_m >= 0, "min_distance_m must not be negative");
  require(variation_share > 0 && variation_share < 1, "variation_share must lie between 0 and 1");
  require(firm_rim >= 0 && firm_rim <= 1, "firm_rim must lie in [0, 1]");
  require(min_area >= 0 && min_area < 1, "min_area must lie in [0, 1)");
  require(margin_px >= 0, "margin_px must not be negative");
}

StaticRegionFinder::StaticRegionFinder(const StaticRegionOptions& options) : options_(options) { options_.check(); }

cv::Mat StaticRegionFinder::gradients(const cv::Mat& grey) const {
  cv::Mat logarithm, x, y, both;
  grey.convertTo(logarithm, CV_32F);
  const double factor = static_cast<double>(options_.width_px) / std::max(grey.cols, grey.rows);
  if (factor < 1) cv::resize(logarithm, logarithm, {}, factor, factor, cv::INTER_AREA);
  // The logarithm turns a factor of the exposure into a constant, which the gradient removes. The gradients are stored
  // as 16-bit integers to halve the memory.
  cv::log(logarithm + kDark, logarithm);
  cv::Sobel(logarithm, x, CV_32F, 1, 0, 3, 1 / (8 * kUnit));
  cv::Sobel(logarithm, y, CV_32F, 0, 1, 3, 1 / (8 * kUnit));
  cv::merge(std::vector<cv::Mat>{x, y}, both);
  both.convertTo(both, CV_16S);
  return both;
}

void StaticRegionFinder::add(cv::Mat gradients, const cv::Size& image_size) {
  if (images() > 0 && image_size != image_size_)
    throw InputError("static regions: an image of " + std::to_string(image_size.width) + " x " +
                     std::to_string(image_size.height) + " pixels among images of " +
                     std::to_string(image_size_.width) + " x " + std::to_string(image_size_.height) +
                     "; give it a camera of its own");
  image_size_ = image_size;
  gradients_.push_back(std::move(gradients));
}

cv::Mat StaticRegionFinder::mask() const {
  if (images() < options_.min_images)
    throw InputError("static regions: " + std::to_string(images()) + " images are too few; at least " +
                     std::to_string(options_.min_images) +
                     " are needed to tell the vehicle from the scene; add images, or lower --min-images");
  const Variation v = variation_of(gradients_);
  std::vector<float> typical(v.usual.begin<float>(), v.usual.end<float>());
  const double t = std::clamp(options_.variation_share * quantile(typical, 0.75), kLeastVariation, kMostVariation);

  // See the head of static_regions.h for these three sets of pixels.
  const cv::Mat still = v.high < t;
  const cv::Mat structure = still & (v.structure > t);
  const cv::Mat firm = structure | (v.usual >= t);
  cv::Mat regions = pieces_with_firm_rim(still & ~structure, firm, options_.firm_rim) | structure;

  const double area = options_.min_area * static_cast<double>(regions.total());
  cv::morphologyEx(regions, regions, cv::MORPH_CLOSE, disc(2));
  cv::morphologyEx(regions, regions, cv::MORPH_OPEN, disc(1));
  regions = without_specks(regions, area);
  regions = ~without_specks(~regions, area);  // holes
  // The pixels on the vehicle's silhouette change with the scene beside them, so the regions grow by one pixel and the
  // margin.
  cv::dilate(regions, regions, disc(1 + options_.margin_px));
  if (cv::countNonZero(regions) == 0) return cv::Mat(image_size_, CV_8U, cv::Scalar(255));
  cv::Mat full;
  cv::resize(regions, full, image_size_, 0, 0, cv::INTER_LINEAR);
  return full < 128;
}

}  // namespace megablock
