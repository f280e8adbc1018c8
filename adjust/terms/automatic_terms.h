// Makes a cost function of Ceres from a residual of ceres_residuals.h, by automatic differentiation.
#pragma once

#include <ceres/autodiff_cost_function.h>
#include <ceres/dynamic_autodiff_cost_function.h>

#include <utility>
#include <vector>

#include "adjust/terms/ceres_residuals.h"

namespace megablock {

// The template parameters are the number of residuals, then the sizes of the blocks.
template <int kResiduals, int... kBlocks, typename Functor>
ceres::CostFunction* automatic_term(Functor functor) {
  return new ceres::AutoDiffCostFunction<Functor, kResiduals, kBlocks...>(new Functor(std::move(functor)));
}

// For sizes that are known at run time; the functor takes an array of blocks.
template <typename Functor>
ceres::CostFunction* automatic_dynamic_term(Functor functor, int residuals, const std::vector<int>& blocks) {
  auto* cost = new ceres::DynamicAutoDiffCostFunction<Functor, 8>(new Functor(std::move(functor)));
  for (const int size : blocks) cost->AddParameterBlock(size);
  cost->SetNumResiduals(residuals);
  return cost;
}

}  // namespace megablock
