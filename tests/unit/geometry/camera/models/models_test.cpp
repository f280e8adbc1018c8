// Tests of every camera model: round trips over the whole sensor, derivatives against central differences, and
// published figures.
#include "geometry/camera/models/models.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "geometry/camera/intrinsics.h"
#include "tests/support/geometry/camera_samples.h"

namespace megablock {
namespace {

class EveryModel : public testing::TestWithParam<CameraModel> {
 protected:
  // Visits the sensor with its borders, in steps of about 60 pixels.
  template <typename Visit>
  void visit_sensor(Visit&& visit, int across = 32, int down = 18) const {
    for (int i = 0; i <= across; ++i)
      for (int j = 0; j <= down; ++j)
        visit(Eigen::Vector2d(i * kSampleWidth / static_cast<double>(across),
                              j * kSampleHeight / static_cast<double>(down)));
  }
  const Intrinsics k_ = sample_camera(GetParam());
};

TEST_P(EveryModel, HasItsOwnNames) {
  const CameraModel model = GetParam();
  EXPECT_EQ(find_model(model_name(model)), model);
  ASSERT_LE(k_.size(), kMaxIntrinsics);
  std::set<std::string> names;
  for (int p = 0; p < k_.size(); ++p) {
    EXPECT_TRUE(names.insert(parameter_name(model, p)).second) << parameter_name(model, p);
    EXPECT_EQ(find_parameter(model, parameter_name(model, p)), p);
  }
  EXPECT_EQ(parameter_name(model, kFocal), "f");
  EXPECT_FALSE(find_parameter(model, "k99"));
  EXPECT_FALSE(find_model(model_name(model) + "-99"));
}

TEST_P(EveryModel, RaysOfPixelsProjectOntoThem) {
  const bool panorama = GetParam().kind == CameraModelKind::kEquirectangular;
  int seen = 0;
  visit_sensor([&](const Eigen::Vector2d& pixel) {
    const auto ray = viewing_ray(k_, pixel);
    if (panorama && !ray) return;  // this panorama extends beyond the poles
    ASSERT_TRUE(ray) << pixel.transpose();
    ++seen;
    EXPECT_NEAR(ray->norm(), 1, 1e-14);
    for (const double distance : {0.1, 1.0, 1e4})
      EXPECT_LT(reprojection(k_, distance * *ray, pixel).norm(), 1e-9) << pixel.transpose();
    const auto normalised = unproject(k_, pixel);
    ASSERT_EQ(normalised.has_value(), ray->z() > 0) << pixel.transpose();
    if (normalised) {
      EXPECT_LT((normalised->homogeneous().normalized() - *ray).norm(), 1e-14);
    }
  });
  EXPECT_GE(seen, panorama ? 33 * 9 : 33 * 19);
}

TEST_P(EveryModel, JacobiansAreCentralDifferences) {
  // Compared with Richardson's extrapolation of central differences, in pixels per camera coordinate at unit distance.
  visit_sensor(
      [&](const Eigen::Vector2d& pixel) {
        if (!Eigen::AlignedBox2d(Eigen::Vector2d(10, 10), Eigen::Vector2d(1910, 1070)).contains(pixel)) return;
        const auto ray = viewing_ray(k_, pixel);
        if (!ray || std::abs(ray->y()) > 0.99) return;
        const ProjectionJacobian analytic = project_with_jacobian(k_, *ray);
        ASSERT_TRUE(analytic.valid);
        EXPECT_LT((analytic.pixel - project(k_, *ray)).norm(), 1e-9);
        const auto derivative = [](auto&& at, double step) -> Eigen::Vector2d {
          const Eigen::Vector2d coarse = (at(2 * step) - at(-2 * step)) / (4 * step),
                                fine = (at(step) - at(-step)) / (2 * step);
          return (4 * fine - coarse) / 3;
        };
        for (int i = 0; i < 3; ++i) {
          const auto at = [&](double step) { return reprojection(k_, *ray + step * Eigen::Vector3d::Unit(i), pixel); };
          EXPECT_LT((analytic.by_point.col(i) - derivative(at, 1e-4)).norm(), 2e-5) << "coordinate " << i;
        }
        ASSERT_EQ(analytic.by_intrinsics.cols(), k_.size());
        for (int p = 0; p < k_.size(); ++p) {
          if (contains(parameters_with(GetParam(), ParameterRole::kImageSize), p)) {
            EXPECT_TRUE(analytic.by_intrinsics.col(p).isZero(0));
            continue;
          }
          const double unit = analytic.by_intrinsics.col(p).norm();  // px per unit of the parameter
          const auto at = [&](double step) {
            Intrinsics k = k_;
            k[p] += step;
            return reprojection(k, *ray, pixel);
          };
          const double step = 1e-2 / std::max(unit, 1e-2);
          EXPECT_LT((analytic.by_intrinsics.col(p) - derivative(at, step)).norm(), 1e-6 * std::max(unit, 1.0))
              << parameter_name(GetParam(), p) << " at " << pixel.transpose();
        }
      },
      11, 7);
}

class EveryCorrection : public EveryModel {
 protected:
  // By the template that automatic differentiation uses.
  static Eigen::Vector2d correction(const Intrinsics& k, const Eigen::Vector2d& pixel) {
    return with_model(k.model().kind, [&]<typename Model>(std::type_identity<Model>) -> Eigen::Vector2d {
      if constexpr (Model::kCorrectsPixels) return Model::template correction<double>(k.model().order, k.data(), pixel);
      return no_pixel();
    });
  }
};

TEST_P(EveryCorrection, LeadsToThePinholePixel) {
  double largest = 0;
  visit_sensor([&](const Eigen::Vector2d& pixel) {
    const Eigen::Vector2d value = correction(k_, pixel);
    EXPECT_LT((correction_at(k_, pixel).value - value).norm(), 1e-11);
    const Eigen::Vector2d straight = project(Intrinsics{k_[0], k_[1], k_[2], 0, 0, 0, 0, 0}, *viewing_ray(k_, pixel));
    EXPECT_LT((pixel + value - straight).norm(), 1e-9);
    largest = std::max(largest, value.norm());
  });
  EXPECT_GT(largest, 5);  // otherwise the comparison would mean little
}

TEST_P(EveryModel, StartsWithoutDistortion) {
  const Intrinsics start = start_intrinsics(GetParam(), 1000, kSampleWidth, kSampleHeight);
  const Eigen::Vector2d centre = project(start, {0, 0, 5});
  EXPECT_LT((centre - Eigen::Vector2d(960, 540)).norm(), 1e-12);
  const IntrinsicSigmas sigma = weak_sigmas(start, 50, kSampleWidth);
  const IntrinsicSigmas of_all = weak_sigmas(start, 50, kSampleWidth, free_parameters(GetParam()));
  for (int p = 0; p < kMaxIntrinsics; ++p) {
    const bool panorama_turn = GetParam().kind == CameraModelKind::kEquirectangular && p == kPrincipalX;
    const bool rare = p >= count_without_rare(GetParam());
    EXPECT_EQ(sigma[static_cast<std::size_t>(p)] > 0, !rare && !is_fixed(GetParam(), p) && !panorama_turn);
  }
  // One sigma of a term moves a pixel at one focal length from the centre by less than half a focal length.
  for (int p = 0; p < start.size(); ++p) {
    Intrinsics moved = start;
    moved[p] += of_all[static_cast<std::size_t>(p)];
    const auto ray = viewing_ray(moved, {960 + 600, 540 + 300});
    ASSERT_TRUE(ray) << parameter_name(GetParam(), p);
    EXPECT_LT(reprojection(start, *ray, {1560, 840}).norm(), 500) << parameter_name(GetParam(), p);
  }
}

std::string test_name(const testing::TestParamInfo<CameraModel>& info) {
  std::string name = model_name(info.param);
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
}
std::vector<CameraModel> every_correction() {
  std::vector<CameraModel> models = every_model();
  std::erase_if(models, [](const CameraModel& model) { return !corrects_pixels(model); });
  return models;
}
INSTANTIATE_TEST_SUITE_P(All, EveryModel, testing::ValuesIn(every_model()), test_name);
INSTANTIATE_TEST_SUITE_P(All, EveryCorrection, testing::ValuesIn(every_correction()), test_name);

// The cameras in Cannelle's table of simulations (2013): the edge corrections belong to the corner farthest from the
// centre of symmetry. The table prints b of the third camera with a minus, and the row of the fourth camera's centre as
// 3709; with these the corrections would be 115 and 4.6 pixels.
TEST(IgnRadial, HasThePublishedEdgeCorrections) {
  struct Published {
    double width, height;
    Intrinsics camera;
    double edge_px;
  };
  const CameraModel ign = *find_model("ign-radial");
  const std::vector<Published> cameras = {
      {3000, 2008, {ign, {2610, 1498, 985, 1481, 971, -1.7e-8, 3e-15, -2.2e-22}}, 59.7},
      {3000, 2008, {ign, {6627, 1511, 985, 1721, 1145, -6.2e-10, 6.1e-17, -8.2e-24}}, 4.2},
      {1920, 1080, {ign, {1400, 961, 542, 961, 542, -4.6e-8, 3.1e-14, -1.2e-21}}, 14.9},
      {7256, 5450, {ign, {11775, 3657, 2728, 3697, 2709, -2.8e-11, -4.2e-19, 9.7e-27}}, 3.1}};
  for (const Published& published : cameras) {
    const Eigen::Vector2d symmetry(published.camera[kSymmetryX], published.camera[kSymmetryY]);
    Eigen::Vector2d farthest = symmetry;
    for (const double x : {0.0, published.width})
      for (const double y : {0.0, published.height})
        if ((Eigen::Vector2d(x, y) - symmetry).norm() > (farthest - symmetry).norm()) farthest = {x, y};
    const Eigen::Vector2d correction = correction_at(published.camera, farthest).value;
    EXPECT_NEAR(correction.norm(), published.edge_px, 0.1 * published.edge_px);
    EXPECT_LT(correction.dot(farthest - symmetry), 0);  // towards the centre
  }
}

TEST(IgnRadial, IsTheOddRadialModelInPixels) {
  const Intrinsics ign = sample_camera(*find_model("ign-radial"));
  Intrinsics odd(*find_model("odd-radial-3"));
  std::copy_n(ign.begin(), kRadialTerms, odd.begin());
  for (int i = 0; i < 3; ++i) odd[kRadialTerms + i] = ign[kRadialTerms + i] * std::pow(ign[kFocal], 2 * i + 2);
  for (const Eigen::Vector2d& pixel : {Eigen::Vector2d(30, 1000), Eigen::Vector2d(1900, 20)})
    EXPECT_LT((correction_at(ign, pixel).value - correction_at(odd, pixel).value).norm(), 1e-11);
}

TEST(Fisheye, IsEquidistantBeyondNinetyDegrees) {
  const Intrinsics k(*find_model("opencv-fisheye"), {300, 500, 400, 0, 0, 0, 0});
  for (double degrees = 0; degrees < 179; degrees += 7) {
    const double angle = degrees * std::numbers::pi / 180;
    const Eigen::Vector3d ray(0.6 * std::sin(angle), -0.8 * std::sin(angle), std::cos(angle));
    const Eigen::Vector2d expected(500 + 300 * angle * 0.6, 400 - 300 * angle * 0.8);
    EXPECT_LT((project(k, 3 * ray) - expected).norm(), 1e-11) << degrees;
    EXPECT_LT((*viewing_ray(k, expected) - ray).norm(), 1e-13) << degrees;
    EXPECT_EQ(unproject(k, expected).has_value(), degrees < 90) << degrees;
  }
  EXPECT_FALSE(project(k, {0, 0, -1}).allFinite());
  EXPECT_FALSE(viewing_ray(k, {500 + 300 * 3.2, 400}));
}

TEST(Fisheye, EndsWhereItsPolynomialTurnsBack) {
  // The radius t (1 - t^2 / 3) has its maximum at t = 1.
  const Intrinsics k(*find_model("opencv-fisheye"), {300, 0, 0, -1.0 / 3, 0, 0, 0});
  const auto at = [](double angle) { return Eigen::Vector3d(std::sin(angle), 0, std::cos(angle)); };
  EXPECT_TRUE(project(k, at(0.99)).allFinite());
  EXPECT_FALSE(project(k, at(1.01)).allFinite());
  EXPECT_FALSE(project_with_jacobian(k, at(1.01)).valid);
  EXPECT_TRUE(viewing_ray(k, {199, 0}));
  EXPECT_FALSE(viewing_ray(k, {201, 0}));
}

// The distortion as COLMAP's documentation of THIN_PRISM_FISHEYE gives it: additions du, dv to equidistant coordinates.
TEST(ThinPrismFisheye, AddsTheTermsOfColmap) {
  const double f = 420, cx = 512, cy = 384, k1 = -0.02, k2 = 0.011, k3 = -0.004, k4 = 0.0007, p1 = 0.003, p2 = -0.002,
               sx1 = 0.0015, sy1 = -0.0025;
  const Intrinsics k(*find_model("thin-prism-fisheye"), {f, cx, cy, k1, k2, k3, k4, p1, p2, sx1, sy1});
  for (const Eigen::Vector3d& point : {Eigen::Vector3d(1, 2, 3), Eigen::Vector3d(-4, 0.5, 1),
                                       Eigen::Vector3d(0.3, -7, -2), Eigen::Vector3d(0, 0, 9)}) {
    const double theta = std::acos(point.normalized().z()), across = std::hypot(point.x(), point.y());
    const double u = across == 0 ? 0 : theta * point.x() / across, v = across == 0 ? 0 : theta * point.y() / across;
    const double r2 = theta * theta;
    const double radial = k1 * r2 + k2 * std::pow(r2, 2) + k3 * std::pow(r2, 3) + k4 * std::pow(r2, 4);
    const double du = u * radial + 2 * p1 * u * v + p2 * (r2 + 2 * u * u) + sx1 * r2;
    const double dv = v * radial + 2 * p2 * u * v + p1 * (r2 + 2 * v * v) + sy1 * r2;
    EXPECT_LT((project(k, point) - Eigen::Vector2d(cx + f * (u + du), cy + f * (v + dv))).norm(), 1e-10);
  }
  EXPECT_FALSE(project(k, {0, 0, -1}).allFinite());
}

TEST(ThinPrismFisheye, IsTheFisheyeWithoutPrisms) {
  const Intrinsics fisheye(*find_model("opencv-fisheye"), {300, 500, 400, -0.1, 0.02, -0.003, 0.0004});
  Intrinsics prism(*find_model("thin-prism-fisheye"));
  std::copy(fisheye.begin(), fisheye.end(), prism.begin());
  for (double degrees = 1; degrees < 120; degrees += 7) {
    const double angle = degrees * std::numbers::pi / 180;
    const Eigen::Vector3d ray(0.6 * std::sin(angle), -0.8 * std::sin(angle), std::cos(angle));
    EXPECT_LT((project(prism, ray) - project(fisheye, ray)).norm(), 1e-10) << degrees;
    EXPECT_LT((*viewing_ray(prism, project(fisheye, ray)) - ray).norm(), 1e-12) << degrees;
  }
}

TEST(ThinPrismFisheye, EndsWhereItFolds) {
  // Along x the radius t (1 - t^2 / 3) has its maximum at t = 1, as in Fisheye.EndsWhereItsPolynomialTurnsBack.
  const Intrinsics k(*find_model("thin-prism-fisheye"), {300, 0, 0, -1.0 / 3, 0, 0, 0, 0, 0, 0, 0});
  const auto at = [](double angle) { return Eigen::Vector3d(std::sin(angle), 0, std::cos(angle)); };
  EXPECT_TRUE(project(k, at(0.99)).allFinite());
  EXPECT_FALSE(project(k, at(1.01)).allFinite());
  EXPECT_FALSE(project_with_jacobian(k, at(1.01)).valid);
  EXPECT_TRUE(viewing_ray(k, {199, 0}));
  EXPECT_FALSE(viewing_ray(k, {201, 0}));
}

TEST(Equirectangular, SeesTheWholeSphere) {
  const Intrinsics k = start_intrinsics(*find_model("equirectangular"), 0, 3600, 1800);
  const auto expect_pixel = [&](const Eigen::Vector3d& point, double x, double y) {
    EXPECT_LT((project(k, point) - Eigen::Vector2d(x, y)).norm(), 1e-9) << point.transpose();
  };
  expect_pixel({0, 0, 7}, 1800, 900);
  expect_pixel({7, 0, 0}, 2700, 900);
  expect_pixel({-7, 0, 0}, 900, 900);
  expect_pixel({0, 1, 1}, 1800, 1350);  // down is down
  expect_pixel({1e-13, 0, -1}, 3600, 900);
  EXPECT_FALSE(project(k, {0, 1, 0}).allFinite());
  EXPECT_FALSE(project_with_jacobian(k, {0, -1, 0}).valid);
  // Both edges of a panorama are the same place.
  EXPECT_LT(reprojection(k, {0.01, 0, -1}, {1, 900}).norm(), 7);
  EXPECT_LT(reprojection(k, {-0.01, 0, -1}, {3599, 900}).norm(), 7);
  EXPECT_GT(viewing_ray(k, {10, 900})->dot(*viewing_ray(k, {3590, 900})), 0.999);
}

TEST(Corrections, EndWhereTheyFold) {
  // The radius r (1 - r^2 / 3), in focal lengths, has its maximum at one focal length.
  Intrinsics k = start_intrinsics(*find_model("odd-radial-1"), 600, kSampleWidth, kSampleHeight);
  k[kRadialTerms] = -1.0 / 3;
  EXPECT_TRUE(viewing_ray(k, {960 + 590, 540}));
  EXPECT_FALSE(viewing_ray(k, {960 + 610, 540}));
  EXPECT_TRUE(project(k, {0.6, 0, 1}).allFinite());
  EXPECT_FALSE(project(k, {0.7, 0, 1}).allFinite());
  EXPECT_FALSE(project_with_jacobian(k, {0.7, 0, 1}).valid);
}

TEST(Corrections, LegendreAndPolynomialSpanTheSame) {
  // x^2 = (2 P_2 + 1) / 3; the principal point takes the constant.
  Intrinsics polynomial = start_intrinsics(*find_model("polynomial-2"), 1400, kSampleWidth, kSampleHeight);
  Intrinsics legendre = start_intrinsics(*find_model("legendre-2"), 1400, kSampleWidth, kSampleHeight);
  polynomial[*find_parameter(polynomial.model(), "x20")] = 6;
  legendre[*find_parameter(legendre.model(), "x20")] = 4;
  legendre[kPrincipalX] -= 2;
  for (const Eigen::Vector3d& point : {Eigen::Vector3d(0.5, 0.3, 1), Eigen::Vector3d(-0.6, 0.1, 1)})
    EXPECT_LT((project(polynomial, point) - project(legendre, point)).norm(), 1e-9);
}

// Worked by hand: x = 0.5, y = -0.25 without distortion, u = 960 + (1000 + 8) 0.5 - 4 (-0.25), v = 540 - 1000 * 0.25.
TEST(Brown, HasTheAffinityAndSkewOfItsFormula) {
  const Intrinsics k{1000, 960, 540, 0, 0, 0, 0, 0, 8, -4};
  EXPECT_LT((project(k, {1, -0.5, 2}) - Eigen::Vector2d(960 + 504 + 1, 540 - 250)).norm(), 1e-12);
}

// Blocks from before the affinity keep their results to the bit.
TEST(Brown, WithoutAffinityHasTheBitsOfTheFormulaWithoutIt) {
  const Intrinsics k{1411.7, 963.3, 541.9, -0.12, 0.05, -0.01, 1e-3, -7e-4};
  for (int i = -8; i <= 8; ++i)
    for (int j = -5; j <= 5; ++j) {
      const Eigen::Vector3d point(0.071 * i + 0.003, 0.063 * j - 0.002, 1.1);
      const BrownModel::Distortion d =
          BrownModel::distort(k.data(), point.x() * (1 / point.z()), point.y() * (1 / point.z()));
      ProjectionJacobian p;
      ASSERT_TRUE(BrownModel::linearise(k.data(), point, true, p));
      EXPECT_EQ(p.pixel, Eigen::Vector2d(k[1] + k[0] * d.point.x(), k[2] + k[0] * d.point.y()));
      EXPECT_EQ((p.by_point.leftCols<2>()), (k[0] * (1 / point.z())) * d.jacobian);
      const double x = point.x() * (1 / point.z()), y = point.y() * (1 / point.z()), r2 = x * x + y * y, f = k[0];
      Eigen::Matrix<double, 2, 8> by_intrinsics;
      by_intrinsics << d.point.x(), 1, 0, f * x * r2, f * x * (r2 * r2), f * x * (r2 * r2 * r2), f * (2 * x * y),
          f * (r2 + 2 * x * x), d.point.y(), 0, 1, f * y * r2, f * y * (r2 * r2), f * y * (r2 * r2 * r2),
          f * (r2 + 2 * y * y), f * (2 * x * y);
      EXPECT_EQ((p.by_intrinsics.leftCols<8>()), by_intrinsics);
    }
}

TEST(CameraModels, RefuseUnknownNames) {
  for (const char* name : {"", "brow", "brown-1", "odd-radial", "odd-radial-", "odd-radial-0", "odd-radial-10",
                           "legendre-7", "fourier-1x", "fourier--1"})
    EXPECT_FALSE(find_model(name)) << name;
  EXPECT_NE(model_list().find("even-radial-N (N = 1 to 9)"), std::string::npos);
}

}  // namespace
}  // namespace megablock
