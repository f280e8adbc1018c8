// Feature detection on rendered blobs and textures: positions, selection, masks, order, and bad files.
#include "match/features/features.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <tuple>

#include "io/base/error.h"
#include "io/block/tracks.h"
#include "io/images/image_codec.h"
#include "match/features/global_descriptor.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

namespace fs = std::filesystem;

struct Blob {
  double x, y, sigma, height;  // pixels, pixel centres at +0.5
};

// Bright and dark Gaussian blobs, sampled at the pixel centres.
cv::Mat render(int width, int height, const std::vector<Blob>& blobs) {
  cv::Mat grey(height, width, CV_64F, cv::Scalar(128));
  for (const Blob& blob : blobs) {
    const int reach = static_cast<int>(5 * blob.sigma) + 1;
    for (int r = std::max(0, static_cast<int>(blob.y) - reach);
         r < std::min<int>(height, static_cast<int>(blob.y) + reach); ++r) {
      for (int c = std::max(0, static_cast<int>(blob.x) - reach);
           c < std::min<int>(width, static_cast<int>(blob.x) + reach); ++c) {
        const double dx = c + 0.5 - blob.x, dy = r + 0.5 - blob.y;
        grey.at<double>(r, c) += blob.height * std::exp(-(dx * dx + dy * dy) / (2 * blob.sigma * blob.sigma));
      }
    }
  }
  cv::Mat bytes;
  grey.convertTo(bytes, CV_8U);
  return bytes;
}

std::vector<Blob> blob_grid(int width, int height, double spacing, double sigma, std::uint64_t seed) {
  std::mt19937_64 generator(seed);
  std::uniform_real_distribution<double> shift(-2, 2);
  std::vector<Blob> blobs;
  for (double y = spacing; y < height - spacing; y += spacing) {
    for (double x = spacing; x < width - spacing; x += spacing) {
      blobs.push_back({x + shift(generator), y + shift(generator), sigma, blobs.size() % 2 == 0 ? 100.0 : -100.0});
    }
  }
  return blobs;
}

cv::Mat noise_texture(int width, int height, double amplitude, int seed) {
  cv::Mat noise(height, width, CV_32F), smooth, bytes;
  cv::RNG generator(static_cast<std::uint64_t>(seed));
  generator.fill(noise, cv::RNG::NORMAL, 0, 1);
  cv::GaussianBlur(noise, smooth, {}, 1.5);
  smooth.convertTo(bytes, CV_8U, amplitude * 4, 128);
  return bytes;
}

