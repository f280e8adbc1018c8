#include "merge/camera/parameter_choice.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "io/base/error.h"

namespace megablock {

void ParameterChoiceOptions::check() const {
  if (!(least_gain >= 0 && least_gain < 1)) throw InputError("least_gain must lie in [0, 1)");
  if (!(fewest_images >= 2 && groups >= fewest_images))
    throw InputError("groups must be at least fewest_images, that at least 2");
  if (!(certain >= 1)) throw InputError("certain must be at least 1");
  if (!(weak > 0 && weak <= 1)) throw InputError("weak must lie in (0, 1]");
}

namespace {

enum class GroupKind { kFocal, kPrincipalPoint, kRadial, kTangential, kAffinity };

struct Group {
  std::size_t camera = 0;
  GroupKind kind = GroupKind::kFocal;
  std::vector<Eigen::Index> rows;
  std::string names;
  int after = -1;      // the group of the next lower radial term
  bool free = true;    // whether it is estimated
  bool asked = true;   // whether it may be estimated at all
  double raise = NAN;  // of the squared error of prediction, as a share, if it is held; NaN: not asked
};

// The kind of a role; empty for parameters that are estimated in any case.
std::optional<GroupKind> kind_of(ParameterRole role) {
  switch (role) {
    case ParameterRole::kFocal:
      return GroupKind::kFocal;
    case ParameterRole::kPrincipalPoint:
      return GroupKind::kPrincipalPoint;
    case ParameterRole::kRadial:
      return GroupKind::kRadial;
    case ParameterRole::kTangential:
      return GroupKind::kTangential;
    case ParameterRole::kAffinity:
      return GroupKind::kAffinity;
    case ParameterRole::kSymmetry:
    case ParameterRole::kAdditive:
    case ParameterRole::kImageSize:
      break;
  }
  return std::nullopt;
}

bool alone(GroupKind kind) { return kind == GroupKind::kRadial || kind == GroupKind::kAffinity; }

class Chooser {
 public:
  Chooser(const MakeForms& forms, const std::vector<ChoiceCamera>& cameras, const Eigen::VectorXd& start,
          const Eigen::VectorXd& prior_sigma, const ParameterChoiceOptions& options)
      : make_forms_(forms),
        cameras_(cameras),
        start_(start),
        prior_sigma_(prior_sigma),
        options_(options),
        free_(static_cast<std::size_t>(start.size()), 1),
        forms_(forms(free_)) {
    for (std::size_t c = 0; c < cameras.size(); ++c) add_groups(c);
  }

  std::vector<CameraChoice> run() {
    if (few_images()) {
      for (Group& group : groups_)
        if (group.kind == GroupKind::kAffinity) {
          group.asked = false;
          set(group, false);
        }
    }
    best_ = errors();
    while (hold_one()) {
    }
    if (std::find(free_.begin(), free_.end(), 0) != free_.end()) {
      forms_ = make_forms_(free_);
      best_ = errors_of_all();
      while (release_one()) {
      }
    }
    return choices();
  }

 private:
  bool few_images() const { return forms_.images < options_.fewest_images; }
  // Whether a group must show its use.
  bool tested(const Group& group) const { return few_images() || group.kind >= GroupKind::kRadial; }

  void add_groups(std::size_t c) {
    const ChoiceCamera& camera = cameras_[c];
    for (std::size_t i = 0; i < camera.parameters.size(); ++i) {
      const CameraParameter& p = camera_parameters(camera.model)[static_cast<std::size_t>(camera.parameters[i])];
      const auto kind = kind_of(p.role);
      if (!kind) continue;
      const Eigen::Index row = camera.first + static_cast<Eigen::Index>(i);
      const bool same = !groups_.empty() && groups_.back().camera == c && groups_.back().kind == *kind;
      if (same && !alone(*kind)) {
        groups_.back().rows.push_back(row);
        groups_.back().names += ", " + p.name;
        continue;
      }
      Group group{c, *kind, {row}, p.name};
      if (same && *kind == GroupKind::kRadial) group.after = static_cast<int>(groups_.size()) - 1;
      groups_.push_back(std::move(group));
    }
  }

  // Whether no estimated group needs this one.
  bool last(std::size_t g) const {
    return std::none_of(groups_.begin(), groups_.end(),
                        [&](const Group& other) { return other.free && other.after == static_cast<int>(g); });
  }

  void set(Group& group, bool free) {
    group.free = free;
    for (const Eigen::Index row : group.rows) free_[static_cast<std::size_t>(row)] = free;
  }

  // e_g of the present choice.
  Eigen::VectorXd errors() const {
    Eigen::VectorXd result(std::ssize(forms_.without));
    for (Eigen::Index g = 0; g < result.size(); ++g) {
      const CameraForm& form = forms_.without[static_cast<std::size_t>(g)];
      const Eigen::VectorXd value = restricted_minimum(form, free_, start_);
      result[g] = forms_.all.at(value) - form.at(value);
    }
    return result;
  }

  Eigen::VectorXd errors_of_all() {
    std::vector<std::uint8_t> choice(free_.size(), 1);
    for (const Group& group : groups_)
      for (const Eigen::Index row : group.rows) choice[static_cast<std::size_t>(row)] = group.asked;
    std::swap(choice, free_);
    Eigen::VectorXd result = errors();
    std::swap(choice, free_);
    return result;
  }

