// The Stereopolis block: trajectory errors, geometry, wrong matches, bridge, control zones, target field.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <set>

#include "geometry/numbers/angles.h"
#include "geometry/transform/rotation.h"
#include "io/base/error.h"
#include "io/project/project.h"
#include "io/simulate/blocks/simulate.h"
#include "io/simulate/files/write_rendered.h"
#include "io/simulate/scene/simulated_block.h"
#include "io/simulate/scene/trajectory.h"
#include "io/simulate/streets/bridge.h"
#include "io/store/units/state_file.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

using Kind = SimulationOptions::Scene;
using Path = SimulationOptions::Path;

SimulationOptions small(std::int64_t frames) {
  SimulationOptions options = SimulationOptions::of(Kind::kStereopolis);
  options.frames = frames;
  options.street_spacing_m = 60;
  options.points_per_frame = 100;
  return options;
}

// One block for the tests that only look at it: a grid with a bridge, driven twice.
const SimulatedBlock& town() {
  static const SimulatedBlock block = [] {
    SimulationOptions options = small(480);
    options.control_zones = 3;
    return simulate_block(options);
  }();
  return block;
}

Eigen::Vector2d projected(const SimulatedBlock& s, ImageIndex image, const Eigen::Vector3d& point) {
  const Image& entry = s.block.images[image];
  const Pose& mount = s.truth.mounts.front()[static_cast<std::size_t>(entry.mount)];
  const Eigen::Vector3d inside = to_camera(s.truth.frames[entry.frame], mount, point);
  EXPECT_GT(inside.z(), 0);
  return project(s.truth.cameras[s.block.camera_of(image)], inside);
}

double rms(double sum, double n) { return std::sqrt(sum / n); }

TEST(StereopolisTrajectory, ErrorsAreAsStated) {
  const SimulationOptions options = SimulationOptions::of(Kind::kStereopolis);
  double clear = 0, clear_xy = 0, clear_z = 0, heading = 0, absent = 0, frames = 0, stretches = 0, step = 0, steps = 0,
         drifts = 0;
  for (std::int64_t pass = 0; pass < 8; ++pass) {
    const PassErrors errors = draw_pass_errors(options, pass, 12000);
    double largest = 0, largest_z = 0;
    for (std::size_t i = 0; i < errors.gnss.size(); ++i, ++frames) {
      const Eigen::Vector3d& e = errors.position[i];
      if (i > 0) step = std::max(step, (e - errors.position[i - 1]).norm());
      if (i > 0) steps += (e - errors.position[i - 1]).squaredNorm();
      absent += errors.gnss[i] == Gnss::kNone;
      if (errors.gnss[i] != Gnss::kClear) {
        largest = std::max(largest, e.head<2>().norm());
        largest_z = std::max(largest_z, std::abs(e.z()));
        continue;
      }
      if (largest > 0) {  // a masked stretch has ended
        EXPECT_GT(largest, 1.8);
        EXPECT_LT(largest, 4.1);
        EXPECT_LT(largest_z, 0.9 * largest);
        ++stretches;
        drifts += largest;
      }
      largest = largest_z = 0;
      ++clear;
      clear_xy += e.head<2>().squaredNorm() / 2;
      clear_z += e.z() * e.z();
      heading += errors.rotation[i].y() * errors.rotation[i].y();
    }
  }
  EXPECT_NEAR(clear / frames, 0.5, 0.001);
  EXPECT_NEAR(absent / frames, 0.04, 0.002);
  // 48 000 frames with a correlation over 100 (the sum of its squares): 480 independent ones, in x and y twice as many.
  EXPECT_NEAR(rms(clear_xy, clear), 0.02, 0.02 * 4 / std::sqrt(2 * 960));
  EXPECT_NEAR(rms(clear_z, clear), 0.05, 0.05 * 4 / std::sqrt(2 * 480));
  EXPECT_NEAR(rms(heading, clear), 0.025 * kDegree, 0.025 * kDegree * 4 / std::sqrt(2 * 480));
  EXPECT_NEAR(frames / 2 / stretches, 1500, 1);
  EXPECT_NEAR(drifts / stretches, 2.8, 0.4);
  // Smooth: successive frames agree to less than 1 cm, at the ends of masked stretches too.
  EXPECT_LT(rms(steps, frames), 0.006);
  EXPECT_LT(step, 0.01);
}

