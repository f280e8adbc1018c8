// Simulates scenes of cameras whose positions are known (KP-18), their noise and the measures of their errors (KP-19).
//
// Cameras in a box high above the origin, all aimed at it, gamma = 0; every camera sees every point. Satellite: 700 to
// 800 km up, f = 1e6 px; drone: 50 to 75 m, f = 1e4 px. Image coordinates are pixels from the principal point.
#pragma once

#include <random>

#include "adjust/tile/tile_adjustment.h"
#include "geometry/two_view/coplanarity.h"
#include "io/block/held_priors.h"
#include "io/simulate/blocks/simulate.h"

namespace megablock {

struct KnownPositionsOptions {
  enum class Scene { kSatellite, kDrone } scene = Scene::kSatellite;
  int cameras = 6, points = 100;
  double image_sigma_px = 0.1, angle_sigma_rad = 1e-5;
  bool collinear = false;  // all cameras on one straight line
  int control_points = 0;
  double control_sigma_m = 0.3;
  std::uint64_t seed = 1;

  static KnownPositionsOptions satellite(int points, double image_sigma_px, std::uint64_t seed) {
    KnownPositionsOptions options;
    options.points = points;
    options.image_sigma_px = image_sigma_px;
    options.seed = seed;
    return options;
  }
  static KnownPositionsOptions drone(int points, std::uint64_t seed) {
    KnownPositionsOptions options = satellite(points, 1e-2, seed);
    options.scene = Scene::kDrone;
    options.angle_sigma_rad = 1e-2;
    options.control_sigma_m = 0.01;
    return options;
  }
};

struct KnownPositionsScene {
  using Images = std::vector<std::vector<Eigen::Vector2d>>;  // [points][cameras], px from the principal point

  KnownPositionsOptions options;
  double focal = 1e6;
  std::vector<Eigen::Vector3d> centres;                 // [cameras], as held
  std::vector<XyzAngles> true_angles, angles;           // [cameras], of the truth and measured
  std::vector<Eigen::Vector3d> points, control_points;  // true positions
  Images true_images, images;                           // of the points; measured with noise
  Images control_images;                                // measured
  std::vector<Eigen::Vector3d> surveyed;                // control points with the errors of their survey

  explicit KnownPositionsScene(const KnownPositionsOptions& o) : options(o), random_(o.seed) {
    const bool satellite = o.scene == KnownPositionsOptions::Scene::kSatellite;
    extent_ = satellite ? Eigen::Vector3d(20000, 20000, 5000) : Eigen::Vector3d(100, 100, 40);
    focal = satellite ? 1e6 : 1e4;
    place_cameras(satellite ? 700e3 : 50, satellite ? 800e3 : 75);
    for (int j = 0; j < o.points; ++j) points.push_back(visible_point());
    for (int j = 0; j < o.control_points; ++j) control_points.push_back(visible_point());
    true_images = seen(points, 0);
    images = seen(points, o.image_sigma_px);
    control_images = seen(control_points, o.image_sigma_px);
    for (const XyzAngles& a : true_angles) {
      const Eigen::Vector3d e = noise(o.angle_sigma_rad);
      angles.push_back({a.alpha + e.x(), a.beta + e.y(), a.gamma + e.z()});
    }
    for (const Eigen::Vector3d& point : control_points) surveyed.push_back(point + noise(o.control_sigma_m));
  }

  Eigen::Vector2d project(std::size_t camera, const Eigen::Vector3d& point) const {
    return focal * (rotation_from(true_angles[camera]) * (point - centres[camera])).hnormalized();
  }

