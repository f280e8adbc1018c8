#include "merge/camera/parameter_choice.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "geometry/numbers/decompositions.h"
#include "geometry/numbers/fisher.h"
#include "geometry/numbers/student.h"
#include "io/base/error.h"

namespace megablock {

void ParameterChoiceOptions::check() const {
  if (!(probability > 0 && probability < 0.5)) throw InputError("probability must lie in (0, 0.5)");
  if (!(determined > 0 && determined < 1)) throw InputError("determined must lie in (0, 1)");
  if (!(least_gain >= 0 && least_gain < 1)) throw InputError("least_gain must lie in [0, 1)");
  if (!(correlated > 0 && correlated <= 1)) throw InputError("correlated must lie in (0, 1]");
  if (groups < fewest_groups || fewest_groups < 4)
    throw InputError("groups must be at least fewest_groups, that at least 4");
  if (!(few_images >= 1)) throw InputError("few_images must be at least 1");
}

namespace {

// What kind of group, in the order in which they are given up, the last one first.
enum class Order { kFocal, kPrincipalPoint, kRadial, kTangential, kAffinity };

struct Group {
  std::size_t camera = 0;
  Order order = Order::kFocal;
  std::vector<Eigen::Index> rows;
  std::string names;
  int after = -1;           // the group of the next lower radial term
  bool tested = false;      // whether it must be significant
  std::string reason;       // why it is held; empty: it is estimated
  double significance = 0;  // two-sided probability in sigmas of a normal distribution
  double gain = 0;          // share by which left-out images are predicted worse without the group
  bool free() const { return reason.empty(); }
};

// The order of a role; empty for parameters that are estimated in any case.
std::optional<Order> order_of(ParameterRole role) {
  switch (role) {
    case ParameterRole::kFocal:
      return Order::kFocal;
    case ParameterRole::kPrincipalPoint:
      return Order::kPrincipalPoint;
    case ParameterRole::kRadial:
      return Order::kRadial;
    case ParameterRole::kTangential:
      return Order::kTangential;
    case ParameterRole::kAffinity:
      return Order::kAffinity;
    case ParameterRole::kSymmetry:
    case ParameterRole::kAdditive:
    case ParameterRole::kImageSize:
      break;
  }
  return std::nullopt;
}

bool alone(Order order) { return order == Order::kRadial || order == Order::kAffinity; }

class Chooser {
 public:
  Chooser(const MakeForms& forms, const std::vector<ChoiceCamera>& cameras, const Eigen::VectorXd& start,
          const Eigen::VectorXd& prior_sigma, const ParameterChoiceOptions& options)
      : make_forms_(forms),
        cameras_(cameras),
        start_(start),
        prior_sigma_(prior_sigma),
        options_(options),
        free_(static_cast<std::size_t>(start.size()), 1) {
    for (std::size_t c = 0; c < cameras.size(); ++c) add_groups(c);
    renew();
  }

  std::vector<CameraChoice> run() {
    if (std::ssize(without_) < options_.fewest_groups) {
      hold_all_but_focal();
    } else {
      while (hold_undetermined()) renew();
      while (hold_one(insignificant())) {
      }
      while (hold_one(useless())) {
      }
    }
    return choices();
  }

 private:
  void renew() {
    CameraForms forms = make_forms_(free_);
    all_ = std::move(forms.all);
    without_ = std::move(forms.without);
  }

  // Returns whether there was any.
  bool hold_undetermined() {
    bool any = false;
    while (hold_one(undetermined())) any = true;
    return any;
  }

  void add_groups(std::size_t c) {
    const ChoiceCamera& camera = cameras_[c];
    for (std::size_t i = 0; i < camera.parameters.size(); ++i) {
      const CameraParameter& p = camera_parameters(camera.model)[static_cast<std::size_t>(camera.parameters[i])];
      const auto order = order_of(p.role);
      if (!order) continue;
      const Eigen::Index row = camera.first + static_cast<Eigen::Index>(i);
      const bool same = !groups_.empty() && groups_.back().camera == c && groups_.back().order == *order;
      if (same && !alone(*order)) {
        groups_.back().rows.push_back(row);
        groups_.back().names += ", " + p.name;
        continue;
      }
      const int before = same && *order == Order::kRadial ? static_cast<int>(groups_.size()) - 1 : -1;
      groups_.push_back({c, *order, {row}, p.name, before, *order >= Order::kRadial, "", 0});
      tests_ += groups_.back().tested;
    }
  }

  // Whether no estimated group needs this one.
  bool last(std::size_t g) const {
    return std::none_of(groups_.begin(), groups_.end(),
                        [&](const Group& other) { return other.free() && other.after == static_cast<int>(g); });
  }

  struct Verdict {
    int group = -1;
    std::string reason;
  };

  bool hold_one(const Verdict& verdict) {
    if (verdict.group < 0) return false;
    Group& group = groups_[static_cast<std::size_t>(verdict.group)];
    group.reason = verdict.reason;
    for (const Eigen::Index row : group.rows) free_[static_cast<std::size_t>(row)] = 0;
    return true;
  }

  // The jackknife covariance with the present choice.
  Eigen::MatrixXd jackknife() const {
    const auto count = static_cast<Eigen::Index>(without_.size());
    Eigen::MatrixXd values(start_.size(), count);
    for (Eigen::Index g = 0; g < count; ++g)
      values.col(g) = restricted_minimum(without_[static_cast<std::size_t>(g)], free_, start_);
    values.colwise() -= values.rowwise().mean().eval();
    const double n = static_cast<double>(count);
    return (n - 1) / n * values * values.transpose();
  }

