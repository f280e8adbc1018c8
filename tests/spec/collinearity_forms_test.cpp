// Acceptance tests that concern solvers: T-KP01, T-KP02, T-KP03 (A. Barrier, S. Martin, "Bundle adjustment with known
// positions"), T-CP01, T-CP03/04, T-CP05, T-CP06 (a course of image formulas).
#include <gtest/gtest.h>

#include "geometry/camera/camera_matrix.h"
#include "geometry/camera/collinearity.h"
#include "geometry/intersection/triangulation.h"
#include "geometry/transform/rotation_fit.h"
#include "geometry/two_view/coplanarity.h"
#include "reached.h"
#include "tests/support/geometry/pair_scene.h"

namespace megablock {
namespace {

TEST(Spec, TKP01AnglesAndRotations) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> uniform(-1, 1);
  double below = 0, above = 0;
  for (int trial = 0; trial < 10000; ++trial) {
    const XyzAngles truth{std::numbers::pi * uniform(random), 89 * std::numbers::pi / 180 * uniform(random),
                          std::numbers::pi * uniform(random)};
    const XyzAngles back = xyz_angles(rotation_from(truth));
    double error = 0;
    for (const double d : {back.alpha - truth.alpha, back.beta - truth.beta, back.gamma - truth.gamma})
      keep_largest(error, std::abs(std::remainder(d, 2 * std::numbers::pi)));
    double& worst = std::abs(truth.beta) > 85 * std::numbers::pi / 180 ? above : below;
    keep_largest(worst, error);
  }
  expect_at_most(below, 1e-12, "largest error, rad");
  expect_at_most(above, 1e-9, "above 85 deg");
}

TEST(Spec, TKP02CameraMatrix) {
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> uniform(-1, 1);
  double calibration = 0, rotation = 0, centre = 0, determinant = 0, again = 0;
  for (int trial = 0; trial < 10000; ++trial) {
    CameraMatrixParts truth;
    // Frame cameras and satellites; images with y up; skew; a principal point anywhere; any scale and sign.
    const double focal = std::pow(10, 4.5 + 1.5 * uniform(random));
    truth.calibration << focal, 0.01 * focal * uniform(random), 5000 * uniform(random), 0,
        (trial % 2 ? 1 : -1) * focal * (1 + 0.01 * uniform(random)), 5000 * uniform(random), 0, 0, 1;
    truth.pose = {rotation_exp<double>(3.1 * uniform(random) * random_direction(random)),
                  1000 * random_direction(random)};
    const Eigen::Vector3d seen = truth.pose.centre + truth.pose.rotation.conjugate() * Eigen::Vector3d(3, -2, 500);
    CameraMatrix about_centre;  // [I | -C]
    about_centre << Eigen::Matrix3d::Identity(), -truth.pose.centre;
    const CameraMatrix p = std::pow(10, 3 * uniform(random)) * (trial % 3 ? 1 : -1) * truth.calibration *
                           truth.pose.rotation.toRotationMatrix() * about_centre;
    const auto found = decompose_camera_matrix(p, seen);
    ASSERT_TRUE(found);
    keep_largest(calibration, (found->calibration - truth.calibration).norm() / focal);
    keep_largest(rotation, rotation_angle(found->pose.rotation, truth.pose.rotation));
    keep_largest(centre, (found->pose.centre - truth.pose.centre).norm() / 1000);
    keep_largest(determinant, std::abs(found->pose.rotation.toRotationMatrix().determinant() - 1));
    EXPECT_EQ(found->calibration(2, 2), 1);
    const CameraMatrix back = camera_matrix(*found);
    keep_largest(again,
                 std::min((back / back.norm() - p / p.norm()).norm(), (back / back.norm() + p / p.norm()).norm()));
  }
  expect_at_most(calibration, 1e-10, "calibration, of the focal length");
  expect_at_most(rotation, 1e-10, "rotation, rad");
  expect_at_most(centre, 1e-10, "centre, relative");
  expect_at_most(determinant, 1e-12, "determinant less one");
  expect_at_most(again, 1e-10, "the matrix again, relative");
}

// The determinant by its definition, for differences.
double by_definition(const Eigen::Vector3d& base, double focal, const std::array<double, 10>& v) {
  const auto ray = [&](std::size_t at) {
    return Eigen::Vector3d(rotation_from(XyzAngles{v[at], v[at + 1], v[at + 2]}).toRotationMatrix().transpose() *
                           Eigen::Vector3d(v[at + 3] / focal, v[at + 4] / focal, 1));
  };
  return base.dot(ray(0).cross(ray(5)));
}

TEST(Spec, TKP03CoplanarityDeterminant) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const char* names[10] = {"alpha 1", "beta 1", "gamma 1", "x 1", "y 1", "alpha 2", "beta 2", "gamma 2", "x 2", "y 2"};
  std::array<double, 10> worst{};
  double value = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    const double focal = 1000, step = 1e-6;
    const Eigen::Vector3d base = 50 * random_direction(random);
    std::array<double, 10> v;
    for (std::size_t i = 0; i < 10; ++i)
      v[i] = i % 5 < 3 ? (i % 5 == 1 ? 1.4 : 3.1) * uniform(random) : 500 * uniform(random);
    const CoplanarityDeterminant f =
        coplanarity_determinant(base, focal, {v[0], v[1], v[2]}, {v[3], v[4]}, {v[5], v[6], v[7]}, {v[8], v[9]});
    keep_largest(value, std::abs(f.value - by_definition(base, focal, v)) / base.norm());
    for (std::size_t i = 0; i < 10; ++i) {
      // Image coordinates in units of the focal length, so that both kinds of step are angles.
      const double h = i % 5 < 3 ? step : step * focal, scale = base.norm() * (i % 5 < 3 ? 1 : 1 / focal);
      auto up = v, down = v;
      up[i] += h;
      down[i] -= h;
      const double difference = (by_definition(base, focal, up) - by_definition(base, focal, down)) / (2 * h);
      const double analytic = i < 5 ? f.by_first[static_cast<int>(i)] : f.by_second[static_cast<int>(i) - 5];
      keep_largest(worst[i], std::abs(analytic - difference) / scale);
    }
  }
  expect_at_most(value, 1e-12, "value against m.(d1 x d2)");
  for (std::size_t i = 0; i < 10; ++i) expect_at_most(worst[i], 1e-7, std::string("derivative by ") + names[i]);
}

