#include "match/features/features.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <tuple>

#include "io/base/error.h"
#include "io/block/tracks.h"
#include "io/text/plausible.h"
#include "match/features/global_descriptor.h"
#include "match/images/image_file.h"

namespace megablock {

void FeatureOptions::check() const {
  if (max_features < 0) throw InputError("max_features must be 0 (all) or more, not " + std::to_string(max_features));
  require_within(max_megapixels, {0.1, 1e5}, "max_megapixels");
  if (!(contrast_threshold >= 0 && contrast_threshold < 1)) {
    throw InputError("contrast_threshold must be in [0, 1)");
  }
}

namespace {

// OpenCV's own threads would make the results of a unit of work depend on the machine. The caller runs units in
// parallel.
void use_one_opencv_thread() { [[maybe_unused]] static const bool done = (cv::setNumThreads(1), true); }

// The image that SIFT works on: reduced when it has more pixels than allowed.
struct ReducedImage {
  cv::Mat pixels;
  double scale_x = 1, scale_y = 1;  // pixels of the full image per reduced pixel
};

// Width and height are rounded separately, so the two scales may differ a little; positions are scaled back with both.
ReducedImage reduce(const cv::Mat& full, double max_megapixels) {
  const double megapixels = 1e-6 * static_cast<double>(full.cols) * static_cast<double>(full.rows);
  if (megapixels <= max_megapixels) return {full};
  const double factor = std::sqrt(max_megapixels / megapixels);
  const int width = std::max(1, static_cast<int>(std::lround(full.cols * factor)));
  const int height = std::max(1, static_cast<int>(std::lround(full.rows * factor)));
  ReducedImage reduced;
  cv::resize(full, reduced.pixels, cv::Size(width, height), 0, 0, cv::INTER_AREA);
  reduced.scale_x = static_cast<double>(full.cols) / width;
  reduced.scale_y = static_cast<double>(full.rows) / height;
  return reduced;
}

// Offset from OpenCV's positions to positions with pixel centres at +0.5. In OpenCV integer positions are pixel
// centres, which asks for 0.5; its SIFT reports positions 0.25 px too high, so 0.25 remains.
constexpr double kSiftOffset = 0.25;

struct Detection {
  Keypoint keypoint;
  int row;  // in the order of detection
};

// A grid of roughly square cells over the image; cell() returns the index of the cell of a keypoint.
struct Grid {
  Grid(int width, int height, int cells) {
    const double side = std::sqrt(static_cast<double>(width) * height / cells);
    columns = std::max(1, static_cast<int>(std::lround(width / side)));
    rows = std::max(1, static_cast<int>(std::lround(height / side)));
    scale_x = static_cast<double>(columns) / width;
    scale_y = static_cast<double>(rows) / height;
  }
  std::size_t cell(const Keypoint& k) const {
    const int c = std::clamp(static_cast<int>(from_fixed_pixel(k.x) * scale_x), 0, columns - 1);
    const int r = std::clamp(static_cast<int>(from_fixed_pixel(k.y) * scale_y), 0, rows - 1);
    return static_cast<std::size_t>(r) * static_cast<std::size_t>(columns) + static_cast<std::size_t>(c);
  }
  std::size_t size() const { return static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows); }
  int columns = 1, rows = 1;
  double scale_x = 1, scale_y = 1;
};

// Largest first; the other elements make the order unique.
auto position_key(const Detection& d) {
  return std::tuple(-d.keypoint.scale_px, d.keypoint.x, d.keypoint.y, d.keypoint.angle_deg, d.row);
}

// Keeps `limit` detections, evenly distributed. Every grid cell gives its largest detection, then every cell its second
// largest, and so on until the limit is reached. Large features are found again in other images far more often than
// small ones of high contrast (in foliage this gives half as many matches again).
void keep_evenly(std::vector<Detection>& detections, int limit, int width, int height) {
  if (limit == 0 || detections.size() <= static_cast<std::size_t>(limit)) return;
  constexpr int kFeaturesPerCell = 40;
  const Grid grid(width, height, std::max(1, limit / kFeaturesPerCell));
  std::sort(detections.begin(), detections.end(),
            [](const Detection& a, const Detection& b) { return position_key(a) < position_key(b); });
  std::vector<int> count(grid.size(), 0);
  std::vector<std::pair<int, std::size_t>> order(detections.size());  // (rank in its cell, rank by size)
  for (std::size_t i = 0; i < detections.size(); ++i) order[i] = {count[grid.cell(detections[i].keypoint)]++, i};
  std::sort(order.begin(), order.end());
  std::vector<Detection> kept(static_cast<std::size_t>(limit));
  for (std::size_t i = 0; i < kept.size(); ++i) kept[i] = detections[order[i].second];
  detections = std::move(kept);
}

// Turns the 128 floating-point numbers of OpenCV's SIFT into bytes.
SiftDescriptor quantise(const float* sift, bool root) {
  SiftDescriptor bytes;
  if (!root) {
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      bytes[i] = static_cast<std::uint8_t>(std::clamp(std::lround(sift[i]), 0L, 255L));
    }
    return bytes;
  }
  // RootSIFT: the Euclidean distance of the square roots is the Hellinger distance of the histograms (R. Arandjelovic
  // and A. Zisserman, "Three things everyone should know to improve object retrieval", CVPR 2012).
  constexpr double kScale = 176;  // the fast kernel needs norms up to 181 (nearest_kernel.h); 512 finds no more matches
  double sum = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) sum += sift[i];
  const double factor = sum > 0 ? 1 / sum : 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const long value = std::lround(kScale * std::sqrt(sift[i] * factor));
    bytes[i] = static_cast<std::uint8_t>(std::clamp(value, 0L, 127L));
  }
  return bytes;
}

