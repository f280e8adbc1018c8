#include "adjust/tile/prior_scales.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "adjust/terms/linearise.h"
#include "adjust/terms/prior_loss.h"

namespace megablock {

namespace {

constexpr double kBinsPerDoubling = 8;
constexpr double kFirstBin = -5;  // log2 of the start of the first bin
constexpr double kMedianOfTwo = 1.1774, kMedianOfOne = 0.6745;
constexpr double kFarTooSmall = 3;            // factor
constexpr std::int64_t kFewestResiduals = 4;  // residuals of a kind: fewer have no median that stands an outlier
// Of a group: the median of four residuals, from which the group takes its shift, may be a tenth of what it should be.
constexpr std::int64_t kFewestOfGroup = 8;

void add_residual(const Eigen::Vector3d& residual, const Eigen::Vector3d& sigma, LengthCounts& horizontal,
                  LengthCounts& height) {
  if (sigma.head<2>().maxCoeff() < kUnknownHeightSigma) horizontal.add(residual.head<2>().norm());
  if (sigma.z() < kUnknownHeightSigma) height.add(std::abs(residual.z()));
}

}  // namespace

std::size_t LengthCounts::bin_of(double length) {
  const double bin = length > 0 ? kBinsPerDoubling * (std::log2(length) - kFirstBin) : 0;
  return static_cast<std::size_t>(std::clamp(bin, 0.0, kBins - 1.0));
}

void LengthCounts::add(double length) { ++counts_[bin_of(length)]; }

void LengthCounts::add(const LengthCounts& other) {
  for (std::size_t i = 0; i < counts_.size(); ++i) counts_[i] += other.counts_[i];
}

std::int64_t LengthCounts::total() const { return std::accumulate(counts_.begin(), counts_.end(), std::int64_t{0}); }

double LengthCounts::median() const {
  const std::int64_t half = (total() + 1) / 2;
  if (half == 0) return 0;
  std::int64_t below = 0;
  std::size_t bin = 0;
  while ((below += counts_[bin]) < half) ++bin;
  return std::exp2((static_cast<double>(bin) + 0.5) / kBinsPerDoubling + kFirstBin);
}

bool LengthCounts::any_above(double length) const {
  return std::any_of(counts_.begin() + static_cast<std::ptrdiff_t>(bin_of(length)) + 1, counts_.end(),
                     [](std::int64_t count) { return count > 0; });
}

PriorLengths::OfGroup& PriorLengths::of(RigIndex group) {
  const auto place = std::ranges::lower_bound(groups, group, {}, &OfGroup::group);
  return place != groups.end() && place->group == group ? *place : *groups.insert(place, OfGroup{group, {}, {}});
}

void PriorLengths::add(const PriorLengths& other) {
  for (const OfGroup& lengths : other.groups) {
    OfGroup& sum = of(lengths.group);
    sum.horizontal.add(lengths.horizontal);
    sum.height.add(lengths.height);
  }
  position_horizontal.add(other.position_horizontal);
  position_height.add(other.position_height);
  control_horizontal.add(other.control_horizontal);
  control_height.add(other.control_height);
}

PriorLengths prior_lengths(const TileProblem& problem, const TileState& state) {
  PriorLengths lengths;
  for (const auto& term : problem.positions) {
    if (held(term.prior)) continue;
    const Pose& frame = state.frames[static_cast<std::size_t>(term.frame.value)];
    const Eigen::Vector3d residual = linearise_position(frame, prior_of(term, state)).residual;
    if (!term.prior.group.valid()) {
      add_residual(residual, term.prior.sigma, lengths.position_horizontal, lengths.position_height);
    } else {
      PriorLengths::OfGroup& group = lengths.of(term.prior.group);
      add_residual(residual, term.prior.sigma, group.horizontal, group.height);
    }
  }
  for (const auto& term : problem.point_priors) {
    if (held(term) || !problem.active(term.point.value)) continue;
    const Eigen::Vector3d& point = state.points[static_cast<std::size_t>(term.point.value)];
    add_residual(point_prior_residual(point, term), term.sigma, lengths.control_horizontal, lengths.control_height);
  }
  return lengths;
}

namespace {

// The change of a factor that is `now`, by the median of the residuals. `usual`: this median for residuals of one sigma
// with a redundancy of one.
double change_of(double now, const LengthCounts& counts, double usual, double redundancy) {
  if (counts.total() < kFewestResiduals) return 1;
  const double all = now * counts.median() / (usual * std::sqrt(redundancy));
  return (all < kFarTooSmall ? 1 : all) / now;
}

bool has_a_median(const PriorLengths::OfGroup& group) {
  return std::max(group.horizontal.total(), group.height.total()) >= kFewestOfGroup;
}

}  // namespace

SigmaScales contradicted_sigma_scales(const SigmaScales& now, const PriorLengths& lengths) {
  using enum ObservationKind;
  LengthCounts horizontal = lengths.position_horizontal, height = lengths.position_height;
  std::int64_t numbers =
      2 * (horizontal.total() + lengths.control_horizontal.total()) + height.total() + lengths.control_height.total();
  for (const PriorLengths::OfGroup& group : lengths.groups)
    numbers += 2 * group.horizontal.total() + group.height.total();
  const double redundancy = std::max(0.5, 1 - 7 / static_cast<double>(std::max<std::int64_t>(1, numbers)));
  SigmaScales change;
  for (const PositionScale& group : now.of_groups()) change.set_positions({group.group});
  for (const PriorLengths::OfGroup& group : lengths.groups) {
    if (!has_a_median(group)) continue;
    if (!change.has_place_for(group.group)) {
      horizontal.add(group.horizontal);
      height.add(group.height);
      continue;
    }
    const PositionScale of_group = now.of_positions(group.group);
    const auto part = [&](double factor, const LengthCounts& counts, double usual) {
      if (counts.total() < kFewestOfGroup) return 1.0;
      const double of_shift = 1 / static_cast<double>(counts.total());
      return change_of(factor, counts, usual, std::max(0.5, redundancy - of_shift));
    };
    change.set_positions({group.group, part(of_group.horizontal, group.horizontal, kMedianOfTwo),
                          part(of_group.height, group.height, kMedianOfOne)});
  }
  const auto judge = [&](ObservationKind kind, const LengthCounts& counts, double usual) {
    change[kind] = change_of(now[kind], counts, usual, redundancy);
  };
  judge(kPositionHorizontal, horizontal, kMedianOfTwo);
  judge(kPositionHeight, height, kMedianOfOne);
  judge(kControlHorizontal, lengths.control_horizontal, kMedianOfTwo);
  judge(kControlHeight, lengths.control_height, kMedianOfOne);
  return change;
}

void set_losses_from_afar(TileProblem& problem, const ObservationOptions& options) {
  problem.position_loss = options.position_loss.from_afar();
  problem.control_loss = options.control_loss.from_afar();
}

void set_no_losses(TileProblem& problem) { problem.position_loss = problem.control_loss = RobustLoss(); }

void set_last_losses(TileProblem& problem, const ObservationOptions& options) {
  problem.position_loss = options.position_loss;
  problem.control_loss = options.control_loss;
}

}  // namespace megablock