// The entries of the third minor that are printed wrongly: the derivatives with the base along Z.
TEST(Spec, TKP03MisprintedEntries) {
  const double focal = 1000, x1 = 310, y1 = -120, x2 = -250, y2 = 90;
  const XyzAngles a{0.4, -0.3, 0.7}, b{-0.2, 0.25, 1.1};
  const Eigen::Vector3d z(0, 0, 1);
  const CoplanarityDeterminant f = coplanarity_determinant(z, focal, a, {x1, y1}, b, {x2, y2});
  const auto c = [](double t) { return std::cos(t); };
  const auto s = [](double t) { return std::sin(t); };
  const AngledRay k = angled_ray(a, {x1, y1}, focal), l = angled_ray(b, {x2, y2}, focal);
  const double k1 = k.direction.x(), k2 = k.direction.y(), l1 = l.direction.x(), l2 = l.direction.y();
  // F = (k1 l2 - k2 l1) / f^2; by y2, without the factor y2 in front of its first term.
  const double by_y2 =
      k1 * (c(b.alpha) * c(b.gamma) + s(b.alpha) * s(b.beta) * s(b.gamma)) - k2 * c(b.beta) * s(b.gamma);
  expect_at_most(std::abs(f.by_second[4] - by_y2 / focal / focal), 1e-15, "by y2");
  // By y1, with the missing factor s_beta1.
  const double by_y1 =
      c(a.beta) * s(a.gamma) * l2 - l1 * (c(a.alpha) * c(a.gamma) + s(a.alpha) * s(a.beta) * s(a.gamma));
  expect_at_most(std::abs(f.by_first[4] - by_y1 / focal / focal), 1e-15, "by y1");
  // By alpha1, with the missing term: - l1 d(k2)/d(alpha1), k1 does not depend on it.
  const double u = c(a.gamma) * x1 + s(a.gamma) * y1, v = -s(a.gamma) * x1 + c(a.gamma) * y1;
  const double by_alpha = -l1 * (-s(a.alpha) * v + c(a.alpha) * (s(a.beta) * u + focal * c(a.beta)));
  expect_at_most(std::abs(f.by_first[0] - by_alpha / focal / focal), 1e-15, "by alpha1");
  // By gamma2, with - s x2 + c y2 in the second ray's terms.
  const double v2 = -s(b.gamma) * x2 + c(b.gamma) * y2, u2 = c(b.gamma) * x2 + s(b.gamma) * y2;
  const double by_gamma = k1 * (-c(b.alpha) * u2 + s(b.alpha) * s(b.beta) * v2) - k2 * c(b.beta) * v2;
  expect_at_most(std::abs(f.by_second[2] - by_gamma / focal / focal), 1e-15, "by gamma2");
}

