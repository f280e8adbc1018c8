// Covariance of an undetermined base, against the errors of many simulated pairs.
#include "geometry/two_view/open_base.h"

#include <gtest/gtest.h>

#include "geometry/numbers/angles.h"
#include "geometry/two_view/relative_adjustment.h"
#include "tests/support/geometry/pair_scene.h"
#include "tests/support/geometry/scene_pairs.h"

namespace megablock {
namespace {

using Matrix5 = Eigen::Matrix<double, 5, 5>;

PairSceneOptions over_a_plane(double off_normal_deg, double noise_px) {
  PairSceneOptions options;
  options.plane = true;
  options.base = 0.1 * Eigen::Vector3d(std::sin(off_normal_deg * kDegree), 0, std::cos(off_normal_deg * kDegree));
  options.noise_px = noise_px;
  return options;
}

struct Adjusted {
  PointPairs points;
  RelativeOrientation found, truth;
  OrientationPrecision precision;
  double over() const { return base_error_deg(found, truth) / degrees(precision.base_sigma()); }
};

// Starts from the truth, because the choice between the two orientations of a plane is not tested here.
Adjusted adjusted(const PairSceneOptions& options, std::size_t matches, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const PairScene scene(options, matches, random);
  const double scale = 2 * options.noise_px / options.focal_px;
  Adjusted pair{normalised_points(scene), {}, scene.truth, {}};
  pair.found = adjust_orientation(pair.truth, pair.points, {scale});
  pair.precision = precision_of(pair.found, pair.points, std::vector<std::uint8_t>(matches, 1), scale, 1e-9);
  return pair;
}

// Along the normal the errors grow as the square root of the noise; far off the normal they are those of least squares.
TEST(OpenBase, SigmasAreThoseOfErrors) {
  for (const double noise_px : {0.1, 0.5})
    for (const double off_normal_deg : {0.0, 5.0, 10.0, 90.0}) {
      constexpr int kPairs = 60;
      double squares = 0, largest = 0;
      for (std::uint64_t seed = 0; seed < kPairs; ++seed) {
        const double over = adjusted(over_a_plane(off_normal_deg, noise_px), 300, seed).over();
        squares += over * over / kPairs;
        largest = std::max(largest, over);
      }
      const double rms = std::sqrt(squares);
      std::printf("[ reached  ] %2.0f deg off the normal, %.1f px: rms error over sigma %.2f, largest %.2f\n",
                  off_normal_deg, noise_px, rms, largest);
      EXPECT_GT(rms, 0.3) << off_normal_deg << ' ' << noise_px;
      EXPECT_LT(rms, 1.4) << off_normal_deg << ' ' << noise_px;  // two components of one sigma: 1.41
      EXPECT_LT(largest, 4) << off_normal_deg << ' ' << noise_px;
    }
}

// For a well-determined pair of general points the covariance is that of least squares.
TEST(OpenBase, IsLeastSquaresWhereThoseAreLinear) {
  PairSceneOptions options;
  options.rotation = rotation_exp<double>({0.05, -0.08, 0.3});
  options.base = {0.3, 0.05, -0.1};
  options.noise_px = 0.5;
  const Adjusted pair = adjusted(options, 800, 1);
  EXPECT_LT(pair.precision.base_sigma(), 0.2 * kDegree);
  const Eigen::Matrix2d start = 4 * pair.precision.covariance.bottomRightCorner<2, 2>();
  const double scale = 2 * options.noise_px / options.focal_px;
  double slope = 0;
  for (std::size_t i = 0; i < pair.points.size(); ++i) {
    const double share =
        std::pow(sampson_residual(essential_from(pair.found), pair.points.a[i], pair.points.b[i]) / scale, 2);
    slope += (1 - 3 * share) / std::pow(1 + share, 3) / static_cast<double>(pair.points.size());
  }
  const auto covariance = covariance_of_open_base(pair.found, start, pair.points, std::vector<double>(800, 1.0),
                                                  {scale, slope, std::pow(pair.precision.sigma, 2)});
  ASSERT_TRUE(covariance);
  for (int i = 0; i < 5; ++i)
    EXPECT_NEAR(std::sqrt((*covariance)(i, i) / pair.precision.covariance(i, i)), 1, 0.15) << i;
}

TEST(OpenBase, WithoutABaseItStaysOpen) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    PairSceneOptions options;
    options.base.setZero();
    options.noise_px = 0.5;
    const Adjusted pair = adjusted(options, 500, seed);
    const auto covariance =
        covariance_of_open_base(pair.found, 1e-4 * Eigen::Matrix2d::Identity(), pair.points,
                                std::vector<double>(500, 1.0), {1, 1, std::pow(pair.precision.sigma, 2)});
    EXPECT_FALSE(covariance) << seed;
  }
}

// The other orientation of a plane is exactly as good; its surroundings must not enter the covariance of this one.
TEST(OpenBase, TwinsBehindABarrierDoNotCount) {
  const Adjusted pair = adjusted(over_a_plane(45, 0.1), 300, 3);
  EXPECT_LT(degrees(pair.precision.base_sigma()), 3);
}

}  // namespace
}  // namespace megablock
