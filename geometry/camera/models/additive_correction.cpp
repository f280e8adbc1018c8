#include "geometry/camera/models/additive_correction.h"

#include <array>
#include <cstdlib>
#include <numbers>

namespace megablock {

namespace {

constexpr int kHighestOrder = 6;

// Whether the term x^i y^j belongs to a component; see the head of the header for those that are left out.
bool belongs(int component, int i, int j) {
  if (component == 1 && i + j == 1) return false;
  return i + j >= 1 && !(i == 1 && j == 1);
}

std::vector<CorrectionTerm> make_terms(AdditiveBasis basis, int n) {
  std::vector<CorrectionTerm> terms;
  for (int component = 0; component < 2; ++component) {
    if (basis == AdditiveBasis::kFourier) {
      for (int i = 0; i <= n; ++i)
        for (int j = i == 0 ? 1 : -n; j <= n; ++j)
          for (const bool sine : {false, true}) terms.push_back({component, i, j, sine});
    } else {
      for (int degree = 1; degree <= n; ++degree)
        for (int j = 0; j <= degree; ++j)
          if (belongs(component, degree - j, j)) terms.push_back({component, degree - j, j});
    }
  }
  return terms;
}

// Component, function, powers or frequencies, as "x20", "y11", "xc10", "ys2m1".
std::string term_name(AdditiveBasis basis, const CorrectionTerm& t) {
  std::string name = t.component == 0 ? "x" : "y";
  if (basis == AdditiveBasis::kFourier) name += t.sine ? "s" : "c";
  for (const int power : {t.i, t.j}) name += (power < 0 ? "m" : "") + std::to_string(std::abs(power));
  return name;
}

// Values and derivatives of x^i or of the Legendre polynomial P_i(x), i = 0 to n.
struct Basis {
  std::array<double, kHighestOrder + 1> value{}, slope{};
  Basis(AdditiveBasis basis, int n, double x) {
    value[0] = 1;
    for (int i = 0; i < n; ++i) {
      const auto at = static_cast<std::size_t>(i);
      if (basis == AdditiveBasis::kPowers || i == 0) {
        value[at + 1] = x * value[at];
        slope[at + 1] = (i + 1) * value[at];
      } else {  // (i + 1) P_(i+1) = (2i + 1) x P_i - i P_(i-1),  P'_(i+1) = P'_(i-1) + (2i + 1) P_i
        value[at + 1] = ((2 * i + 1) * x * value[at] - i * value[at - 1]) / (i + 1);
        slope[at + 1] = slope[at - 1] + (2 * i + 1) * value[at];
      }
    }
  }
};

// A function with its derivatives by x and y.
struct ValueAndSlopes {
  double value, by_x, by_y;
};

ValueAndSlopes polynomial_value(const CorrectionTerm& t, const Basis& x, const Basis& y) {
  const auto i = static_cast<std::size_t>(t.i), j = static_cast<std::size_t>(t.j);
  return {x.value[i] * y.value[j], x.slope[i] * y.value[j], x.value[i] * y.slope[j]};
}

ValueAndSlopes fourier_value(const CorrectionTerm& t, double x, double y) {
  constexpr double kHalfPi = std::numbers::pi / 2;
  const double phase = kHalfPi * (t.i * x + t.j * y), c = std::cos(phase), s = std::sin(phase);
  const double slope = kHalfPi * (t.sine ? c : -s);
  return {t.sine ? s : c, t.i * slope, t.j * slope};
}

}  // namespace

const std::vector<CorrectionTerm>& correction_terms(AdditiveBasis basis, int order) {
  using Tables = std::array<std::array<std::vector<CorrectionTerm>, kHighestOrder + 1>, 3>;
  static const Tables tables = [] {
    Tables all;
    for (int b = 0; b < 3; ++b)
      for (int n = 1; n <= kHighestOrder; ++n) all[b][n] = make_terms(static_cast<AdditiveBasis>(b), n);
    return all;
  }();
  return tables[static_cast<std::size_t>(basis)][static_cast<std::size_t>(order)];
}

std::vector<CameraParameter> additive_parameters(AdditiveBasis basis, int order) {
  std::vector<CameraParameter> all = common_parameters();
  for (const char* name : {"width", "height"})
    all.push_back({name, ParameterRole::kImageSize, ParameterUnit::kPixels, 0, true});
  for (const CorrectionTerm& t : correction_terms(basis, order))
    all.push_back({term_name(basis, t), ParameterRole::kAdditive, ParameterUnit::kPixels, t.i + std::abs(t.j)});
  return all;
}

Correction additive_correction(AdditiveBasis basis, int order, const double* k, const Eigen::Vector2d& pixel,
                               bool by_parameters) {
  const std::vector<CorrectionTerm>& terms = correction_terms(basis, order);
  Correction c;
  if (by_parameters) c.by_parameters.setZero(2, kCorrectionTerms + static_cast<int>(terms.size()));
  const double free_x = 2 * pixel.x() / k[kImageWidth] - 1, free_y = 2 * pixel.y() / k[kImageHeight] - 1;
  const double x = detail::within_extent(free_x), y = detail::within_extent(free_y);
  // Derivatives of the scaled coordinates; zero where these are held at the border.
  const double scale_x = x == free_x ? 2 / k[kImageWidth] : 0, scale_y = y == free_y ? 2 / k[kImageHeight] : 0;
  const bool fourier = basis == AdditiveBasis::kFourier;
  const Basis basis_x(basis, fourier ? 0 : order, x), basis_y(basis, fourier ? 0 : order, y);
  int p = kCorrectionTerms;
  for (const CorrectionTerm& t : terms) {
    const ValueAndSlopes v = fourier ? fourier_value(t, x, y) : polynomial_value(t, basis_x, basis_y);
    c.value[t.component] += k[p] * v.value;
    c.by_pixel(t.component, 0) += k[p] * v.by_x * scale_x;
    c.by_pixel(t.component, 1) += k[p] * v.by_y * scale_y;
    if (by_parameters) c.by_parameters(t.component, p) = v.value;
    ++p;
  }
  return c;
}

}  // namespace megablock