TEST(Spec, TKP03NoiseFreeDeterminantsVanish) {
  std::mt19937_64 random(33);
  double worst = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    const double focal = 1000;
    const Eigen::Vector3d c1 = 100 * random_direction(random), c2 = 100 * random_direction(random),
                          point = 20 * random_direction(random);
    const auto seen = [&](const Eigen::Vector3d& centre, XyzAngles& angles) {
      // A camera that looks near the point, turned at random.
      const Eigen::Quaterniond aim = rotation_between(point - centre, Eigen::Vector3d::UnitZ());
      const Eigen::Quaterniond r = rotation_exp<double>(0.3 * random_direction(random)) * aim;
      angles = xyz_angles(r);
      const Eigen::Vector3d q = rotation_from(angles) * (point - centre);
      return Eigen::Vector2d(focal * q.head<2>() / q.z());
    };
    XyzAngles a1, a2;
    const Eigen::Vector2d m1 = seen(c1, a1), m2 = seen(c2, a2);
    const double lengths = (c2 - c1).norm() * angled_ray(a1, m1, focal).direction.norm() / focal *
                           angled_ray(a2, m2, focal).direction.norm() / focal;
    keep_largest(worst, std::abs(coplanarity_determinant(c2 - c1, focal, a1, m1, a2, m2).value) / lengths);
  }
  expect_at_most(worst, 1e-12, "largest |F| / |m| |d1| |d2|");
}

// Near-vertical and oblique images over a local frame or one as large as Lambert 93.
NineParameters random_image(std::mt19937_64& random, double max_tilt_deg, const Eigen::Vector3d& shift) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  const double tilt = max_tilt_deg * std::numbers::pi / 180;
  NineParameters image;
  image.rotation = (Eigen::AngleAxisd(std::numbers::pi * uniform(random), Eigen::Vector3d::UnitZ()) *
                    Eigen::AngleAxisd(tilt * uniform(random), Eigen::Vector3d::UnitY()) *
                    Eigen::AngleAxisd(tilt * uniform(random), Eigen::Vector3d::UnitX()))
                       .toRotationMatrix();
  image.centre = shift + Eigen::Vector3d(300 * uniform(random), 300 * uniform(random), 1000 + 500 * uniform(random));
  image.principal_point = {40 * uniform(random), 40 * uniform(random)};
  image.principal_distance = 5000 + 3000 * uniform(random);
  return image;
}