TEST(StereopolisTrajectory, PassesDriftOnTheirOwn) {
  const SimulationOptions options = SimulationOptions::of(Kind::kStereopolis);
  const PassErrors a = draw_pass_errors(options, 0, 2000), b = draw_pass_errors(options, 1, 2000);
  EXPECT_NE(a.gnss, b.gnss);
  EXPECT_NE(a.position.front(), b.position.front());
}

TEST(StereopolisTrajectory, ShortPassesAndOpenSkyWork) {
  SimulationOptions options = SimulationOptions::of(Kind::kStereopolis);
  for (const std::int64_t frames : {2, 3, 7, 20}) {
    const PassErrors errors = draw_pass_errors(options, 0, frames);
    for (const Eigen::Vector3d& e : errors.position) EXPECT_LT(e.norm(), 0.4 + 0.007 * static_cast<double>(frames));
  }
  options.gnss_masked_share = options.gnss_absent_share = 0;
  for (const Eigen::Vector3d& e : draw_pass_errors(options, 0, 2000).position) EXPECT_LT(e.norm(), 0.4);
}

TEST(Stereopolis, JobIsGivenTheTrajectoryAndSigmasThatLie) {
  const SimulatedBlock& s = town();
  double with = 0, worst = 0, step = 0, turn = 0;
  for (std::size_t f = 0; f < s.block.frames.size(); ++f) {
    const FrameIndex index(static_cast<std::int64_t>(f));
    const Frame& frame = s.block.frames[index];
    ASSERT_TRUE(frame.given_pose && frame.attitude_prior);
    EXPECT_EQ(frame.position_prior.has_value(), s.gnss[f] != Gnss::kNone);
    worst = std::max(worst, (frame.given_pose->centre - s.truth.frames[index].centre).norm());
    EXPECT_LT(rotation_angle(frame.given_pose->rotation, s.truth.frames[index].rotation), 0.25 * kDegree);
    if (!frame.position_prior) continue;
    ++with;
    EXPECT_TRUE((frame.position_prior->sigma.array() == 0.02).all());
    EXPECT_EQ(frame.position_prior->position, frame.given_pose->centre);
  }
  EXPECT_NEAR(with / 480, 0.96, 0.012);            // a frame more or less per stretch
  EXPECT_GT(worst, 0.2);                           // ten sigmas: 120 masked frames, at most 7 mm per frame
  ASSERT_EQ(s.block.relative_poses.size(), 478u);  // two passes
  for (const RelativePose& r : s.block.relative_poses) {
    const Pose &a = s.truth.frames[r.from], &b = s.truth.frames[r.to];
    EXPECT_EQ(r.to.value, r.from.value + 1);
    EXPECT_DOUBLE_EQ(r.position_sigma_m, 0.005);
    EXPECT_DOUBLE_EQ(r.rotation_sigma_rad, 0.01 * kDegree);
    step += (a.rotation * (b.centre - a.centre) - r.pose.centre).squaredNorm();
    turn += rotation_log<double>(b.rotation * a.rotation.conjugate() * r.pose.rotation.conjugate()).squaredNorm();
  }
  EXPECT_NEAR(rms(step, 3 * 478), 0.005, 0.0005);
  EXPECT_NEAR(rms(turn, 3 * 478), 0.01 * kDegree, 0.001 * kDegree);
}

