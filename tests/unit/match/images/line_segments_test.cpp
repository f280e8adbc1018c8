// Line segments of rendered edges: positions and covariances against the truth, for many noise levels.
#include "match/images/line_segments.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <random>

#include "io/base/error.h"

namespace megablock {
namespace {

// Bright bars on dark ground, with edges through known points. The grey value of a pixel is its covered share, from 8 x
// 8 samples.
struct Bars {
  cv::Mat picture;
  struct Edge {
    Eigen::Vector2d point, along;
  };
  std::vector<Edge> edges;

  Bars(std::uint64_t seed, double noise) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal(0, 1);
    std::uniform_real_distribution<double> uniform(0, 1);
    constexpr int kCell = 120, kCells = 5;
    picture = cv::Mat(kCell * kCells, kCell * kCells, CV_8U);
    struct Bar {
      Eigen::Vector2d middle, along;
      double half_width, half_length;
    };
    std::vector<Bar> bars;
    for (int k = 0; k < kCells * kCells; ++k) {
      // A third of the edges runs nearly along rows or columns of pixels, as edges of buildings do.
      const double angle =
          k % 3 == 0 ? (k % 2) * 0.5 * EIGEN_PI + 0.03 * (uniform(random) - 0.5) : uniform(random) * EIGEN_PI;
      const double x = kCell * (k % kCells + 0.5) + uniform(random), y = kCell * (k / kCells + 0.5) + uniform(random);
      bars.push_back({{x, y}, {std::cos(angle), std::sin(angle)}, 8 + 4 * uniform(random), 42});
      const Eigen::Vector2d across(-bars.back().along.y(), bars.back().along.x());
      edges.push_back({bars.back().middle + bars.back().half_width * across, bars.back().along});
      edges.push_back({bars.back().middle - bars.back().half_width * across, bars.back().along});
    }
    for (int row = 0; row < picture.rows; ++row)
      for (int column = 0; column < picture.cols; ++column) {
        const Bar& bar = bars[static_cast<std::size_t>(row / kCell * kCells + column / kCell)];
        int covered = 0;
        for (int s = 0; s < 64; ++s) {
          const Eigen::Vector2d p = Eigen::Vector2d(column + (s % 8 + 0.5) / 8, row + (s / 8 + 0.5) / 8) - bar.middle;
          covered += std::abs(p.dot(bar.along)) < bar.half_length &&
                     std::abs(p.x() * bar.along.y() - p.y() * bar.along.x()) < bar.half_width;
        }
        picture.at<unsigned char>(row, column) =
            cv::saturate_cast<unsigned char>(60 + 120 * covered / 64.0 + noise * normal(random));
      }
  }
};

struct EdgeErrors {
  int found = 0, edges = 0;
  double mean_offset = 0, rms_offset = 0, normalised = 0;
};

EdgeErrors errors_of(double noise, double straightness) {
  EdgeErrors e;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const Bars bars(seed, noise);
    SegmentOptions options;
    options.straightness_px = straightness;
    const std::vector<LineSegment> segments = find_line_segments(bars.picture, {}, options);
    e.edges += static_cast<int>(bars.edges.size());
    for (const Bars::Edge& edge : bars.edges)
      for (const LineSegment& segment : segments) {
        const Eigen::Vector2d middle = 0.5 * (segment.first + segment.second);
        const Eigen::Vector2d across(-edge.along.y(), edge.along.x());
        if ((middle - edge.point).norm() > 40 || std::abs((middle - edge.point).dot(across)) > 2 ||
            std::abs(segment.line.along().dot(across)) > 0.1)
          continue;
        // The line about the edge's own point should have the distance and the direction zero.
        const ImageLine about = line_about(segment.line, edge.point);
        const double sign = about.along().dot(edge.along) < 0 ? -1 : 1;
        const Eigen::Vector2d error(
            std::asin(sign * (edge.along.x() * about.along().y() - edge.along.y() * about.along().x())), about.rho);
        ++e.found;
        e.mean_offset += about.rho * about.across().dot(Eigen::Vector2d(1, 1));
        e.rms_offset += about.rho * about.rho;
        e.normalised += error.dot(about.covariance.inverse() * error) / 2;
      }
  }
  e.mean_offset /= e.found;
  e.rms_offset = std::sqrt(e.rms_offset / e.found);
  e.normalised = e.normalised / e.found;
  return e;
}

