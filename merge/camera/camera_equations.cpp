// The tile is condensed as in a merge, with the cameras as its separator. The update is S with the right-hand side b,
// and |z|^2, the decrease by everything that was eliminated. With c the weighted squares at the state, c_0 = c - |z|^2
// - b'S^-1 b and k_0 = k + S^-1 b. A datum that is free is held by minimal constraints; they do not touch the cameras,
// because a similarity changes no residual.
#include "merge/camera/camera_equations.h"

#include <algorithm>

#include "geometry/numbers/decompositions.h"
#include "merge/datum/condense_on.h"
#include "merge/tile/condense.h"

namespace megablock {

namespace {

Eigen::VectorXd present_values(const TileProblem& problem, const TileState& state) {
  std::vector<double> values;
  for (std::size_t c = 0; c < problem.cameras.size(); ++c)
    for (int p = 0; p < state.cameras[c].size(); ++p)
      if (contains(problem.camera_free[c], p)) values.push_back(state.cameras[c][static_cast<std::size_t>(p)]);
  return Eigen::Map<const Eigen::VectorXd>(values.data(), std::ssize(values));
}

// Parameters have units that differ by many orders of magnitude; the diagonal is scaled to one before any solution.
Eigen::VectorXd scale_of(const Eigen::MatrixXd& information) {
  return information.diagonal().unaryExpr([](double d) { return d > 0 ? 1 / std::sqrt(d) : 1.0; });
}

std::vector<Eigen::Index> rows_where(const std::vector<std::uint8_t>& flags, bool set) {
  std::vector<Eigen::Index> rows;
  for (std::size_t i = 0; i < flags.size(); ++i)
    if ((flags[i] != 0) == set) rows.push_back(static_cast<Eigen::Index>(i));
  return rows;
}

}  // namespace

double CameraForm::at(const Eigen::VectorXd& parameters) const {
  const Eigen::VectorXd d = parameters - minimum;
  return least + d.dot(information * d);
}

std::optional<CameraForm> condense_on_cameras(const TileProblem& problem, const TileState& state) {
  const UpdateMatrix update = condense_on(UnknownKind::kCamera, problem, state);
  CameraForm form;
  form.minimum = present_values(problem, state);
  const auto n = static_cast<Eigen::Index>(update.diagonal.size());
  if (n != form.minimum.size()) return std::nullopt;
  form.information.resize(n, n);
  std::size_t next = 0;
  for (Eigen::Index j = 0; j < n; ++j)
    for (Eigen::Index i = j; i < n; ++i) form.information(i, j) = form.information(j, i) = update.matrix[next++];
  const Eigen::VectorXd b = Eigen::Map<const Eigen::VectorXd>(update.rhs.data(), n);
  const Eigen::VectorXd scale = scale_of(form.information);
  const Eigen::VectorXd step =
      scale.asDiagonal() * solve_symmetric(scale.asDiagonal() * form.information * scale.asDiagonal(),
                                           Eigen::VectorXd(scale.asDiagonal() * b));
  form.minimum += step;
  form.least = update.sums.weighted_squares - update.sums.decrement_squared - b.dot(step);
  return form;
}

Eigen::VectorXd restricted_minimum(const CameraForm& form, const std::vector<std::uint8_t>& free,
                                   const Eigen::VectorXd& held) {
  // S_ff (k_f - k_0f) = -S_fh (k_h - k_0h).
  const std::vector<Eigen::Index> f = rows_where(free, true), h = rows_where(free, false);
  Eigen::VectorXd result = held;
  if (f.empty()) return result;
  const Eigen::MatrixXd own = form.information(f, f);
  const Eigen::VectorXd rhs = -form.information(f, h) * (held - form.minimum)(h);
  const Eigen::VectorXd scale = scale_of(own);
  result(f) = form.minimum(f) + scale.asDiagonal() * solve_symmetric(scale.asDiagonal() * own * scale.asDiagonal(),
                                                                     Eigen::VectorXd(scale.asDiagonal() * rhs));
  return result;
}

Eigen::MatrixXd restricted_covariance(const CameraForm& form, const std::vector<std::uint8_t>& free) {
  const std::vector<Eigen::Index> f = rows_where(free, true);
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(form.information.rows(), form.information.cols());
  if (f.empty()) return result;
  const Eigen::MatrixXd own = form.information(f, f);
  const Eigen::VectorXd scale = scale_of(own);
  result(f, f) = scale.asDiagonal() * inverse(scale.asDiagonal() * own * scale.asDiagonal()) * scale.asDiagonal();
  return result;
}

}  // namespace megablock