  // The raise of the error over the best choice, and the limit up to which it does not count.
  struct Raise {
    double value = 0, limit = 0;
    bool matters() const { return value > limit; }
  };
  Raise raise_of(const Eigen::VectorXd& error) const {
    const Eigen::VectorXd by_group = error - best_;
    const auto n = static_cast<double>(by_group.size());
    const double scatter = (by_group.array() - by_group.mean()).matrix().squaredNorm() / std::max(1.0, n - 1);
    const double fewer = std::max(
        1.0, static_cast<double>(options_.groups) / static_cast<double>(std::max<std::int64_t>(1, forms_.images)));
    const double error_of_sum = std::sqrt(n * scatter);
    return {by_group.sum(),
            std::clamp(options_.least_gain * fewer * best_.sum(), error_of_sum, options_.certain * error_of_sum)};
  }

  bool hold_one() {
    int least = -1;
    Raise smallest;
    Eigen::VectorXd error_there;
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      Group& group = groups_[g];
      if (!group.free || !tested(group) || !last(g)) continue;
      set(group, false);
      const Eigen::VectorXd error = errors();
      set(group, true);
      const Raise raise = raise_of(error);
      group.raise = raise.value / best_.sum();
      if (least >= 0 && raise.value >= smallest.value) continue;
      least = static_cast<int>(g);
      smallest = raise;
      error_there = error;
    }
    if (least < 0 || smallest.matters()) return false;
    set(groups_[static_cast<std::size_t>(least)], false);
    if (smallest.value < 0) best_ = error_there;
    return true;
  }

  // Releases the held group that lowers the error most, if the error is above that of all parameters by more than the
  // limit.
  bool release_one() {
    const Eigen::VectorXd now = errors();
    if (!raise_of(now).matters()) return false;
    int best = -1;
    double lowest = now.sum();
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      Group& group = groups_[g];
      if (group.free || !group.asked || (group.after >= 0 && !groups_[static_cast<std::size_t>(group.after)].free))
        continue;
      set(group, true);
      const double sum = errors().sum();
      set(group, false);
      if (sum >= lowest) continue;
      lowest = sum;
      best = static_cast<int>(g);
    }
    if (best < 0) return false;
    Group& group = groups_[static_cast<std::size_t>(best)];
    set(group, true);
    group.raise = (now.sum() - lowest) / best_.sum();
    return true;
  }

  std::vector<CameraChoice> choices() const {
    std::vector<CameraChoice> result(cameras_.size());
    for (std::size_t c = 0; c < cameras_.size(); ++c) {
      const ChoiceCamera& camera = cameras_[c];
      for (std::size_t i = 0; i < camera.parameters.size(); ++i)
        if (free_[static_cast<std::size_t>(camera.first) + i]) result[c].estimated |= mask_of(camera.parameters[i]);
      result[c].reason = reason_of(c);
      result[c].focal_scatter_px = focal_scatter(camera);
    }
    return result;
  }

  // The sigma of the focal length from its scatter over the groups that are left out (jackknife); 0: it is held.
  double focal_scatter(const ChoiceCamera& camera) const {
    const auto found = std::find(camera.parameters.begin(), camera.parameters.end(), kFocal);
    if (found == camera.parameters.end()) return 0;
    const Eigen::Index row = camera.first + (found - camera.parameters.begin());
    Eigen::VectorXd focal(std::ssize(forms_.without));
    for (Eigen::Index g = 0; g < focal.size(); ++g)
      focal[g] = restricted_minimum(forms_.without[static_cast<std::size_t>(g)], free_, start_)[row];
    const auto n = static_cast<double>(focal.size());
    return n > 0 ? std::sqrt((n - 1) / n * (focal.array() - focal.mean()).square().sum()) : 0;
  }

  std::string reason_of(std::size_t c) const {
    const Eigen::MatrixXd covariance = restricted_covariance(forms_.all, free_);
    std::string estimated, held;
    for (const Group& group : groups_) {
      if (group.camera != c) continue;
      std::string& list = group.free ? estimated : held;
      list += (list.empty() ? "" : "; ") + group.names;
      if (!group.asked) list += " (too few images)";
      if (!std::isnan(group.raise)) list += fmt::format(" ({:.2g} %)", 100 * group.raise);
      const bool weak = group.free && std::any_of(group.rows.begin(), group.rows.end(), [&](Eigen::Index row) {
                          return std::sqrt(covariance(row, row)) > options_.weak * prior_sigma_[row];
                        });
      if (weak) list += " (mostly by its prior)";
    }
    return "estimated: " + (estimated.empty() ? "nothing" : estimated) + (held.empty() ? "" : "; held: " + held) +
           fmt::format("; in brackets: the rise of the squared error of left-out {} without it",
                       few_images() ? "tie points" : "images");
  }

  const MakeForms& make_forms_;
  const std::vector<ChoiceCamera>& cameras_;
  const Eigen::VectorXd &start_, &prior_sigma_;
  const ParameterChoiceOptions& options_;
  std::vector<std::uint8_t> free_;  // [rows]
  CameraForms forms_;
  Eigen::VectorXd best_;  // errors of the best choice so far
  std::vector<Group> groups_;
};

}  // namespace

std::vector<CameraChoice> choose_parameters(const MakeForms& forms, const std::vector<ChoiceCamera>& cameras,
                                            const Eigen::VectorXd& start, const Eigen::VectorXd& prior_sigma,
                                            const ParameterChoiceOptions& options) {
  options.check();
  return Chooser(forms, cameras, start, prior_sigma, options).run();
}

}  // namespace megablock