TEST(LineSegments, AreWhereTheEdgesAre) {
  const EdgeErrors e = errors_of(2, 0);
  EXPECT_GE(e.found, 0.95 * e.edges);
  EXPECT_LT(e.rms_offset, 0.05);
  EXPECT_LT(std::abs(e.mean_offset), 0.02) << "right and down: pixel centres at +0.5";
  RecordProperty("rms_offset_px", std::to_string(e.rms_offset));
  RecordProperty("mean_offset_px", std::to_string(e.mean_offset));
}

TEST(LineSegments, HaveTheErrorsOfTheirCovariance) {
  for (const double noise : {3.0, 6.0}) {
    const EdgeErrors e = errors_of(noise, 0.015);  // displacement of edges by the sampling into pixels, without noise
    EXPECT_GT(e.normalised, 0.7) << noise;
    EXPECT_LT(e.normalised, 1.5) << noise;
    RecordProperty("normalised" + std::to_string(static_cast<int>(noise)), std::to_string(e.normalised));
  }
}

TEST(LineSegments, OfReducedPicturesReferToTheFullOne) {
  const Bars bars(7, 1);
  SegmentOptions options;
  const auto full = find_line_segments(bars.picture, {}, options);
  options.max_megapixels = 0.25;  // from 600 x 600 to 500 x 500
  const auto reduced = find_line_segments(bars.picture, {}, options);
  EXPECT_GT(reduced.size(), 30u);
  int near = 0;
  for (const LineSegment& r : reduced)
    for (const LineSegment& f : full) {
      const Eigen::Vector2d middle = 0.5 * (r.first + r.second);
      const ImageLine about = line_about(f.line, middle);
      near += (0.5 * (f.first + f.second) - middle).norm() < 30 && std::abs(about.rho) < 0.3;
    }
  EXPECT_GE(near, 0.9 * static_cast<double>(reduced.size()));
}

TEST(LineSegments, PicturesWithoutEdges) {
  EXPECT_TRUE(find_line_segments({}, {}).empty());
  EXPECT_TRUE(find_line_segments(cv::Mat(5, 300, CV_8U, cv::Scalar(7)), {}).empty());
  EXPECT_TRUE(find_line_segments(cv::Mat(300, 300, CV_8U, cv::Scalar(128)), {}).empty());
  cv::Mat noise(300, 300, CV_8U);
  cv::RNG(1).fill(noise, cv::RNG::UNIFORM, 0, 256);
  EXPECT_LE(find_line_segments(noise, {}).size(), 1u);
}

TEST(LineSegments, NoneInMaskedRegions) {
  const Bars bars(3, 1);
  cv::Mat mask(bars.picture.size(), CV_8U, cv::Scalar(255));
  mask.colRange(0, 300).setTo(0);
  const auto segments = find_line_segments(bars.picture, mask);
  EXPECT_GT(segments.size(), 10u);
  for (const LineSegment& s : segments) EXPECT_GE(std::min(s.first.x(), s.second.x()), 300);
}

TEST(LineSegments, OptionsOutOfRange) {
  SegmentOptions options;
  options.min_length_px = 2;
  EXPECT_THROW(options.check(), InputError);
  options = {};
  options.max_megapixels = 0;
  EXPECT_THROW(options.check(), InputError);
  options = {};
  options.straightness_px = -1;
  EXPECT_THROW(options.check(), InputError);
}

}  // namespace
}  // namespace megablock
