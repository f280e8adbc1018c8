#include "geometry/vanishing/vanishing_circles.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "geometry/estimation/gauss_helmert.h"
#include "geometry/numbers/binomial.h"
#include "geometry/numbers/decompositions.h"
#include "geometry/numbers/median.h"

namespace megablock {

namespace {

// |K - H| - |K|, in the form that does not cancel (see the head of vanishing_circles.h).
double circle_residual(const Eigen::Vector2d& centre, const Eigen::Vector2d& foot) {
  return (foot.squaredNorm() - 2 * centre.dot(foot)) / ((centre - foot).norm() + centre.norm());
}

// A vanishing point P = e / c, given by its direction e = (cos phi, sin phi) from the origin and the inverse c of its
// distance, which passes through zero where P passes through infinity. With u = c |H|^2 - e'H and g = e - 2 c H, where
// |g|^2 = 1 + 4 c u, the residual is 2 u / (|g| + 1), up to the sign of c; its differential is (du - residual^2
// dc) / |g|.
//
// The observations are (theta, rho) of the line, with H = rho (-sin theta, cos theta). Where a foot is close to its
// vanishing point, a turn of the line moves it along the circle by more than the range in which the circle is straight;
// a covariance of H would be misleading.
struct CircleEquation {
  static constexpr int kUnknowns = 2, kEquations = 1, kMeasurements = 2, kConstraints = 0;
  using State = Eigen::Vector2d;  // phi, c
  void linearise(const State& state, const Eigen::Vector2d& line, std::size_t,
                 GroupEquations<CircleEquation>& out) const {
    const Eigen::Vector2d along(std::cos(line(0)), std::sin(line(0))), across(-along.y(), along.x());
    const Eigen::Vector2d e(std::cos(state(0)), std::sin(state(0))), turned(-e.y(), e.x()), foot = line(1) * across;
    const Eigen::Vector2d g = e - 2 * state(1) * foot;
    const double length = g.norm(), residual = 2 * (state(1) * foot.squaredNorm() - e.dot(foot)) / (length + 1);
    out.value(0) = residual;
    out.by_unknowns << -turned.dot(foot) / length, (foot.squaredNorm() - residual * residual) / length;
    out.by_measurements << line(1) * g.dot(along) / length, -g.dot(across) / length;
  }
  void move(State& state, const Eigen::Vector2d& step) const { state += step; }

