// The score of a point and its reduced normal equations, unknown by unknown: -J'r - Y z, and J'J - Y Y'
// (point_equations.h). They are for sums over clusters of points; the assembly of a front has kernels of its own.
#pragma once

#include "merge/tile/point_equations.h"

namespace megablock {

class ReducedPoint {
 public:
  // Takes point i of the present batch; call it after reduce(). `equations` outlives the object.
  ReducedPoint(const PointEquations& equations, std::size_t i) : equations_(equations), i_(i) {
    equations.blocks(i, blocks_);
  }

  // Calls add(unknown, part of the score), several times for an unknown.
  template <typename Add>
  void visit_score(const Add& add) {
    const PointEquations::Point& point = equations_.points()[i_];
    for (std::int64_t lane = point.first; lane < point.last; ++lane) {
      const Eigen::Vector2d residual = equations_.residual(lane);
      const int count = equations_.jacobians(lane, jacobians_);
      for (int k = 0; k < count; ++k) {
        const auto& block = jacobians_[static_cast<std::size_t>(k)];
        add(block.unknown, -block.jacobian.transpose() * residual);
      }
    }
    for (const PointEquations::Block& block : blocks_) add(block.unknown, -block.matrix() * equations_.z(i_));
  }

  // Calls add(unknown a, unknown b, part of the block a, b), for a, b and b, a, several times for a pair.
  template <typename Add>
  void visit_normal(const Add& add) {
    const PointEquations::Point& point = equations_.points()[i_];
    for (std::int64_t lane = point.first; lane < point.last; ++lane) {
      const int count = equations_.jacobians(lane, jacobians_);
      for (int k = 0; k < count; ++k)
        for (int l = 0; l < count; ++l) {
          const auto &a = jacobians_[static_cast<std::size_t>(k)], &b = jacobians_[static_cast<std::size_t>(l)];
          add(a.unknown, b.unknown, a.jacobian.transpose() * b.jacobian);
        }
    }
    // The list has a frame once for each of its groups, so that pairs of equal frames come twice.
    for (const PointEquations::Block& a : blocks_)
      for (const PointEquations::Block& b : blocks_) add(a.unknown, b.unknown, -a.matrix() * b.matrix().transpose());
  }

 private:
  const PointEquations& equations_;
  std::size_t i_;
  std::vector<PointEquations::Block> blocks_;
  std::array<JacobianBlock<IntrinsicJacobian>, 3> jacobians_;
};

}  // namespace megablock