TEST(Stereopolis, ObservationsHaveTheirNoiseAndTheirShareOfWrongMatches) {
  const SimulatedBlock& s = town();
  double chi2 = 0, right = 0, wrong = 0, kinds[4] = {};
  std::vector<double> count(s.block.frames.size(), 0);
  for (std::size_t t = 0; t < s.points.size(); ++t) {
    const auto begin = static_cast<std::size_t>(s.tracks.begin[t]),
               end = static_cast<std::size_t>(s.tracks.begin[t + 1]);
    for (std::size_t o = begin; o < end; ++o) {
      ++count[static_cast<std::size_t>(s.block.images[s.tracks.image[o]].frame.value)];
      const Eigen::Vector2d measured(from_fixed_pixel(s.tracks.x[o]), from_fixed_pixel(s.tracks.y[o]));
      const Eigen::Vector2d residual = projected(s, s.tracks.image[o], s.points[t]) - measured;
      ++kinds[s.outlier[o]];
      if (s.outlier[o]) {
        ++wrong;
      } else {
        ++right;
        chi2 += residual.squaredNorm() / 0.25;
        EXPECT_LT(residual.norm(), 3);
      }
    }
  }
  const double n = right + wrong;
  EXPECT_NEAR(chi2 / (2 * right), 1, 5 * std::sqrt(1 / right));
  EXPECT_NEAR(wrong / n, 0.03, 0.003);  // groups of one to three: half as many draws
  EXPECT_GT(kinds[2], 0.2 * wrong);
  EXPECT_GT(kinds[3], 0.05 * wrong);
  EXPECT_NEAR(n / 480, 100, 12);
  EXPECT_GT(*std::min_element(count.begin(), count.end()), 80);
  EXPECT_NEAR(n / static_cast<double>(s.points.size()), 5, 0.4);
}

// Neighbouring outliers on a repeated facade agree with each other: their rays meet at another place, a whole number of
// windows away.
TEST(Stereopolis, RepeatedFacadesAreOtherPlacesOfTheFacade) {
  const SimulatedBlock& s = town();
  double agree = 0, groups = 0;
  for (std::size_t t = 0; t < s.points.size(); ++t)
    for (auto o = static_cast<std::size_t>(s.tracks.begin[t]); o < static_cast<std::size_t>(s.tracks.begin[t + 1]);
         ++o) {
      if (s.outlier[o] != static_cast<std::uint8_t>(Verdict::kRepeated)) continue;
      const Eigen::Vector2d measured(from_fixed_pixel(s.tracks.x[o]), from_fixed_pixel(s.tracks.y[o]));
      double nearest = 1e9;
      for (const int axis : {0, 1})
        for (int k = -3; k <= 3; ++k) {
          Eigen::Vector3d place = s.points[t];
          place[axis] += 3 * k;
          const Image& entry = s.block.images[s.tracks.image[o]];
          const Eigen::Vector3d inside = to_camera(
              s.truth.frames[entry.frame], s.truth.mounts.front()[static_cast<std::size_t>(entry.mount)], place);
          if (k == 0 || inside.z() < 0.5) continue;
          nearest = std::min(
              nearest, (project(s.truth.cameras[s.block.camera_of(s.tracks.image[o])], inside) - measured).norm());
        }
      ++groups;
      agree += nearest < 3;
    }
  ASSERT_GT(groups, 100);
  EXPECT_EQ(agree, groups);
}

TEST(Stereopolis, PassesShareTracksAlsoWhereTheyCross) {
  const SimulatedBlock& s = town();
  double passes = 0, crossing = 0;
  for (std::size_t t = 0; t < s.points.size(); ++t) {
    std::set<std::int64_t> seen, axes;
    for (auto o = s.tracks.begin[t]; o < s.tracks.begin[t + 1]; ++o) {
      const FrameIndex frame = s.block.images[s.tracks.image[static_cast<std::size_t>(o)]].frame;
      seen.insert(s.block.frames[frame].pass);
      const Eigen::Vector3d ahead = s.truth.frames[frame].rotation.conjugate() * Eigen::Vector3d::UnitZ();
      axes.insert(std::abs(ahead.x()) > 0.9 ? 0 : std::abs(ahead.y()) > 0.9 ? 1 : 2);
    }
    passes += seen.size() == 2;
    crossing += axes.contains(0) && axes.contains(1);
  }
  EXPECT_GT(passes, 0.1 * static_cast<double>(s.points.size()));
  EXPECT_GT(crossing, 100);
}

