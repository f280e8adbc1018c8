// Simulates priors and given poses. Every stated sigma is the true one.
//
// With the true pose (R, C) of a frame and normal errors n:
//
//     position    P = C + R' (a + c) + gps_sigma n   of the antenna; a is its lever arm in axes of the rig
//     attitude    R_m = Exp(b) Exp(sigma n) R        the errors turn about the axes of the rig
//     relative    R_ab = Exp(sigma n) R_b R_a',  t_ab = R_a (C_b - C_a) + sigma n
//     given pose  C + sigma e, R Exp(sigma e)        e: DriftingError, about the axes of the ground
//
// The errors c and b of lever arm and boresight are nothing unless the options ask for them.
//
// The job uses the same forms for its residuals, so that every weighted residual of the truth is standard normal.
#include "io/simulate/blocks/priors.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "geometry/numbers/angles.h"
#include "io/simulate/scene/relative_measurement.h"

namespace megablock {

namespace {

// Selects exactly round(share * frames) frames at random.
std::vector<std::uint8_t> frames_with_position(const SimulationOptions& options) {
  const auto total = static_cast<std::size_t>(options.frames);
  const auto wanted = static_cast<std::size_t>(std::llround(options.gps_share * static_cast<double>(total)));
  std::vector<std::size_t> order(total);
  std::iota(order.begin(), order.end(), std::size_t{0});
  Random random(options.seed, Random::Purpose::kPriors);
  std::vector<std::uint8_t> chosen(total, 0);
  for (std::size_t i = 0; i < wanted; ++i) {
    // The first steps of a Fisher-Yates shuffle.
    std::swap(order[i], order[i + static_cast<std::size_t>(random.below(static_cast<std::int64_t>(total - i)))]);
    chosen[order[i]] = 1;
  }
  return chosen;
}

// The errors of a drifting trajectory: a stationary first-order process along the pass plus white noise. Their sum has
// the standard deviation 1 per axis.
class DriftingError {
 public:
  // s_i = m s_{i-1} + sqrt(1 - m^2) n has the variance 1, and e_i = k s_i + sqrt(1 - k^2) n as well. m = 0.97 is a
  // correlation length of 33 frames.
  Eigen::Vector3d next(bool new_pass, Random& random) {
    constexpr double kSlow = 0.9, kMemory = 0.97;
    const Eigen::Vector3d step = random.normal3();
    slow_ = new_pass ? step : Eigen::Vector3d(kMemory * slow_ + std::sqrt(1 - kMemory * kMemory) * step);
    return kSlow * slow_ + std::sqrt(1 - kSlow * kSlow) * random.normal3();
  }

 private:
  Eigen::Vector3d slow_ = Eigen::Vector3d::Zero();
};

// Makes given poses by integration of the relative poses (SimulationOptions::start_offset_m).
class IntegratedChain {
 public:
  explicit IntegratedChain(const SimulationOptions& options) : options_(options) {}
  // `relative` is the pose relative to the previous frame; nullptr at the beginning of a pass.
  Pose next(std::int64_t frame, const Pose& truth, const RelativePose* relative) {
    if (relative == nullptr || length_ == options_.start_chain_frames) {
      length_ = 0;
      Random random(options_.seed, Random::Purpose::kChain, static_cast<std::uint64_t>(frame));
      const Eigen::Vector3d direction = random.normal3().normalized();
      here_ = truth;
      // The cubic root makes the shifts uniform in the ball.
      here_.centre += options_.start_offset_m * std::cbrt(random.uniform(0, 1)) * direction;
    } else {
      // C_b = C_a + R_a' t_ab and R_b = R_ab R_a. The errors of the relative rotations add up, so the far end of a pass
      // bends away.
      here_.centre += here_.rotation.conjugate() * relative->pose.centre;
      here_.rotation = (relative->pose.rotation * here_.rotation).normalized();
    }
    ++length_;
    return here_;
  }

 private:
  const SimulationOptions& options_;
  Pose here_;
  int length_ = 0;
};

}  // namespace

void simulate_priors(const SimulationOptions& options, SimulatedBlock& simulated) {
  Block& block = simulated.block;
  const bool street = options.scene == SimulationOptions::Scene::kStreet;
  // In axes of the rig, x right, y down, z ahead: the antenna is 0.6 m above the cameras.
  const Eigen::Vector3d lever_arm = street ? Eigen::Vector3d(0.1, -0.6, -0.2) : Eigen::Vector3d::Zero();
  const bool given = options.start_position_error_m >= 0 && options.start_rotation_error_deg >= 0;
  const std::vector<std::uint8_t> with_position = frames_with_position(options);
  DriftingError position_error, rotation_error;
  IntegratedChain chain(options);
  for (std::size_t i = 0; i < block.frames.size(); ++i) {
    const FrameIndex index(static_cast<std::int64_t>(i));
    Frame& frame = block.frames[index];
    const Pose& pose = simulated.truth.frames[index];
    // Each frame has its own stream, and every quantity is drawn even if the options do not need it. A change of one
    // option therefore leaves the other quantities as they are.
    Random random(options.seed, Random::Purpose::kPriors, 1 + static_cast<std::uint64_t>(i));
    const Eigen::Vector3d position_noise = random.normal3(), attitude_noise = random.normal3();
    const bool new_pass = i == 0 || block.frames[FrameIndex(index.value - 1)].pass != frame.pass;
    const Eigen::Vector3d start_position = position_error.next(new_pass, random),
                          start_rotation = rotation_error.next(new_pass, random);
    if (options.gps_sigma_m > 0 && with_position[i]) {
      PositionPrior prior;
      prior.sigma.setConstant(options.gps_sigma_m);
      prior.lever_arm = lever_arm;
      const Eigen::Vector3d antenna = lever_arm + options.lever_arm_error_m * kOffReceiver;
      prior.position = pose.centre + pose.rotation.conjugate() * antenna + options.gps_sigma_m * position_noise;
      frame.position_prior = prior;
    }
    if (options.attitude_sigma_deg > 0) {
      AttitudePrior prior;
      prior.sigma_rad.setConstant(kDegree * options.attitude_sigma_deg);
      const Eigen::Vector3d turn = kDegree * options.attitude_sigma_deg * attitude_noise;
      const Eigen::Quaterniond boresight = rotation_exp<double>(kDegree * options.boresight_error_deg * kOffReceiver);
      prior.rotation_cw = (boresight * rotation_exp<double>(turn) * pose.rotation).normalized();
      frame.attitude_prior = prior;
    }
    if (given) {
      Pose start = pose;
      start.centre += options.start_position_error_m * start_position;
      start.rotation = rotation_update(start.rotation, kDegree * options.start_rotation_error_deg * start_rotation);
      frame.given_pose = start;
    }
    const bool linked = options.relative_position_sigma_m > 0 && !new_pass;
    if (linked)
      block.relative_poses.push_back(
          measure_relative(options, simulated.truth, FrameIndex(index.value - 1), index, random));
    if (options.start_offset_m > 0)
      frame.given_pose = chain.next(index.value, pose, linked ? &block.relative_poses.back() : nullptr);
  }
}

}  // namespace megablock
