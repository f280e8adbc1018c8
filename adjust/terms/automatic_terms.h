// A residual of ceres_residuals.h as a cost function of Ceres, by automatic differentiation.
#pragma once

#include <ceres/autodiff_cost_function.h>
#include <ceres/dynamic_autodiff_cost_function.h>

#include <utility>
#include <vector>

#include "adjust/terms/ceres_residuals.h"

namespace megablock {

// The number of residuals, then the sizes of the blocks.
template <int kResiduals, int... kBlocks, typename Functor>
ceres::CostFunction* automatic_term(Functor functor) {
  return new ceres::AutoDiffCostFunction<Functor, kResiduals, kBlocks...>(new Functor(std::move(functor)));
}

// Sizes that are known when the program runs; the functor takes an array of blocks.
template <typename Functor>
ceres::CostFunction* automatic_dynamic_term(Functor functor, int residuals, const std::vector<int>& blocks) {
  auto* cost = new ceres::DynamicAutoDiffCostFunction<Functor, 8>(new Functor(std::move(functor)));
  for (const int size : blocks) cost->AddParameterBlock(size);
  cost->SetNumResiduals(residuals);
  return cost;
}

}  // namespace megablock
