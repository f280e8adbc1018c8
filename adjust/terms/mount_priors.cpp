// Defines the terms for priors of mounts: r = Log(R R_0') / sigma (radians), (C - C_0) / sigma (metres, in the rig).
//
// The tile of the first oriented image with the mount owns them. Their information about the scale is not given here:
// it depends on the other mounts of the rig (similarity_information.h).
#include "adjust/terms/automatic_terms.h"
#include "adjust/terms/linearise.h"
#include "adjust/terms/rotation_difference.h"
#include "adjust/terms/terms.h"

namespace megablock {

MountResidual linearise_mount(const Pose& mount, const TileProblem::MountTerm& term) {
  const double rotation_weight = 1 / term.rotation_sigma_rad, position_weight = 1 / term.position_sigma_m;
  const RotationDifference difference = rotation_difference(mount.rotation, term.value.rotation);
  MountResidual result;
  result.residual << rotation_weight * difference.value, position_weight * (mount.centre - term.value.centre);
  result.by_mount.setZero();
  result.by_mount.topLeftCorner<3, 3>() = rotation_weight * difference.by_rotation;
  result.by_mount.bottomRightCorner<3, 3>() = position_weight * Eigen::Matrix3d::Identity();
  return result;
}

namespace {

class MountPriors final : public ObservationType {
 public:
  std::size_t count(const TileProblem& problem) const override { return problem.mount_priors.size(); }
  TermUnknowns unknowns(const TileProblem& problem, std::size_t row) const override {
    TermUnknowns unknowns;
    unknowns.mounts[0] = problem.mount_priors[row].mount;
    return unknowns;
  }
  void linearise(const TileProblem& problem, const TileState& state, std::size_t row,
                 const TermVisit& visit) const override {
    const TileProblem::MountTerm& term = problem.mount_priors[row];
    const MountResidual r = linearise_mount(state.mounts[static_cast<std::size_t>(term.mount)], term);
    LinearTerm out;
    out.set_residual(r.residual);
    out.kinds.fill(ObservationKind::kMount);
    out.add_block(LinearTerm::By::kMount, term.mount, r.by_mount);
    visit(out);
  }
  ceres::CostFunction* automatic(const TileProblem& problem, std::size_t row) const override {
    return automatic_term<6, kPoseBlock>(residual::MountKnown{problem.mount_priors[row]});
  }
};

}  // namespace

const ObservationType& mount_priors() {
  static const MountPriors type;
  return type;
}

}  // namespace megablock