  Verdict undetermined() const {
    const Eigen::MatrixXd formal = restricted_covariance(all_, free_), robust = jackknife();
    for (int g = static_cast<int>(groups_.size()) - 1; g >= 0; --g) {
      const Group& group = groups_[static_cast<std::size_t>(g)];
      if (!group.free() || !last(static_cast<std::size_t>(g))) continue;
      for (const Eigen::Index row : group.rows) {
        const double sigma = std::sqrt(std::max(formal(row, row), robust(row, row)));
        if (sigma > options_.determined * prior_sigma_[row])
          return {g, fmt::format("not determined: sigma {:.2g} of {:.2g} a priori", sigma, prior_sigma_[row])};
        for (const Group& other : groups_) {
          if (!other.free() || other.order >= group.order || other.camera != group.camera) continue;
          for (const Eigen::Index column : other.rows) {
            const double r = formal(row, column) / std::sqrt(formal(row, row) * formal(column, column));
            if (std::abs(r) > options_.correlated)
              return {g, fmt::format("correlated by {:.3f} with {}", r, other.names)};
          }
        }
      }
    }
    return {};
  }

  Verdict insignificant() {
    const Eigen::MatrixXd robust = jackknife();
    const Eigen::VectorXd value = restricted_minimum(all_, free_, start_);
    const auto count = static_cast<double>(without_.size());
    Verdict least;
    double largest = options_.probability / std::max(1, tests_);
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      Group& group = groups_[g];
      if (!group.free() || !group.tested || !last(g)) continue;
      const auto q = static_cast<double>(group.rows.size());
      const Eigen::VectorXd difference = (value - start_)(group.rows);
      const Eigen::MatrixXd covariance = robust(group.rows, group.rows);
      const double t = difference.dot(solve_symmetric(covariance, difference).col(0));
      const double f = t * (count - q) / (q * (count - 1));
      const double probability = std::isfinite(f) && count > q ? fisher_exceeds(f, q, count - q) : 1;
      group.significance = probability > 0 ? normal_quantile(0.5 * std::min(probability, 1.0)) : 38;
      if (!(probability > largest)) continue;
      largest = probability;
      least = {static_cast<int>(g), fmt::format("not significant, {:.1f} sigma", group.significance)};
    }
    return least;
  }

  // The error with which the other images predict those of each group.
  double predicted() const {
    double sum = 0;
    for (const CameraForm& form : without_) {
      const Eigen::VectorXd value = restricted_minimum(form, free_, start_);
      sum += all_.at(value) - form.at(value);
    }
    return sum;
  }

  Verdict useless() {
    const double with = predicted();
    Verdict least;
    double smallest = options_.least_gain;
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      Group& group = groups_[g];
      if (!group.free() || !group.tested || !last(g)) continue;
      for (const Eigen::Index row : group.rows) free_[static_cast<std::size_t>(row)] = 0;
      const double gain = predicted() / with - 1;
      for (const Eigen::Index row : group.rows) free_[static_cast<std::size_t>(row)] = 1;
      group.gain = gain;
      if (gain >= smallest) continue;
      smallest = gain;
      least = {static_cast<int>(g), fmt::format("{:.1f} sigma, but predicts left-out images only {:.2f} % better",
                                                group.significance, 100 * std::max(0.0, gain))};
    }
    return least;
  }

  void hold_all_but_focal() {
    for (std::size_t g = 0; g < groups_.size(); ++g)
      if (groups_[g].order != Order::kFocal) hold_one({static_cast<int>(g), "too few images"});
    const Eigen::MatrixXd formal = restricted_covariance(all_, free_);
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      const Eigen::Index row = groups_[g].rows.front();
      if (!groups_[g].free()) continue;
      const double sigma = options_.few_images * std::sqrt(formal(row, row));
      if (!(sigma <= options_.determined * prior_sigma_[row])) hold_one({static_cast<int>(g), "too few images"});
    }
  }

  std::vector<CameraChoice> choices() const {
    std::vector<CameraChoice> result(cameras_.size());
    for (std::size_t c = 0; c < cameras_.size(); ++c) {
      const ChoiceCamera& camera = cameras_[c];
      for (std::size_t i = 0; i < camera.parameters.size(); ++i)
        if (free_[static_cast<std::size_t>(camera.first) + i]) result[c].estimated |= mask_of(camera.parameters[i]);
      result[c].reason = reason_of(c);
    }
    return result;
  }

  std::string reason_of(std::size_t c) const {
    std::string estimated, held;
    for (const Group& group : groups_) {
      if (group.camera != c) continue;
      std::string& list = group.free() ? estimated : held;
      list += (list.empty() ? "" : "; ") + group.names;
      if (!group.free())
        list += " (" + group.reason + ")";
      else if (group.gain > 0)  // lower radial terms are kept with the higher ones
        list += fmt::format(" ({:.1f} sigma, {:.1f} %)", group.significance, 100 * group.gain);
    }
    return "estimated: " + (estimated.empty() ? "nothing" : estimated) + (held.empty() ? "" : "; held: " + held);
  }

  const MakeForms& make_forms_;
  CameraForm all_;
  std::vector<CameraForm> without_;
  const std::vector<ChoiceCamera>& cameras_;
  const Eigen::VectorXd &start_, &prior_sigma_;
  const ParameterChoiceOptions& options_;
  std::vector<std::uint8_t> free_;  // [rows]
  std::vector<Group> groups_;
  int tests_ = 0;
};

}  // namespace

std::vector<CameraChoice> choose_parameters(const MakeForms& forms, const std::vector<ChoiceCamera>& cameras,
                                            const Eigen::VectorXd& start, const Eigen::VectorXd& prior_sigma,
                                            const ParameterChoiceOptions& options) {
  options.check();
  return Chooser(forms, cameras, start, prior_sigma, options).run();
}

}  // namespace megablock