TEST(Spec, TCP01NineParameterProjection) {
  std::mt19937_64 random(101);
  std::uniform_real_distribution<double> uniform(-1, 1);
  double against_report = 0, rotation = 0, angles = 0, lines = 0, vanishing = 0, principal = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const NineParameters image = random_image(random, 45, Eigen::Vector3d::Zero());
    std::array<Eigen::Vector3d, 3> m;
    std::array<Eigen::Vector2d, 3> x;
    std::array<Eigen::Vector3d, 3> inside;  // the image rays: (x - x_p, y - y_p, -p)
    for (std::size_t i = 0; i < 3; ++i) {
      m[i] = origin_before(image, 800 + 300 * uniform(random)) + 200 * random_direction(random);
      if (i == 2) m[2] = m[0] + 0.4 * (m[1] - m[0]);
      x[i] = project(image, m[i]);
      inside[i] << x[i] - image.principal_point, -image.principal_distance;
      // 0.3: R_report = diag(1, -1, -1) R, f = p, x - x_p, -(y - y_p).
      const Pose pose = pose_from(image);
      const Eigen::Vector3d q = to_inside(pose, m[i]);
      const Eigen::Vector2d report = image.principal_distance * q.head<2>() / q.z();
      keep_largest(against_report,
                   (report - Eigen::Vector2d(inside[i].x(), -inside[i].y())).norm() / image.principal_distance);
      const NineParameters again = nine_from(pose, image.principal_distance, image.principal_point);
      keep_largest(rotation, (again.rotation - image.rotation).norm());
    }
    keep_largest(angles, std::abs(angle_between(inside[0], inside[1]) -
                                  angle_between(m[0] - image.centre, m[1] - image.centre)));
    const Eigen::Vector2d side = x[1] - x[0], part = x[2] - x[0];
    keep_largest(lines, std::abs(side.x() * part.y() - side.y() * part.x()) / side.norm() / image.principal_distance);
    // Points far along a direction tend to where its parallel through the centre meets the image.
    const Eigen::Vector3d direction =
        -(image.rotation.row(2).transpose() + 0.3 * random_direction(random)).normalized();
    const Eigen::Vector2d limit = project(image, image.centre + direction);
    keep_largest(vanishing, (project(image, m[0] + 1e12 * direction) - limit).norm() / image.principal_distance);
    const Eigen::Vector2d along_axis = project(image, m[0] - 1e12 * image.rotation.row(2).transpose());
    keep_largest(principal, (along_axis - image.principal_point).norm() / image.principal_distance);
  }
  expect_at_most(against_report, 1e-12, "against the report's model, of p");
  expect_at_most(rotation, 1e-14, "rotation as a pose and back");
  expect_at_most(angles, 1e-12, "angles between rays, rad");
  expect_at_most(lines, 1e-12, "points off the image of their line, of p");
  expect_at_most(vanishing, 1e-8, "vanishing points from 1e12 m, of p");
  expect_at_most(principal, 1e-8, "that of the axis from the principal point, of p");
}

