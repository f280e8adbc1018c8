// Converts poses for Ceres. A block is x = (q, C), the tangent increment (w, d) is that of pose_update: q Exp(w), C +
// d. The Jacobian of Plus at 0 is the 7 x 6 matrix dq/dw = Q' / 4 above, with Q = quaternion_to_tangent(q), and the
// identity below. Since dw/dq dq/dw = I, a cost function that knows its derivative J by (w, d) may hand Ceres J_w Q for
// the quaternion: Ceres multiplies by dq/dw and gets J_w again. AnalyticImage does so.
#include "adjust/tile/ceres_problem.h"

#include <ceres/cost_function.h>
#include <ceres/loss_function.h>

#include <algorithm>
#include <functional>

#include "adjust/terms/automatic_terms.h"
#include "adjust/terms/linearise.h"
#include "adjust/terms/terms.h"
#include "io/base/error.h"

namespace megablock {

void to_block(const Pose& pose, double* block) {
  const Eigen::Quaterniond& q = pose.rotation;
  block[0] = q.w(), block[1] = q.x(), block[2] = q.y(), block[3] = q.z();
  Eigen::Map<Eigen::Vector3d>(block + 4) = pose.centre;
}

Pose from_block(const double* block) {
  return {Eigen::Quaterniond(block[0], block[1], block[2], block[3]), Eigen::Map<const Eigen::Vector3d>(block + 4)};
}

// To first order q Exp(w) = q (1, w/2), so that dq/dw_i = q e_i / 2 for the imaginary units e_i. The q e_i are
// orthonormal, so that dw_i/dq = 2 (q e_i)'.
Eigen::Matrix<double, 3, 4> quaternion_to_tangent(const double* q) {
  Eigen::Matrix<double, 3, 4> result;
  result << -q[1], q[0], q[3], -q[2],  //
      -q[2], -q[3], q[0], q[1],        //
      -q[3], q[2], -q[1], q[0];
  return 2 * result;
}

bool PoseManifold::Plus(const double* x, const double* delta, double* x_plus_delta) const {
  to_block(pose_update(from_block(x), Eigen::Map<const PoseIncrement>(delta)), x_plus_delta);
  return true;
}

bool PoseManifold::PlusJacobian(const double* x, double* jacobian) const {
  Eigen::Map<Eigen::Matrix<double, 7, 6, Eigen::RowMajor>> map(jacobian);
  map.setZero();
  map.topLeftCorner<4, 3>() = 0.25 * quaternion_to_tangent(x).transpose();
  map.bottomRightCorner<3, 3>().setIdentity();
  return true;
}

bool PoseManifold::Minus(const double* y, const double* x, double* y_minus_x) const {
  const Pose a = from_block(y), b = from_block(x);
  Eigen::Map<PoseIncrement> map(y_minus_x);
  map << rotation_log<double>(b.rotation.conjugate() * a.rotation), a.centre - b.centre;
  return true;
}

bool PoseManifold::MinusJacobian(const double* x, double* jacobian) const {
  Eigen::Map<Eigen::Matrix<double, 6, 7, Eigen::RowMajor>> map(jacobian);
  map.setZero();
  map.topLeftCorner<3, 4>() = quaternion_to_tangent(x);
  map.bottomRightCorner<3, 3>().setIdentity();
  return true;
}

namespace {

// linearise_image() for Ceres. Ceres multiplies the Jacobian of a pose by dq/dw; dw/dq is its left inverse.
class AnalyticImage : public ceres::CostFunction {
 public:
  AnalyticImage(const CameraModel& model, const Eigen::Vector2d& measured, double inverse_sigma)
      : model_(model), measured_(measured), inverse_sigma_(inverse_sigma) {
    set_num_residuals(2);
    *mutable_parameter_block_sizes() = {kPoseBlock, kPoseBlock, parameter_count(model), 3};
  }

