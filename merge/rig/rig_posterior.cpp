// The tile is condensed as in a merge, with the free mounts as its separator: frames, cameras and points are
// eliminated, and the update matrix is S + P over the mounts (rig_posterior.h). A free datum is held by the minimal
// constraints of gauge.h. They must not hold the scale, which would then seem to be observed. They do not, because the
// priors of free mounts give it: adjust/calibration/rig_observations.cpp keeps their sigmas below the extent of the
// rig.
//
// A unit vector g, in units U, is the growth of one rig. When the open directions contain it (squared cosine of at
// least kSame), the scale is undetermined. It is taken out of the open directions, so that mounts are not named for it,
// and on request out of the covariance, C -> (I - g g') C (I - g g').
#include "merge/rig/rig_posterior.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "adjust/terms/linearise.h"
#include "geometry/numbers/decompositions.h"
#include "merge/datum/condense_on.h"
#include "merge/tile/condense.h"

namespace megablock {

namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

std::int32_t mount_row(const TileProblem& problem, const UnknownId& id) {
  const MountId mount{RigIndex(id.index), id.part};
  return static_cast<std::int32_t>(std::lower_bound(problem.mounts.begin(), problem.mounts.end(), mount) -
                                   problem.mounts.begin());
}

// The update matrix unpacked, both triangles.
Eigen::MatrixXd full(const UpdateMatrix& update) {
  const auto n = static_cast<Eigen::Index>(update.diagonal.size());
  Eigen::MatrixXd matrix(n, n);
  std::size_t next = 0;
  for (Eigen::Index j = 0; j < n; ++j)
    for (Eigen::Index i = j; i < n; ++i) matrix(i, j) = matrix(j, i) = update.matrix[next++];
  return matrix;
}

// The information of the priors of the mounts, in the order of the update matrix.
Eigen::MatrixXd prior_information(const TileProblem& problem, const TileState& state, const UnknownList& mounts) {
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(6 * std::ssize(mounts), 6 * std::ssize(mounts));
  for (std::size_t u = 0; u < mounts.size(); ++u) {
    const std::int32_t row = mount_row(problem, mounts[u].id);
    for (const auto& term : problem.mount_priors) {
      if (term.mount != row) continue;
      const Matrix6 jacobian = linearise_mount(state.mounts[static_cast<std::size_t>(row)], term).by_mount;
      const auto first = static_cast<Eigen::Index>(6 * u);
      information.block<6, 6>(first, first) += jacobian.transpose() * jacobian;
    }
  }
  return information;
}

// The increments of the mounts at which a direction counts as undetermined, one for each scalar unknown.
Eigen::VectorXd units(std::size_t mounts) {
  constexpr double kOpenRotation = 5 * std::numbers::pi / 180, kOpenPosition = 0.1;  // rad, m
  Eigen::VectorXd unit(6 * static_cast<Eigen::Index>(mounts));
  for (Eigen::Index i = 0; i < unit.size(); ++i) unit(i) = i % 6 < 3 ? kOpenRotation : kOpenPosition;
  return unit;
}

// The unit directions in which the rigs grow about their references; increments are in the units above.
Eigen::MatrixXd scale_directions(const TileProblem& problem, const TileState& state, const UnknownList& mounts,
                                 const Eigen::VectorXd& unit) {
  Eigen::MatrixXd directions(unit.size(), 0);
  for (std::size_t first = 0; first < mounts.size();) {
    const std::int64_t rig = mounts[first].id.index;
    const auto reference = std::find_if(problem.mounts.begin(), problem.mounts.end(),
                                        [&](const MountId& id) { return id.rig.value == rig; });
    const Eigen::Vector3d origin = state.mounts[static_cast<std::size_t>(reference - problem.mounts.begin())].centre;
    Eigen::VectorXd growth = Eigen::VectorXd::Zero(unit.size());
    std::size_t u = first;
    for (; u < mounts.size() && mounts[u].id.index == rig; ++u)
      growth.segment<3>(static_cast<Eigen::Index>(6 * u + 3)) =
          state.mounts[static_cast<std::size_t>(mount_row(problem, mounts[u].id))].centre - origin;
    growth = growth.cwiseQuotient(unit);
    if (growth.norm() > 0) {
      directions.conservativeResize(Eigen::NoChange, directions.cols() + 1);
      directions.rightCols<1>() = growth.normalized();
    }
    first = u;
  }
  return directions;
}

}  // namespace

RigPosterior rig_posterior(const TileProblem& problem, const TileState& state, bool without_scale) {
  RigPosterior posterior;
  const UpdateMatrix update = condense_on(UnknownKind::kMount, problem, state);
  const UnknownList& mounts = update.unknowns;
  if (mounts.empty()) return posterior;
  const Eigen::MatrixXd prior = prior_information(problem, state, mounts);
  const Eigen::VectorXd unit = units(mounts.size());
  const Eigen::MatrixXd information = full(update);
  Eigen::MatrixXd covariance =  // in units
      inverse(unit.asDiagonal() * information * unit.asDiagonal());
  const SymmetricEigen eigen = symmetric_eigen(unit.asDiagonal() * (information - prior) * unit.asDiagonal());

  Eigen::Index open = 0;
  while (open < eigen.values.size() && eigen.values(open) < 1) ++open;
  Eigen::MatrixXd directions = eigen.vectors.leftCols(open);
  const Eigen::MatrixXd scales = scale_directions(problem, state, mounts, unit);
  constexpr double kSame = 0.8;  // squared cosine between a scale and the open directions
  for (Eigen::Index s = 0; s < scales.cols(); ++s) {
    const Eigen::VectorXd scale = scales.col(s), along = directions.transpose() * scale;
    if (along.squaredNorm() < kSame) continue;
    posterior.scale_determined = false;
    // The part of the open space along the scale goes; the columns are no basis any more, but their squares still add
    // up to the share of each mount.
    directions -= (directions * along.normalized()) * along.normalized().transpose();
    if (!without_scale) continue;
    covariance -= scale * (scale.transpose() * covariance);
    covariance -= (covariance * scale) * scale.transpose();
  }
  covariance = unit.asDiagonal() * covariance * unit.asDiagonal();
  constexpr double kPart = 0.25;  // squared share of an open direction that a mount must have to be named
  for (std::size_t u = 0; u < mounts.size(); ++u) {
    const auto first = static_cast<Eigen::Index>(6 * u);
    posterior.mounts.push_back({mount_row(problem, mounts[u].id), covariance.block<6, 6>(first, first),
                                directions.middleRows<3>(first).squaredNorm() < kPart,
                                directions.middleRows<3>(first + 3).squaredNorm() < kPart});
  }
  return posterior;
}

}  // namespace megablock
