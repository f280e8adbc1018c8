#include "adjust/orientation/position_shifts.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <optional>

#include "adjust/orientation/shift_fit.h"
#include "geometry/numbers/median.h"
#include "io/block/held_priors.h"
#include "io/text/counted.h"
#include "io/text/side_text.h"

namespace megablock {

namespace {

constexpr std::size_t kFewestOfShift = 4;    // positions of a group
constexpr std::size_t kMostMoments = 100;    // at which the positions are cut in two
constexpr std::size_t kMostChosen = 20'000;  // positions that are cut in two: each moment costs a fit
constexpr double kOfStatedSigma = 3, kOfSpread = 3, kOfChosen = 6, kOfFew = 6;
constexpr double kBetter = 0.5;                   // share of the residuals without groups
constexpr double kNear = 0.25, kNearlyAll = 0.8;  // of the offset; share of a group
constexpr double kGap_s = 600;                    // between two flights

// Numbers the groups by their size. Positions of small groups take no part. Empty where one group is left.
std::optional<Division> division_by(const std::vector<std::string>& names, bool chosen) {
  std::map<std::string, std::size_t> sizes;
  for (const std::string& name : names)
    if (!name.empty()) ++sizes[name];
  std::erase_if(sizes, [](const auto& size) { return size.second < kFewestOfShift; });
  if (sizes.size() < 2) return std::nullopt;
  std::vector<std::pair<std::string, std::size_t>> order(sizes.begin(), sizes.end());
  std::ranges::stable_sort(order, [](const auto& a, const auto& b) { return a.second > b.second; });
  Division division;
  division.chosen = chosen;
  std::map<std::string, int> number;
  for (const auto& [name, size] : order) {
    number[name] = static_cast<int>(division.names.size());
    division.names.push_back(name);
  }
  for (const std::string& name : names) {
    const auto found = number.find(name);
    division.group.push_back(found == number.end() ? -1 : found->second);
  }
  return division;
}

class ShiftFinder {
 public:
  ShiftFinder(const Block& block, const BlockState& state, const std::vector<FrameIndex>& frames) : block_(block) {
    std::array<std::vector<double>, 3> sigmas;
    for (const FrameIndex f : frames) {
      const Frame& frame = block.frames[f];
      if (!state.oriented[f]) continue;
      any_held_ |= is_held(frame);
      if (!takes_part(frame)) continue;
      const PositionPrior prior = corrected(*frame.position_prior, block, frame.rig, state.mounts);
      pairs_.push_back({f, prior.position + difference(state.frames[f], prior), prior.position, prior.sigma});
      for (std::size_t k = 0; k < 3; ++k) sigmas[k].push_back(prior.sigma[static_cast<int>(k)]);
    }
    for (std::size_t k = 0; k < 3; ++k) stated_[static_cast<int>(k)] = median(std::move(sigmas[k]));
  }

  PositionShifts run() {
    if (any_held_ || pairs_.size() < 2 * kFewestOfShift) return {};
    Division all;
    all.group.assign(pairs_.size(), 0);
    all.names = {""};
    const auto alone = fit_shifts(pairs_, all);
    if (!alone) return {};
    alone_ = *alone;
    without_groups_ = alone_.mean.cwiseMin(mean_beside_bend(pairs_, alone_.residuals));
    consider(division_by(by_folder(), false));
    consider(division_by(by_rig(), false));
    consider(division_by(by_flight(), false));
    // What is known of the images explains more than what their residuals are sorted by.
    if (!best_ && pairs_.size() <= kMostChosen) {
      consider_moments();
      consider_heaps();
    }
    return best_ ? PositionShifts{shifts(), fit_.similarity} : PositionShifts();
  }

 private:
  static bool is_held(const Frame& frame) {
    return (frame.position_prior && held(*frame.position_prior)) ||
           (frame.attitude_prior && held(*frame.attitude_prior));
  }
  static bool takes_part(const Frame& frame) {
    const auto& prior = frame.position_prior;
    return prior && !prior->group.valid() && prior->sigma.maxCoeff() < kUnknownHeightSigma / 2;
  }

