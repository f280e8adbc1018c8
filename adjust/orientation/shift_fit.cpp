#include "adjust/orientation/shift_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include "geometry/numbers/decompositions.h"
#include "geometry/numbers/median.h"

namespace megablock {

namespace {

constexpr double kMadToSigma = 1.4826;
constexpr int kReweightings = 20;

// The similarity and the offsets of a division.
class ShiftFitter {
 public:
  ShiftFitter(const std::vector<AntennaPair>& pairs, const Division& division)
      : division_(division), weights_(pairs.size(), 1) {
    std::vector<double> sigmas;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      sigmas.push_back(pairs[i].sigma.minCoeff());
      if (division.group[i] >= 0) used_.push_back({i, static_cast<std::size_t>(division.group[i]), &pairs[i]});
    }
    least_m_ = 0.1 * median(std::move(sigmas));
    fitted_.residuals.assign(pairs.size(), Eigen::Vector3d::Zero());
  }

  std::optional<ShiftFit> run() {
    for (int iteration = 0; iteration < kReweightings; ++iteration)
      if (!solve()) return std::nullopt;
    measure();
    return std::move(fitted_);
  }

 private:
  struct Used {
    std::size_t row, group;
    const AntennaPair* pair;
  };

  void find_centroids() {
    const std::size_t groups = division_.names.size();
    in_block_.assign(groups, Eigen::Vector3d::Zero());
    observed_ = in_block_;
    std::vector<double> sum(groups, 0);
    for (const Used& used : used_) {
      sum[used.group] += weights_[used.row];
      in_block_[used.group] += weights_[used.row] * used.pair->in_block;
      observed_[used.group] += weights_[used.row] * used.pair->observed;
    }
    for (std::size_t g = 0; g < groups; ++g) in_block_[g] /= sum[g], observed_[g] /= sum[g];
  }

  // One solution with the present weights, and the weights of the next one.
  bool solve() {
    find_centroids();
    std::vector<Eigen::Vector3d> from, to;
    std::vector<double> weights;
    for (const Used& used : used_) {
      from.push_back(used.pair->in_block - in_block_[used.group]);
      to.push_back(used.pair->observed - observed_[used.group]);
      weights.push_back(weights_[used.row]);
    }
    keep_attitude(from, to, weights);
    auto turn = fit_similarity(from, to, weights);
    if (!turn) return false;
    turn->translation.setZero();
    std::vector<double> lengths;
    for (std::size_t i = 0; i < used_.size(); ++i) {
      const Eigen::Vector3d residual = to[i] - (*turn)(from[i]);
      fitted_.residuals[used_[i].row] = residual;
      lengths.push_back(residual.norm());
      weights_[used_[i].row] = 1 / std::max(lengths.back(), least_m_);
    }
    usual_m_ = median(std::move(lengths));
    fitted_.offsets.clear();
    for (std::size_t g = 0; g < observed_.size(); ++g)
      fitted_.offsets.push_back((observed_[g] - observed_[0]) - (*turn)(in_block_[g] - in_block_[0]));
    turn->translation = observed_[0] - (*turn)(in_block_[0]);
    fitted_.similarity = *turn;
    return true;
  }

  // Positions on a line do not tell the turn about it, and their errors would. Six further pairs say that the block
  // keeps its attitude, with the information that the errors feign.
  void keep_attitude(std::vector<Eigen::Vector3d>& from, std::vector<Eigen::Vector3d>& to,
                     std::vector<double>& weights) const {
    constexpr double kLeast = 1e-6;  // of the length
    double all = 0, squares = 0;
    for (std::size_t i = 0; i < from.size(); ++i) {
      all += weights[i];
      squares += weights[i] * from[i].squaredNorm();
    }
    const double length = std::sqrt(squares / all);
    const double weight = all * std::pow(std::max(usual_m_ / length, kLeast), 2) / 4;
    for (int axis = 0; axis < 3; ++axis)
      for (const double end : {-length, length}) {
        from.emplace_back(end * Eigen::Vector3d::Unit(axis));
        to.push_back(from.back());
        weights.push_back(weight);
      }
  }

  void measure() {
    for (int k = 0; k < 3; ++k) {
      std::vector<double> lengths;
      for (const Used& used : used_) lengths.push_back(std::abs(fitted_.residuals[used.row][k]));
      fitted_.mean[k] = std::accumulate(lengths.begin(), lengths.end(), 0.0) / static_cast<double>(lengths.size());
      fitted_.scatter[k] = kMadToSigma * median(std::move(lengths));
    }
  }

  const Division& division_;
  std::vector<Used> used_;                            // pairs of a group
  std::vector<double> weights_;                       // [pairs]
  double least_m_ = 0;                                // of a residual, for its weight
  double usual_m_ = 0;                                // median length of the residuals
  std::vector<Eigen::Vector3d> in_block_, observed_;  // [groups] centroids
  ShiftFit fitted_;
};

// Polynomials of the second order in the two directions in which the block extends most, [pairs x terms].
Eigen::MatrixXd bends(const std::vector<AntennaPair>& pairs) {
  constexpr std::size_t kFewestForBend = 12;  // positions
  const auto n = static_cast<Eigen::Index>(pairs.size());
  Eigen::MatrixX3d places(n, 3);
  for (Eigen::Index i = 0; i < n; ++i) places.row(i) = pairs[static_cast<std::size_t>(i)].in_block.transpose();
  places.rowwise() -= places.colwise().mean().eval();
  const SymmetricEigen3 spread = symmetric_eigen3(places.transpose() * places / static_cast<double>(n));
  std::array<int, 3> axes{0, 1, 2};
  std::ranges::sort(axes, std::ranges::greater(), [&](int axis) { return spread.values[axis]; });
  places /= std::sqrt(std::max(spread.values[axes[0]], 1e-12));
  const Eigen::ArrayXd u = places * spread.vectors.col(axes[0]), v = places * spread.vectors.col(axes[1]);
  Eigen::MatrixXd all(n, 6);
  all << Eigen::ArrayXd::Ones(n), u, v, u * u, u * v, v * v;
  return pairs.size() < kFewestForBend ? Eigen::MatrixXd(all.leftCols(1)) : all;
}

}  // namespace

std::optional<ShiftFit> fit_shifts(const std::vector<AntennaPair>& pairs, const Division& division) {
  return ShiftFitter(pairs, division).run();
}

Eigen::Vector3d mean_beside_bend(const std::vector<AntennaPair>& pairs, const std::vector<Eigen::Vector3d>& residuals) {
  constexpr double kRidge = 1e-9, kLeast = 1e-6;
  const Eigen::MatrixXd basis = bends(pairs);
  const auto n = static_cast<Eigen::Index>(pairs.size());
  Eigen::Vector3d means;
  for (int k = 0; k < 3; ++k) {
    Eigen::VectorXd along(n), weights = Eigen::VectorXd::Ones(n), left;
    for (Eigen::Index i = 0; i < n; ++i) along[i] = residuals[static_cast<std::size_t>(i)][k];
    for (int iteration = 0; iteration < kReweightings; ++iteration) {
      Eigen::MatrixXd normal = basis.transpose() * weights.asDiagonal() * basis;
      normal.diagonal().array() += kRidge * normal.trace();
      left = along - basis * solve_symmetric(normal, basis.transpose() * weights.asDiagonal() * along);
      weights = left.cwiseAbs().cwiseMax(kLeast).cwiseInverse();
    }
    means[k] = left.cwiseAbs().mean();
  }
  return means;
}

}  // namespace megablock
