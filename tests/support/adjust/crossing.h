// Simulates two passes of a street rig at one place, for tests: the frames, their trajectory with errors, and the
// points that all four frames see, with some wrong matches.
#pragma once

#include "adjust/registration/four_frames.h"
#include "geometry/numbers/angles.h"
#include "tests/support/adjust/street_rig.h"

namespace megablock {

struct CrossingOptions {
  int points = 60;           // seen in all four frames, about
  double wrong_share = 0.3;  // of the tracks
  double noise_px = 0.5;
  double trajectory_error_m = 2;                                         // of the second pass, length
  double trajectory_error_deg = 0.06;                                    // about each axis
  double pair_position_error_m = 0.005, pair_rotation_error_deg = 0.01;  // within a pass
};

struct Crossing {
  std::array<Pose, 4> truth, trajectory;
  std::vector<FourFrameTrack> tracks;
  std::vector<std::uint8_t> wrong;  // [tracks]
  Pose true_relative() const { return relative_to(truth[0], truth[2]); }
  std::vector<FourFrameTrack> right_tracks() const {
    std::vector<FourFrameTrack> right;
    for (std::size_t t = 0; t < tracks.size(); ++t)
      if (!wrong[t]) right.push_back(tracks[t]);
    return right;
  }
};

inline Crossing make_crossing(std::uint64_t seed, const CrossingOptions& options) {
  Noise noise(seed);
  Crossing crossing;
  // The second pass crosses, follows or meets the first.
  const double headings[] = {std::numbers::pi / 2, 0, std::numbers::pi, -std::numbers::pi / 2};
  const double first = 0, second = headings[seed % 4] + 0.1 * noise();
  const Eigen::Vector3d place(1000, 2000, 40);
  const auto frame = [&](double heading, double along, const Eigen::Vector3d& offset) {
    const Eigen::Vector3d forward(std::cos(heading), std::sin(heading), 0);
    return level_rig(place + offset + along * forward, heading + 0.01 * noise(), 0.01 * noise.triple());
  };
  const Eigen::Vector3d offset(noise.uniform(-4, 4), noise.uniform(-4, 4), 0.05 * noise());
  crossing.truth = {frame(first, -2, {0, 0, 0}), frame(first, 2, {0, 0, 0}), frame(second, -2, offset),
                    frame(second, 2, offset)};

  crossing.trajectory = crossing.truth;
  const Eigen::Vector3d drift = options.trajectory_error_m * noise.triple().normalized();
  const Eigen::Vector3d turn = options.trajectory_error_deg * kDegree * noise.triple();
  for (std::size_t f = 2; f < 4; ++f) {
    Pose& pose = crossing.trajectory[f];
    pose.centre = crossing.truth[2].centre + drift +
                  rotation_exp<double>(turn).conjugate() * (pose.centre - crossing.truth[2].centre);
    pose.rotation = (pose.rotation * rotation_exp<double>(turn)).normalized();
  }
  for (const std::size_t f : {1u, 3u}) {
    crossing.trajectory[f].centre += options.pair_position_error_m * noise.triple();
    crossing.trajectory[f].rotation =
        rotation_update(crossing.trajectory[f].rotation, options.pair_rotation_error_deg * kDegree * noise.triple());
  }

  // Facades 6 to 14 m off the axes of two crossing streets, and the road.
  const auto surface = [&]() -> Eigen::Vector3d {
    const double along = noise.uniform(-35, 35), side = noise.uniform(6, 14) * (noise.uniform(0, 1) < 0.5 ? -1 : 1);
    const double height = noise.uniform(-2.5, 9);
    const Eigen::Vector3d local =
        noise.uniform(0, 1) < 0.5 ? Eigen::Vector3d(along, side, height) : Eigen::Vector3d(side, along, height);
    return place + local;
  };
  const auto see = [&](const Eigen::Vector3d& point, std::size_t f) {
    return street_rig().see(to_inside(crossing.truth[f], point));
  };
  const auto seen_point = [&] {
    for (;;) {
      const Eigen::Vector3d point = surface();
      bool all = true;
      for (std::size_t f = 0; f < 4; ++f) all &= see(point, f).has_value();
      if (all) return point;
    }
  };
  for (int i = 0; i < options.points; ++i) {
    std::array<Eigen::Vector3d, 4> points;
    points.fill(seen_point());
    const bool wrong = noise.uniform(0, 1) < options.wrong_share;
    if (wrong) {  // another point in the second pass, or in one image
      const Eigen::Vector3d other = seen_point();
      if (noise.uniform(0, 1) < 0.7)
        points[2] = points[3] = other;
      else
        points[static_cast<std::size_t>(noise.uniform(0, 3.99))] = other;
    }
    FourFrameTrack track;
    for (std::size_t f = 0; f < 4; ++f)
      track.views.push_back(
          {static_cast<std::int32_t>(f), street_rig().ray(*see(points[f], f), options.noise_px * noise.pair())});
    crossing.tracks.push_back(std::move(track));
    crossing.wrong.push_back(wrong);
  }
  return crossing;
}

// A place is feasible when its right matches alone give the pose to half of what is asked for, 2 cm and 0.02 degrees,
// so that these are two standard deviations.
inline bool is_feasible(const Crossing& crossing) {
  const PairRegistration best = register_pair(crossing.truth, crossing.right_tracks(), {}, 0);
  return best.kept > 20 && best.position_sigma_m <= 0.01 && best.rotation_sigma_deg <= 0.01;
}

struct RegistrationErrors {
  double position_m, rotation_deg;
  bool good() const { return position_m <= 0.02 && rotation_deg <= 0.02; }
};
inline RegistrationErrors errors_of(const Pose& relative, const Crossing& crossing) {
  const Pose truth = crossing.true_relative();
  return {(relative.centre - truth.centre).norm(),
          rotation_angle(relative.rotation, truth.rotation) * 180 / std::numbers::pi};
}

}  // namespace megablock