TEST(Spec, TCP03TCP04NineAndElevenParameters) {
  const Eigen::Vector3d lambert(652000, 6862000, 0);
  double rotation = 0, distance = 0, point = 0, centre = 0, determinant = 0, projection = 0;
  int negative = 0, refused = 0, own_origin = 0;
  std::mt19937_64 random(103);
  const auto round_trip = [&](const NineParameters& image, const Eigen::Vector3d& origin) {
    const auto eleven = eleven_from(image, origin);
    if (!eleven) {
      ++refused;
      return false;
    }
    negative += image.rotation.row(2).dot(image.centre - origin) < 0;
    const auto back = nine_from(*eleven);
    if (!back) return false;
    const double p = image.principal_distance;
    keep_largest(rotation, (back->image.rotation - image.rotation).cwiseAbs().maxCoeff());
    keep_largest(distance, std::abs(back->image.principal_distance / p - 1));
    keep_largest(point, (back->image.principal_point - image.principal_point).norm() / p);
    keep_largest(centre, (back->image.centre - image.centre).norm());
    keep_largest(determinant, std::abs(back->image.rotation.determinant() - 1));
    const Eigen::Vector3d seen = origin_before(image, 1000) + 100 * random_direction(random);
    keep_largest(projection, (project(*eleven, seen) - project(image, seen)).norm() / p);
    return true;
  };
  for (int trial = 0; trial < 10000; ++trial) {
    const int kind = trial % 4;
    if (kind == 3) {
      // Coordinates of a national grid and tilts of 8 deg: from their own origin, or from one before the image.
      const NineParameters image = random_image(random, 8, lambert);
      EXPECT_TRUE(round_trip(image, origin_before(image, 1000)));
      if (round_trip(image, Eigen::Vector3d::Zero())) ++own_origin;
    } else {
      NineParameters image = random_image(random, kind == 0 ? 10 : 45, Eigen::Vector3d::Zero());
      if (kind == 2) image.centre.z() *= -1;  // below the plane of the origin
      if (!round_trip(image, Eigen::Vector3d::Zero())) {
        EXPECT_TRUE(round_trip(image, origin_before(image, 1000)));
      }
    }
  }
  EXPECT_GT(negative, 2500) << "the case in which the printed formulas give -R";
  EXPECT_GT(own_origin, 2400);
  expect_at_most(rotation, 1e-12, "rotation");
  expect_at_most(distance, 1e-12, "p, relative");
  expect_at_most(point, 1e-12, "principal point, of p");
  expect_at_most(centre, 1e-8, "centre, m");
  expect_at_most(determinant, 1e-12, "determinant");
  std::printf("[ reached  ] image points %.2g of p; %d refused for an origin in the plane of the centre\n", projection,
              refused);
  const NineParameters image = random_image(random, 8, lambert);
  const Eigen::Vector3d along = image.rotation.row(0);
  EXPECT_FALSE(eleven_from(image, image.centre + 1000 * along + 1e-4 * image.rotation.row(2).transpose()));
}

struct GroundControl {
  std::vector<Eigen::Vector3d> ground;
  std::vector<Eigen::Vector2d> image;

  GroundControl(const NineParameters& camera, int count, double noise, std::mt19937_64& random) {
    std::uniform_real_distribution<double> uniform(-1, 1);
    std::normal_distribution<double> normal(0, 1);
    const double depth = 1000;
    for (int i = 0; i < count; ++i) {
      const double z = depth * (1 + 0.25 * uniform(random));
      const Eigen::Vector3d inside(0.35 * z * uniform(random), 0.35 * z * uniform(random), -z);
      ground.emplace_back(camera.centre + camera.rotation.transpose() * inside);
      image.emplace_back(project(camera, ground.back()) + noise * Eigen::Vector2d(normal(random), normal(random)));
    }
  }
};