// Frames on the bridge and frames of the street that it crosses share no track, though they meet in plan.
TEST(Stereopolis, BridgeAndStreetBelowShareNothing) {
  const SimulatedBlock& s = town();
  // The bridge is where two frames stand close in plan, but 6 to 8 m apart in height.
  std::optional<Eigen::Vector2d> bridge;
  for (const Pose& a : s.truth.frames)
    for (const Pose& b : s.truth.frames) {
      const Eigen::Vector3d d = a.centre - b.centre;
      if (d.head<2>().norm() < 4 && d.z() > 6 && d.z() < 8) bridge = a.centre.head<2>();
    }
  ASSERT_TRUE(bridge.has_value());
  const auto side = [&](FrameIndex frame) {  // 1 upon the bridge and its ramps, 2 in the street below, 0 elsewhere
    const Pose& pose = s.truth.frames[frame];
    if ((pose.centre.head<2>() - *bridge).norm() > 40) return 0;
    const Eigen::Vector3d ahead = pose.rotation.conjugate() * Eigen::Vector3d::UnitZ();
    return std::abs(ahead.x()) > std::abs(ahead.y()) ? 1 : 2;
  };
  std::int64_t upon = 0, below = 0;
  for (std::size_t t = 0; t < s.points.size(); ++t) {
    bool on[3] = {};
    for (auto o = s.tracks.begin[t]; o < s.tracks.begin[t + 1]; ++o)
      on[side(s.block.images[s.tracks.image[static_cast<std::size_t>(o)]].frame)] = true;
    upon += on[1];
    below += on[2];
    EXPECT_FALSE(on[1] && on[2]) << s.points[t].transpose() << ", bridge at " << bridge->transpose();
  }
  EXPECT_GT(upon, 200);
  EXPECT_GT(below, 200);
}

TEST(Stereopolis, EveryStreetIsDrivenBothWays) {
  const SimulatedBlock& s = town();
  std::int64_t lonely = 0, days[2] = {};
  for (std::size_t f = 0; f < s.block.frames.size(); ++f) {
    const FrameIndex a(static_cast<std::int64_t>(f));
    const Eigen::Vector3d ahead = s.truth.frames[a].rotation.conjugate() * Eigen::Vector3d::UnitZ();
    const bool met = std::any_of(s.truth.frames.begin(), s.truth.frames.end(), [&](const Pose& other) {
      return (other.centre - s.truth.frames[a].centre).norm() < 8 &&
             ahead.dot(other.rotation.conjugate() * Eigen::Vector3d::UnitZ()) < -0.8;
    });
    lonely += !met;
    ++days[static_cast<std::size_t>((s.block.frames[a].time_s - 1.6e9) / 86400)];
  }
  EXPECT_LT(lonely, 24);  // at corners
  EXPECT_EQ(days[0], 240);
  EXPECT_EQ(days[1], 240);
}

TEST(Stereopolis, MountsAreOffByWhatIsStated) {
  SimulationOptions options = small(4);
  options.rig_cameras = 16;
  double shift = 0, turn = 0, n = 0;
  for (options.seed = 1; options.seed <= 12; ++options.seed) {
    const SimulatedBlock s = simulate_block(options);
    const Rig& rig = s.block.rigs.front();
    EXPECT_TRUE(rig.mounts.front().held());
    EXPECT_EQ(rig.mounts.front().pose.centre, s.truth.mounts.front().front().centre);
    for (std::size_t m = 1; m < rig.mounts.size(); ++m, n += 3) {
      EXPECT_DOUBLE_EQ(rig.mounts[m].position_sigma_m, 0.005);
      EXPECT_DOUBLE_EQ(rig.mounts[m].rotation_sigma_rad, 0.5 * kDegree);
      shift += (rig.mounts[m].pose.centre - s.truth.mounts.front()[m].centre).squaredNorm();
      turn += std::pow(rotation_angle(rig.mounts[m].pose.rotation, s.truth.mounts.front()[m].rotation), 2);
    }
  }
  EXPECT_NEAR(rms(shift, n), 0.005, 0.0005);
  EXPECT_NEAR(rms(turn, n), 0.5 * kDegree, 0.05 * kDegree);
}

