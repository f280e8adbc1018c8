#include "adjust/orientation/position_shifts.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <optional>

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
constexpr double kMadToSigma = 1.4826;
constexpr int kReweightings = 20;

struct AntennaPair {
  FrameIndex frame;
  Eigen::Vector3d in_block, observed;  // antenna
  Eigen::Vector3d sigma;               // stated
};

// A division of the pairs into groups. Group 0 is the largest, and -1 takes no part.
struct Division {
  std::vector<int> group;          // [pairs]
  std::vector<std::string> names;  // [groups]
  bool chosen = false;             // among many
};

struct ShiftFit {
  Similarity similarity;                                                              // to the datum of group 0
  std::vector<Eigen::Vector3d> offsets;                                               // [groups] o_g
  std::vector<Eigen::Vector3d> residuals;                                             // [pairs] p - s R x - t - o_g
  Eigen::Vector3d mean = Eigen::Vector3d::Zero(), scatter = Eigen::Vector3d::Zero();  // of |r|; s
};

std::optional<ShiftFit> fit(const std::vector<AntennaPair>& pairs, const Division& division) {
  const std::size_t groups = division.names.size();
  std::vector<double> weights(pairs.size(), 1);
  std::vector<double> sigmas;
  for (const AntennaPair& pair : pairs) sigmas.push_back(pair.sigma.minCoeff());
  const double least = 0.1 * median(std::move(sigmas));
  ShiftFit fitted;
  for (int iteration = 0; iteration < kReweightings; ++iteration) {
    std::vector<double> sum(groups, 0);
    std::vector<Eigen::Vector3d> x(groups, Eigen::Vector3d::Zero()), p = x;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      if (division.group[i] < 0) continue;
      const auto g = static_cast<std::size_t>(division.group[i]);
      sum[g] += weights[i];
      x[g] += weights[i] * pairs[i].in_block;
      p[g] += weights[i] * pairs[i].observed;
    }
    for (std::size_t g = 0; g < groups; ++g) x[g] /= sum[g], p[g] /= sum[g];
    std::vector<Eigen::Vector3d> from, to;
    std::vector<double> used;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      if (division.group[i] < 0) continue;
      const auto g = static_cast<std::size_t>(division.group[i]);
      from.push_back(pairs[i].in_block - x[g]);
      to.push_back(pairs[i].observed - p[g]);
      used.push_back(weights[i]);
    }
    auto turn = fit_similarity(from, to, used);
    if (!turn) return std::nullopt;
    turn->translation.setZero();
    fitted.similarity = *turn;
    fitted.similarity.translation = p[0] - (*turn)(x[0]);
    fitted.offsets.clear();
    for (std::size_t g = 0; g < groups; ++g) fitted.offsets.push_back((p[g] - p[0]) - (*turn)(x[g] - x[0]));
    fitted.residuals.assign(pairs.size(), Eigen::Vector3d::Zero());
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      if (division.group[i] < 0) continue;
      const auto g = static_cast<std::size_t>(division.group[i]);
      fitted.residuals[i] = (pairs[i].observed - p[g]) - (*turn)(pairs[i].in_block - x[g]);
      weights[i] = 1 / std::max(fitted.residuals[i].norm(), least);
    }
  }
  for (int k = 0; k < 3; ++k) {
    std::vector<double> lengths;
    for (std::size_t i = 0; i < pairs.size(); ++i)
      if (division.group[i] >= 0) lengths.push_back(std::abs(fitted.residuals[i][k]));
    fitted.mean[k] = std::accumulate(lengths.begin(), lengths.end(), 0.0) / static_cast<double>(lengths.size());
    fitted.scatter[k] = kMadToSigma * median(std::move(lengths));
  }
  return fitted;
}

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
  ShiftFinder(const Block& block, const BlockState& state, const std::vector<FrameIndex>& frames)
      : block_(block), image_of_(block.frames.size(), ImageIndex()) {
    for (ImageIndex i(0); block.images.contains(i); ++i.value)
      if (ImageIndex& image = image_of_[block.images[i].frame]; !image.valid()) image = i;
    std::array<std::vector<double>, 3> sigmas;
    for (const FrameIndex f : frames) {
      const Frame& frame = block.frames[f];
      if (!state.oriented[f] || !takes_part(frame)) continue;
      const PositionPrior prior = corrected(*frame.position_prior, block, frame.rig, state.mounts);
      pairs_.push_back({f, prior.position + difference(state.frames[f], prior), prior.position, prior.sigma});
      for (std::size_t k = 0; k < 3; ++k) sigmas[k].push_back(prior.sigma[static_cast<int>(k)]);
    }
    for (std::size_t k = 0; k < 3; ++k) stated_[static_cast<int>(k)] = median(std::move(sigmas[k]));
  }

  PositionShifts run() {
    if (pairs_.size() < 2 * kFewestOfShift) return {};
    Division all;
    all.group.assign(pairs_.size(), 0);
    all.names = {""};
    const auto alone = fit(pairs_, all);
    if (!alone) return {};
    alone_ = *alone;
    for (const auto& names : {by_folder(), by_rig(), by_flight()}) consider(division_by(names, false));
    if (pairs_.size() <= kMostChosen) {
      consider_moments();
      consider_heaps();
    }
    return best_ ? PositionShifts{shifts(), fit_.similarity} : PositionShifts();
  }

 private:
  static bool takes_part(const Frame& frame) {
    const auto& prior = frame.position_prior;
    return prior && !held(*prior) && !prior->group.valid() && prior->sigma.maxCoeff() < kUnknownHeightSigma / 2;
  }

  std::vector<std::string> by_folder() const {
    std::vector<std::string> names;
    for (const AntennaPair& pair : pairs_) {
      const ImageIndex image = image_of_[pair.frame];
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
  std::vector<std::size_t> in_time() const {
    std::vector<std::size_t> order(pairs_.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    if (std::ranges::all_of(pairs_, [&](const AntennaPair& pair) { return std::isfinite(time(pair)); }))
      std::ranges::stable_sort(order, {}, [&](std::size_t i) { return time(pairs_[i]); });
    return order;
  }
  double time(const AntennaPair& pair) const { return block_.frames[pair.frame].time_s; }
  std::vector<std::string> by_flight() const {
    std::vector<std::string> names(pairs_.size());
    int flight = 1;
    double before = std::numeric_limits<double>::quiet_NaN();
    for (const std::size_t i : in_time()) {
      if (time(pairs_[i]) - before > kGap_s) ++flight;
      before = time(pairs_[i]);
      if (std::isfinite(before)) names[i] = "flight " + std::to_string(flight);
    }
    return names;
  }
  void consider_moments() {
    const std::vector<std::size_t> order = in_time();
    const std::size_t step = std::max<std::size_t>(1, order.size() / kMostMoments);
    for (std::size_t first = kFewestOfShift; first + kFewestOfShift <= order.size(); first += step) {
      std::vector<std::string> names(pairs_.size(), "images before " + name(order[first]));
      for (std::size_t i = first; i < order.size(); ++i) names[order[i]] = "images from " + name(order[first]) + " on";
      consider(division_by(names, true));
    }
  }
  std::string name(std::size_t pair) const { return block_.frames[pairs_[pair].frame].name; }

  // The cut along each axis that leaves the least squares within the two sides (Otsu 1979), in the residuals without
  // groups; then twice again in those of the groups that were found, with their offsets.
  void consider_heaps() {
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<double> along;
      for (const Eigen::Vector3d& r : alone_.residuals) along.push_back(r[axis]);
      for (int again = 0; again < 3; ++again) {
        const double cut = best_cut(along);
        std::vector<std::string> names;
        for (const double r : along) names.emplace_back(r < cut ? "lower" : "upper");
        const auto division = division_by(names, true);
        const auto fitted = division ? fit(pairs_, *division) : std::nullopt;
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
    for (std::size_t i = 1; i < along.size(); ++i) {
      below += along[i - 1];
      const auto low = static_cast<double>(i);
      const double apart = (all - below) / (n - low) - below / low;
      if (const double between = low * (n - low) * apart * apart; between > best) best = between, cut = along[i];
    }
    return cut;
  }

  // Keeps the division if it is the best so far and some group of it counts.
  void consider(const std::optional<Division>& division) {
    if (!division) return;
    const auto fitted = fit(pairs_, *division);
    if (!fitted || (best_ && fitted->mean.sum() >= fit_.mean.sum())) return;
    for (std::size_t g = 1; g < fitted->offsets.size(); ++g)
      if (axes_of(*division, *fitted, g).any()) {
        best_ = division;
        fit_ = *fitted;
        return;
      }
  }
  // The axes along which a group counts.
  Eigen::Array<bool, 3, 1> axes_of(const Division& division, const ShiftFit& fitted, std::size_t g) const {
    const double times = division.chosen ? kOfChosen * (1 + kOfFew / static_cast<double>(pairs_.size())) : kOfSpread;
    Eigen::Array<bool, 3, 1> axes;
    for (int k = 0; k < 3; ++k) {
      const double offset = std::abs(fitted.offsets[g][k]);
      axes[k] = offset > kOfStatedSigma * stated_[k] && offset > times * fitted.scatter[k] &&
                fitted.mean[k] < kBetter * alone_.mean[k] && agrees(division, fitted, g, k);
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
  IndexedVector<FrameIndex, ImageIndex> image_of_;  // the first one of each frame
  std::vector<AntennaPair> pairs_;
  Eigen::Vector3d stated_ = Eigen::Vector3d::Zero();  // median sigmas
  ShiftFit alone_, fit_;
  std::optional<Division> best_;
};

}  // namespace

PositionShifts find_position_shifts(const Block& block, const BlockState& state,
                                    const std::vector<FrameIndex>& frames) {
  return ShiftFinder(block, state, frames).run();
}

std::string shift_text(const Block& block, const PositionShift& shift) {
  constexpr std::size_t kNamed = 5;
  std::string text = fmt::format("{} ({}) lie {} the {} others: ", counted(std::ssize(shift.frames), "position"),
                                 shift.kind, side_text(shift.offset), shift.others);
  for (std::size_t i = 0; i < std::min(kNamed, shift.frames.size()); ++i)
    text += (i > 0 ? ", " : "") + block.frames[shift.frames[i]].name;
  if (shift.frames.size() > kNamed) text += fmt::format(" and {} more", shift.frames.size() - kNamed);
  return text +
         "; flights or receivers with different datums? Their shift is an unknown of the adjustment ('orientation: "
         "{shift_positions: false}' leaves them), and the others give the datum";
}

}  // namespace megablock