  std::vector<std::string> by_folder() const {
    IndexedVector<FrameIndex, ImageIndex> first(block_.frames.size(), ImageIndex());  // image of each frame
    for (ImageIndex i(0); block_.images.contains(i); ++i.value)
      if (ImageIndex& image = first[block_.images[i].frame]; !image.valid()) image = i;
    std::vector<std::string> names;
    for (const AntennaPair& pair : pairs_) {
      const ImageIndex image = first[pair.frame];
      const std::string name = image.valid() ? block_.name_of(image) : std::string();
      const auto slash = name.rfind('/');
      names.push_back("folder '" + (slash == std::string::npos ? std::string(".") : name.substr(0, slash)) + "'");
    }
    return names;
  }
  std::vector<std::string> by_rig() const {
    std::vector<std::string> names;
    for (const AntennaPair& pair : pairs_)
      names.push_back("rig '" + block_.rigs[block_.frames[pair.frame].rig].name + "'");
    return names;
  }
  // Those without a time come last, in the order of the block.
  std::vector<std::size_t> in_time() const {
    std::vector<std::size_t> order(pairs_.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::ranges::stable_sort(order, {}, [&](std::size_t i) {
      return std::isfinite(time(i)) ? time(i) : std::numeric_limits<double>::infinity();
    });
    return order;
  }
  double time(std::size_t pair) const { return block_.frames[pairs_[pair].frame].time_s; }
  std::vector<std::string> by_flight() const {
    std::vector<std::string> names(pairs_.size());
    int flight = 1;
    double before = std::numeric_limits<double>::infinity();
    for (const std::size_t i : in_time()) {
      if (!std::isfinite(time(i))) continue;
      if (time(i) - before > kGap_s) ++flight;
      before = time(i);
      names[i] = "flight " + std::to_string(flight);
    }
    return names;
  }

  // Moments at equal steps, then nearer and nearer to the best of them.
  void consider_moments() {
    const std::vector<std::size_t> order = in_time();
    const std::size_t last = order.size() - kFewestOfShift;
    std::size_t step = (order.size() + kMostMoments - 1) / kMostMoments, best = 0;
    for (std::size_t first = kFewestOfShift; first <= last; first += step)
      if (consider_moment(order, first)) best = first;
    for (; best > 0 && step > 1; step = (step + 1) / 2)
      for (const std::size_t first :
           {best - std::min(best - kFewestOfShift, step / 2), std::min(last, best + step / 2)})
        if (consider_moment(order, first)) best = first;
  }
  bool consider_moment(const std::vector<std::size_t>& order, std::size_t first) {
    std::vector<std::string> names(pairs_.size(), "images before " + name(order[first]));
    for (std::size_t i = first; i < order.size(); ++i) names[order[i]] = "images from " + name(order[first]) + " on";
    return consider(division_by(names, true));
  }
  const std::string& name(std::size_t pair) const { return block_.frames[pairs_[pair].frame].name; }

  // The cut along each axis that leaves the least squares within the two sides (Otsu 1979), in the residuals without
  // groups; then twice again in those of the groups that were found, with their offsets.
  void consider_heaps() {
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<double> along;
      for (const Eigen::Vector3d& r : alone_.residuals) along.push_back(r[axis]);
      for (int again = 0; again < 3; ++again) {
        const double cut = best_cut(along);
        std::vector<std::string> names;
        for (const double r : along)
          names.emplace_back(r < cut ? "residuals on one side" : "residuals on the other side");
        const auto division = division_by(names, true);
        const auto fitted = division ? fit_shifts(pairs_, *division) : std::nullopt;
        if (!fitted) break;
        consider(division);
        for (std::size_t i = 0; i < along.size(); ++i)
          along[i] = fitted->residuals[i][axis] + fitted->offsets[static_cast<std::size_t>(division->group[i])][axis];
      }
    }
  }
  static double best_cut(std::vector<double> along) {
    std::ranges::sort(along);
    const auto n = static_cast<double>(along.size());
    const double all = std::accumulate(along.begin(), along.end(), 0.0);
    double below = 0, best = -1, cut = along.front();
    for (std::size_t i = 1; i + kFewestOfShift <= along.size(); ++i) {
      below += along[i - 1];
      if (i < kFewestOfShift) continue;
      const auto low = static_cast<double>(i);
      const double apart = (all - below) / (n - low) - below / low;
      if (const double between = low * (n - low) * apart * apart; between > best) best = between, cut = along[i];
    }
    return cut;
  }

