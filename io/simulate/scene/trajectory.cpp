#include "io/simulate/scene/trajectory.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "geometry/numbers/angles.h"
#include "io/simulate/scene/relative_measurement.h"

namespace megablock {

namespace {

constexpr double kMemory_frames = 40;  // correlation length of the errors under a clear sky
constexpr double kAnySpeed = 1e9;
constexpr int kWaves = 4;                    // number of waves of a drift
constexpr double kDriftHeight = 0.3;         // drift in height, over the horizontal drift
constexpr double kHeadingDrift_deg = 0.045;  // mean of the largest drift of the heading in a stretch

// A smooth stationary process of unit variance. An autoregressive process passes the same filter twice: e_i = c e_{i-1}
// + u_i with u_i = c u_{i-1} + n_i. Its steps have the sigma 1 - c. Those of the simple process e_i = c e_{i-1} + n_i
// would have sqrt(2 (1 - c)).
class SmoothError {
 public:
  // The first values have the stationary covariance, so there is no run-in: var u = 1 / (1 - c^2), cov(e, u) =
  // 1 / (1 - c^2)^2, var e = (1 + c^2) / (1 - c^2)^3. next() divides by the root of the last.
  explicit SmoothError(Random& random)
      : u_(random.normal3() / std::sqrt(kLoss)), e_((u_ + kKept * random.normal3() / std::sqrt(kLoss)) / kLoss) {}
  Eigen::Vector3d next(Random& random) {
    const Eigen::Vector3d now = e_ / std::sqrt((1 + kKept * kKept) / (kLoss * kLoss * kLoss));
    u_ = kKept * u_ + random.normal3();
    e_ = kKept * e_ + u_;
    return now;
  }

 private:
  static constexpr double kKept = 1 - 1 / kMemory_frames;  // c
  static constexpr double kLoss = 1 - kKept * kKept;
  Eigen::Vector3d u_, e_;
};

struct Stretch {
  std::int64_t begin, end;
};

// Draws masked stretches of random lengths with the mean `mean`, with clear stretches before, between and after them.
std::vector<Stretch> draw_stretches(double share, double mean, std::int64_t frames, Random& random) {
  const double masked = share * static_cast<double>(frames);
  // At least one stretch. All masked lengths are scaled so that they add up to `share` exactly; so a short pass has one
  // stretch that is shorter than `mean`.
  const auto count = static_cast<std::size_t>(std::max<std::int64_t>(1, std::llround(masked / mean)));
  std::vector<double> lengths(2 * count + 1);  // of the clear and masked stretches in turn, first a clear one
  double sums[] = {0, 0};
  for (std::size_t k = 0; k < lengths.size(); ++k) sums[k % 2] += lengths[k] = random.uniform(0.75, 1.25);
  std::vector<Stretch> stretches;
  double place = 0;
  for (std::size_t k = 0; k < lengths.size(); ++k) {
    const double start = place;
    place += lengths[k] * (k % 2 == 1 ? masked : static_cast<double>(frames) - masked) / sums[k % 2];
    if (k % 2 == 1) stretches.push_back({std::llround(start), std::llround(place)});
  }
  return stretches;
}

// Draws the drift over a stretch, which is zero before and after it. It is a sum of half waves with random amplitudes ~
// 1/k^3 (a Karhunen-Loeve series like that of the Brownian bridge, but smoother) times `shape` along the axes. The
// first amplitude is a unit vector in the first `axes` coordinates. The drift is scaled so that its largest length in
// these coordinates is `largest`, but its steps are at most `fastest`.
std::vector<Eigen::Vector3d> draw_drift(std::int64_t length, double largest, double fastest, int axes,
                                        const Eigen::Vector3d& shape, Random& random) {
  std::array<Eigen::Vector3d, kWaves> amplitudes;
  for (int k = 0; k < kWaves; ++k) amplitudes[k] = shape.cwiseProduct(random.normal3()) / std::pow(k + 1, 3);
  // The first half wave has no zero inside the stretch. A unit amplitude keeps it dominant, so that the drift grows and
  // shrinks once, as a smoothed trajectory does.
  amplitudes[0].head(axes).normalize();
  std::vector<Eigen::Vector3d> drift(static_cast<std::size_t>(length) + 1);  // with the frame after the stretch
  double longest = 0, steepest = 0;
  Eigen::Vector3d before = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < drift.size(); ++i) {
    const double phase = std::numbers::pi * static_cast<double>(i + 1) / static_cast<double>(length + 1);
    drift[i].setZero();
    for (int k = 0; k < kWaves; ++k) drift[i] += std::sin((k + 1) * phase) * amplitudes[k];
    longest = std::max(longest, drift[i].head(axes).norm());
    steepest = std::max(steepest, (drift[i] - before).norm());
    before = drift[i];
  }
  drift.pop_back();
  // Whichever limit is reached first.
  const double scale = std::min(largest / longest, fastest / steepest);
  for (Eigen::Vector3d& d : drift) d *= scale;
  return drift;
}

}  // namespace

