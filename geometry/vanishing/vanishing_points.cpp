#include "geometry/vanishing/vanishing_points.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <numeric>
#include <random>

#include "geometry/camera/camera.h"
#include "geometry/estimation/gauss_helmert.h"
#include "geometry/numbers/binomial.h"
#include "geometry/numbers/decompositions.h"
#include "geometry/numbers/median.h"

namespace megablock {

namespace {

// The direction V and a basis of its tangent plane that moves with it.
struct AxisState {
  Eigen::Vector3d axis;
  Eigen::Matrix<double, 3, 2> tangent;
};

// The Gauss-Helmert equation V'N = 0, one for each normal.
struct AxisEquation {
  static constexpr int kUnknowns = 2, kEquations = 1, kMeasurements = 3, kConstraints = 0;
  using State = AxisState;
  void linearise(const State& s, const Eigen::Vector3d& normal, std::size_t, GroupEquations<AxisEquation>& out) const {
    out.value(0) = s.axis.dot(normal);
    out.by_unknowns = normal.transpose() * s.tangent;
    out.by_measurements = s.axis.transpose();
  }
  void move(State& s, const Eigen::Vector2d& step) const {
    s.axis = (s.axis + s.tangent * step).normalized();
    s.tangent.col(0) = (s.tangent.col(0) - s.axis * s.axis.dot(s.tangent.col(0))).normalized();
    const Eigen::Vector3d third = s.axis.cross(s.tangent.col(0));
    s.tangent.col(1) = third.dot(s.tangent.col(1)) < 0 ? Eigen::Vector3d(-third) : third;
  }
};

double largest_sigma(const Eigen::Matrix3d& covariance) {
  return std::sqrt(std::max(0.0, symmetric_eigen3(covariance).values(2)));
}

// Sum of N N' / (V' S V) over the planes added, S the covariance of N. Its null vector is the next V.
struct WeightedNormals {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  int count = 0;
  void add(const InterpretationPlane& plane, const Eigen::Vector3d& axis) {
    sum += plane.normal * plane.normal.transpose() / axis.dot(plane.covariance * axis);
    ++count;
  }
  Eigen::Vector3d null_vector() const { return symmetric_eigen3(sum).vectors.col(0); }
};

// Whether a plane is a unit normal with a covariance, and certain enough.
bool is_usable(const InterpretationPlane& plane, double max_sigma) {
  if (!plane.normal.allFinite() || !plane.covariance.allFinite() || std::abs(plane.normal.norm() - 1) > 1e-6)
    return false;
  const double sigma = largest_sigma(plane.covariance);
  return sigma > 0 && sigma <= max_sigma;
}

// One search for all vanishing points of an image; the head of vanishing_points.h lists its steps.
class AxisSearch {
 public:
  AxisSearch(std::span<const InterpretationPlane> planes, const VanishingOptions& options)
      : planes_(planes), options_(options), random_(options.seed) {
    result_.point_of.assign(planes.size(), -1);
    std::vector<double> sigmas;
    for (std::size_t i = 0; i < planes.size(); ++i)
      if (is_usable(planes[i], options.max_normal_sigma)) {
        usable_.push_back(static_cast<int>(i));
        sigmas.push_back(largest_sigma(planes[i].covariance));
      }
    if (usable_.empty()) return;
    result_.tolerance = median(sigmas);
    find_representatives(sigmas);
  }

  VanishingPoints run() {
    left_ = usable_;
    while (true) {
      // One vanishing point per pass, until the best one may be an accident.
      gather_lines();
      if (x_.size() < kFewestLines) break;
      std::int64_t captured = 0;
      Eigen::Vector3d axis = best_pair(captured);
      const auto n = static_cast<double>(x_.size());
      const double log10_nfa =
          std::log10(n * (n - 1) / 2) +
          log10_binomial_tail(static_cast<std::int64_t>(x_.size()) - 2, captured - 2, std::sin(result_.tolerance));
      if (!(captured >= static_cast<std::int64_t>(kFewestLines) && log10_nfa < options_.max_log10_nfa)) break;
      refine(axis);
      const bool is_new = is_no_tail(axis);
      if (!remove(axis)) break;
      if (!is_new) continue;
      axes_.push_back(axis);
      lines_then_.push_back(static_cast<std::int64_t>(x_.size()));
    }
    deal_out();
    return std::move(result_);
  }