  // Returns false, for Ceres an invalid step, where the camera cannot project the point.
  bool Evaluate(double const* const* blocks, double* residual, double** jacobians) const override {
    Intrinsics intrinsics(model_);
    std::copy_n(blocks[2], intrinsics.size(), intrinsics.begin());
    const Pose frame = from_block(blocks[0]), mount = from_block(blocks[1]);
    const Eigen::Vector3d point = Eigen::Map<const Eigen::Vector3d>(blocks[3]);
    Eigen::Map<Eigen::Vector2d> result(residual);
    if (jacobians == nullptr) {
      result = inverse_sigma_ * reprojection(intrinsics, to_camera(frame, mount, point), measured_);
      return result.allFinite();
    }
    const ImageResidual image = linearise_image(frame, mount, intrinsics, point, measured_, inverse_sigma_);
    if (!image.in_front) return false;
    result = image.residual;
    if (jacobians[0]) write_pose(image.by_frame, blocks[0], jacobians[0]);
    if (jacobians[1]) write_pose(image.by_mount, blocks[1], jacobians[1]);
    if (jacobians[2])
      Eigen::Map<Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>>(jacobians[2], 2, intrinsics.size()) =
          image.by_intrinsics;
    if (jacobians[3]) as_matrix<3>(jacobians[3]) = image.by_point;
    return true;
  }

 private:
  template <int kColumns>
  static Eigen::Map<Eigen::Matrix<double, 2, kColumns, Eigen::RowMajor>> as_matrix(double* jacobian) {
    return Eigen::Map<Eigen::Matrix<double, 2, kColumns, Eigen::RowMajor>>(jacobian);
  }
  static void write_pose(const Eigen::Matrix<double, 2, 6>& by_tangent, const double* block, double* jacobian) {
    auto map = as_matrix<kPoseBlock>(jacobian);
    map.leftCols<4>() = by_tangent.leftCols<3>() * quaternion_to_tangent(block);
    map.rightCols<3>() = by_tangent.rightCols<3>();
  }

  CameraModel model_;
  Eigen::Vector2d measured_;
  double inverse_sigma_;
};

// The loss with Cauchy's tail, which Ceres does not have. Up to the tail it is Huber's loss of Ceres.
class CauchyTail final : public ceres::LossFunction {
 public:
  explicit CauchyTail(double scale) : huber_(scale), square_(scale * scale) {}
  void Evaluate(double s, double rho[3]) const override {
    if (s <= 4 * square_) return huber_.Evaluate(s, rho);
    rho[0] = square_ * (3 + 2 * std::log(s / (4 * square_)));
    rho[1] = 2 * square_ / s;
    rho[2] = -2 * square_ / (s * s);
  }