TEST(Stereopolis, CamerasCarryTheirNumbers) {
  SimulationOptions options = small(4);
  const auto names = [&] {
    std::vector<std::string> found;
    for (const Camera& camera : simulate_block(options).block.cameras) found.push_back(camera.name);
    return found;
  };
  const std::vector<std::string> ten = {"c21", "c22", "c23", "c31", "c32", "c33", "c34", "c41", "c42", "c43"};
  EXPECT_EQ(names(), ten);
  EXPECT_EQ(simulate_block(options).block.name_of(ImageIndex(19)), "f000001_c43.jpg");
  options.rig_cameras = 14;
  EXPECT_EQ(names().front(), "c11");
  EXPECT_EQ(names().back(), "c52");
}

TEST(Stereopolis, ZonesLieOnCrossings) {
  const SimulatedBlock& s = town();
  std::vector<int> control(3, 0), checks(3, 0);
  for (std::size_t p = 0; p < s.block.control_points.size(); ++p) {
    const ControlPoint& point = s.block.control_points[p];
    const auto zone = static_cast<std::size_t>(point.name[4] - '0');
    ASSERT_EQ(point.name.substr(0, 4), "zone");
    (point.role == PointRole::kControl ? control : checks)[zone]++;
    for (const int axis : {0, 1}) {
      const double place = s.control_truth[p][axis] / 60;
      EXPECT_LT(60 * std::abs(place - std::round(place)), 13);
    }
    EXPECT_GE(point.measurements.size(), 3u);
    EXPECT_TRUE((point.sigma.array() == 0.015).all());
    EXPECT_LT((point.position - s.control_truth[p]).norm(), 6 * 0.015);
    for (const ImageMeasurement& m : point.measurements)
      EXPECT_LT((projected(s, m.image, s.control_truth[p]) - m.pixel).norm(), 3);
  }
  for (std::size_t z = 0; z < 3; ++z) {
    EXPECT_GE(control[z] + checks[z], 8);
    EXPECT_LE(control[z] + checks[z], 40);
    EXPECT_EQ(checks[z], (control[z] + checks[z]) / 7);
  }
}

TEST(Stereopolis, AZoneCanBeHeldOut) {
  SimulationOptions options = small(200);
  options.control_zones = 2;
  options.held_out_zone = 1;
  const SimulatedBlock s = simulate_block(options);
  std::int64_t held_out = 0;
  for (const ControlPoint& point : s.block.control_points) {
    if (!point.name.starts_with("zone1")) continue;
    EXPECT_EQ(point.role, PointRole::kCheck);
    ++held_out;
  }
  EXPECT_GE(held_out, 8);
  EXPECT_EQ(s.block.control_points.front().role, PointRole::kControl);
}

TEST(Stereopolis, SeedDecidesEverything) {
  SimulationOptions options = small(60);
  const SimulatedBlock a = simulate_block(options), b = simulate_block(options);
  EXPECT_EQ(a.tracks.x, b.tracks.x);
  EXPECT_EQ(a.points, b.points);
  EXPECT_EQ(a.block.frames.back().given_pose->centre, b.block.frames.back().given_pose->centre);
  options.seed = 2;
  EXPECT_NE(simulate_block(options).tracks.x, a.tracks.x);
}

TEST(Stereopolis, NonsenseIsRefused) {
  const auto refused = [](auto change) {
    SimulationOptions options = small(100);
    change(options);
    EXPECT_THROW(simulate_block(options), InputError);
  };
  refused([](SimulationOptions& o) { o.rig_cameras = 17; });
  refused([](SimulationOptions& o) { o.drives = 0; });
  refused([](SimulationOptions& o) { o.days = 3; });
  refused([](SimulationOptions& o) { o.drives = 60; });
  refused([](SimulationOptions& o) { o.gnss_masked_share = 1; });
  refused([](SimulationOptions& o) { o.gnss_absent_share = 0.6; });
  refused([](SimulationOptions& o) { o.drift_per_frame_m = 0; });
  refused([](SimulationOptions& o) { o.control_zones = 500; });
  refused([](SimulationOptions& o) { o.held_out_zone = 0; });
  refused([](SimulationOptions& o) { o.outlier_share = 0.5; });
  refused([](SimulationOptions& o) { o.mount_rotation_error_deg = -1; });
}