TEST(Spec, TCP05ControlPointsToElevenToNine) {
  const Eigen::Vector3d lambert(652000, 6862000, 0);
  std::mt19937_64 random(105);
  for (const int count : {6, 8, 20}) {
    double exact = 0, linear = 0, inside = 0, ratio = 0;
    int refused = 0;
    constexpr int kTrials = 300;
    for (int trial = 0; trial < kTrials; ++trial) {
      const NineParameters truth = random_image(random, 30, lambert);
      const GroundControl without(truth, count, 0, random), noisy(truth, count, 0.5, random);
      const auto eleven = fit_eleven(without.ground, without.image);
      ASSERT_TRUE(eleven);
      const auto nine = nine_from(*eleven);
      ASSERT_TRUE(nine);
      keep_largest(linear, (nine->image.centre - truth.centre).norm());
      const auto refined = fit_nine(nine->image, without.ground, without.image);
      ASSERT_TRUE(refined);
      keep_largest(exact, (refined->image.centre - truth.centre).norm());
      keep_largest(inside, std::abs(refined->image.principal_distance / truth.principal_distance - 1));
      keep_largest(inside, (refined->image.principal_point - truth.principal_point).norm() / truth.principal_distance);
      const auto start = fit_eleven(noisy.ground, noisy.image);
      const auto physical = start ? nine_from(*start) : std::nullopt;
      const auto fitted = physical ? fit_nine(physical->image, noisy.ground, noisy.image) : std::nullopt;
      if (!fitted) {
        ++refused;
        continue;
      }
      ratio += fitted->squares / 0.25 / (2 * count - 9);
    }
    const std::string name = std::to_string(count) + " points: ";
    // Coordinates of 7e6 m are rounded at 1e-9 m.
    expect_at_most(linear, 1e-8, name + "centre from exact points, linear, m");
    expect_at_most(exact, 1e-8, name + "refined, m");
    expect_at_most(inside, 1e-10, name + "principal distance and point, of p");
    expect_at_most(refused, 0, name + "not settled, of 300");
    expect_at_most(std::abs(std::sqrt(ratio / (kTrials - refused)) - 1), 0.1,
                   name + "rms at 0.5 px against theory, less one");
  }
  const NineParameters truth = random_image(random, 30, lambert);
  const GroundControl five(truth, 5, 0.5, random);
  EXPECT_FALSE(fit_eleven(five.ground, five.image));
  for (const double noise : {0.0, 0.5}) {
    GroundControl plane(truth, 20, noise, random);
    for (const double slope : {0.0, 0.3}) {
      for (std::size_t i = 0; i < 20; ++i) {
        const Eigen::Vector2d error = plane.image[i] - project(truth, plane.ground[i]);
        plane.ground[i].z() = 12 + slope * (plane.ground[i].x() - lambert.x());
        plane.image[i] = project(truth, plane.ground[i]) + error;
      }
      EXPECT_FALSE(fit_eleven(plane.ground, plane.image)) << "coplanar, noise " << noise << " px, slope " << slope;
    }
  }
}

TEST(Spec, TCP06Restitution) {
  const Eigen::Vector3d lambert(652000, 6862000, 0);
  std::mt19937_64 random(106);
  std::normal_distribution<double> normal(0, 1);
  for (const std::size_t count : {2u, 3u, 5u, 10u}) {
    double exact = 0, difference = 0, error = 0;
    for (int trial = 0; trial < 300; ++trial) {
      std::vector<NineParameters> nine;
      std::vector<ElevenParameters> eleven;
      std::vector<Eigen::Vector2d> image, noisy;
      std::vector<PointView> views;
      std::vector<Intrinsics> cameras(count);
      const Eigen::Vector3d point = lambert + 50 * random_direction(random);
      for (std::size_t i = 0; i < count; ++i) {
        nine.push_back(random_image(random, 10, lambert));
        nine[i].principal_distance = 5000;
        eleven.push_back(eleven_from(nine[i], origin_before(nine[i], 1000)).value());
        image.push_back(project(nine[i], point));
        noisy.emplace_back(image[i] + 0.5 * Eigen::Vector2d(normal(random), normal(random)));
        const double p = nine[i].principal_distance;
        cameras[i] = {p, nine[i].principal_point.x(), -nine[i].principal_point.y()};
        views.push_back({pose_from(nine[i]), &cameras[i], {noisy[i].x(), -noisy[i].y()}, 2});
      }
      const auto found = restitute(eleven, image);
      ASSERT_TRUE(found);
      keep_largest(exact, (*found - point).norm());
      const auto linear = restitute(eleven, noisy);
      const auto refined = triangulate(views);
      ASSERT_TRUE(linear && refined);
      difference += (*linear - refined->position).squaredNorm();
      error += (refined->position - point).squaredNorm();
    }
    const std::string name = std::to_string(count) + " images: ";
    expect_at_most(exact, 1e-7, name + "exact, m");
    expect_at_most(std::sqrt(difference / error), 0.1, name + "linear from refined, of the error at 0.5 px");
  }
}

}  // namespace
}  // namespace megablock
