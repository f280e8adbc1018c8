// Sets up the observations and unknowns of a tile as a ceres::Problem. The tile adjustment uses it with analytic
// derivatives, which are fast. The monolithic reference of merge/ uses it with automatic derivatives, and thus none of
// our linearisation code.
#pragma once

#include <ceres/problem.h>

#include <array>
#include <memory>
#include <utility>
#include <vector>

#include "adjust/terms/ceres_residuals.h"

namespace megablock {

struct CeresOptions {
  enum class Derivatives { kAutomatic, kAnalytic } derivatives = Derivatives::kAutomatic;
  // Masks of the estimated intrinsics, one per camera of the problem; empty = problem.camera_free.
  std::vector<ParameterMask> camera_free;
};

// Builds and owns the ceres::Problem and the parameter blocks. It holds only the active points and their kept
// observations; frames and cameras without any residual are not in the Ceres problem. Held parameters are constant as
// whole blocks, or as single intrinsics by a SubsetManifold. The datum is left as the observations give it (see
// datum.h).
class CeresTile {
 public:
  CeresTile(const TileProblem& problem, const TileState& state, const CeresOptions& options = {});
  CeresTile(const CeresTile&) = delete;
  CeresTile& operator=(const CeresTile&) = delete;
  ~CeresTile();

  ceres::Problem& problem() { return *ceres_; }
  double* frame(std::int64_t row) { return &values_[row * kPoseBlock]; }
  double* mount(std::int64_t row) { return &values_[mounts_begin_ + row * kPoseBlock]; }
  double* camera(std::int64_t row) { return &values_[camera_begin_[row]]; }
  double* point(std::int64_t row) { return &values_[points_begin_ + row * 3]; }

  bool is_point(const double* block) const;

  // The blocks with unknowns: frames, cameras, mounts and points, each in the order of its table. As parameter blocks
  // of ceres::Problem::EvaluateOptions they fix the order of the columns (tangent sizes: 6, free intrinsics, 6, 3).
  std::vector<double*> unknown_blocks();
  // The same without points.
  std::vector<double*> unknown_blocks_without_points();

  // Writes the values of the blocks to `state`. Points that take no part keep their values.
  void store(TileState& state);

 private:
  void add_images(const TileProblem& problem, const TileState& state, CeresOptions::Derivatives derivatives);
  void add_others(const TileProblem& problem);
  ceres::LossFunction* loss(const RobustLoss& loss);  // nullptr: no loss
  void hold_parameters(const TileProblem& problem, const TileState& state,
                       const std::vector<ParameterMask>& camera_free);
  bool unknown(const double* block) const;

  // Ceres orders blocks by their addresses. One allocation for all of them keeps the order, and with it the bits of the
  // result, the same every time: frames, mounts, cameras, points.
  std::int64_t frame_count_, mount_count_, camera_count_, point_count_;
  std::int64_t mounts_begin_;
  std::vector<std::int64_t> camera_begin_;  // [cameras]
  std::int64_t points_begin_;
  std::vector<double> values_;
  std::vector<std::uint8_t> point_used_;
  PoseManifold pose_manifold_;
  std::vector<std::unique_ptr<ceres::Manifold>> camera_manifolds_;
  std::vector<std::pair<RobustLoss, std::unique_ptr<ceres::LossFunction>>> losses_;
  std::unique_ptr<ceres::Problem> ceres_;
};

}  // namespace megablock
