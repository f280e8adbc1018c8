#include "merge/point_equations.h"

#include <cmath>
#include <map>

#include "merge/unknowns.h"

namespace megablock {

std::vector<ImageUnknowns> image_unknowns(const TileProblem& problem, const TilePlan& plan) {
  std::vector<ImageUnknowns> list;
  std::map<std::pair<std::int64_t, std::int64_t>, std::int64_t> calibrations;
  list.reserve(problem.images.size());
  for (const TileImage& image : problem.images) {
    ImageUnknowns u;
    u.frame = plan.unknown_of_frame[at(image.frame.value)];
    u.camera = plan.unknown_of_camera[at(image.camera.value)];
    u.mount = plan.unknown_of_mount[at(image.mount)];
    if (u.camera >= 0) u.free = plan.camera_free[at(image.camera.value)];
    u.camera_width = count_of(u.free);
    u.shared_width = u.camera_width + (u.mount >= 0 ? 6 : 0);
    if (u.shared_width > 0)
      u.calibration =
          calibrations.try_emplace({u.camera, u.mount}, static_cast<std::int64_t>(calibrations.size())).first->second;
    list.push_back(u);
  }
  return list;
}

std::vector<std::int64_t> prior_rows(const TileProblem& problem) {
  std::vector<std::int64_t> rows(problem.points.size(), -1);
  for (std::size_t i = 0; i < problem.point_priors.size(); ++i)
    rows[at(problem.point_priors[i].point.value)] = static_cast<std::int64_t>(i);
  return rows;
}

PointEquations::PointEquations(const TileProblem& problem, const TilePlan& plan, const TileState& state)
    : problem_(problem),
      state_(state),
      views_(image_views(problem, state)),
      unknowns_(image_unknowns(problem, plan)),
      prior_(prior_rows(problem)) {
  slot_.assign(plan.unknowns.size(), -1);
  for (const ImageUnknowns& u : unknowns_) widest_ = std::max(widest_, u.shared_width);
}

void PointEquations::linearise(std::int64_t point, const Pass& pass) {
  clear(point);
  for (std::int64_t row = problem_.begin[at(point)]; row < problem_.begin[at(point + 1)]; ++row)
    if (problem_.kept[at(row)]) add_observation(point, row, pass.curvature);
  v_.setZero();
  b_.setZero();
  for (const FramePart& part : frames_) {
    v_ += part.v;
    b_ += part.b;
  }
  add_prior(point);
  factorise(pass.lambda);
}

void PointEquations::clear(std::int64_t point) {
  for (const FramePart& part : frames_) slot_[at(part.unknown)] = -1;
  for (const SharedPart& part : shared_) slot_[at(part.unknown)] = -1;
  frames_.clear();
  shared_.clear();
  blocks_.clear();
  observations_.clear();
  rho_ = weighted_squares_ = 0;
  residual_count_ = 0;
  // J_s, W_sk, W_s and Y: nothing that was taken moves until the next point.
  const auto most = at(problem_.begin[at(point + 1)] - problem_.begin[at(point)]);
  const std::size_t room = most * static_cast<std::size_t>(11 * widest_ + 18);
  if (store_.size() < room) store_.resize(room);
  taken_ = 0;
}

double* PointEquations::take(int count) {
  double* first = store_.data() + taken_;
  taken_ += static_cast<std::size_t>(count);
  return first;
}

void PointEquations::add_observation(std::int64_t point, std::int64_t row, bool curvature) {
  const std::int64_t image = problem_.image[at(row)].value;
  const ImageView& view = views_[at(image)];
  const ImageUnknowns& unknowns = unknowns_[at(image)];
  CameraResidual r;
  if (!linearise_in_camera(view, state_.points[at(point)], {problem_.x[at(row)], problem_.y[at(row)]},
                           problem_.inverse_sigma[at(row)], unknowns.camera >= 0, r))
    throw ComputeError("a kept observation of point " + std::to_string(problem_.points[at(point)].index) +
                       " lies behind image " + std::to_string(problem_.images[at(image)].image.value));
  const double squares = r.residual.squaredNorm();
  if (!std::isfinite(squares))  // as a pivot it would pass for a direction that nothing observes
    throw ComputeError("the observation of point " + std::to_string(problem_.points[at(point)].index) + " in image " +
                       std::to_string(problem_.images[at(image)].image.value) + " or its sigma is not a finite number");
  const LossWeight weight(problem_.image_loss, squares, curvature);
  rho_ += weight.rho;
  weighted_squares_ += weight.first * squares;
  residual_count_ += 2;
  if (weight.root != 1) {
    r.by_camera = weight.weighted(r.by_camera, r.residual);
    if (unknowns.camera >= 0) r.by_intrinsics = weight.weighted(r.by_intrinsics, r.residual);
  }

  Observation& observation = observations_.emplace_back();
  observation.image = image;
  observation.residual = weight.residual_scale * r.residual;
  observation.by_point.noalias() = r.by_camera * view.rotation;

  std::int32_t& slot = slot_[at(unknowns.frame)];
  if (slot < 0) {
    slot = static_cast<std::int32_t>(frames_.size());
    FramePart& added = frames_.emplace_back();
    added.unknown = unknowns.frame;
    added.from_frame = r.from_frame;
    added.v.setZero();
    added.b.setZero();
  }
  FramePart& part = frames_[at(slot)];
  part.v.noalias() += observation.by_point.transpose().lazyProduct(observation.by_point);
  part.b.noalias() -= observation.by_point.transpose().lazyProduct(observation.residual);
  observation.frame = slot;
  if (unknowns.shared_width > 0) add_shared(unknowns, view, r, observation);
}

void PointEquations::add_shared(const ImageUnknowns& unknowns, const ImageView& view, const CameraResidual& r,
                                Observation& observation) {
  const int width = unknowns.shared_width;
  double* rows = take(2 * width);
  Eigen::Map<Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>> jacobian(rows, 2, width);
  int column = 0;
  for (int k = 0; column < unknowns.camera_width; ++k)
    if (contains(unknowns.free, k)) jacobian.col(column++) = r.by_intrinsics.col(k);
  if (unknowns.mount >= 0) jacobian.rightCols<6>() = by_mount(view, r);

  double* w = take(3 * width);
  for (int j = 0; j < 3; ++j) {
    const double first = observation.by_point(0, j), second = observation.by_point(1, j);
    for (int i = 0; i < width; ++i) w[i + j * width] = rows[i] * first + rows[i + width] * second;
  }
  observation.shared = rows;
  observation.shared_point = w;
  if (unknowns.camera >= 0) add_to_shared(unknowns.camera, unknowns.camera_width, w, width);
  if (unknowns.mount >= 0) add_to_shared(unknowns.mount, 6, w + unknowns.camera_width, width);
}

void PointEquations::add_to_shared(std::int64_t unknown, int dimension, const double* w, int rows) {
  std::int32_t& slot = slot_[at(unknown)];
  if (slot < 0) {
    slot = static_cast<std::int32_t>(shared_.size());
    shared_.push_back({unknown, dimension, take(3 * dimension)});
    std::fill_n(shared_.back().w, 3 * dimension, 0.0);
  }
  double* sum = shared_[at(slot)].w;
  for (int j = 0; j < 3; ++j)
    for (int i = 0; i < dimension; ++i) sum[i + j * dimension] += w[i + j * rows];
}

void PointEquations::add_prior(std::int64_t point) {
  const std::int64_t i = prior_[at(point)];
  if (i < 0) return;
  const auto& term = problem_.point_priors[at(i)];
  const Eigen::Vector3d weight = term.sigma.cwiseInverse();  // 0 on a free axis
  const Eigen::Vector3d r = point_prior_residual(state_.points[at(point)], term);
  v_.diagonal() += weight.cwiseAbs2();
  b_ -= weight.cwiseProduct(r);
  rho_ += r.squaredNorm();
  weighted_squares_ += r.squaredNorm();
  residual_count_ += (weight.array() > 0).count();
}

void PointEquations::factorise(double lambda) {
  diagonal_ = v_.diagonal();
  const double floor = kPivotTolerance * (1 + lambda);
  Eigen::Matrix3d c = v_;  // its lower triangle becomes C without its diagonal, whose inverse goes to inverse_
  inverse_.setZero();
  held_ = 0;
  for (int k = 0; k < 3; ++k) {
    double pivot = v_(k, k) + lambda * diagonal_[k];
    for (int j = 0; j < k; ++j) pivot -= c(k, j) * c(k, j);
    const bool free = pivot > floor * diagonal_[k];
    held_ += !free;
    inverse_(k, k) = free ? 1 / std::sqrt(pivot) : 0;  // a held row and column vanish
    for (int i = k + 1; i < 3; ++i) {
      for (int j = 0; j < k; ++j) c(i, k) -= c(i, j) * c(k, j);
      c(i, k) *= inverse_(k, k);
    }
  }
  inverse_(1, 0) = -inverse_(1, 1) * (c(1, 0) * inverse_(0, 0));
  inverse_(2, 1) = -inverse_(2, 2) * (c(2, 1) * inverse_(1, 1));
  inverse_(2, 0) = -inverse_(2, 2) * (c(2, 0) * inverse_(0, 0) + c(2, 1) * inverse_(1, 0));
  z_ = inverse_ * b_;
}

void PointEquations::reduce() {
  for (FramePart& part : frames_) {
    part.t.noalias() = part.v.lazyProduct(inverse_.transpose());
    double* y = take(18);  // G'T
    for (int j = 0; j < 3; ++j) {
      Eigen::Map<Eigen::Vector3d>(y + 6 * j) = part.from_frame.cross(part.t.col(j));
      Eigen::Map<Eigen::Vector3d>(y + 6 * j + 3) = -part.t.col(j);
    }
    blocks_.push_back({part.unknown, 6, y});
  }
  for (const SharedPart& part : shared_) {
    double* y = take(3 * part.dimension);
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 3>>(y, part.dimension, 3).noalias() =
        Rows3(part.w, part.dimension, 3).lazyProduct(inverse_.transpose());
    slot_[at(part.unknown)] = static_cast<std::int32_t>(blocks_.size());
    blocks_.push_back({part.unknown, part.dimension, y});
  }
}

Eigen::Vector3d PointEquations::step(const double* x, const std::vector<std::int64_t>& offsets) const {
  Eigen::Vector3d rest = b_;
  for (const FramePart& part : frames_) {  // -G x_f = u x w + t, as [u]x w + t
    const Eigen::Map<const PoseIncrement> frame(x + offsets[at(part.unknown)]);
    rest += part.v * (part.from_frame.cross(frame.head<3>()) + frame.tail<3>());
  }
  for (const SharedPart& part : shared_)
    rest -= Rows3(part.w, part.dimension, 3).transpose() *
            Eigen::Map<const Eigen::VectorXd>(x + offsets[at(part.unknown)], part.dimension);
  return inverse_.transpose() * (inverse_ * rest);
}

int PointEquations::jacobians(const Observation& observation,
                              std::array<JacobianBlock<IntrinsicJacobian>, 3>& blocks) const {
  const ImageUnknowns& u = unknowns_of(observation);
  const Eigen::Map<const Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>> shared(observation.shared, 2,
                                                                                           u.shared_width);
  int count = 0;
  blocks[at(count++)] = {u.frame, by_pose(observation.by_point, frames_[at(observation.frame)].from_frame)};
  if (u.camera >= 0) blocks[at(count++)] = {u.camera, shared.leftCols(u.camera_width)};
  if (u.mount >= 0) blocks[at(count++)] = {u.mount, shared.rightCols(6)};
  return count;
}

}  // namespace megablock
