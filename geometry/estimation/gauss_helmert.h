// Solves least squares for equations that contain several observations, all with errors (the Gauss-Helmert model, also
// called condition adjustment with unknowns; Kalantari 2009, chapter 5). Typical uses are a similarity between two sets
// of measured points and the direction that measured planes have in common.
//
// The unknowns x and the observations l with covariance S satisfy f(x, l + v) = 0 and, where there are constraints,
// g(x) = 0. Sought are the x and the corrections v for which v' S^-1 v is least. Linearised at x0 and l0 = l + v0, with
// A = df/dx, B = df/dl and C = dg/dx:
//
//     A dx + B v = b,     b = -f(x0, l0) - B (l - l0),     C dx = -g(x0)
//     N = (B S B')^-1
//     | A'NA  C' | |dx|   | A'Nb |
//     | C     0  | |k | = | -g   |,     v = S c,  c = B'N (b - A dx),     v' S^-1 v = (b - A dx)' N (b - A dx)
//
// Each iteration moves both x and l0. The b above refers to the original observations l, not to l0; this makes the
// iteration converge to the minimum, where another b would make it stop at a point that depends on the path.
//
// S is never inverted. It may be singular, as the covariance of a unit vector is, as long as B S B' is regular.
//
// The covariance of x is the upper left block of the inverse of the bordered matrix. Where S is known only up to a
// factor, multiply it by the variance factor weighted_squares / redundancy.
//
// The observations come in groups that are independent of one another, each with its own equations; B S B' is then
// block diagonal, and only small blocks are inverted. Correlated observations must be in one group.
//
// The iteration ends when a step moves unknowns and observations together by less than `step_sigmas`, measured in their
// own standard deviations: dx' A'NA dx + sum (c - c0)' S (c - c0). It also ends when a small step does not get shorter
// any more, which is the effect of rounding.
//
// A model states the numbers of unknowns, equations and observations, and evaluates the equations:
//
//     struct Model {
//       static constexpr int kUnknowns, kEquations, kMeasurements;   // the last two of one group
//       static constexpr int kConstraints;                           // may be 0
//       using State = ...;                                           // where x lives; steps are tangent vectors of it
//       void linearise(const State&, const Measured& l, std::size_t group, GroupEquations<Model>& out) const;
//       void move(State&, const Step& dx) const;
//       void constrain(const State&, ConstraintEquations<Model>& out) const;   // where kConstraints > 0
//     };
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

namespace megablock {

// Value f and derivatives A and B of the equations of one group; the model fills it in.
template <typename Model>
struct GroupEquations {
  Eigen::Matrix<double, Model::kEquations, 1> value;
  Eigen::Matrix<double, Model::kEquations, Model::kUnknowns> by_unknowns;
  Eigen::Matrix<double, Model::kEquations, Model::kMeasurements> by_measurements;
};
// Value g and derivative C of the constraints.
template <typename Model>
struct ConstraintEquations {
  Eigen::Matrix<double, Model::kConstraints, 1> value;
  Eigen::Matrix<double, Model::kConstraints, Model::kUnknowns> by_unknowns;
};

struct GaussHelmertOptions {
  int max_iterations = 50;
  double step_sigmas = 1e-6;  // a step shorter than this, in standard deviations, ends the iteration
};

// Result of an adjustment.
template <typename Model>
struct GaussHelmertFit {
  using Measured = Eigen::Matrix<double, Model::kMeasurements, 1>;