 private:
  static constexpr std::size_t kFewestLines = 4;
  static constexpr double kSameSigmas = 4;      // within these, two lines may be one
  static constexpr double kOwnSigmas = 5;       // within these, a line may belong to a vanishing point
  static constexpr double kTailLog10 = -2;      // log10 of the probability that leftovers look like a vanishing point
  static constexpr double kNear = 5 * kDegree;  // a vanishing point this close to another may consist of its leftovers

  const InterpretationPlane& plane(int i) const { return planes_[static_cast<std::size_t>(i)]; }

  // Of each set of lines that may be one and the same, only the line with the smallest sigma represents the set. Lines
  // are sorted by |z| of their normals, which limits the comparisons to neighbours.
  void find_representatives(const std::vector<double>& sigmas) {
    represents_.assign(planes_.size(), true);
    const auto height = [&](std::size_t k) { return std::abs(plane(usable_[k]).normal.z()); };
    std::vector<std::size_t> by_height(usable_.size()), by_sigma, place(usable_.size());
    std::iota(by_height.begin(), by_height.end(), 0);
    by_sigma = by_height;
    std::stable_sort(by_height.begin(), by_height.end(), [&](auto a, auto b) { return height(a) < height(b); });
    std::stable_sort(by_sigma.begin(), by_sigma.end(), [&](auto a, auto b) { return sigmas[a] < sigmas[b]; });
    for (std::size_t k = 0; k < by_height.size(); ++k) place[by_height[k]] = k;
    // The most certain line of a set represents it, so lines are visited by their sigmas.
    const double largest = sigmas[by_sigma.back()];
    for (const std::size_t best : by_sigma) {
      const int line = usable_[best];
      if (!represents_[static_cast<std::size_t>(line)]) continue;
      const Eigen::Matrix<double, 3, 2> across = tangent_plane(plane(line).normal);
      const auto look = [&](std::size_t k) {  // false: too far, as |z| changes no faster than the normal turns
        const std::size_t other = by_height[k];
        if (std::abs(height(other) - height(best)) > kSameSigmas * (sigmas[best] + largest)) return false;
        if (other != best && is_same_line(line, usable_[other], across))
          represents_[static_cast<std::size_t>(usable_[other])] = false;
        return true;
      };
      for (std::size_t k = place[best]; k-- > 0 && look(k);) {
      }
      for (std::size_t k = place[best] + 1; k < by_height.size() && look(k); ++k) {
      }
    }
  }

  // Whether two normals are equal within their covariances. b may have the opposite sign.
  bool is_same_line(int a, int b, const Eigen::Matrix<double, 3, 2>& across) const {
    const Eigen::Vector2d off = across.transpose() * plane(b).normal;  // up to its sign
    if (off.squaredNorm() > 0.25) return false;
    const Eigen::Matrix2d covariance = across.transpose() * (plane(a).covariance + plane(b).covariance) * across;
    return off.dot(covariance.inverse() * off) < kSameSigmas * kSameSigmas;
  }

  // Copies the normals that count into three arrays, which makes counting fast.
  void gather_lines() {
    x_.clear();
    y_.clear();
    z_.clear();
    for (const int i : left_) {
      if (!represents_[static_cast<std::size_t>(i)]) continue;
      x_.push_back(plane(i).normal.x());
      y_.push_back(plane(i).normal.y());
      z_.push_back(plane(i).normal.z());
    }
  }

  std::int64_t count_near(const Eigen::Vector3d& axis, double sine) const {
    std::int64_t count = 0;
    for (std::size_t i = 0; i < x_.size(); ++i)
      count += std::abs(axis.x() * x_[i] + axis.y() * y_[i] + axis.z() * z_[i]) <= sine;
    return count;
  }

