// Gives the simplest estimator for ransac.h: N unknowns c of y = c.x, from samples of N observations. With it, tests
// concern only the engine.
#pragma once

#include <Eigen/Dense>
#include <array>
#include <optional>
#include <random>
#include <vector>

#include "geometry/numbers/solutions.h"

namespace megablock {

// Observations with x in [-1, 1]^N. The y of an outlier lies anywhere in [-3, 3].
template <int N>
struct LinearModelScene {
  using Vector = Eigen::Matrix<double, N, 1>;
  Vector truth;
  std::vector<Vector> x;
  std::vector<double> y;

  // Exactly the share `outliers` of the observations are outliers.
  LinearModelScene(std::size_t count, double outliers, double noise, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> uniform(-1, 1);
    std::normal_distribution<double> normal(0, 1);
    const auto draw = [&] { return Vector::NullaryExpr([&] { return uniform(random); }).eval(); };
    truth = draw();
    const auto wrong = static_cast<std::size_t>(outliers * static_cast<double>(count) + 0.5);
    for (std::size_t i = 0; i < count; ++i) {
      x.push_back(draw());
      y.push_back(i < wrong ? 3 * uniform(random) : truth.dot(x[i]) + noise * normal(random));
    }
  }
};

template <int N>
class LinearModelEstimator {
 public:
  using Model = Eigen::Matrix<double, N, 1>;
  // The size is dynamic, up to eight, so that Eigen's decompositions are compiled once and not for every N.
  using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 8, 8>;
  static constexpr std::size_t kSampleSize = N;
  explicit LinearModelEstimator(const LinearModelScene<N>& scene) : scene_(&scene) {}
  std::size_t size() const { return scene_->x.size(); }
  double chance(double residual) const { return std::min(1.0, residual / 3); }

  Solutions<Model, 1> solve(const std::array<std::size_t, N>& rows) const {
    Square a(N, N);
    Eigen::VectorXd y(N);
    for (int i = 0; i < N; ++i) {
      a.row(i) = scene_->x[rows[static_cast<std::size_t>(i)]].transpose();
      y[i] = scene_->y[rows[static_cast<std::size_t>(i)]];
    }
    Solutions<Model, 1> found;
    const Eigen::FullPivLU<Square> lu(a);
    if (lu.isInvertible()) found.push_back(lu.solve(y));
    return found;
  }
  auto squared_residuals(const Model& c) const {
    return [this, c](std::size_t i) {
      const double r = c.dot(scene_->x[i]) - scene_->y[i];
      return r * r;
    };
  }
  std::optional<Model> refine(const Model& c, double threshold) const {
    const auto residual = squared_residuals(c);
    Square normal = Square::Zero(N, N);
    Eigen::VectorXd right = Model::Zero();
    for (std::size_t i = 0; i < size(); ++i) {
      if (!(residual(i) <= threshold * threshold)) continue;
      normal += scene_->x[i] * scene_->x[i].transpose();
      right += scene_->x[i] * scene_->y[i];
    }
    return Model(normal.ldlt().solve(right));
  }

 private:
  const LinearModelScene<N>* scene_;
};

}  // namespace megablock
