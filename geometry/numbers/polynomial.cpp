#include "geometry/numbers/polynomial.h"

#include <cmath>

namespace megablock {

namespace {

struct Value {
  double f = 0, slope = 0, magnitude = 0;  // magnitude: sum of |c_i x^i|, which bounds the rounding error of f
};

Value value_of(std::span<const double> c, double x) {
  // Horner's scheme for the value, its derivative and the sum of magnitudes.
  Value v;
  for (std::size_t i = c.size(); i-- > 0;) {
    v.slope = v.slope * x + v.f;
    v.f = v.f * x + c[i];
    v.magnitude = v.magnitude * std::abs(x) + std::abs(c[i]);
  }
  return v;
}

// The root between `low` and `high`, where the values have different signs. Newton's step is taken where it stays
// inside the bracket, bisection otherwise. A step shorter than `settled` (relative to x) is the last.
double root_between(std::span<const double> c, double low, double high, bool rising, double settled) {
  double x = 0.5 * (low + high);
  for (int iteration = 0; iteration < 200; ++iteration) {
    double f = 0, slope = 0;
    for (std::size_t i = c.size(); i-- > 0;) {
      slope = slope * x + f;
      f = f * x + c[i];
    }
    if (f == 0) return x;
    ((f > 0) == rising ? high : low) = x;
    double next = x - f / slope;
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (std::abs(next - x) <= settled * std::abs(x) || next == low || next == high) return next;
    x = next;
  }
  return x;
}

// The roots of the polynomial itself are found to the last bit. The extrema only separate the roots, so they need less:
// the error of a value at an extremum grows with the square of the extremum's error, and Newton's last step leaves an
// error of about the square of that step.
constexpr double kRootSettled = 1e-16, kExtremumSettled = 1e-6;

// Rounding of a value, relative to the largest coefficient. The bound by the sum of magnitudes is not enough at a
// double root at zero, where all terms vanish.
constexpr double kRounding = 1e-14;

using Binomials = std::array<std::array<double, detail::kMaxDegree + 1>, detail::kMaxDegree + 1>;
constexpr Binomials kBinomials = [] {
  Binomials b{};
  for (std::size_t n = 0; n <= detail::kMaxDegree; ++n) {
    b[n][0] = 1;
    for (std::size_t k = 1; k <= n; ++k) b[n][k] = b[n - 1][k - 1] + (k < n ? b[n - 1][k] : 0);
  }
  return b;
}();

}  // namespace

double evaluate_polynomial(std::span<const double> c, double x) { return value_of(c, x).f; }

std::size_t detail::roots_within(std::span<const double> c, double low, double high, double double_root,
                                 double* roots) {
  // The loop runs over the derivatives from the one of degree 1 up to the polynomial itself. `roots` holds the roots of
  // the previous derivative, which are the extrema of the current one and split the interval into monotonic pieces.
  const std::size_t degree = c.size() - 1;
  // The derivative of order m, divided by m! to keep the coefficients small.
  std::array<double, kMaxDegree + 1> derivative;
  std::array<double, kMaxDegree + 1> places;  // ends of the monotonic pieces
  std::size_t count = 0;
  for (std::size_t k = 1; k <= degree; ++k) {
    const std::size_t order = degree - k;
    double largest = 0;
    for (std::size_t i = 0; i <= k; ++i) {
      derivative[i] = kBinomials[i + order][order] * c[i + order];
      largest = std::max(largest, std::abs(derivative[i]));
    }
    const std::span<const double> d(derivative.data(), k + 1);
    for (std::size_t i = 0; i < count; ++i) places[i] = roots[i];
    places[count] = high;
    const std::size_t intervals = count + 1;
    const double tolerance = k == degree ? double_root : kDoubleRoot;
    const double settled = k == degree ? kRootSettled : kExtremumSettled;
    count = 0;
    bool crossed = false;  // the sign changed in the piece before
    double start = low;
    Value left = value_of(d, low);
    for (std::size_t i = 0; i < intervals; ++i) {
      const Value right = value_of(d, places[i]);
      const bool crosses = (left.f < 0) != (right.f < 0);
      // An extremum that touches zero within rounding is a double root. It counts only if neither of the adjacent
      // pieces has a crossing, which would be the same root.
      if (i > 0 && !crossed && !crosses && std::abs(left.f) < tolerance * left.magnitude + kRounding * largest)
        roots[count++] = start;
      if (crosses) roots[count++] = root_between(d, start, places[i], left.f < 0, settled);
      crossed = crosses;
      start = places[i];
      left = right;
    }
  }
  return count;
}

}  // namespace megablock
