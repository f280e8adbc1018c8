// Acceptance of the environment's corrections (CP-07): T-CP07.
#include "geometry/camera/environment.h"

#include <gtest/gtest.h>

#include <cmath>

#include "cluster/job/messages.h"
#include "geometry/camera/camera.h"
#include "geometry/numbers/median.h"
#include "io/base/error.h"
#include "io/block/crs.h"
#include "io/result/result.h"
#include "tests/integration/block_folder.h"
#include "tests/spec/reached.h"

namespace megablock {
namespace {

constexpr double kHeight = 3000;

// Radial distortion a r^3 + b r^5 + c r^7 of 40 px in the corners.
Intrinsics distorted_camera() {
  Intrinsics camera(CameraModel{CameraModelKind::kIgnRadial});
  camera[kFocal] = 9000;
  camera[kPrincipalX] = camera[kSymmetryX] = 4500;
  camera[kPrincipalY] = camera[kSymmetryY] = 3000;
  camera[kRadialTerms] = 3e-10;
  camera[kRadialTerms + 1] = -6e-18;
  camera[kRadialTerms + 2] = 5e-26;
  return camera;
}

TEST(TCP07, InverseOfTheForwardCorrection) {
  const Intrinsics camera = distorted_camera();
  Intrinsics perspective(CameraModel{CameraModelKind::kPinhole});
  for (const int k : {kFocal, kPrincipalX, kPrincipalY}) perspective[k] = camera[k];
  const EnvironmentEffect effect{refraction_constant(kHeight, 300), curvature_constant(kHeight - 300)};
  double radial = 0, environment = 0, all = 0, largest = 0;
  for (const double tilt : {0., 3., 45.}) {
    const Eigen::Vector3d down(0, std::sin(tilt * std::numbers::pi / 180), std::cos(tilt * std::numbers::pi / 180));
    for (double x = 0; x <= 9000; x += 300)
      for (double y = 0; y <= 6000; y += 300) {
        const Eigen::Vector2d pixel(x, y);
        // Perspective -> what the lens makes of it -> perspective.
        const Eigen::Vector2d corrected = pixel + correction_at(camera, pixel).value;
        keep_largest(radial, (solve_correction(camera, corrected) - pixel).norm());
        const Eigen::Vector2d seen = seen_pixel(effect, perspective, pixel, down);
        keep_largest(environment, (geometric_pixel(effect, perspective, seen, down) - pixel).norm());
        const Eigen::Vector2d both = seen_pixel(effect, camera, pixel, down);
        keep_largest(all, (geometric_pixel(effect, camera, both, down) - pixel).norm());
        keep_largest(largest, (both - pixel).norm());
      }
  }
  expect_at_least(largest, 1, "largest correction, px");
  expect_at_most(radial, 1e-6, "inverse(forward) of the radial distortion, px");
  expect_at_most(environment, 1e-6, "of refraction and curvature, px");
  expect_at_most(all, 1e-6, "of all three, px");
}

SimulationOptions survey(const std::string& camera_model) {
  SimulationOptions options;
  options.frames = 42;
  options.height_m = kHeight;
  options.terrain_relief_m = 400;
  options.forward_overlap = 0.6;
  options.side_overlap = 0.4;
  options.image_width = 9000;
  options.image_height = 6000;
  options.focal_px = 9000;
  options.points_per_frame = 150;
  options.image_noise_px = 0.05;
  options.gps_sigma_m = 0.02;
  options.control_points = 8;
  options.control_sigma_m = 0.02;
  options.camera_model = camera_model;
  options.calibrate = false;  // the distortion is known
  return options;
}

// Measurements as the atmosphere and, of a block in grid coordinates, the curved earth change them.
void inject(SimulatedBlock& s) {
  const auto seen = [&](ImageIndex image, const Eigen::Vector2d& pixel, const Eigen::Vector3d& point) {
    const Mount& mount = s.block.mount_of(image);
    const Pose camera = camera_pose(s.truth.frames[s.block.images[image].frame], mount.pose);
    const double height = camera.centre.z();
    return seen_pixel({refraction_constant(height, point.z()), curvature_constant(height - point.z())},
                      s.truth.cameras[mount.camera], pixel, camera.rotation * Eigen::Vector3d(0, 0, -1));
  };
  for (std::int64_t t = 0; t < s.tracks.track_count(); ++t)
    for (std::int64_t o = s.tracks.begin[t]; o < s.tracks.begin[t + 1]; ++o) {
      const Eigen::Vector2d pixel =
          seen(s.tracks.image[o], {from_fixed_pixel(s.tracks.x[o]), from_fixed_pixel(s.tracks.y[o])}, s.points[t]);
      s.tracks.x[o] = to_fixed_pixel(pixel.x());
      s.tracks.y[o] = to_fixed_pixel(pixel.y());
    }
  for (std::size_t p = 0; p < s.block.control_points.size(); ++p)
    for (ImageMeasurement& m : s.block.control_points[p].measurements)
      m.pixel = seen(m.image, m.pixel, s.control_truth[p]);
}

struct Outcome {
  double rms_px, position_rms_m;
  double median_height_error_m;  // of the tie points, absolute
};

// A whole run of the program.
Outcome adjusted(const SimulatedBlock& s, const std::string& settings) {
  const BlockFolder folder;
  folder.write(s, settings);
  EXPECT_EQ(folder.run(), 0);
  const BlockResult result = read_result(folder.job("result/block.h5"));
  double squares = 0;
  for (FrameIndex f(0); s.truth.frames.contains(f); ++f.value)
    squares += (result.state.frames[f].centre - s.truth.frames[f].centre).squaredNorm();
  std::vector<double> heights;
  for (std::size_t t = 0; t < result.points.size(); ++t) {
    const Eigen::Vector3d& truth = s.points[static_cast<std::size_t>(result.file_tracks[t].value)];
    if (result.points[t].allFinite()) heights.push_back(std::abs(result.points[t].z() - truth.z()));
  }
  return {reprojection_statistics(result).rms_px, std::sqrt(squares / static_cast<double>(s.truth.frames.size())),
          median(std::move(heights))};
}

void say(const Outcome& expected, const Outcome& corrected, const Outcome& without) {
  for (const auto& [name, o] : {std::pair("expected", expected), {"corrected", corrected}, {"without", without}})
    std::printf("%-9s rms %.5f px, positions %.4f m, heights of points %.4f m\n", name, o.rms_px, o.position_rms_m,
                o.median_height_error_m);
}
// Most of it is taken up by poses and points, which it bends.
void expect_without(const Outcome& expected, const Outcome& without) {
  expect_at_least(without.rms_px, 1.05 * expected.rms_px, "rms residual without corrections, px");
  expect_at_least(without.median_height_error_m, 1.5 * expected.median_height_error_m,
                  "heights of points without corrections, median m");
}

constexpr const char* kBoth = "environment: {refraction: true, earth_curvature: true}\n";

TEST(TCP07, BlockWithCorrectionsHasTheResidualsOfTheUndistortedOne) {
  SimulatedBlock ideal = simulate_block(survey("pinhole")), real = simulate_block(survey("ign-radial"));
  ideal.block.ground = real.block.ground = GroundFrame();  // grid coordinates
  inject(real);
  const Outcome expected = adjusted(ideal, ""), corrected = adjusted(real, kBoth), without = adjusted(real, "");
  say(expected, corrected, without);
  expect_without(expected, without);
  expect_at_most(std::abs(corrected.rms_px - expected.rms_px), 0.01 * expected.rms_px,
                 "rms residual off that of the undistorted block, px");
  expect_at_most(corrected.position_rms_m, 1.1 * expected.position_rms_m, "positions, rms m");
  expect_at_most(corrected.median_height_error_m, 1.1 * expected.median_height_error_m, "heights of points, median m");
}

// The flat frame of a transverse Mercator projection through the block's origin, with heights above the ellipsoid.
void to_grid(SimulatedBlock& s) {
  s.block.ground = GroundFrame{true, 46.5, 3, 0, "EPSG:4326"};
  const Georeference georeference(s.block.ground);
  const CrsToWgs84 grid("+proj=tmerc +lat_0=46.5 +lon_0=3 +k=1 +datum=WGS84 +units=m");
  const auto moved = [&](const Eigen::Vector3d& place) { return grid.from_wgs84(georeference.to_geodetic(place)); };
  const auto moved_pose = [&](Pose& pose) {
    const Geodetic place = georeference.to_geodetic(pose.centre);
    pose.rotation = (pose.rotation * georeference.own_from_block(place).conjugate()).normalized();
    pose.centre = grid.from_wgs84(place);
  };
  for (Frame& frame : s.block.frames) {
    frame.position_prior->position = moved(frame.position_prior->position);
    moved_pose(*frame.given_pose);
  }
  for (Pose& pose : s.truth.frames) moved_pose(pose);
  for (Eigen::Vector3d& point : s.points) point = moved(point);
  for (ControlPoint& point : s.block.control_points) point.position = moved(point.position);
  for (Eigen::Vector3d& point : s.control_truth) point = moved(point);
  s.block.ground = GroundFrame();
}

TEST(TCP07, BlockInGridCoordinatesHasTheResidualsOfTheTopocentricOne) {
  const SimulatedBlock topocentric = simulate_block(survey("pinhole"));
  SimulatedBlock grid = topocentric;
  to_grid(grid);
  const Outcome expected = adjusted(topocentric, ""),
                corrected = adjusted(grid, "environment: {earth_curvature: true}\n"), without = adjusted(grid, "");
  say(expected, corrected, without);
  expect_without(expected, without);
  expect_at_most(std::abs(corrected.rms_px - expected.rms_px), 0.01 * expected.rms_px,
                 "rms residual off that of the topocentric block, px");
  expect_at_most(corrected.position_rms_m, 1.1 * expected.position_rms_m, "positions, rms m");
  // Not their heights: horizontal distances of a projection are those at the height 0. At the height z they are longer
  // by z / R, and points seem that share of the flying height lower (9 cm at 200 m).
}

TEST(TCP07, CurvatureOfATopocentricFrameIsRefused) {
  SimulatedBlock block = simulate_block(survey("pinhole"));
  block.block.ground = GroundFrame{true, 46.5, 3, 0, "EPSG:4326"};
  const BlockFolder folder;
  folder.write(block, kBoth);
  EXPECT_THROW(folder.run(), InputError);
}

}  // namespace
}  // namespace megablock