// Images, and a project that starts from the trajectory, the nominal mounts and the laboratory's calibration.
TEST(StereopolisRendered, FilesAreAProject) {
  SimulationOptions options = small(4);
  options.rig_cameras = 3;
  options.image_width = 160;
  options.image_height = 90;
  options.focal_px = 117;
  const ScratchDirectory folder;
  write_rendered_block(options, folder.path());
  const Block block = read_project(folder.path("block.yaml")).block;
  const BlockState truth = read_state(folder.path("truth.h5"));
  ASSERT_EQ(block.images.size(), 12u);
  EXPECT_EQ(block.name_of(ImageIndex(0)), "f000000_c22.jpg");
  ASSERT_EQ(block.frames.size(), 4u);
  for (std::size_t f = 0; f < 4; ++f) {
    const FrameIndex index(static_cast<std::int64_t>(f));
    ASSERT_TRUE(block.frames[index].given_pose);
    EXPECT_LT((block.frames[index].given_pose->centre - truth.frames[index].centre).norm(), 0.5);
    EXPECT_LT(rotation_angle(block.frames[index].given_pose->rotation, truth.frames[index].rotation), 0.3 * kDegree);
  }
  const std::vector<Mount>& mounts = block.rigs.front().mounts;
  ASSERT_EQ(mounts.size(), 3u);
  EXPECT_TRUE(mounts[0].held());
  for (std::size_t m = 1; m < 3; ++m) {
    EXPECT_NEAR(mounts[m].position_sigma_m, 0.005, 1e-9);
    EXPECT_NEAR(mounts[m].rotation_sigma_rad, 0.5 * kDegree, 1e-9);
    const double off = rotation_angle(mounts[m].pose.rotation, truth.mounts.front()[m].rotation);
    EXPECT_GT(off, 0.01 * kDegree);
    EXPECT_LT(off, 3 * kDegree);
  }
  for (const Camera& camera : block.cameras) {
    EXPECT_NEAR(camera.intrinsics[kFocal], 117, 1e-6);
    EXPECT_NEAR(camera.intrinsics[kRadial1], 0.09, 1e-6);
    EXPECT_GT(camera.prior_sigma[kFocal], 0);
  }
  options.scene = Kind::kTargetField;
  EXPECT_THROW(write_rendered_block(options, folder.path("targets")), InputError);
}

class TargetFieldTest : public testing::TestWithParam<Path> {};

TEST_P(TargetFieldTest, TargetsAndTiePointsAreMeasured) {
  const SimulationOptions options = SimulationOptions::of(Kind::kTargetField, GetParam());
  const SimulatedBlock s = simulate_block(options);
  ASSERT_EQ(std::ssize(s.block.frames), options.frames);
  EXPECT_EQ(std::ssize(s.block.control_points), options.control_points + options.check_points);
  double chi2 = 0, n = 0;
  for (std::size_t p = 0; p < s.control_truth.size(); ++p)
    for (const ImageMeasurement& m : s.block.control_points[p].measurements) {
      chi2 += (projected(s, m.image, s.control_truth[p]) - m.pixel).squaredNorm() / 0.25;
      n += 2;
    }
  EXPECT_NEAR(chi2 / n, 1, 5 * std::sqrt(2 / n));
  const bool sparse = GetParam() == Path::kSparse;
  std::set<std::int64_t> cameras;
  for (const ImageIndex image : s.tracks.image) cameras.insert(s.block.camera_of(image).value);
  EXPECT_EQ(cameras.size() == 10, !sparse);
  if (!sparse) {
    EXPECT_NEAR(static_cast<double>(s.tracks.observation_count()) / 30, 350, 40);
  }
}

INSTANTIATE_TEST_SUITE_P(Paths, TargetFieldTest,
                         testing::Values(Path::kSingle, Path::kLine, Path::kLoop, Path::kS, Path::kAll, Path::kSparse));

}  // namespace
}  // namespace megablock