 private:
  ceres::HuberLoss huber_;
  double square_;
};

std::unique_ptr<ceres::LossFunction> ceres_loss(const RobustLoss& loss) {
  switch (loss.kind) {
    case RobustLoss::Kind::kHuber:
      return std::make_unique<ceres::HuberLoss>(loss.scale);
    case RobustLoss::Kind::kCauchy:
      return std::make_unique<ceres::CauchyLoss>(loss.scale);
    case RobustLoss::Kind::kCauchyTail:
      return std::make_unique<CauchyTail>(loss.scale);
    case RobustLoss::Kind::kNone:
      break;
  }
  return nullptr;
}

// Losses and manifolds are shared by thousands of residuals and owned by CeresTile. The checks of Ceres take longer
// than the addition of a residual.
ceres::Problem::Options problem_options() {
  ceres::Problem::Options options;
  options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.disable_all_safety_checks = true;
  return options;
}

struct DynamicImage {
  residual::ImageMeasured image;
  template <typename Scalar>
  bool operator()(const Scalar* const* blocks, Scalar* result) const {
    return image(blocks[0], blocks[1], blocks[2], blocks[3], result);
  }
};

ceres::CostFunction* automatic_image(const residual::ImageMeasured& image) {
  if (image.model == CameraModel())
    return automatic_term<2, kPoseBlock, kPoseBlock, parameter_count(CameraModel()), 3>(image);
  return automatic_dynamic_term(DynamicImage{image}, 2, {kPoseBlock, kPoseBlock, parameter_count(image.model), 3});
}

}  // namespace

// The blocks lie in one allocation in the order frames, mounts, cameras, points. Residuals are added by point and row,
// then by type, so that a problem has the same bits in every run.
CeresTile::CeresTile(const TileProblem& problem, const TileState& state, const CeresOptions& options)
    : frame_count_(std::ssize(state.frames)),
      mount_count_(std::ssize(state.mounts)),
      camera_count_(std::ssize(state.cameras)),
      point_count_(std::ssize(state.points)),
      mounts_begin_(frame_count_ * kPoseBlock),
      point_used_(problem.points.size(), 0),
      ceres_(std::make_unique<ceres::Problem>(problem_options())) {
  const auto& camera_free = options.camera_free.empty() ? problem.camera_free : options.camera_free;
  if (state.frames.size() != problem.frames.size() || state.cameras.size() != problem.cameras.size() ||
      state.mounts.size() != problem.mounts.size() || state.points.size() != problem.points.size() ||
      camera_free.size() != problem.cameras.size())
    throw InputError("the tile's state does not fit its problem");
  points_begin_ = mounts_begin_ + mount_count_ * kPoseBlock;
  for (const Intrinsics& intrinsics : state.cameras) {
    camera_begin_.push_back(points_begin_);
    points_begin_ += intrinsics.size();
  }
  values_.resize(static_cast<std::size_t>(points_begin_ + point_count_ * 3));
  for (std::int64_t f = 0; f < frame_count_; ++f) to_block(state.frames[f], frame(f));
  for (std::int64_t m = 0; m < mount_count_; ++m) to_block(state.mounts[m], mount(m));
  for (std::int64_t c = 0; c < camera_count_; ++c)
    std::copy(state.cameras[c].begin(), state.cameras[c].end(), camera(c));
  for (std::int64_t p = 0; p < point_count_; ++p) Eigen::Map<Eigen::Vector3d>(point(p)) = state.points[p];
  add_images(problem, state, options.derivatives);
  add_others(problem);
  hold_parameters(problem, state, camera_free);
}

CeresTile::~CeresTile() = default;

void CeresTile::add_images(const TileProblem& problem, const TileState& state, CeresOptions::Derivatives derivatives) {
  ceres::LossFunction* image_loss = loss(problem.image_loss);
  for (std::int64_t p = 0; p < problem.point_count(); ++p) {
    if (!problem.active(p)) continue;
    point_used_[p] = 1;
    for (std::int64_t row = problem.begin[p]; row < problem.begin[p + 1]; ++row) {
      if (!problem.kept[row]) continue;
      const TileImage& image = problem.images[problem.image[row].value];
      const Eigen::Vector2d measured(problem.x[row], problem.y[row]);
      const double weight = problem.inverse_sigma[row];
      const CameraModel& model = state.cameras[image.camera.value].model();
      ceres::CostFunction* cost = derivatives == CeresOptions::Derivatives::kAnalytic
                                      ? static_cast<ceres::CostFunction*>(new AnalyticImage(model, measured, weight))
                                      : automatic_image({model, measured, weight});
      ceres_->AddResidualBlock(cost, image_loss, frame(image.frame.value), mount(image.mount),
                               camera(image.camera.value), point(p));
    }
  }
}

void CeresTile::add_others(const TileProblem& problem) {
  for (const ObservationType* type : observation_types()) {
    for (std::size_t row = 0; row < type->count(problem); ++row) {
      const TermUnknowns term = type->unknowns(problem, row);
      // The prior of a point that takes no part would be a problem of its own.
      if (term.point >= 0 && !point_used_[term.point]) continue;
      std::vector<double*> blocks;
      for (int f = 0; f < term.frame_count; ++f) blocks.push_back(frame(term.frame[static_cast<std::size_t>(f)]));
      for (const std::int32_t m : term.mounts)
        if (m >= 0) blocks.push_back(mount(m));
      if (term.camera >= 0) blocks.push_back(camera(term.camera));
      if (term.point >= 0) blocks.push_back(point(term.point));
      ceres_->AddResidualBlock(type->automatic(problem, row), loss(type->loss(problem, row)), blocks);
    }
  }
}

// Returns the same object for all residuals of the same loss.
ceres::LossFunction* CeresTile::loss(const RobustLoss& loss) {
  if (loss.kind == RobustLoss::Kind::kNone) return nullptr;
  for (const auto& [known, function] : losses_)
    if (known.kind == loss.kind && known.scale == loss.scale) return function.get();
  return losses_.emplace_back(loss, ceres_loss(loss)).second.get();
}

// Only blocks that have a residual are in the problem, and only these can be held.
void CeresTile::hold_parameters(const TileProblem& problem, const TileState& state,
                                const std::vector<ParameterMask>& camera_free) {
  for (std::int64_t f = 0; f < frame_count_; ++f)
    if (ceres_->HasParameterBlock(frame(f))) ceres_->SetManifold(frame(f), &pose_manifold_);
  for (std::int64_t m = 0; m < mount_count_; ++m) {
    if (!ceres_->HasParameterBlock(mount(m))) continue;
    ceres_->SetManifold(mount(m), &pose_manifold_);
    if (!problem.mount_free[m]) ceres_->SetParameterBlockConstant(mount(m));
  }
  for (std::int64_t c = 0; c < camera_count_; ++c) {
    double* block = camera(c);
    if (!ceres_->HasParameterBlock(block)) continue;
    std::vector<int> held;
    const int count = state.cameras[c].size();
    for (int k = 0; k < count; ++k)
      if (!contains(camera_free[c], k)) held.push_back(k);
    if (std::ssize(held) == count) {
      ceres_->SetParameterBlockConstant(block);
    } else if (!held.empty()) {
      camera_manifolds_.push_back(std::make_unique<ceres::SubsetManifold>(count, held));
      ceres_->SetManifold(block, camera_manifolds_.back().get());
    }
  }
}

bool CeresTile::unknown(const double* block) const {
  return ceres_->HasParameterBlock(block) && !ceres_->IsParameterBlockConstant(block);
}

// Points come last in the one allocation of all blocks. The comparison of pointers is that of std::less_equal, which is
// defined for pointers of any origin.
bool CeresTile::is_point(const double* block) const {
  const std::less_equal<const double*> not_after;
  return not_after(values_.data() + points_begin_, block);
}

std::vector<double*> CeresTile::unknown_blocks_without_points() {
  std::vector<double*> blocks;
  const auto add = [&](double* block) {
    if (unknown(block)) blocks.push_back(block);
  };
  for (std::int64_t f = 0; f < frame_count_; ++f) add(frame(f));
  for (std::int64_t c = 0; c < camera_count_; ++c) add(camera(c));
  for (std::int64_t m = 0; m < mount_count_; ++m) add(mount(m));
  return blocks;
}

std::vector<double*> CeresTile::unknown_blocks() {
  std::vector<double*> blocks = unknown_blocks_without_points();
  for (std::int64_t p = 0; p < point_count_; ++p)
    if (point_used_[p]) blocks.push_back(point(p));
  return blocks;
}

void CeresTile::store(TileState& state) {
  // The values as Plus() has left them: quaternions are unit already, and held blocks keep their bits.
  for (std::int64_t f = 0; f < frame_count_; ++f) state.frames[f] = from_block(frame(f));
  for (std::int64_t m = 0; m < mount_count_; ++m) state.mounts[m] = from_block(mount(m));
  for (std::int64_t c = 0; c < camera_count_; ++c)
    std::copy_n(camera(c), state.cameras[c].size(), state.cameras[c].begin());
  for (std::int64_t p = 0; p < point_count_; ++p)
    if (point_used_[p]) state.points[p] = Eigen::Map<const Eigen::Vector3d>(point(p));
}

}  // namespace megablock
