#include "adjust/orientation/mirrored_layout.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <utility>
#include <vector>

#include "geometry/numbers/median.h"
#include "geometry/numbers/straight_line.h"
#include "geometry/similarity/minimal_similarity.h"
#include "geometry/similarity/similarity.h"

namespace megablock {

namespace {

using Points = std::vector<Eigen::Vector3d>;

constexpr std::size_t kFewestFree = 4, kFewestInPlace = 3;
constexpr std::size_t kFewOfLayout = 6;                        // from so many points on the smaller factor suffices
constexpr std::size_t kMostPoints = 200;                       // evenly among all; more say no more
constexpr std::size_t kMostTriples = 500, kAllSamplesOf = 15;  // points: 455 samples
constexpr double kTimes = 5, kTimesOfFew = 10;                 // of e over e'
constexpr double kOfSigma = 3, kLeastMirrored = 0.002, kMostMirrored = 0.02;  // of e; of e over d; of e' over d
constexpr double kLeastInPlace = 0.1;                                         // of e over d
constexpr double kAsUpright = 0.3;                                            // difference of cosines that says nothing

Points evenly(std::span<const Eigen::Vector3d> points) {
  const std::size_t step = 1 + (points.size() - 1) / kMostPoints;
  Points some;
  for (std::size_t i = 0; i < points.size(); i += step) some.push_back(points[i]);
  return some;
}

Eigen::Vector3d middle_of(const Points& points) {
  Eigen::Vector3d middle;
  for (int k = 0; k < 3; ++k) {
    std::vector<double> coordinates;
    for (const Eigen::Vector3d& p : points) coordinates.push_back(p[k]);
    middle[k] = median(std::move(coordinates));
  }
  return middle;
}

// Gross errors move neither the middle nor the median distance from it.
double size_of(const Points& points) {
  const Eigen::Vector3d middle = middle_of(points);
  std::vector<double> distances;
  for (const Eigen::Vector3d& p : points) distances.push_back((p - middle).norm());
  return median(std::move(distances));
}

Points reflected(Points points, Reflection reflection) {
  for (Eigen::Vector3d& p : points) {
    if (reflection == Reflection::kExchanged) std::swap(p.x(), p.y());
    if (reflection == Reflection::kFirstReversed) p.x() = -p.x();
    if (reflection == Reflection::kSecondReversed) p.y() = -p.y();
  }
  return points;
}

double times_of(std::size_t points) { return points < kFewOfLayout ? kTimesOfFew : kTimes; }

double rms_of_smallest(std::vector<double> squares, std::size_t number) {
  std::ranges::nth_element(squares, squares.begin() + static_cast<std::ptrdiff_t>(number) - 1);
  const double sum = std::accumulate(squares.begin(), squares.begin() + static_cast<std::ptrdiff_t>(number), 0.0);
  return std::sqrt(sum / static_cast<double>(number));
}

// Least trimmed squares of a similarity: the best of many samples of three points, fitted to its best points until
// they no longer change (P. Rousseeuw and K. Van Driessen, "Computing LTS regression", 2006).
class TrimmedFit {
 public:
  TrimmedFit(const Points& from, const Points& to) : from_(from), to_(to), decisive_((from.size() + 4) / 2) {
    const std::size_t n = from.size();
    if (n <= kAllSamplesOf) {
      for (std::size_t a = 0; a < n; ++a)
        for (std::size_t b = a + 1; b < n; ++b)
          for (std::size_t c = b + 1; c < n; ++c) sample(a, b, c);
    } else {
      std::mt19937_64 random(n);
      for (std::size_t k = 0; k < kMostTriples; ++k) {
        const std::size_t a = random() % n, b = random() % n, c = random() % n;
        if (a != b && b != c && a != c) sample(a, b, c);
      }
    }
    refine();
  }

  double rms() const { return rms_; }  // infinite: no sample had a solution
  const Eigen::Quaterniond& rotation() const { return best_.rotation; }
  // Of the points that decided.
  bool on_a_line() const {
    const Points places = best_points(best_).second;
    const Eigen::Vector3d mean =
        std::accumulate(places.begin(), places.end(), Eigen::Vector3d(Eigen::Vector3d::Zero())) /
        static_cast<double>(places.size());
    Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
    for (const Eigen::Vector3d& p : places) scatter += (p - mean) * (p - mean).transpose();
    return straight_line(scatter).has_value();
  }

