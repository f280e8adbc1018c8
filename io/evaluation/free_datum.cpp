#include "io/evaluation/free_datum.h"

#include <algorithm>
#include <cmath>

#include "geometry/numbers/decompositions.h"
#include "geometry/transform/rotation.h"

namespace megablock {

namespace {

using Matrix67 = Eigen::Matrix<double, 6, 7>;
using Matrix77 = Eigen::Matrix<double, 7, 7>;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Vector7 = Eigen::Matrix<double, 7, 1>;

constexpr double kOneLine = 1e-8;  // eigenvalue of N'WN over the largest one

// The rows of N and the weights of a set of poses.
class Movements {
 public:
  Movements(std::span<const Pose> poses, DatumFit fit) : poses_(poses) {
    for (const Pose& pose : poses) centre_ += pose.centre / static_cast<double>(poses.size());
    for (const Pose& pose : poses) extent_ = std::max(extent_, (pose.centre - centre_).norm());
    if (!(extent_ > 0)) extent_ = 1;
    weights_ = Vector6::Ones();
    weights_.tail<3>() /= extent_ * extent_;
    if (fit == DatumFit::kPositions) weights_.head<3>().setZero();
  }
  const Vector6& weights() const { return weights_; }
  // Its columns are phi, t / L and s, so that they are alike in size.
  Matrix67 of(std::size_t i) const {
    const Eigen::Vector3d arm = poses_[i].centre - centre_;
    Matrix67 move = Matrix67::Zero();
    move.topLeftCorner<3, 3>() = -Eigen::Matrix3d::Identity();
    move.bottomRows<3>() << -skew<double>(arm), extent_ * Eigen::Matrix3d::Identity(), arm;
    return move;
  }
  Matrix77 normal() const {
    Matrix77 m = Matrix77::Zero();
    for (std::size_t i = 0; i < poses_.size(); ++i) m += of(i).transpose() * weights_.asDiagonal() * of(i);
    return m;
  }
  Similarity similarity(const Vector7& a) const {
    Similarity moved;
    moved.scale = std::exp(a[6]);
    moved.rotation = rotation_exp<double>(a.head<3>());
    moved.translation = centre_ + extent_ * a.segment<3>(3) - moved.scale * (moved.rotation * centre_);
    return moved;
  }

 private:
  std::span<const Pose> poses_;
  Eigen::Vector3d centre_ = Eigen::Vector3d::Zero();
  double extent_ = 0;
  Vector6 weights_;
};

bool regular(const Matrix77& normal) {
  const Eigen::VectorXd values = symmetric_eigen(normal).values;
  return values.minCoeff() > kOneLine * values.maxCoeff();
}

// The mean rotation between the attitudes, then scale and translation of the positions.
std::optional<Similarity> start(std::span<const Pose> from, std::span<const Pose> to) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  Eigen::Vector3d from_mean = Eigen::Vector3d::Zero(), to_mean = from_mean;
  const auto n = static_cast<double>(from.size());
  for (std::size_t i = 0; i < from.size(); ++i) {
    sum += (to[i].rotation.conjugate() * from[i].rotation).toRotationMatrix();
    from_mean += from[i].centre / n;
    to_mean += to[i].centre / n;
  }
  const SingularValues svd = singular_values(sum);
  Eigen::Matrix3d turn = svd.u.leftCols<3>() * svd.v.transpose();
  if (turn.determinant() < 0) {
    Eigen::Matrix3d u = svd.u.leftCols<3>();
    u.col(2) *= -1;
    turn = u * svd.v.transpose();
  }
  double squares = 0, products = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    squares += (from[i].centre - from_mean).squaredNorm();
    products += (to[i].centre - to_mean).dot(turn * (from[i].centre - from_mean));
  }
  if (!(squares > 0 && products > 0)) return std::nullopt;
  const double scale = products / squares;
  return Similarity{scale, Eigen::Quaterniond(turn), to_mean - scale * (turn * from_mean)};
}

}  // namespace

bool determine_similarity(std::span<const Pose> poses) {
  return poses.size() >= 3 && regular(Movements(poses, DatumFit::kPositions).normal());
}

