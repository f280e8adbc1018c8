// Gives a small town for tests: passes of a vehicle over a grid of streets, a trajectory that drifts by metres on each
// pass, relative poses of successive frames and registrations where passes meet.
#pragma once

#include "adjust/registration/four_frames.h"
#include "adjust/registration/joint_adjustment.h"
#include "geometry/numbers/angles.h"
#include "tests/support/adjust/street_rig.h"

namespace megablock {

struct TownOptions {
  int streets = 4;  // along each axis
  double spacing_m = 100, frame_distance_m = 4;
  int passes = 4;
  double drift_m = 3;         // largest of a masked stretch
  double masked_share = 0.5;  // of the frames, in stretches of 100
  double chain_position_m = 0.005, chain_rotation_deg = 0.01;
  double registration_position_m = 0.005, registration_rotation_deg = 0.01;
  double wrong_share = 0;  // of the registrations
  std::uint64_t seed = 1;
};

struct Town {
  std::vector<Pose> truth;
  JointInput input;
  std::vector<std::uint8_t> wrong;   // [registrations]
  std::vector<std::uint8_t> masked;  // [frames]
};

inline Town make_town(const TownOptions& options) {
  Noise noise(options.seed);
  Town town;
  JointInput& input = town.input;
  const double side = options.spacing_m * (options.streets - 1);
  const auto per_street = static_cast<int>(side / options.frame_distance_m);
  for (int pass = 0; pass < options.passes; ++pass) {
    const std::size_t begin = town.truth.size();
    for (int street = 0; street < options.streets; ++street)
      for (int i = 0; i < per_street; ++i) {
        const bool back = (street + pass / 2) % 2 == 1, along_y = pass % 2 == 1;
        const double s = options.frame_distance_m * (back ? per_street - i : i), lane = back ? 1.75 : -1.75;
        const double a = options.spacing_m * street + lane;
        const double heading = (along_y ? std::numbers::pi / 2 : 0) + (back ? std::numbers::pi : 0);
        const Eigen::Vector3d place = along_y ? Eigen::Vector3d(a, s, 40) : Eigen::Vector3d(s, a, 40);
        town.truth.push_back(level_rig(place + 0.05 * noise.triple(), heading, 0.01 * noise.triple()));
      }
    // Drift: half sines on stretches of 100 frames, in a direction and of a size of their own.
    const std::size_t frames = town.truth.size() - begin;
    const auto stretch = static_cast<std::size_t>(100);
    Eigen::Vector3d direction;
    bool masked = false;
    for (std::size_t f = 0; f < frames; ++f) {
      if (f % stretch == 0) {
        masked = noise.uniform(0, 1) < options.masked_share;
        direction = noise.triple();
        direction.z() *= 0.3;
        direction *= options.drift_m * noise.uniform(0.6, 1.3) / direction.norm();
      }
      Pose start = town.truth[begin + f];
      start.centre += 0.02 * noise.triple();
      if (masked) start.centre += std::sin(std::numbers::pi * static_cast<double>(f % stretch) / stretch) * direction;
      start.rotation = rotation_update(start.rotation, 0.03 * kDegree * noise.triple());
      input.start.push_back(start);
      input.pass.push_back(pass);
      town.masked.push_back(masked);
    }
    for (std::size_t f = begin + 1; f < town.truth.size(); ++f) {
      ChainLink link{FrameIndex(static_cast<std::int64_t>(f) - 1),
                     FrameIndex(static_cast<std::int64_t>(f)),
                     relative_to(town.truth[f - 1], town.truth[f]),
                     options.chain_rotation_deg * kDegree,
                     options.chain_position_m,
                     false};
      // Between streets the serpentine jumps; a real drive goes on, so the link is one of many frames.
      if (link.pose.centre.norm() > 3 * options.frame_distance_m)
        link.rotation_sigma_rad *= 5, link.position_sigma_m *= 5;
      link.pose.centre += link.position_sigma_m * noise.triple();
      link.pose.rotation =
          (rotation_exp<double>(link.rotation_sigma_rad * noise.triple()) * link.pose.rotation).normalized();
      input.chain.push_back(link);
    }
  }
  input.located.assign(town.truth.size(), 1);
  const auto count = static_cast<std::int64_t>(town.truth.size());
  std::vector<std::int64_t> last(town.truth.size(), -1000);
  for (std::int64_t a = 0; a < count; ++a)
    for (std::int64_t b = a + 100; b < count; ++b) {
      const Pose &from = town.truth[static_cast<std::size_t>(a)], &to = town.truth[static_cast<std::size_t>(b)];
      if ((from.centre - to.centre).norm() > 5 || a - last[static_cast<std::size_t>(b / 10)] < 15) continue;
      last[static_cast<std::size_t>(b / 10)] = a;
      const bool wrong = noise.uniform(0, 1) < options.wrong_share;
      RegistrationLink link{FrameIndex(a), FrameIndex(b), relative_to(from, to), Matrix6::Zero()};
      const double r = options.registration_rotation_deg * kDegree, t = options.registration_position_m;
      link.covariance.diagonal() << r * r, r * r, r * r, t * t, t * t, t * t;
      link.pose.rotation = (rotation_exp<double>(r * noise.triple()) * link.pose.rotation).normalized();
      link.pose.centre += t * noise.triple();
      if (wrong) {  // one window further, or anything
        link.pose.centre += 3 * noise.uniform(0.3, 1.5) * noise.triple().normalized();
        link.pose.rotation = (rotation_exp<double>(2 * kDegree * noise.triple()) * link.pose.rotation).normalized();
      }
      input.registrations.push_back(link);
      town.wrong.push_back(wrong);
    }
  return town;
}

inline double rms_error(const Town& town, const std::vector<Pose>& frames) {
  double sum = 0;
  for (std::size_t f = 0; f < frames.size(); ++f) sum += (frames[f].centre - town.truth[f].centre).squaredNorm();
  return std::sqrt(sum / static_cast<double>(frames.size()));
}

// Between the frames of right registrations: error of the relative position.
inline double relative_error(const Town& town, const std::vector<Pose>& frames) {
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < town.wrong.size(); ++i) {
    const auto a = static_cast<std::size_t>(town.input.registrations[i].from.value);
    const auto b = static_cast<std::size_t>(town.input.registrations[i].to.value);
    sum += (relative_to(frames[a], frames[b]).centre - relative_to(town.truth[a], town.truth[b]).centre).squaredNorm();
    ++count;
  }
  return std::sqrt(sum / count);
}

}  // namespace megablock