  // The pole of the great circle with most normals, among the pairs drawn.
  Eigen::Vector3d best_pair(std::int64_t& captured) {
    const std::size_t n = x_.size(), pairs = n * (n - 1) / 2;
    const std::size_t draws = std::max(n / 2, static_cast<std::size_t>(std::max(0, options_.min_draws)));
    const double sine = std::sin(result_.tolerance);
    Eigen::Vector3d best = Eigen::Vector3d::Zero();
    const auto consider = [&](std::size_t i, std::size_t j) {
      const Eigen::Vector3d cross = Eigen::Vector3d(x_[i], y_[i], z_[i]).cross(Eigen::Vector3d(x_[j], y_[j], z_[j]));
      const double size = cross.norm();
      if (!(size > sine)) return;
      const Eigen::Vector3d axis = cross / size;
      const std::int64_t count = count_near(axis, sine);
      if (count <= captured) return;
      captured = count;
      best = axis;
    };
    if (pairs <= draws) {
      for (std::size_t i = 0; i < n; ++i)
        for (std::size_t j = i + 1; j < n; ++j) consider(i, j);
    } else {
      for (std::size_t draw = 0; draw < draws; ++draw) {
        const std::size_t i = random_() % n, j = random_() % n;
        if (i != j) consider(i, j);
      }
    }
    return best;
  }

  static double log10_nfa(std::int64_t lines, std::int64_t captured, double p) {
    const auto n = static_cast<double>(lines);
    return std::log10(n * (n - 1) / 2) + log10_binomial_tail(lines - 2, captured - 2, p);
  }
  bool is_no_accident(std::int64_t lines, std::int64_t captured, double p) const {
    return captured >= static_cast<std::int64_t>(kFewestLines) &&
           log10_nfa(lines, captured, p) < options_.max_log10_nfa;
  }

  // Compares the lines near the axis with those near its mirror image in each neighbouring axis found before.
  bool is_no_tail(const Eigen::Vector3d& axis) const {
    for (const Eigen::Vector3d& other : axes_) {
      if (axis.cross(other).norm() > std::sin(kNear)) continue;
      const Eigen::Vector3d mirrored = 2 * other.dot(axis) * other - axis;
      std::int64_t own = 0, opposite = 0;
      for (const int i : left_) {
        if (!represents_[static_cast<std::size_t>(i)]) continue;
        const bool here = std::abs(axis.dot(plane(i).normal)) <= reach(axis, i);
        const bool there = std::abs(mirrored.dot(plane(i).normal)) <= reach(mirrored, i);
        own += here && !there;
        opposite += there && !here;
      }
      if (log10_binomial_tail(own + opposite, own, 0.5) > kTailLog10) return false;
    }
    return true;
  }

  // Moves the axis to the weighted null vector of the normals within 2 t, three times.
  void refine(Eigen::Vector3d& axis) const {
    const double sine = std::sin(2 * result_.tolerance);
    for (int round = 0; round < 3; ++round) {
      WeightedNormals normals;
      for (const int i : left_)
        if (std::abs(axis.dot(plane(i).normal)) <= sine) normals.add(plane(i), axis);
      if (normals.count < 3 || !normals.sum.allFinite()) return;
      axis = normals.null_vector();
    }
  }

  // Sine of the distance from the circle within which lines are removed.
  double reach(const Eigen::Vector3d& axis, int i) const {
    return std::max(std::sin(2 * result_.tolerance), 3 * std::sqrt(axis.dot(plane(i).covariance * axis)));
  }

  bool remove(const Eigen::Vector3d& axis) {
    const std::size_t before = left_.size();
    std::erase_if(left_, [&](int i) { return std::abs(axis.dot(plane(i).normal)) <= reach(axis, i); });
    return left_.size() < before;
  }