  // Keeps the division if it is the best so far and some group of it counts, and returns whether it does.
  bool consider(const std::optional<Division>& division) {
    if (!division) return false;
    const auto fitted = fit_shifts(pairs_, *division);
    if (!fitted || (best_ && fitted->mean.sum() >= fit_.mean.sum())) return false;
    for (std::size_t g = 1; g < fitted->offsets.size(); ++g)
      if (axes_of(*division, *fitted, g).any()) {
        best_ = division;
        fit_ = *fitted;
        return true;
      }
    return false;
  }
  // The axes along which a group counts.
  Eigen::Array<bool, 3, 1> axes_of(const Division& division, const ShiftFit& fitted, std::size_t g) const {
    const double times = division.chosen ? kOfChosen * (1 + kOfFew / static_cast<double>(pairs_.size())) : kOfSpread;
    Eigen::Array<bool, 3, 1> axes;
    for (int k = 0; k < 3; ++k) {
      const double offset = std::abs(fitted.offsets[g][k]);
      axes[k] = offset > kOfStatedSigma * stated_[k] && offset > times * fitted.scatter[k] &&
                fitted.mean[k] < kBetter * without_groups_[k] && agrees(division, fitted, g, k);
    }
    return axes;
  }
  // Whether nearly all positions of the group, and enough of them, share its offset.
  bool agrees(const Division& division, const ShiftFit& fitted, std::size_t g, int axis) const {
    std::size_t all = 0, near = 0;
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      if (division.group[i] != static_cast<int>(g)) continue;
      ++all;
      near += std::abs(fitted.residuals[i][axis]) < kNear * std::abs(fitted.offsets[g][axis]);
    }
    return near >= kFewestOfShift && static_cast<double>(near) >= kNearlyAll * static_cast<double>(all);
  }

  std::vector<PositionShift> shifts() const {
    std::vector<PositionShift> found;
    for (std::size_t g = 1; g < best_->names.size(); ++g) {
      const Eigen::Array<bool, 3, 1> axes = axes_of(*best_, fit_, g);
      if (!axes.any()) continue;
      PositionShift shift;
      shift.kind = best_->names[g];
      shift.shifted = axes.cast<std::uint8_t>();
      shift.offset = axes.select(fit_.offsets[g].array(), 0);
      shift.others = static_cast<std::size_t>(std::ranges::count(best_->group, 0));
      for (std::size_t i = 0; i < pairs_.size(); ++i)
        if (best_->group[i] == static_cast<int>(g)) shift.frames.push_back(pairs_[i].frame);
      found.push_back(std::move(shift));
    }
    return found;
  }

  const Block& block_;
  std::vector<AntennaPair> pairs_;
  Eigen::Vector3d stated_ = Eigen::Vector3d::Zero();  // median sigmas
  bool any_held_ = false;                             // the held ones give the datum
  ShiftFit alone_, fit_;
  Eigen::Vector3d without_groups_ = Eigen::Vector3d::Zero();  // mean of |r| of one group that may be bent
  std::optional<Division> best_;
};

}  // namespace

PositionShifts find_position_shifts(const Block& block, const BlockState& state,
                                    const std::vector<FrameIndex>& frames) {
  return ShiftFinder(block, state, frames).run();
}

std::string shift_text(const Block& block, const PositionShift& shift) {
  constexpr std::size_t kNamed = 5;
  std::string text =
      fmt::format("{} ({}) lie {} the {} of the largest group: ", counted(std::ssize(shift.frames), "position"),
                  shift.kind, side_text(shift.offset), shift.others);
  for (std::size_t i = 0; i < std::min(kNamed, shift.frames.size()); ++i)
    text += (i > 0 ? ", " : "") + block.frames[shift.frames[i]].name;
  if (shift.frames.size() > kNamed) text += fmt::format(" and {} more", shift.frames.size() - kNamed);
  return text +
         "; flights or receivers with different datums? Their shift is an unknown of the adjustment ('orientation: "
         "{shift_positions: false}' leaves them), and the largest group gives the datum";
}

}  // namespace megablock