  // Mean over points and cameras of the length of the image error, px; mean over cameras of the length of the error of
  // the three angles, rad.
  double image_error(const Images& estimate) const {
    double sum = 0;
    for (std::size_t j = 0; j < points.size(); ++j)
      for (std::size_t i = 0; i < centres.size(); ++i) sum += (estimate[j][i] - true_images[j][i]).norm();
    return sum / static_cast<double>(points.size() * centres.size());
  }
  double angle_error(const std::vector<XyzAngles>& estimate) const {
    double sum = 0;
    for (std::size_t i = 0; i < centres.size(); ++i)
      sum += Eigen::Vector3d(difference(estimate[i].alpha, true_angles[i].alpha),
                             difference(estimate[i].beta, true_angles[i].beta),
                             difference(estimate[i].gamma, true_angles[i].gamma))
                 .norm();
    return sum / static_cast<double>(centres.size());
  }
  double point_rms(const std::vector<Eigen::Vector3d>& estimate) const {
    double sum = 0;
    for (std::size_t j = 0; j < points.size(); ++j) sum += (estimate[j] - points[j]).squaredNorm();
    return std::sqrt(sum / static_cast<double>(points.size()));
  }
  static double difference(double a, double b) { return std::remainder(a - b, 2 * std::numbers::pi); }

  // The scene as a block: held positions, measured angles as start and as prior. Its images are ample for what they
  // see; their principal point is off the origin only so that pixels are positive.
  SimulatedBlock block() const {
    SimulatedBlock result;
    Block& b = result.block;
    Camera camera;
    camera.name = "known";
    camera.width = camera.height = static_cast<int>(2 * kPrincipalPoint);
    camera.intrinsics = Intrinsics({CameraModelKind::kPinhole, 0}, {focal, kPrincipalPoint, kPrincipalPoint});
    camera.focal_known = true;
    b.cameras.push_back(camera);
    b.rigs.push_back({"rig", {Mount{CameraIndex(0), Pose{}}}});
    for (std::size_t i = 0; i < centres.size(); ++i) {
      const std::string name = std::to_string(i);
      Frame frame;
      frame.name = name;
      frame.rig = RigIndex(0);
      frame.position_prior =
          PositionPrior{centres[i], Eigen::Vector3d::Constant(kHeldPositionSigma), Eigen::Vector3d::Zero()};
      const Eigen::Quaterniond rotation = rotation_from(angles[i]);
      frame.attitude_prior = AttitudePrior{rotation, attitude_sigmas(angles[i])};
      frame.given_pose = Pose{rotation, centres[i]};
      b.frames.push_back(frame);
      b.add_image(name, {FrameIndex(static_cast<std::int64_t>(i)), 0, 0});
    }
    for (std::size_t k = 0; k < control_points.size(); ++k) {
      ControlPoint point;
      point.name = "control " + std::to_string(k);
      point.position = surveyed[k];
      point.sigma.setConstant(options.control_sigma_m);
      for (std::size_t i = 0; i < centres.size(); ++i)
        point.measurements.push_back(
            {ImageIndex(static_cast<std::int64_t>(i)), pixel(control_images[k][i]), options.image_sigma_px});
      b.control_points.push_back(point);
    }
    add_tracks(result.tracks);
    result.points = points;
    result.control_truth = control_points;
    result.truth = initial_state(b);
    for (std::size_t i = 0; i < centres.size(); ++i)
      result.truth.frames[FrameIndex(static_cast<std::int64_t>(i))] = {rotation_from(true_angles[i]), centres[i]};
    return result;
  }
  static constexpr double kPrincipalPoint = 200000;
  static Eigen::Vector2d pixel(const Eigen::Vector2d& image) { return image.array() + kPrincipalPoint; }

 private:
  double uniform(double from, double to) { return std::uniform_real_distribution<double>(from, to)(random_); }
  Eigen::Vector3d noise(double sigma) {
    std::normal_distribution<double> normal(0, 1);
    const double x = normal(random_), y = normal(random_), z = normal(random_);
    return sigma * Eigen::Vector3d(x, y, z);
  }