class Features : public testing::Test {
 protected:
  std::string path(const std::string& name) const { return scratch_.path(name); }
  std::string write(const std::string& name, const cv::Mat& pixels) const {
    write_image_file(path(name), pixels);
    return path(name);
  }
  // Copies the first part of a file.
  std::string truncate(const std::string& from, const std::string& name, double share) const {
    std::ifstream in(from, std::ios::binary);
    std::vector<char> bytes(std::istreambuf_iterator<char>(in), {});
    bytes.resize(static_cast<std::size_t>(static_cast<double>(bytes.size()) * share));
    std::ofstream(path(name), std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    return path(name);
  }
  ImageFeatures detect(const std::string& file, const FeatureOptions& options = {},
                       const std::string& mask = "") const {
    return detect_features(file, mask, ImageIndex(3), options);
  }

 private:
  ScratchDirectory scratch_;
};

// Mean and number of the differences found - true, over the blobs that have a feature within reach.
std::tuple<double, double, int> mean_offset(const ImageFeatures& features, const std::vector<Blob>& blobs,
                                            double reach) {
  double dx = 0, dy = 0;
  int count = 0;
  for (const Blob& blob : blobs) {
    const Keypoint* nearest = nullptr;
    double best = reach;
    for (const Keypoint& k : features.keypoints) {
      const double distance = std::hypot(from_fixed_pixel(k.x) - blob.x, from_fixed_pixel(k.y) - blob.y);
      if (distance < best) {
        best = distance;
        nearest = &k;
      }
    }
    if (!nearest) continue;
    dx += from_fixed_pixel(nearest->x) - blob.x;
    dy += from_fixed_pixel(nearest->y) - blob.y;
    ++count;
  }
  return {dx / count, dy / count, count};
}

TEST_F(Features, PositionsHavePixelCentresAtOneHalf) {
  for (const double sigma : {2.0, 3.5, 6.0}) {
    const auto blobs = blob_grid(1000, 800, 12 * sigma, sigma, 1);
    const ImageFeatures features = detect(write("blobs.png", render(1000, 800, blobs)));
    const auto [dx, dy, count] = mean_offset(features, blobs, 1.0);
    EXPECT_GT(count, static_cast<int>(0.85 * static_cast<double>(blobs.size()))) << "sigma " << sigma;
    EXPECT_NEAR(dx, 0, 0.01) << "sigma " << sigma;
    EXPECT_NEAR(dy, 0, 0.01) << "sigma " << sigma;
  }
}

TEST_F(Features, PositionsInReducedImagesReferToTheFullImage) {
  FeatureOptions options;
  for (const double megapixels : {0.75, 1.3}) {  // a factor of exactly 2, and an odd one
    options.max_megapixels = megapixels;
    const auto blobs = blob_grid(2000, 1500, 90, 8, 2);
    const ImageFeatures features = detect(write("large.png", render(2000, 1500, blobs)), options);
    const auto [dx, dy, count] = mean_offset(features, blobs, 2.0);
    EXPECT_EQ(features.width, 2000);
    EXPECT_GT(count, static_cast<int>(0.85 * static_cast<double>(blobs.size())));
    EXPECT_NEAR(dx, 0, 0.02) << megapixels;
    EXPECT_NEAR(dy, 0, 0.02) << megapixels;
    const auto far = std::max_element(features.keypoints.begin(), features.keypoints.end(),
                                      [](const Keypoint& a, const Keypoint& b) { return a.x < b.x; });
    EXPECT_GT(from_fixed_pixel(far->x), 1700);
  }
}

TEST_F(Features, AreKeptEvenly) {
  cv::Mat pixels = noise_texture(800, 400, 60, 1);
  noise_texture(400, 400, 12, 2).copyTo(pixels(cv::Rect(0, 0, 400, 400)));  // weak left half
  FeatureOptions options;
  options.max_features = 600;
  const ImageFeatures features = detect(write("halves.png", pixels), options);
  ASSERT_EQ(features.keypoints.size(), 600u);
  const auto left = std::count_if(features.keypoints.begin(), features.keypoints.end(),
                                  [](const Keypoint& k) { return from_fixed_pixel(k.x) < 400; });
  EXPECT_NEAR(static_cast<double>(left), 300, 60);
  options.max_features = 0;
  EXPECT_GT(detect(path("halves.png"), options).keypoints.size(), 600u);
}

TEST_F(Features, RootSiftHasTheNormOfItsScale) {
  const std::string file = write("texture.png", noise_texture(300, 300, 50, 3));
  const ImageFeatures features = detect(file);
  ASSERT_GT(features.descriptors.size(), 100u);
  for (const SiftDescriptor& d : features.descriptors) {
    double square = 0;
    for (const double v : d) square += v * v;
    EXPECT_NEAR(std::sqrt(square), 176, 5);  // at most 181, which fast matching needs
  }
}

TEST_F(Features, AreSortedAndRepeatable) {
  const std::string file = write("texture.png", noise_texture(400, 300, 50, 4));
  const ImageFeatures first = detect(file), second = detect(file);
  EXPECT_EQ(first.image, ImageIndex(3));
  EXPECT_TRUE(std::is_sorted(first.keypoints.begin(), first.keypoints.end(), [](const Keypoint& a, const Keypoint& b) {
    return std::tuple(-a.scale_px, a.x, a.y) < std::tuple(-b.scale_px, b.x, b.y);
  }));
  EXPECT_EQ(first.descriptors, second.descriptors);
  EXPECT_EQ(first.global_descriptor, second.global_descriptor);
}

TEST_F(Features, NoneUnderTheMask) {
  const std::string file = write("texture.png", noise_texture(400, 300, 50, 5));
  cv::Mat mask(300, 400, CV_8U, cv::Scalar(255));
  mask(cv::Rect(100, 50, 200, 100)).setTo(0);
  const ImageFeatures features = detect(file, {}, write("mask.png", mask));
  ASSERT_GT(features.keypoints.size(), 100u);
  for (const Keypoint& k : features.keypoints) {
    const double x = from_fixed_pixel(k.x), y = from_fixed_pixel(k.y);
    EXPECT_FALSE(x >= 100 && x < 300 && y >= 50 && y < 150) << x << " " << y;
  }
}

TEST_F(Features, MaskOfAnotherSizeIsAFailure) {
  const std::string file = write("texture.png", noise_texture(400, 300, 50, 5));
  const ImageFeatures features = detect(file, {}, write("mask.png", cv::Mat(200, 400, CV_8U, cv::Scalar(255))));
  EXPECT_THAT(features.failure, testing::HasSubstr("400 x 200"));
  EXPECT_TRUE(features.keypoints.empty());
  EXPECT_THAT(detect(file, {}, path("nowhere.png")).failure, testing::HasSubstr("nowhere.png"));
}

TEST_F(Features, BadFilesAreFailuresWithAReason) {
  EXPECT_THAT(detect(path("nowhere.jpg")).failure, testing::HasSubstr("missing"));
  std::ofstream(path("empty.jpg")).close();
  EXPECT_THAT(detect(path("empty.jpg")).failure, testing::HasSubstr("empty"));
  std::ofstream(path("text.jpg")) << "no image at all";
  EXPECT_THAT(detect(path("text.jpg")).failure, testing::HasSubstr("not an image"));
  const std::string jpeg = write("good.jpg", noise_texture(400, 300, 50, 6));
  EXPECT_EQ(detect(jpeg).failure, "");
  for (const double share : {0.01, 0.3, 0.7, 0.999}) {
    const ImageFeatures features = detect(truncate(jpeg, "cut.jpg", share));
    EXPECT_NE(features.failure, "") << share;
    EXPECT_EQ(features.width, 0) << share;
  }
  EXPECT_THAT(detect(truncate(jpeg, "cut.jpg", 0.7)).failure, testing::HasSubstr("truncated"));
  const std::string png = write("good.png", noise_texture(400, 300, 50, 6));
  EXPECT_NE(detect(truncate(png, "cut.png", 0.5)).failure, "");
  EXPECT_NE(detect(path("")).failure, "");  // a folder
}

TEST_F(Features, ProgressiveJpegsAndTrailingBytesAreComplete) {
  const cv::Mat pixels = noise_texture(400, 300, 50, 7);
  write_image_file(path("progressive.jpg"), pixels,
                   {cv::IMWRITE_JPEG_PROGRESSIVE, 1, cv::IMWRITE_JPEG_RST_INTERVAL, 4});
  EXPECT_EQ(detect(path("progressive.jpg")).failure, "");
  std::ofstream(path("progressive.jpg"), std::ios::binary | std::ios::app) << "maker's trailer";
  EXPECT_EQ(detect(path("progressive.jpg")).failure, "");
}

TEST_F(Features, SixteenBitImagesAreStretched) {
  cv::Mat wide;
  noise_texture(300, 300, 50, 8).convertTo(wide, CV_16U, 2, 1000);  // uses 2 % of the range
  EXPECT_GT(detect(write("wide.tif", wide)).keypoints.size(), 100u);
}

// A pixel that is always bright leaves the features of all others where they are.
TEST_F(Features, HotPixelsChangeNothing) {
  cv::Mat wide;
  noise_texture(300, 300, 50, 8).convertTo(wide, CV_16U, 8);  // 11 bits
  const ImageFeatures plain = detect(write("plain.tif", wide));
  for (int i = 0; i < 20; ++i) wide.at<std::uint16_t>(7 + i, 11 + 13 * i) = i % 3 == 0 ? 0 : 65535;
  const ImageFeatures hot = detect(write("hot.tif", wide));
  // Twenty of the ninety pixels beyond the range have changed: a step or two of the eight values between greys.
  EXPECT_NEAR(plain.grey_range[0], hot.grey_range[0], 16);
  EXPECT_NEAR(plain.grey_range[1], hot.grey_range[1], 16);
  std::size_t found = 0;
  for (const Keypoint& a : plain.keypoints)
    found += std::ranges::any_of(hot.keypoints, [&](const Keypoint& b) {
      return std::abs(a.x - b.x) < 512 && std::abs(a.y - b.y) < 512 && std::abs(a.scale_px / b.scale_px - 1) < 0.1;
    });
  EXPECT_GT(found, plain.keypoints.size() * 9 / 10);
}

TEST_F(Features, TheRangeOfGreyValuesLeavesAThousandthOut) {
  cv::Mat ramp(100, 100, CV_16U);
  for (int i = 0; i < 10000; ++i) ramp.at<std::uint16_t>(i / 100, i % 100) = static_cast<std::uint16_t>(3 * i);
  const auto range = [&](const std::string& name, const cv::Mat& image) {
    return detect(write(name, image)).grey_range;
  };
  EXPECT_EQ(range("ramp.tif", ramp), (std::array<float, 2>{30, 29967}));  // ten pixels darker, ten brighter
  cv::Mat floats;
  ramp.convertTo(floats, CV_32F);
  floats.at<float>(50, 50) = std::numeric_limits<float>::infinity();
  const auto of_floats = range("ramp_32.tif", floats);
  EXPECT_NEAR(of_floats[0], 30, 3);
  EXPECT_NEAR(of_floats[1], 29967, 3);
  EXPECT_EQ(range("grey.png", cv::Mat(100, 100, CV_8U, cv::Scalar(90))), (std::array<float, 2>{90, 90}));
}

TEST_F(Features, AMaskOfSixteenBitsMasksWhereItIsNought) {
  const cv::Mat texture = noise_texture(200, 200, 50, 8);
  cv::Mat mask(200, 200, CV_16U, cv::Scalar(1));
  mask.colRange(0, 100).setTo(0);
  mask.at<std::uint16_t>(5, 150) = 65535;
  const ImageFeatures features =
      detect_features(write("texture.png", texture), write("mask.png", mask), ImageIndex(0), {});
  EXPECT_GT(features.keypoints.size(), 30u);
  for (const Keypoint& k : features.keypoints) EXPECT_GE(k.x, 100 * 1024);
}

TEST_F(Features, AnImageWithoutTextureHasNoneAndDoesNotFail) {
  const ImageFeatures features = detect(write("flat.png", cv::Mat(100, 100, CV_8U, cv::Scalar(90))));
  EXPECT_EQ(features.failure, "");
  EXPECT_TRUE(features.keypoints.empty());
  EXPECT_EQ(features.width, 100);
  EXPECT_EQ(detect(write("dot.png", cv::Mat(1, 1, CV_8U, cv::Scalar(90)))).keypoints.size(), 0u);
}

TEST_F(Features, GlobalDescriptorPrefersTheSamePlaceTurned) {
  const auto likeness = [](const ImageFeatures& a, const ImageFeatures& b) {
    double sum = 0;
    for (std::size_t i = 0; i < 128; ++i) sum += a.global_descriptor[i] * b.global_descriptor[i];
    return sum;
  };
  const cv::Mat fine = noise_texture(500, 500, 50, 9);
  cv::Mat turned, coarse;
  cv::rotate(fine, turned, cv::ROTATE_90_CLOCKWISE);
  cv::GaussianBlur(render(500, 500, blob_grid(500, 500, 20, 2, 3)), coarse, {}, 2);
  const ImageFeatures a = detect(write("a.png", fine)), b = detect(write("b.png", turned)),
                      c = detect(write("c.png", coarse));
  EXPECT_NEAR(likeness(a, a), 1, 1e-5);
  EXPECT_GT(likeness(a, b), likeness(a, c) + 0.01);
}

TEST_F(Features, BadOptionsAreRefused) {
  FeatureOptions options;
  options.max_features = -1;
  EXPECT_THROW(detect("x.jpg", options), InputError);
  options = {};
  options.contrast_threshold = 2;
  EXPECT_THROW(detect("x.jpg", options), InputError);
}

}  // namespace
}  // namespace megablock
