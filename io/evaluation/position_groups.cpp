#include "io/evaluation/position_groups.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "geometry/numbers/median.h"
#include "io/block/held_priors.h"

namespace megablock {

namespace {

constexpr std::ptrdiff_t kFewestOfGroup = 4;  // positions of a group
constexpr double kOfDeviation = 6, kOfFew = 6, kOfStated = 3, kEmpty = 0.5;
constexpr std::size_t kNamedOfGroup = 5;

struct AxisResidual {  // observed minus adjusted, along one axis
  double metres = 0;
  FrameIndex frame;
};

struct Side {
  double mean = 0, deviation = 0;
};

Side side_of(std::span<const AxisResidual> along) {
  Side side;
  const auto n = static_cast<double>(along.size());
  for (const AxisResidual& r : along) side.mean += r.metres / n;
  for (const AxisResidual& r : along) side.deviation += std::pow(r.metres - side.mean, 2) / (n - 1);
  side.deviation = std::sqrt(side.deviation);
  return side;
}

// The number of values below the cut with the least squares within its sides; `along` ascend.
std::ptrdiff_t best_cut(std::span<const AxisResidual> along) {
  const auto n = std::ssize(along);
  double all = 0, below = 0, best = -1;
  for (const AxisResidual& r : along) all += r.metres;
  std::ptrdiff_t cut = 0;
  for (std::ptrdiff_t i = 1; i < n; ++i) {
    below += along[static_cast<std::size_t>(i - 1)].metres;
    if (i < kFewestOfGroup || n - i < kFewestOfGroup) continue;
    const double low = static_cast<double>(i), high = static_cast<double>(n - i);
    const double apart = (all - below) / high - below / low;
    if (const double between = low * high * apart * apart; between > best) best = between, cut = i;
  }
  return cut;
}

struct Groups {
  std::size_t axis = 0;
  double apart = 0;               // metres
  std::vector<FrameIndex> upper;  // positions observed above those of the others, in the order of the frames
  std::size_t all = 0;
};

// The groups along an axis; apart = 0: there is one group.
Groups groups_along(std::size_t axis, const BlockResult& result, std::span<const report::PositionResidual> residuals) {
  Groups groups;
  groups.axis = axis;
  std::vector<AxisResidual> along;
  std::vector<double> sigmas;
  for (const report::PositionResidual& r : residuals) {
    // The stated sigma: two groups may be why the adjustment used a larger one.
    const double sigma = result.block.frames[r.frame].position_prior->sigma[static_cast<int>(axis)];
    if (sigma >= kUnknownHeightSigma || sigma <= 2 * kHeldPositionSigma) continue;
    along.push_back({-r.difference[static_cast<int>(axis)], r.frame});
    sigmas.push_back(sigma);
  }
  std::stable_sort(along.begin(), along.end(),
                   [](const AxisResidual& a, const AxisResidual& b) { return a.metres < b.metres; });
  const std::ptrdiff_t cut = best_cut(along);
  if (cut == 0) return groups;
  const std::span<const AxisResidual> all(along);
  const auto below = all.first(static_cast<std::size_t>(cut)), above = all.subspan(static_cast<std::size_t>(cut));
  const Side low = side_of(below), high = side_of(above);
  const double apart = high.mean - low.mean, empty = above.front().metres - below.back().metres;
  const double times = kOfDeviation * (1 + kOfFew / static_cast<double>(along.size()));
  if (apart <= times * std::max(low.deviation, high.deviation) || apart <= kOfStated * median(std::move(sigmas)) ||
      empty < kEmpty * apart)
    return groups;
  groups.apart = apart;
  groups.all = along.size();
  for (const AxisResidual& r : above) groups.upper.push_back(r.frame);
  std::sort(groups.upper.begin(), groups.upper.end());
  return groups;
}

}  // namespace

std::string position_groups_text(const BlockResult& result, std::span<const report::PositionResidual> residuals) {
  constexpr std::array<const char*, 3> kAxes{"east of", "north of", "above"};
  Groups widest;
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (Groups groups = groups_along(axis, result, residuals); groups.apart > widest.apart) widest = std::move(groups);
  if (widest.apart == 0) return "";
  std::string text = fmt::format("{} of {} positions lie {:.1f} m {} the other {}: ", widest.upper.size(), widest.all,
                                 widest.apart, kAxes[widest.axis], widest.all - widest.upper.size());
  for (std::size_t i = 0; i < std::min(kNamedOfGroup, widest.upper.size()); ++i)
    text += (i > 0 ? ", " : "") + result.block.frames[widest.upper[i]].name;
  if (widest.upper.size() > kNamedOfGroup) text += fmt::format(" and {} more", widest.upper.size() - kNamedOfGroup);
  return text +
         "; flights or receivers with different datums? give one of them a shift with 'gps: {groups: [...]}', correct "
         "its positions, or leave them out";
}

}  // namespace megablock