  typename Model::State state;
  Eigen::Matrix<double, Model::kUnknowns, Model::kUnknowns> covariance;
  std::vector<Measured> corrections;  // v, one for each group
  double weighted_squares = 0;        // v' S^-1 v
  std::int64_t redundancy = 0;
  int iterations = 0;
};

// Covariance J Sigma J' of y = h(x), with the derivatives J = dh/dx, made exactly symmetric.
template <typename Jacobian, typename Covariance>
auto propagated(const Eigen::MatrixBase<Jacobian>& j, const Eigen::MatrixBase<Covariance>& covariance) {
  constexpr int kRows = Jacobian::RowsAtCompileTime;
  const Eigen::Matrix<double, kRows, kRows> result = j * covariance * j.transpose();
  return Eigen::Matrix<double, kRows, kRows>(0.5 * (result + result.transpose()));
}

namespace gauss_helmert {

template <typename Model>
struct Group {
  GroupEquations<Model> at;
  Eigen::Matrix<double, Model::kEquations, Model::kEquations> weight;  // N
  Eigen::Matrix<double, Model::kEquations, 1> right;                   // b
  Eigen::Matrix<double, Model::kMeasurements, 1> c;
};

}  // namespace gauss_helmert

// Adjusts from the approximation `start`. `covariances` holds the covariance S of the observations of each group, or a
// single one for all groups. Empty where the observations do not determine the unknowns (fewer equations than unknowns,
// dependent equations), where an equation contains no error, where a value is not finite, and where the iteration does
// not converge.
template <typename Model>
std::optional<GaussHelmertFit<Model>> fit_gauss_helmert(
    const Model& model, const typename Model::State& start,
    std::span<const Eigen::Matrix<double, Model::kMeasurements, 1>> measured,
    std::span<const Eigen::Matrix<double, Model::kMeasurements, Model::kMeasurements>> covariances,
    const GaussHelmertOptions& options = {}) {
  constexpr int kU = Model::kUnknowns, kE = Model::kEquations, kM = Model::kMeasurements, kC = Model::kConstraints;
  constexpr int kAll = kU + kC;
  using Bordered = Eigen::Matrix<double, kAll, kAll>;
  const auto covariance_of = [&](std::size_t i) -> const auto& { return covariances[covariances.size() == 1 ? 0 : i]; };

  GaussHelmertFit<Model> fit{start, {}, {}, 0, 0, 0};
  fit.redundancy = static_cast<std::int64_t>(measured.size()) * kE + kC - kU;
  if (fit.redundancy < 0 || (covariances.size() != 1 && covariances.size() != measured.size())) return std::nullopt;
  std::vector<gauss_helmert::Group<Model>> groups(measured.size());
  for (auto& group : groups) group.c.setZero();
  double previous_step = std::numeric_limits<double>::infinity();
  for (fit.iterations = 1; fit.iterations <= options.max_iterations; ++fit.iterations) {
    Bordered matrix = Bordered::Zero();
    Eigen::Matrix<double, kAll, 1> right = Eigen::Matrix<double, kAll, 1>::Zero();
    for (std::size_t i = 0; i < groups.size(); ++i) {
      auto& g = groups[i];
      const Eigen::Matrix<double, kM, 1> correction = covariance_of(i) * g.c;
      model.linearise(fit.state, measured[i] + correction, i, g.at);
      const auto& [value, a, b] = g.at;
      const Eigen::Matrix<double, kE, kE> variance = b * covariance_of(i) * b.transpose();
      g.weight = variance.inverse();
      if (!g.weight.allFinite()) return std::nullopt;  // an equation without error, or a value that is not finite
      g.right = b * correction - value;
      const Eigen::Matrix<double, kU, kE> weighted = a.transpose() * g.weight;
      matrix.template topLeftCorner<kU, kU>() += weighted * a;
      right.template head<kU>() += weighted * g.right;
    }
    const Eigen::Matrix<double, kU, kU> normal = matrix.template topLeftCorner<kU, kU>();
    if constexpr (kC > 0) {
      ConstraintEquations<Model> constraint;
      model.constrain(fit.state, constraint);
      matrix.template bottomLeftCorner<kC, kU>() = constraint.by_unknowns;
      matrix.template topRightCorner<kU, kC>() = constraint.by_unknowns.transpose();
      right.template tail<kC>() = -constraint.value;
    }
    if (!matrix.allFinite() || !right.allFinite()) return std::nullopt;

    // The unknowns have different units, and the constraints others again. Scaling gives all of them the size one; only
    // then does a small pivot mean a dependent equation.
    Eigen::Matrix<double, kAll, 1> scale;
    const double largest = normal.diagonal().maxCoeff();
    if (!(largest > 0)) return std::nullopt;
    for (int k = 0; k < kU; ++k) scale(k) = 1 / std::sqrt(normal(k, k) > 1e-30 * largest ? normal(k, k) : largest);
    for (int k = kU; k < kAll; ++k) {
      const double size = matrix.row(k).template head<kU>().cwiseProduct(scale.template head<kU>().transpose()).norm();
      if (!(size > 0)) return std::nullopt;
      scale(k) = 1 / size;
    }
    Eigen::FullPivLU<Bordered> factor(scale.asDiagonal() * matrix * scale.asDiagonal());
    factor.setThreshold(1e-13);
    if (!factor.isInvertible()) return std::nullopt;
    const Bordered inverse = scale.asDiagonal() * factor.inverse() * scale.asDiagonal();
    const Eigen::Matrix<double, kU, 1> dx = (inverse * right).template head<kU>();

    double moved = dx.dot(normal * dx);
    fit.weighted_squares = 0;
    for (std::size_t i = 0; i < groups.size(); ++i) {
      auto& g = groups[i];
      const Eigen::Matrix<double, kE, 1> rest = g.right - g.at.by_unknowns * dx, weighted = g.weight * rest;
      const Eigen::Matrix<double, kM, 1> c = g.at.by_measurements.transpose() * weighted, change = c - g.c;
      moved += change.dot(covariance_of(i) * change);
      fit.weighted_squares += rest.dot(weighted);
      g.c = c;
    }
    const double step = std::sqrt(std::max(0.0, moved));
    if (!std::isfinite(step)) return std::nullopt;
    model.move(fit.state, dx);
    if (step < options.step_sigmas || (step < 1e-2 && step > 0.5 * previous_step)) {
      const Eigen::Matrix<double, kU, kU> covariance = inverse.template topLeftCorner<kU, kU>();
      fit.covariance = 0.5 * (covariance + covariance.transpose());
      fit.corrections.reserve(groups.size());
      for (std::size_t i = 0; i < groups.size(); ++i) fit.corrections.push_back(covariance_of(i) * groups[i].c);
      return fit;
    }
    previous_step = step;
  }
  return std::nullopt;
}

}  // namespace megablock