  // P in pixels, and P with its covariance propagated from (phi, c).
  static Eigen::Vector2d pixel(const State& state) {
    return Eigen::Vector2d(std::cos(state(0)), std::sin(state(0))) / state(1);
  }
  static ImagePoint point(const State& state, const Eigen::Matrix2d& covariance) {
    const Eigen::Vector2d p = pixel(state);
    Eigen::Matrix2d by_state;
    by_state << -p.y(), -p.x() / state(1), p.x(), -p.y() / state(1);
    return {p, propagated(by_state, covariance)};
  }
};

// Algebraic fit: the null vector (w, w P) of the rows [|H|^2, -H']. Each row is divided by the standard deviation that
// the errors of the line give |H|^2 - P'H with the previous P. In the first round it is divided by |H|, which makes the
// residual the distance rho - n'P. Returns the state of CircleEquation.
std::optional<Eigen::Vector2d> null_vector_fit(std::span<const LineFoot> feet, int rounds) {
  if (feet.size() < 2) return std::nullopt;
  double size = 0;
  for (const LineFoot& foot : feet) size += foot.point.norm() / static_cast<double>(feet.size());
  if (!(size > 0) || !std::isfinite(size)) return std::nullopt;
  // H is counted in units of its mean length, which makes the three columns comparable.
  Eigen::Vector3d solution;
  for (int round = 0; round < rounds; ++round) {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (const LineFoot& foot : feet) {
      const Eigen::Vector2d h = foot.point / size;
      const Eigen::Vector3d row(h.squaredNorm(), -h.x(), -h.y());
      double variance = h.squaredNorm();
      if (round > 0) {
        const Eigen::Vector2d by_foot = 2 * solution(0) * h - solution.tail<2>();
        variance = by_foot.dot(foot.covariance * by_foot);
      }
      if (variance > 0) sum += row * row.transpose() / variance;
    }
    if (!sum.allFinite()) return std::nullopt;
    const SymmetricEigen3 eigen = symmetric_eigen3(sum);
    if (!(eigen.values(1) > 1e-14 * eigen.values(2))) return std::nullopt;
    solution = eigen.vectors.col(0);
  }
  const double away = solution.tail<2>().norm();
  if (!solution.allFinite() || !(away > 1e-9 * std::abs(solution(0)))) return std::nullopt;
  return Eigen::Vector2d(std::atan2(solution(2), solution(1)), solution(0) / away / size);
}

// A line closer to the origin than this may pass on either side of it, and then its foot is meaningless.
bool is_clear_of_origin(const ImageLine& line) {
  return std::abs(line.rho) > 3 * std::sqrt(std::max(0.0, line.covariance(1, 1)));
}

// Feet of the lines that are clear of the origin.
std::vector<LineFoot> feet_of(std::span<const ImageLine> lines) {
  std::vector<LineFoot> feet;
  for (const ImageLine& line : lines)
    if (is_clear_of_origin(line)) feet.push_back(foot_of(line));
  return feet;
}

// The larger half axis of an error ellipse.
double larger_half_axis(const Eigen::Matrix2d& c) {
  const double sum = c.trace(), difference = std::hypot(c(0, 0) - c(1, 1), 2 * c(0, 1));
  return std::sqrt(0.5 * (sum + difference));
}

// Probability that an arbitrary line lies in the band of the circle: the share of theta in (0, 2 pi) and rho in (0,
// reach) with rho |rho - n'P| < band |P|.
double share_of_band(const Eigen::Vector2d& point, double band, double reach) {
  constexpr int kDirections = 64;
  const double limit = band * point.norm();
  double share = 0;
  const auto covered = [&](double from, double to) {
    return std::max(0.0, std::min(to, reach) - std::max(from, 0.0)) / reach;
  };
  for (int k = 0; k < kDirections; ++k) {
    const double angle = 2 * std::numbers::pi * (k + 0.5) / kDirections;
    const double c = std::cos(angle) * point.x() + std::sin(angle) * point.y();
    // -limit < rho^2 - c rho < limit: the interval between the roots of the upper bound, less the interval between the
    // roots of the lower bound, if it has any.
    const double outer = std::sqrt(c * c + 4 * limit), inner = c * c > 4 * limit ? std::sqrt(c * c - 4 * limit) : 0;
    share += covered(0.5 * (c - outer), 0.5 * (c + outer)) - covered(0.5 * (c - inner), 0.5 * (c + inner));
  }
  return share / kDirections;
}

struct FoundCircle {
  Eigen::Vector2d point;
  double log10_nfa;
  std::vector<int> lines;
};

// The search about one origin. `left` are the lines to use; `reach` is the largest rho in the image.
std::vector<FoundCircle> search_circles(const std::vector<LineFoot>& feet, std::vector<int> left, double reach,
                                        const CircleOptions& options) {
  std::vector<FoundCircle> found;
  std::vector<double> axes;
  for (const int i : left) axes.push_back(larger_half_axis(feet[static_cast<std::size_t>(i)].covariance));
  const double band = median(axes);
  std::mt19937_64 random(options.seed);
  const auto foot = [&](int i) -> const Eigen::Vector2d& { return feet[static_cast<std::size_t>(i)].point; };
  while (left.size() >= 5) {
    const std::size_t n = left.size();
    const std::size_t draws = std::max(n / 2, static_cast<std::size_t>(std::max(0, options.min_draws)));
    std::int64_t captured = 0;
    Eigen::Vector2d best = Eigen::Vector2d::Zero();
    for (std::size_t draw = 0; draw < draws; ++draw) {
      const int i = left[random() % n], j = left[random() % n];
      Eigen::Matrix2d rows;
      rows << foot(i).transpose(), foot(j).transpose();
      if (!(std::abs(rows.determinant()) > 1e-9 * foot(i).norm() * foot(j).norm())) continue;
      const Eigen::Vector2d point = rows.inverse() * Eigen::Vector2d(foot(i).squaredNorm(), foot(j).squaredNorm());
      std::int64_t count = 0;
      for (const int k : left) count += std::abs(circle_residual(0.5 * point, foot(k))) < band;
      if (count <= captured) continue;
      captured = count;
      best = point;
    }
    const auto lines = static_cast<double>(n);
    const double p = share_of_band(best, band, reach);
    const double log10_nfa =
        std::log10(lines * (lines - 1) / 2) + log10_binomial_tail(static_cast<std::int64_t>(n) - 2, captured - 2, p);
    if (!(captured >= 4 && log10_nfa < options.max_log10_nfa)) break;
    FoundCircle circle{best, log10_nfa, {}};
    for (int round = 0; round < 3; ++round) {
      std::vector<LineFoot> own;
      circle.lines.clear();
      for (const int k : left)
        if (std::abs(circle_residual(0.5 * circle.point, foot(k))) < 2 * band) {
          circle.lines.push_back(k);
          own.push_back(feet[static_cast<std::size_t>(k)]);
        }
      const auto refined = null_vector_fit(own, 3);
      if (!refined || !CircleEquation::pixel(*refined).allFinite()) break;
      circle.point = CircleEquation::pixel(*refined);
    }
    const std::size_t before = left.size();
    std::erase_if(left, [&](int k) {
      const double sigma = larger_half_axis(feet[static_cast<std::size_t>(k)].covariance);
      return std::abs(circle_residual(0.5 * circle.point, foot(k))) < std::max(2 * band, 3 * sigma);
    });
    if (left.size() == before) break;
    found.push_back(std::move(circle));
  }
  return found;
}

}  // namespace

std::optional<ImagePoint> fit_vanishing_circle(std::span<const ImageLine> lines) {
  const auto start = null_vector_fit(feet_of(lines), 3);
  if (!start) return std::nullopt;
  std::vector<Eigen::Vector2d> measured;
  std::vector<Eigen::Matrix2d> covariances;
  for (const ImageLine& line : lines) {
    if (!is_clear_of_origin(line)) continue;
    measured.emplace_back(line.theta, line.rho);
    covariances.push_back(line.covariance);
  }
  const auto fit = fit_gauss_helmert(CircleEquation(), *start, std::span<const Eigen::Vector2d>(measured),
                                     std::span<const Eigen::Matrix2d>(covariances));
  if (!fit) return std::nullopt;
  const ImagePoint point = CircleEquation::point(fit->state, fit->covariance);
  if (!point.pixel.allFinite() || !point.covariance.allFinite()) return std::nullopt;
  return point;
}

std::optional<Eigen::Vector2d> fit_vanishing_circle_algebraic(std::span<const ImageLine> lines) {
  const auto state = null_vector_fit(feet_of(lines), 1);
  if (!state || !CircleEquation::pixel(*state).allFinite()) return std::nullopt;
  return CircleEquation::pixel(*state);
}

std::vector<CirclePoint> find_vanishing_points_by_circles(std::span<const ImageLine> lines, int width, int height,
                                                          const CircleOptions& options) {
  const double diagonal = std::hypot(width, height);
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();
  std::vector<LineFoot> feet(lines.size());
  std::vector<FoundCircle> circles;
  for (int pass = 0; pass < 2; ++pass) {
    std::vector<int> usable;
    for (std::size_t i = 0; i < lines.size(); ++i) {
      const ImageLine& line = lines[i];
      if (!std::isfinite(line.theta) || !std::isfinite(line.rho) || !line.covariance.allFinite() ||
          !(std::sqrt(line.covariance(0, 0)) <= options.max_theta_sigma))
        continue;
      const ImageLine about = line_about(line, origin);
      if (!is_clear_of_origin(about) || !(std::abs(about.rho) > 0.02 * diagonal)) continue;
      feet[i] = foot_of(about);
      usable.push_back(static_cast<int>(i));
    }
    double reach = 0;
    for (const int x : {0, width})
      for (const int y : {0, height}) reach = std::max(reach, (Eigen::Vector2d(x, y) - origin).norm());
    circles = search_circles(feet, usable, reach, options);
    if (pass > 0 || circles.empty()) break;
    Eigen::Vector2d barycentre = Eigen::Vector2d::Zero();
    for (const FoundCircle& circle : circles)
      barycentre += (origin + 0.5 * circle.point) / static_cast<double>(circles.size());
    // A single circle of a distant vanishing point would move the origin far away, where all feet nearly coincide. So
    // the origin stays within two diagonals of the middle of the image.
    const Eigen::Vector2d middle(0.5 * width, 0.5 * height), away = barycentre - middle;
    origin = middle + away * std::min(1.0, 2 * diagonal / std::max(away.norm(), 1e-9));
  }
  std::vector<CirclePoint> points;
  for (const FoundCircle& circle : circles) {
    std::vector<ImageLine> own;
    for (const int i : circle.lines) own.push_back(line_about(lines[static_cast<std::size_t>(i)], origin));
    auto point = fit_vanishing_circle(own);
    if (!point) continue;
    point->pixel += origin;
    points.push_back({*point, circle.log10_nfa, circle.lines});
  }
  return points;
}

}  // namespace megablock