// Whether the keypoint's pixel is 0 in the mask. Positions are in units of 2^-10 px.
bool is_masked(const cv::Mat& mask, const Keypoint& k) {
  if (mask.empty()) return false;
  const int column = std::clamp(k.x >> 10, 0, mask.cols - 1), row = std::clamp(k.y >> 10, 0, mask.rows - 1);
  return mask.at<std::uint8_t>(row, column) == 0;
}

cv::Ptr<cv::SIFT> make_sift(const FeatureOptions& options) {
  constexpr int kLayers = 3;
  constexpr double kEdgeThreshold = 10, kSigma = 1.6;
  return cv::SIFT::create(0, kLayers, options.contrast_threshold, kEdgeThreshold, kSigma);
}

// Converts OpenCV's keypoints to the full image and leaves out those under the mask.
std::vector<Detection> place(const std::vector<cv::KeyPoint>& found, const ReducedImage& image, const cv::Mat& mask) {
  std::vector<Detection> detections;
  detections.reserve(found.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    const cv::KeyPoint& f = found[i];
    Detection d;
    d.keypoint.x = to_fixed_pixel((f.pt.x + kSiftOffset) * image.scale_x);
    d.keypoint.y = to_fixed_pixel((f.pt.y + kSiftOffset) * image.scale_y);
    d.keypoint.scale_px = static_cast<float>(f.size * std::sqrt(image.scale_x * image.scale_y));
    d.keypoint.angle_deg = f.angle;
    d.row = static_cast<int>(i);
    if (!is_masked(mask, d.keypoint)) detections.push_back(d);
  }
  return detections;
}

// Detects features, selects them and describes the selected ones. SIFT builds its image pyramid twice in this way,
// which costs less than to describe the two thirds that are not selected.
void detect_and_describe(const cv::Mat& pixels, const cv::Mat& mask, const FeatureOptions& options,
                         ImageFeatures& features) {
  const ReducedImage image = reduce(pixels, options.max_megapixels);
  const auto sift = make_sift(options);
  std::vector<cv::KeyPoint> found;
  sift->detect(image.pixels, found);
  std::vector<Detection> detections = place(found, image, mask);
  keep_evenly(detections, options.max_features, pixels.cols, pixels.rows);
  std::sort(detections.begin(), detections.end(),
            [](const Detection& a, const Detection& b) { return position_key(a) < position_key(b); });
  if (detections.empty()) return;

  std::vector<cv::KeyPoint> kept;
  for (const Detection& d : detections) kept.push_back(found[static_cast<std::size_t>(d.row)]);
  cv::Mat descriptors;
  sift->compute(image.pixels, kept, descriptors);
  CV_Assert(descriptors.rows == static_cast<int>(detections.size()));
  for (std::size_t i = 0; i < detections.size(); ++i) {
    features.keypoints.push_back(detections[i].keypoint);
    features.descriptors.push_back(quantise(descriptors.ptr<float>(static_cast<int>(i)), options.root_sift));
  }
}

// Reads an image and its mask. Returns the reason of a failure, or an empty string.
std::string load(const std::string& path, const std::string& mask_path, GreyImage& image, cv::Mat& mask) {
  image = read_grey_image(path);
  if (!image.failure.empty()) return image.failure;
  const cv::Mat& pixels = image.pixels;
  if (mask_path.empty()) return {};
  GreyImage mask_image = read_mask(mask_path);
  if (!mask_image.failure.empty()) return "mask " + mask_path + ": " + mask_image.failure;
  if (mask_image.pixels.size() != pixels.size()) {
    return "mask " + mask_path + " has " + std::to_string(mask_image.pixels.cols) + " x " +
           std::to_string(mask_image.pixels.rows) + " pixels, the image " + std::to_string(pixels.cols) + " x " +
           std::to_string(pixels.rows);
  }
  mask = mask_image.pixels;
  return {};
}

}  // namespace

ImageFeatures detect_features(const std::string& path, const std::string& mask_path, ImageIndex image,
                              const FeatureOptions& options) {
  options.check();
  use_one_opencv_thread();
  ImageFeatures features;
  features.image = image;
  GreyImage grey;
  cv::Mat mask;
  features.failure = load(path, mask_path, grey, mask);
  if (!features.failure.empty()) return features;
  const cv::Mat& pixels = grey.pixels;
  try {
    detect_and_describe(pixels, mask, options, features);
  } catch (const cv::Exception& e) {
    features.keypoints.clear();
    features.failure = "feature detection failed: " + e.err;
    return features;
  }
  features.width = pixels.cols;
  features.height = pixels.rows;
  features.grey_range = {static_cast<float>(grey.dark), static_cast<float>(grey.bright)};
  features.global_descriptor = global_descriptor(features.descriptors);
  return features;
}

}  // namespace megablock