 private:
  std::vector<double> squares_of(const Similarity& similarity) const {
    std::vector<double> squares;
    for (std::size_t i = 0; i < from_.size(); ++i) squares.push_back((similarity(from_[i]) - to_[i]).squaredNorm());
    return squares;
  }
  // In both systems.
  std::pair<Points, Points> best_points(const Similarity& similarity) const {
    const std::vector<double> squares = squares_of(similarity);
    std::vector<std::size_t> order(squares.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::ranges::stable_sort(order, {}, [&](std::size_t i) { return squares[i]; });
    std::pair<Points, Points> best;
    for (std::size_t i = 0; i < decisive_; ++i) {
      best.first.push_back(from_[order[i]]);
      best.second.push_back(to_[order[i]]);
    }
    return best;
  }
  // Returns whether it is better than all before.
  bool propose(const Similarity& similarity) {
    const double rms = rms_of_smallest(squares_of(similarity), decisive_);
    if (!(rms < rms_)) return false;
    rms_ = rms;
    best_ = similarity;
    return true;
  }
  void sample(std::size_t a, std::size_t b, std::size_t c) {
    const auto found = solve_similarity({from_[a], from_[b], from_[c]}, {to_[a], to_[b], to_[c]});
    if (found) propose(*found);
  }
  void refine() {
    constexpr int kRounds = 10;
    for (int round = 0; round < kRounds && std::isfinite(rms_); ++round) {
      const auto [from, to] = best_points(best_);
      const auto fitted = fit_similarity(from, to);
      if (!fitted || !propose(*fitted)) return;
    }
  }

  const Points &from_, &to_;
  std::size_t decisive_;
  Similarity best_;
  double rms_ = std::numeric_limits<double>::infinity();
};

// One for images that look down or whose y axis points down, and all between; minus one for those that look up or hang
// on their heads.
double uprightness(const Eigen::Quaterniond& to_ground, const MeanAxes& axes) {
  return std::min(1.0, -(to_ground * (axes.view + axes.down)).z());
}

// The rms distance after the median shift.
double rms_after_shift(const Points& from, const Points& to) {
  Points differences;
  for (std::size_t i = 0; i < from.size(); ++i) differences.push_back(to[i] - from[i]);
  const Eigen::Vector3d shift = middle_of(differences);
  std::vector<double> squares;
  for (const Eigen::Vector3d& d : differences) squares.push_back((d - shift).squaredNorm());
  return rms_of_smallest(std::move(squares), std::min(from.size(), (from.size() + 3) / 2));
}

}  // namespace

std::optional<MirroredLayout> find_mirrored_layout(std::span<const Eigen::Vector3d> model,
                                                   std::span<const Eigen::Vector3d> given, double sigma_m,
                                                   const MeanAxes& axes) {
  if (model.size() < kFewestFree || model.size() != given.size()) return std::nullopt;
  const Points from = evenly(model), to = evenly(given), exchanged = reflected(to, Reflection::kExchanged);
  const double size = size_of(to);
  const TrimmedFit as_given(from, to);
  if (!(as_given.rms() > std::max(kOfSigma * sigma_m, kLeastMirrored * size))) return std::nullopt;
  const TrimmedFit mirrored(from, exchanged);
  if (!(mirrored.rms() < kMostMirrored * size && times_of(from.size()) * mirrored.rms() < as_given.rms()))
    return std::nullopt;
  const double upright = uprightness(mirrored.rotation(), axes);
  if (!(upright > std::max(0.0, uprightness(as_given.rotation(), axes) - kAsUpright))) return std::nullopt;
  if (mirrored.on_a_line()) return std::nullopt;
  return MirroredLayout{Reflection::kExchanged, mirrored.rms(), as_given.rms()};
}

std::optional<MirroredLayout> find_mirrored_layout_in_place(std::span<const Eigen::Vector3d> model,
                                                            std::span<const Eigen::Vector3d> given) {
  if (model.size() < kFewestInPlace || model.size() != given.size()) return std::nullopt;
  const Points from = evenly(model), to = evenly(given);
  const double as_given = rms_after_shift(from, to);
  if (!(as_given > kLeastInPlace * size_of(to))) return std::nullopt;
  std::optional<MirroredLayout> best;
  for (const Reflection reflection :
       {Reflection::kExchanged, Reflection::kFirstReversed, Reflection::kSecondReversed}) {
    const double mirrored = rms_after_shift(from, reflected(to, reflection));
    if (times_of(from.size()) * mirrored < as_given && (!best || mirrored < best->mirrored_m))
      best = MirroredLayout{reflection, mirrored, as_given};
  }
  return best;
}

}  // namespace megablock
