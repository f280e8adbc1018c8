#include "geometry/polynomial.h"

#include <algorithm>
#include <cmath>

namespace megablock {

namespace {

constexpr double kDoubleRoot = 1e-9;

struct Value {
  double f = 0, slope = 0, magnitude = 0;  // magnitude: sum of the terms' absolute values
};

Value value_of(std::span<const double> c, double x) {
  Value v;
  for (std::size_t i = c.size(); i-- > 0;) {
    v.slope = v.slope * x + v.f;
    v.f = v.f * x + c[i];
    v.magnitude = v.magnitude * std::abs(x) + std::abs(c[i]);
  }
  return v;
}

// The root between two places of different sign.
double root_between(std::span<const double> c, double low, double high) {
  const bool rising = value_of(c, high).f > 0;
  double x = 0.5 * (low + high);
  for (int iteration = 0; iteration < 200; ++iteration) {
    const Value v = value_of(c, x);
    if (v.f == 0) return x;
    ((v.f > 0) == rising ? high : low) = x;
    double next = x - v.f / v.slope;
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (std::abs(next - x) <= 1e-16 * std::abs(x) || next == low || next == high) return next;
    x = next;
  }
  return x;
}

}  // namespace

double evaluate_polynomial(std::span<const double> c, double x) { return value_of(c, x).f; }

std::vector<double> real_roots(std::span<const double> c) {
  const std::size_t degree = c.size() - 1;
  double largest = 0;
  for (const double value : c) largest = std::max(largest, std::abs(value));
  if (degree == 0 || !std::isfinite(largest) || !(std::abs(c[degree]) > 1e-12 * largest)) return {};
  if (degree == 1) return {-c[0] / c[1]};
  std::vector<double> derivative(degree);
  for (std::size_t i = 1; i <= degree; ++i) derivative[i - 1] = static_cast<double>(i) * c[i];
  std::vector<double> places = real_roots(derivative);
  const double bound = 1 + largest / std::abs(c[degree]);  // Cauchy's
  places.insert(places.begin(), -bound);
  places.push_back(bound);
  std::vector<double> roots;
  bool crossed = false;  // the sign changed in the interval before
  for (std::size_t i = 0; i + 1 < places.size(); ++i) {
    const Value left = value_of(c, places[i]), right = value_of(c, places[i + 1]);
    const bool crosses = (left.f < 0) != (right.f < 0);
    if (i > 0 && !crossed && !crosses && std::abs(left.f) < kDoubleRoot * left.magnitude) roots.push_back(places[i]);
    if (crosses) roots.push_back(root_between(c, places[i], places[i + 1]));
    crossed = crosses;
  }
  return roots;
}

}  // namespace megablock
