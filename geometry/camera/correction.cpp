// Derivatives of the corrections. Radial, with u = 1 px or f, rho = r/u, g = sum c_i rho^e_i:
//     d_q = g I + q q' (sum e_i c_i rho^(e_i - 2)) / u^2,   d_s = -d_q,   d_c_i = q rho^e_i,
//     d_f = -q/f sum e_i c_i rho^e_i   (u = f only)
#include "geometry/camera/correction.h"

#include <Eigen/LU>
#include <array>
#include <limits>
#include <numbers>

namespace megablock {

namespace {

using Kind = CameraModelKind;
constexpr int kHighestDegree = 6;

// Whether the term x^i y^j belongs to a component; see the head of correction.h for those that are left out.
bool belongs(int component, int i, int j) {
  if (component == 1 && i + j == 1) return false;
  return i + j >= 1 && !(i == 1 && j == 1);
}

std::vector<CorrectionTerm> make_terms(const CameraModel& model) {
  std::vector<CorrectionTerm> terms;
  const int n = model.order;
  for (int component = 0; component < 2; ++component) {
    if (model.kind == Kind::kFourier) {
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

// Term tables of all additive models, by kind and order.
class TermTables {
 public:
  TermTables() {
    for (const CameraModelForm& form : camera_model_forms())
      for (int order = form.lowest_order; order <= form.highest_order; ++order)
        if (const CameraModel model{form.kind, order}; is_additive(model)) table(model) = make_terms(model);
  }
  const std::vector<CorrectionTerm>& operator()(const CameraModel& model) const {
    return const_cast<TermTables*>(this)->table(model);
  }

 private:
  std::vector<CorrectionTerm>& table(const CameraModel& model) {
    return tables_[static_cast<std::size_t>(model.kind) - static_cast<std::size_t>(Kind::kPolynomial)]
                  [static_cast<std::size_t>(model.order)];
  }
  std::array<std::array<std::vector<CorrectionTerm>, kHighestDegree + 1>, 3> tables_;
};

void resize_parameters(const Intrinsics& k, bool wanted, Correction& c) {
  if (wanted) c.by_parameters.setZero(2, k.size());
}

Correction radial(const Intrinsics& k, const Eigen::Vector2d& pixel, bool parameters) {
  Correction c{Eigen::Vector2d::Zero(), Eigen::Matrix2d::Zero(), {}};
  resize_parameters(k, parameters, c);
  const Kind kind = k.model().kind;
  const double unit = kind == Kind::kIgnRadial ? 1 : k[kFocal];
  const Eigen::Vector2d q = pixel - Eigen::Vector2d(k[kSymmetryX], k[kSymmetryY]);
  const double rho2 = q.squaredNorm() / (unit * unit);
  if (!(rho2 > 0)) return c;
  double power = kind == Kind::kEvenRadial ? std::sqrt(rho2) : rho2;  // rho^e, e the exponent of the first term
  int exponent = kind == Kind::kEvenRadial ? 1 : 2;
  double g = 0, slope = 0;  // slope: sum e c rho^e
  for (int p = kRadialTerms; p < k.size(); ++p, power *= rho2, exponent += 2) {
    g += k[p] * power;
    slope += exponent * k[p] * power;
    if (parameters) c.by_parameters.col(p) = power * q;
  }
  c.value = g * q;
  c.by_pixel = (slope / q.squaredNorm()) * q * q.transpose();
  c.by_pixel.diagonal().array() += g;
  if (!parameters) return c;
  c.by_parameters.middleCols<2>(kSymmetryX) = -c.by_pixel;
  if (kind != Kind::kIgnRadial) c.by_parameters.col(kFocal) = -(slope / k[kFocal]) * q;
  return c;
}

// Values and derivatives of x^i or of the Legendre polynomial P_i(x), i = 0 to n.
struct Basis {
  std::array<double, kHighestDegree + 1> value{}, slope{};
  Basis(Kind kind, int n, double x) {
    value[0] = 1;
    for (int i = 0; i < n; ++i) {
      const auto at = static_cast<std::size_t>(i);
      if (kind == Kind::kPolynomial || i == 0) {
        value[at + 1] = x * value[at];
        slope[at + 1] = (i + 1) * value[at];
      } else {  // (i + 1) P_(i+1) = (2i + 1) x P_i - i P_(i-1),  P'_(i+1) = P'_(i-1) + (2i + 1) P_i
        value[at + 1] = ((2 * i + 1) * x * value[at] - i * value[at - 1]) / (i + 1);
        slope[at + 1] = slope[at - 1] + (2 * i + 1) * value[at];
      }
    }
  }
};

// A function of an additive correction with its derivatives by x and y.
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

Correction additive(const Intrinsics& k, const Eigen::Vector2d& pixel, bool parameters) {
  Correction c{Eigen::Vector2d::Zero(), Eigen::Matrix2d::Zero(), {}};
  resize_parameters(k, parameters, c);
  const CameraModel& model = k.model();
  const double free_x = 2 * pixel.x() / k[kImageWidth] - 1, free_y = 2 * pixel.y() / k[kImageHeight] - 1;
  const double x = detail::within_extent(free_x), y = detail::within_extent(free_y);
  // Derivatives of the scaled coordinates; zero where these are held at the border.
  const double scale_x = x == free_x ? 2 / k[kImageWidth] : 0, scale_y = y == free_y ? 2 / k[kImageHeight] : 0;
  const bool fourier = model.kind == Kind::kFourier;
  const Basis basis_x(model.kind, fourier ? 0 : model.order, x), basis_y(model.kind, fourier ? 0 : model.order, y);
  int p = kCorrectionTerms;
  for (const CorrectionTerm& t : correction_term_list(model)) {
    const ValueAndSlopes v = fourier ? fourier_value(t, x, y) : polynomial_value(t, basis_x, basis_y);
    c.value[t.component] += k[p] * v.value;
    c.by_pixel(t.component, 0) += k[p] * v.by_x * scale_x;
    c.by_pixel(t.component, 1) += k[p] * v.by_y * scale_y;
    if (parameters) c.by_parameters(t.component, p) = v.value;
    ++p;
  }
  return c;
}

}  // namespace

const std::vector<CorrectionTerm>& correction_term_list(const CameraModel& model) {
  static const TermTables tables;
  return tables(model);
}

Correction correction_with_jacobian(const Intrinsics& k, const Eigen::Vector2d& pixel) {
  return is_radial(k.model()) ? radial(k, pixel, true) : additive(k, pixel, true);
}

Correction correction_at(const Intrinsics& k, const Eigen::Vector2d& pixel) {
  return is_radial(k.model()) ? radial(k, pixel, false) : additive(k, pixel, false);
}

Eigen::Vector2d solve_correction(const Intrinsics& k, const Eigen::Vector2d& corrected) {
  constexpr int kMaxIterations = 30;
  // After a step of this length the error is its square times the curvature (far below 1 per pixel), that is rounding.
  constexpr double kLastStepPx = 1e-7;
  Eigen::Vector2d m = corrected;
  for (int i = 0; i < kMaxIterations; ++i) {
    const Correction c = correction_at(k, m);
    if (!keeps_orientation(c)) break;
    const Eigen::Matrix2d jacobian = Eigen::Matrix2d::Identity() + c.by_pixel;
    const Eigen::Vector2d step = jacobian.inverse() * (corrected - m - c.value);
    m += step;
    if (!m.allFinite()) break;
    if (step.squaredNorm() < kLastStepPx * kLastStepPx) return m;
  }
  return Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
}

}  // namespace megablock
