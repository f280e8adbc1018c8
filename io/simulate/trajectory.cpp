#include "io/simulate/trajectory.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace megablock {

namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kMemory = 0.98;             // of the errors under a clear sky, from frame to frame
constexpr double kFastestDrift = 0.04;       // metres of largest drift per frame of a stretch
constexpr double kDriftHeight = 0.3;         // of the horizontal drift
constexpr double kHeadingDrift_deg = 0.045;  // mean of the largest of a stretch

struct Stretch {
  std::int64_t begin, end;
};

// Masked stretches of random lengths about `mean`, with clear ones before, between and after.
std::vector<Stretch> draw_stretches(double share, double mean, std::int64_t frames, Random& random) {
  const double masked = share * static_cast<double>(frames);
  const auto count = static_cast<std::size_t>(std::max<std::int64_t>(1, std::llround(masked / mean)));
  std::vector<double> lengths(2 * count + 1);  // clear, masked, clear, ...
  double sums[] = {0, 0};
  for (std::size_t k = 0; k < lengths.size(); ++k) sums[k % 2] += lengths[k] = random.uniform(0.5, 1.5);
  std::vector<Stretch> stretches;
  double place = 0;
  for (std::size_t k = 0; k < lengths.size(); ++k) {
    const double start = place;
    place += lengths[k] * (k % 2 == 1 ? masked : static_cast<double>(frames) - masked) / sums[k % 2];
    if (k % 2 == 1) stretches.push_back({std::llround(start), std::llround(place)});
  }
  return stretches;
}

// Integral of a Gauss-Markov velocity over a stretch, zero before and after it, largest length `largest` over the first
// `axes` coordinates.
std::vector<Eigen::Vector3d> draw_drift(std::int64_t length, double largest, int axes, Random& random) {
  const double memory = std::exp(-2 / static_cast<double>(length));  // of the velocity
  Eigen::Vector3d velocity = random.normal3(), place = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3d> drift;
  for (std::int64_t i = 0; i <= length; ++i) {
    drift.push_back(place += velocity);
    velocity = memory * velocity + std::sqrt(1 - memory * memory) * random.normal3();
  }
  const Eigen::Vector3d chord = drift.back() / static_cast<double>(length + 1);
  drift.pop_back();
  double longest = 0;
  for (std::size_t i = 0; i < drift.size(); ++i) {
    drift[i] -= static_cast<double>(i + 1) * chord;
    longest = std::max(longest, drift[i].head(axes).norm());
  }
  for (Eigen::Vector3d& d : drift) d *= largest / longest;
  return drift;
}

}  // namespace

PassErrors draw_pass_errors(const SimulationOptions& options, std::int64_t pass, std::int64_t frames) {
  Random random(options.seed, Random::Purpose::kTrajectory, static_cast<std::uint64_t>(pass));
  PassErrors errors;
  errors.gnss.assign(static_cast<std::size_t>(frames), Gnss::kClear);
  const Eigen::Vector3d position_sigma(0.02, 0.02, 0.05);
  const Eigen::Vector3d rotation_sigma = kDegree * Eigen::Vector3d(0.02, 0.025, 0.02);
  Eigen::Vector3d position = random.normal3(), rotation = random.normal3();
  for (std::int64_t i = 0; i < frames; ++i) {
    errors.position.push_back(position_sigma.cwiseProduct(position));
    errors.rotation.push_back(rotation_sigma.cwiseProduct(rotation));
    position = kMemory * position + std::sqrt(1 - kMemory * kMemory) * random.normal3();
    rotation = kMemory * rotation + std::sqrt(1 - kMemory * kMemory) * random.normal3();
  }
  if (options.gnss_masked_share == 0) return errors;
  const double mean = std::min(static_cast<double>(options.gnss_masked_frames), static_cast<double>(frames) / 4);
  for (const Stretch& s : draw_stretches(options.gnss_masked_share, std::max(1.0, mean), frames, random)) {
    const std::int64_t length = s.end - s.begin;
    if (length < 1) continue;
    const double share = random.uniform(2.0 / 3, 4.0 / 3);
    const auto shift =
        draw_drift(length, std::min(options.drift_m * share, kFastestDrift * static_cast<double>(length)), 2, random);
    const auto turn = draw_drift(length, kDegree * kHeadingDrift_deg * random.uniform(2.0 / 3, 4.0 / 3), 3, random);
    // Without any satellite: a part of the stretch, somewhere in it.
    const double absent = static_cast<double>(length) * options.gnss_absent_share / options.gnss_masked_share;
    const double absent_from = random.uniform(0, static_cast<double>(length) - absent);
    for (std::int64_t i = 0; i < length; ++i) {
      const auto row = static_cast<std::size_t>(s.begin + i), k = static_cast<std::size_t>(i);
      const double place = static_cast<double>(i) + 0.5;
      errors.gnss[row] = place >= absent_from && place < absent_from + absent ? Gnss::kNone : Gnss::kMasked;
      errors.position[row] += Eigen::Vector3d(1, 1, kDriftHeight).cwiseProduct(shift[k]);
      errors.rotation[row] += Eigen::Vector3d(0.5, 1, 0.5).cwiseProduct(turn[k]);
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
      given.rotation = (rotation_exp<double>(errors.rotation[row]) * given.rotation).normalized();
      frame.given_pose = given;
      if (options.gps_sigma_m > 0 && errors.gnss[row] != Gnss::kNone)
        frame.position_prior = PositionPrior{given.centre, Eigen::Vector3d::Constant(options.gps_sigma_m)};
      if (options.attitude_sigma_deg > 0)
        frame.attitude_prior =
            AttitudePrior{given.rotation, Eigen::Vector3d::Constant(kDegree * options.attitude_sigma_deg)};
      if (options.relative_position_sigma_m > 0 && f > begin) {
        Random random(options.seed, Random::Purpose::kPriors, 1 + static_cast<std::uint64_t>(f));
        block.relative_poses.push_back(measure_relative(options, simulated.truth, FrameIndex(f - 1), index, random));
      }
    }
  }
}

}  // namespace megablock