std::optional<Similarity> fit_datum(std::span<const Pose> from, std::span<const Pose> to, DatumFit fit) {
  if (from.size() < 2 || from.size() != to.size()) return std::nullopt;
  if (fit == DatumFit::kPositions) {
    std::vector<Eigen::Vector3d> a, b;
    for (const Pose& pose : from) a.push_back(pose.centre);
    for (const Pose& pose : to) b.push_back(pose.centre);
    return from.size() < 3 ? std::nullopt : fit_similarity(a, b);
  }
  std::optional<Similarity> similarity = start(from, to);
  constexpr int kIterations = 20;
  for (int i = 0; similarity && i < kIterations; ++i) {
    std::vector<Pose> moved;
    for (const Pose& pose : from) moved.push_back((*similarity)(pose));
    const Movements movements(moved, fit);
    Vector7 right = Vector7::Zero();
    for (std::size_t k = 0; k < moved.size(); ++k) {
      Vector6 error;
      error << rotation_log<double>(moved[k].rotation.conjugate() * to[k].rotation), to[k].centre - moved[k].centre;
      right += movements.of(k).transpose() * movements.weights().cwiseProduct(error);
    }
    const Vector7 a = solve_symmetric(movements.normal(), right);
    similarity = movements.similarity(a) * *similarity;
    if (a.norm() < 1e-13) break;
  }
  return similarity;
}

Eigen::MatrixXd after_fit(const Eigen::MatrixXd& covariance, std::span<const Pose> poses, DatumFit fit) {
  const Movements movements(poses, fit);
  const auto n = static_cast<Eigen::Index>(6 * poses.size());
  Eigen::MatrixXd moves(n, 7), weighted(n, 7);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    moves.middleRows<6>(static_cast<Eigen::Index>(6 * i)) = movements.of(i);
    weighted.middleRows<6>(static_cast<Eigen::Index>(6 * i)) = movements.weights().asDiagonal() * movements.of(i);
  }
  const Eigen::MatrixXd s =
      Eigen::MatrixXd::Identity(n, n) - moves * inverse(weighted.transpose() * moves) * weighted.transpose();
  return s * covariance * s.transpose();
}

DatumCovariances stated_covariances(const BlockResult& result, std::span<const FrameIndex> frames, SigmaKind kind) {
  const auto& all = kind == SigmaKind::kFormal ? result.frame_covariance : result.empirical.frame_covariance;
  DatumCovariances covariances;
  for (std::size_t i = 0; i < frames.size() && !all.empty(); ++i) covariances.frames.push_back(all[frames[i]]);
  return covariances;
}

DatumCovariances covariances_after_fit(const BlockResult& result, std::span<const FrameIndex> frames, DatumFit fit,
                                       SigmaKind kind) {
  const bool formal = kind == SigmaKind::kFormal;
  const auto& all_aligned = formal ? result.aligned_covariance : result.empirical.aligned_covariance;
  DatumCovariances found = stated_covariances(result, frames, kind);
  if (found.frames.empty()) return found;
  if (result.free_parts.size() > 1)
    return {{},
            "no ratios: the block has " + std::to_string(result.free_parts.size()) +
                " free parts, and one similarity does not fit them"};
  // From the covariances of all poses together.
  const BlockResult::JointCovariance& joint = formal ? result.joint_covariance : result.empirical.joint_covariance;
  std::vector<Eigen::Index> rows;
  std::vector<Pose> poses;
  for (const FrameIndex frame : frames) {
    const auto place = std::ranges::lower_bound(joint.frames, frame);
    if (place == joint.frames.end() || *place != frame) break;
    for (Eigen::Index k = 0; k < 6; ++k) rows.push_back(6 * (place - joint.frames.begin()) + k);
    poses.push_back(result.state.frames[frame]);
  }
  if (!frames.empty() && poses.size() == frames.size()) {
    const Eigen::MatrixXd c = after_fit(joint.matrix(rows, rows), poses, fit);
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const auto row = static_cast<Eigen::Index>(6 * i);
      found.frames[i] = c.block<6, 6>(row, row);
    }
    return found;
  }
  // From those after a fit of all poses.
  const bool aligned = fit == DatumFit::kPositions && !all_aligned.empty();
  for (std::size_t i = 0; i < frames.size() && aligned; ++i) found.frames[i] = all_aligned[frames[i]];
  const auto all = std::ranges::count_if(result.state.oriented, [](auto oriented) { return oriented != 0; });
  if (fit == DatumFit::kPositions && !aligned)
    found.note = "the sigmas belong to another datum than the fit: the result is older than this program";
  else if (std::ssize(frames) < all)
    found.note = "the sigmas are those after a fit of all " + std::to_string(all) + " images, of which " +
                 std::to_string(frames.size()) + " were compared";
  return found;
}

}  // namespace megablock