PassErrors draw_pass_errors(const SimulationOptions& options, std::int64_t pass, std::int64_t frames) {
  Random random(options.seed, Random::Purpose::kTrajectory, static_cast<std::uint64_t>(pass));
  PassErrors errors;
  errors.gnss.assign(static_cast<std::size_t>(frames), Gnss::kClear);
  // East, north, up; then the rig's x (pitch), y (down, so heading) and z (roll).
  const Eigen::Vector3d position_sigma(0.02, 0.02, 0.05);
  const Eigen::Vector3d rotation_sigma = kDegree * Eigen::Vector3d(0.02, 0.025, 0.02);
  // The errors under a clear sky continue below the drift of masked stretches.
  SmoothError position(random), rotation(random);
  for (std::int64_t i = 0; i < frames; ++i) {
    errors.position.push_back(position_sigma.cwiseProduct(position.next(random)));
    errors.rotation.push_back(rotation_sigma.cwiseProduct(rotation.next(random)));
  }
  if (options.gnss_masked_share == 0) return errors;
  for (const Stretch& s : draw_stretches(options.gnss_masked_share, options.gnss_masked_frames, frames, random)) {
    const std::int64_t length = s.end - s.begin;
    if (length < 1) continue;
    const double share = random.uniform(2.0 / 3, 4.0 / 3);
    const auto shift =
        draw_drift(length, options.drift_m * share, options.drift_per_frame_m, 2, {1, 1, kDriftHeight}, random);
    const auto turn = draw_drift(length, kDegree * kHeadingDrift_deg * random.uniform(2.0 / 3, 4.0 / 3), kAnySpeed, 3,
                                 {0.5, 1, 0.5}, random);
    // A part of the stretch, at a random place in it, has no satellite at all. gnss_absent_share is a share of all
    // frames; within masked stretches it is gnss_absent_share / gnss_masked_share.
    const double absent = static_cast<double>(length) * options.gnss_absent_share / options.gnss_masked_share;
    const double absent_from = random.uniform(0, static_cast<double>(length) - absent);
    for (std::int64_t i = 0; i < length; ++i) {
      const auto row = static_cast<std::size_t>(s.begin + i), k = static_cast<std::size_t>(i);
      const double place = static_cast<double>(i) + 0.5;
      errors.gnss[row] = place >= absent_from && place < absent_from + absent ? Gnss::kNone : Gnss::kMasked;
      errors.position[row] += shift[k];
      errors.rotation[row] += turn[k];
    }
  }
  return errors;
}

void simulate_trajectory(const SimulationOptions& options, SimulatedBlock& simulated) {
  Block& block = simulated.block;
  for (std::int64_t begin = 0, end = 0; begin < std::ssize(block.frames); begin = end) {
    const std::int64_t pass = block.frames[FrameIndex(begin)].pass;
    while (end < std::ssize(block.frames) && block.frames[FrameIndex(end)].pass == pass) ++end;
    const PassErrors errors = draw_pass_errors(options, pass, end - begin);
    simulated.gnss.insert(simulated.gnss.end(), errors.gnss.begin(), errors.gnss.end());
    for (std::int64_t f = begin; f < end; ++f) {
      const FrameIndex index(f);
      const auto row = static_cast<std::size_t>(f - begin);
      Frame& frame = block.frames[index];
      Pose given = simulated.truth.frames[index];
      given.centre += errors.position[row];
      // Exp stands on the left, so the error turns about the axes of the rig: roll, pitch and heading have sigmas of
      // their own.
      given.rotation = (rotation_exp<double>(errors.rotation[row]) * given.rotation).normalized();
      frame.given_pose = given;
      if (options.gps_sigma_m > 0 && errors.gnss[row] != Gnss::kNone)
        frame.position_prior = PositionPrior{given.centre, Eigen::Vector3d::Constant(options.gps_sigma_m)};
      if (options.attitude_sigma_deg > 0)
        frame.attitude_prior =
            AttitudePrior{given.rotation, Eigen::Vector3d::Constant(kDegree * options.attitude_sigma_deg)};
      if (options.relative_position_sigma_m > 0 && f > begin) {
        // Odometer and gyroscopes measure the true motion with white noise. They do not feel the drift of the
        // satellites, which is how an adjustment can find it.
        Random random(options.seed, Random::Purpose::kPriors, 1 + static_cast<std::uint64_t>(f));
        block.relative_poses.push_back(measure_relative(options, simulated.truth, FrameIndex(f - 1), index, random));
      }
    }
  }
}

}  // namespace megablock