  void place_cameras(double lowest, double highest) {
    const double slope = std::copysign(extent_.y() / extent_.x(), uniform(-1, 1));  // from corner to corner
    const double line_z = uniform(lowest, highest);
    for (int i = 0; i < options.cameras; ++i) {
      const double x = uniform(-extent_.x(), extent_.x()), y = uniform(-extent_.y(), extent_.y()),
                   z = uniform(lowest, highest);
      centres.push_back(options.collinear ? Eigen::Vector3d(x, slope * x, line_z) : Eigen::Vector3d(x, y, z));
      true_angles.push_back(aimed_at_origin(centres.back()));
    }
  }
  static XyzAngles aimed_at_origin(const Eigen::Vector3d& centre) {
    const Eigen::Vector3d d = -centre.normalized();
    XyzAngles a;
    a.beta = std::asin(-d.x());
    a.alpha = std::asin(d.y() / std::cos(a.beta));
    if (std::cos(a.alpha) * std::cos(a.beta) * d.z() < 0) a.alpha = std::numbers::pi - a.alpha;
    return a;
  }
  Eigen::Vector3d visible_point() {
    for (;;) {
      const double x = uniform(-extent_.x(), extent_.x()), y = uniform(-extent_.y(), extent_.y()),
                   z = uniform(-extent_.z(), extent_.z());
      const Eigen::Vector3d point = 0.5 * Eigen::Vector3d(x, y, z);
      bool visible = true;
      for (std::size_t i = 0; i < centres.size(); ++i) {
        const Eigen::Vector3d inside = rotation_from(true_angles[i]) * (point - centres[i]);
        visible = visible && inside.z() > 0.2 * inside.norm();
      }
      if (visible) return point;
    }
  }
  Images seen(const std::vector<Eigen::Vector3d>& all, double sigma) {
    Images result;
    for (const Eigen::Vector3d& point : all) {
      result.emplace_back();
      for (std::size_t i = 0; i < centres.size(); ++i)
        result.back().push_back(project(i, point) + noise(sigma).head<2>());
    }
    return result;
  }
  // About the axes of the camera: R' = Rz(gamma + c) Ry(beta + b) Rx(alpha + a) turns it by c z + b Rz y + a Rz Ry x.
  Eigen::Vector3d attitude_sigmas(const XyzAngles& a) const {
    const Eigen::Matrix3d rz = Eigen::AngleAxisd(a.gamma, Eigen::Vector3d::UnitZ()).toRotationMatrix(),
                          ry = Eigen::AngleAxisd(a.beta, Eigen::Vector3d::UnitY()).toRotationMatrix();
    Eigen::Matrix3d by_angles;
    by_angles << rz * ry.col(0), rz.col(1), Eigen::Vector3d::UnitZ();
    return options.angle_sigma_rad * by_angles.rowwise().norm();
  }
  void add_tracks(TrackSet& tracks) const {
    tracks.begin.push_back(0);
    for (std::size_t j = 0; j < points.size(); ++j) {
      tracks.id.push_back(TrackIndex(static_cast<std::int64_t>(j)));
      for (std::size_t i = 0; i < centres.size(); ++i) {
        const Eigen::Vector2d at = pixel(images[j][i]);
        tracks.image.push_back(ImageIndex(static_cast<std::int64_t>(i)));
        tracks.x.push_back(to_fixed_pixel(at.x()));
        tracks.y.push_back(to_fixed_pixel(at.y()));
        tracks.feature.push_back(-1);
      }
      tracks.begin.push_back(tracks.observation_count());
    }
  }

  std::mt19937_64 random_;
  Eigen::Vector3d extent_;
};

// How a scene is adjusted: with the noise it has, and points that distant cameras see under small angles.
inline AdjustOptions adjustment_of(const KnownPositionsScene& scene) {
  AdjustOptions options;
  options.observations.image_sigma_px = scene.options.image_sigma_px;
  options.estimate_image_sigma = false;
  options.min_intersection_deg = 0.1;
  return options;
}

}  // namespace megablock