  // Assigns every line to one axis, estimates the axes from their lines, and drops those that no longer pass the test.
  void deal_out() {
    // Assignment and estimation depend on each other, so both are repeated.
    std::vector<std::vector<int>> lines(axes_.size());
    for (int round = 0; round < 3; ++round) {
      for (auto& own : lines) own.clear();
      for (const int i : usable_) {
        int& owner = result_.point_of[static_cast<std::size_t>(i)];
        owner = -1;
        double least = 0;
        for (std::size_t a = 0; a < axes_.size(); ++a) {
          const double off = std::abs(axes_[a].dot(plane(i).normal));
          if (off > reach(axes_[a], i)) continue;
          const double sigmas = off / std::sqrt(axes_[a].dot(plane(i).covariance * axes_[a]));
          if (sigmas > kOwnSigmas || (owner >= 0 && sigmas >= least)) continue;
          owner = static_cast<int>(a);
          least = sigmas;
        }
        if (owner >= 0) lines[static_cast<std::size_t>(owner)].push_back(i);
      }
      for (std::size_t a = 0; a < axes_.size(); ++a) {
        WeightedNormals normals;
        for (const int i : lines[a]) normals.add(plane(i), axes_[a]);
        if (normals.count >= 3 && normals.sum.allFinite()) axes_[a] = normals.null_vector();
      }
    }
    std::vector<int> number(axes_.size(), -1);
    std::vector<InterpretationPlane> own;
    for (std::size_t a = 0; a < axes_.size(); ++a) {
      own.clear();
      std::int64_t different = 0;
      for (const int i : lines[a]) {
        own.push_back(plane(i));
        different += represents_[static_cast<std::size_t>(i)];
      }
      if (!is_no_accident(std::max(lines_then_[a], different), different, std::sin(result_.tolerance))) continue;
      const auto fit = fit_axis(own);
      if (!fit || largest_sigma(fit->axis.covariance) > options_.max_axis_sigma) continue;
      number[a] = static_cast<int>(result_.points.size());
      const double nfa = log10_nfa(std::max(lines_then_[a], different), different, std::sin(result_.tolerance));
      result_.points.push_back({fit->axis, nfa, fit->weighted_squares, fit->redundancy, lines[a]});
    }
    for (int& owner : result_.point_of)
      if (owner >= 0) owner = number[static_cast<std::size_t>(owner)];
  }

  std::span<const InterpretationPlane> planes_;
  const VanishingOptions& options_;
  std::mt19937_64 random_;
  VanishingPoints result_;
  std::vector<int> usable_, left_;
  std::vector<bool> represents_;
  std::vector<double> x_, y_, z_;  // of the lines that are left and count
  std::vector<Eigen::Vector3d> axes_;
  std::vector<std::int64_t> lines_then_;  // number of lines that were left when an axis was found
};

}  // namespace

VanishingPoints find_vanishing_points(std::span<const InterpretationPlane> planes, const VanishingOptions& options) {
  return AxisSearch(planes, options).run();
}

std::optional<FittedAxis> fit_axis(std::span<const InterpretationPlane> planes) {
  if (planes.size() < 2) return std::nullopt;
  // Equal weights give the start, because the right weights depend on the axis.
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const InterpretationPlane& plane : planes) sum += plane.normal * plane.normal.transpose();
  if (!sum.allFinite()) return std::nullopt;
  const Eigen::Vector3d start = symmetric_eigen3(sum).vectors.col(0);
  std::vector<Eigen::Vector3d> normals;
  std::vector<Eigen::Matrix3d> covariances;
  normals.reserve(planes.size());
  covariances.reserve(planes.size());
  for (const InterpretationPlane& plane : planes) {
    normals.push_back(plane.normal);
    covariances.push_back(plane.covariance);
  }
  const auto fit =
      fit_gauss_helmert(AxisEquation(), AxisState{start, tangent_plane(start)},
                        std::span<const Eigen::Vector3d>(normals), std::span<const Eigen::Matrix3d>(covariances));
  if (!fit) return std::nullopt;
  return FittedAxis{
      {fit->state.axis, propagated(fit->state.tangent, fit->covariance)}, fit->weighted_squares, fit->redundancy};
}

}  // namespace megablock
