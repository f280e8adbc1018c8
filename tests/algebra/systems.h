// Gives the polynomial systems of relative orientation and of similarities (M39, M47, M50), with random coefficients
// from the field.
#pragma once

#include <array>
#include <random>

#include "tests/algebra/ideal.h"

namespace megablock::algebra {

template <std::uint64_t P>
class Systems {
 public:
  using Poly = Polynomial<P>;
  using System = std::vector<Poly>;
  using Vector = std::array<Poly, 3>;
  using Matrix = std::array<Vector, 3>;

  explicit Systems(unsigned seed) : random_(seed) {}

  // Unknowns a b c d, Tx Ty Tz: unit quaternion and unit base.
  System five_points_quaternion() {
    variables_ = 7;
    const Vector t{x(4), x(5), x(6)};
    System system = coplanarities(5, quaternion(), t);
    system.push_back(x(0) * x(0) + x(1) * x(1) + x(2) * x(2) + x(3) * x(3) - number(1));
    system.push_back(square(t) - number(1));
    return system;
  }
  // Unknowns l m n, Tx Ty Tz: Thompson's rotation times 4 Delta, unit base.
  System five_points_thompson() {
    variables_ = 6;
    const Poly l = x(0), m = x(1), n = x(2), s = l * l + m * m + n * n, four = number(4) - s;
    const Matrix rotation{{{four + l * l * 2, l * m * 2 - n * 4, l * n * 2 + m * 4},
                           {l * m * 2 + n * 4, four + m * m * 2, m * n * 2 - l * 4},
                           {l * n * 2 - m * 4, m * n * 2 + l * 4, four + n * n * 2}}};
    const Vector t{x(3), x(4), x(5)};
    System system = coplanarities(5, rotation, t);
    system.push_back(square(t) - number(1));
    return system;
  }
  // Unknowns a b c d, s t: unit quaternion, stereographic base.
  System five_points_stereographic() {
    variables_ = 6;
    const Poly s = x(4), t = x(5);
    System system = coplanarities(5, quaternion(), {t * 2, s * 2, t * t + s * s - number(1)});
    system.push_back(x(0) * x(0) + x(1) * x(1) + x(2) * x(2) + x(3) * x(3) - number(1));
    return system;
  }
  // Unknowns Tx Ty Tz t: heading 2 atan t, unit base. `wrong`: the middle row of the rotation without its factor 1 +
  // t^2, as the thesis prints it.
  System three_points_vertical(bool wrong = false) {
    variables_ = 4;
    const Poly t = x(3), one = number(1), zero = number(0), plus = one + t * t, minus = one - t * t;
    const Matrix rotation{{{minus, zero, t * -2}, {zero, wrong ? one : plus, zero}, {t * 2, zero, minus}}};
    const Vector base{x(0), x(1), x(2)};
    System system = coplanarities(3, rotation, base);
    system.push_back(square(base) - one);
    return system;
  }
  // Unknowns a b c lambda: Cayley's rotation and scale from the coordinates of two points and the height of a third.
  System similarity() {
    variables_ = 4;
    std::array<Vector, 3> from, to;
    for (auto& point : from) point = random_vector();
    for (auto& point : to) point = random_vector();
    // e - lambda d - v x (e + lambda d) for a side d, e.
    const auto side = [&](std::size_t i, std::size_t j) {
      Vector d, e, sum, result;
      for (std::size_t k = 0; k < 3; ++k) {
        d[k] = (from[j][k] - from[i][k]) * x(3);
        e[k] = to[j][k] - to[i][k];
        sum[k] = d[k] + e[k];
      }
      for (std::size_t k = 0; k < 3; ++k) {
        const std::size_t l = (k + 1) % 3, m = (k + 2) % 3;
        result[k] = e[k] - d[k] - (x(static_cast<int>(l)) * sum[m] - x(static_cast<int>(m)) * sum[l]);
      }
      return result;
    };
    const Vector km = side(0, 1), kn = side(0, 2), mn = side(1, 2);
    return {km[0], km[1], kn[2], mn[2]};
  }

 private:
  Poly x(int i) const { return Poly::variable(i, variables_); }
  Poly number(std::int64_t value) const { return Poly::constant(value, variables_); }
  Poly square(const Vector& v) const { return v[0] * v[0] + v[1] * v[1] + v[2] * v[2]; }
  Vector random_vector() {
    Vector v;
    for (Poly& c : v) c = number(static_cast<std::int64_t>(1 + random_() % (P - 1)));
    return v;
  }
  Matrix quaternion() const {
    const Poly a = x(0), b = x(1), c = x(2), d = x(3), aa = a * a, bb = b * b, cc = c * c, dd = d * d;
    return {{{aa + bb - cc - dd, (b * c - d * a) * 2, (b * d + c * a) * 2},
             {(b * c + d * a) * 2, aa - bb + cc - dd, (c * d - b * a) * 2},
             {(b * d - c * a) * 2, (c * d + b * a) * 2, aa - bb - cc + dd}}};
  }
  // second' [t]x R first = 0.
  System coplanarities(int count, const Matrix& rotation, const Vector& t) {
    System system;
    for (int i = 0; i < count; ++i) {
      const Vector first = random_vector(), second = random_vector();
      Vector turned;
      for (std::size_t k = 0; k < 3; ++k)
        turned[k] = rotation[k][0] * first[0] + rotation[k][1] * first[1] + rotation[k][2] * first[2];
      Poly sum;
      for (std::size_t k = 0; k < 3; ++k) {
        const std::size_t l = (k + 1) % 3, m = (k + 2) % 3;
        sum = sum + second[k] * (t[l] * turned[m] - t[m] * turned[l]);
      }
      system.push_back(sum);
    }
    return system;
  }

  std::mt19937_64 random_;
  int variables_ = 0;
};

}  // namespace megablock::algebra
