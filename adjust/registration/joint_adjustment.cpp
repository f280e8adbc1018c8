// Adjusts these residuals, each a vector with unit covariance where it is good. W is a whitening matrix, W'W = C^-1.
//
//     link          W [Log(R_to R_from' R_m'),  R_from (C_to - C_from) - T]       (in_ground: C_to - C_from - T)
//     resection     W [Log(R_0' R),  C - C_0]
//     position      (C - C_0) sqrt(w / n) / sigma                                n neighbours share one error
//     attitude      Log(R_0' R) / (sigma sqrt(n))
//     control       P (s / |s| - v) / sigma_px,   s = R (X - C) - o               ray v from o, P: rig_ray.h
//     point         (X - X_0) / sigma
//
// Reweighting. In round k of K the scale of a loss is c_k = c_0 (c_n / c_0)^(k / (K - 2)), not below c_n. All weights
// are held while Ceres solves; they are numbers that the residuals point to. The first round has unit weights: the
// registrations then pull the trajectory together, whatever its errors.
#include "adjust/registration/joint_adjustment.h"

#include <ceres/autodiff_cost_function.h>
#include <ceres/covariance.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

#include "adjust/terms/ceres_residuals.h"
#include "geometry/numbers/angles.h"
#include "io/base/error.h"

namespace megablock {

namespace {

using residual::centre_of;
using residual::rotation_of;
using residual::Vector3;

// A matrix W with W'W = C^-1.
Matrix6 whitening(const Matrix6& covariance) {
  // C = L L', W = L^-1.
  const Eigen::LLT<Matrix6> factor(covariance);
  if (factor.info() != Eigen::Success) throw ComputeError("the covariance of a relative pose is not positive definite");
  return factor.matrixL().solve(Matrix6::Identity());
}

template <typename Scalar>
void store(const Matrix6& white, const Vector3<Scalar>& a, const Vector3<Scalar>& b, double weight, Scalar* result) {
  Eigen::Matrix<Scalar, 6, 1> both;
  both << a, b;
  Eigen::Map<Eigen::Matrix<Scalar, 6, 1>>{result} = white.cast<Scalar>() * both * Scalar(std::sqrt(weight));
}

// The residual of a link. `weight` points to a number that changes from round to round.
struct LinkResidual {
  Pose pose;
  Matrix6 white;
  bool in_ground;
  const double* weight;
  template <typename Scalar>
  bool operator()(const Scalar* from, const Scalar* to, Scalar* result) const {
    const Eigen::Quaternion<Scalar> measured = pose.rotation.cast<Scalar>();
    const Vector3<Scalar> w =
        rotation_log<Scalar>(rotation_of(to) * rotation_of(from).conjugate() * measured.conjugate());
    const Vector3<Scalar> base = in_ground ? Vector3<Scalar>(centre_of(to) - centre_of(from))
                                           : to_inside<Scalar>(rotation_of(from), centre_of(from), centre_of(to));
    store<Scalar>(white, w, base - pose.centre.cast<Scalar>(), *weight, result);
    return true;
  }
};

// The rotation error is taken on the right, as the covariance of a resection is that of PoseIncrement.
struct ResectedResidual {
  Pose pose;
  Matrix6 white;
  template <typename Scalar>
  bool operator()(const Scalar* frame, Scalar* result) const {
    const Eigen::Quaternion<Scalar> known = pose.rotation.cast<Scalar>();
    store<Scalar>(white, rotation_log<Scalar>(known.conjugate() * rotation_of(frame)),
                  centre_of(frame) - pose.centre.cast<Scalar>(), 1, result);
    return true;
  }
};

// `inverse_sigma` is that of the present round, with the weight in it.
struct PositionResidual {
  Eigen::Vector3d position;
  const double* inverse_sigma;
  template <typename Scalar>
  bool operator()(const Scalar* frame, Scalar* result) const {
    for (int i = 0; i < 3; ++i) result[i] = (frame[4 + i] - position[i]) * *inverse_sigma;
    return true;
  }
};

struct AttitudeResidual {
  Eigen::Quaterniond rotation;
  double inverse_sigma;
  template <typename Scalar>
  bool operator()(const Scalar* frame, Scalar* result) const {
    const Eigen::Quaternion<Scalar> known = rotation.cast<Scalar>();
    Eigen::Map<Vector3<Scalar>>{result} =
        rotation_log<Scalar>(known.conjugate() * rotation_of(frame)) * Scalar(inverse_sigma);
    return true;
  }
};

// The difference of unit vectors, in the tangent plane of the measured ray and in pixels. It is finite behind the
// camera, where the point of a poor start may be.
struct RayResidualOfPoint {
  RigRay ray;
  double inverse_sigma;
  const double* weight;
  template <typename Scalar>
  bool operator()(const Scalar* frame, const Scalar* point, Scalar* result) const {
    const Vector3<Scalar> ground(point[0], point[1], point[2]);
    const Vector3<Scalar> sight =
        to_inside<Scalar>(rotation_of(frame), centre_of(frame), ground) - ray.origin.cast<Scalar>();
    const Vector3<Scalar> off = sight / sight.norm() - ray.direction.cast<Scalar>();
    Eigen::Map<Eigen::Matrix<Scalar, 2, 1>>{result} =
        ray.to_pixels.cast<Scalar>() * off * Scalar(inverse_sigma * std::sqrt(*weight));
    return true;
  }
};

struct PointResidual {
  Eigen::Vector3d position, sigma;
  template <typename Scalar>
  bool operator()(const Scalar* point, Scalar* result) const {
    for (int i = 0; i < 3; ++i) result[i] = (point[i] - position[i]) / sigma[i];
    return true;
  }
};

double geman_mcclure(double q, double scale) { return 1 / std::pow(1 + q / (scale * scale), 2); }

// The scale in a round. It falls from `first` to `last` in equal ratios; the last two rounds have the same scale.
double falling(double first, double last, int round, int rounds) {
  const double part = rounds > 2 ? std::min(1.0, static_cast<double>(round) / (rounds - 2)) : 1;
  return first * std::pow(last / first, part);
}

class JointProblem {
 public:
  JointProblem(const JointInput& input, const JointOptions& options)
      : input_(input), options_(options), frames_(input.start.size()) {
    values_.resize(kPoseBlock * frames_ + 3 * input.points.size());
    for (std::size_t f = 0; f < frames_; ++f) to_block(input.start[f], frame(f));
    for (std::size_t p = 0; p < input.points.size(); ++p) std::copy_n(input.points[p].position.data(), 3, point(p));
    registration_weight_.assign(input.registrations.size(), 1);
    position_weight_.assign(frames_, options.use_positions ? 1 : 0);
    inverse_position_sigma_.assign(frames_, 0);
    ceres::Problem::Options problem_options;
    problem_options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    ceres_ = std::make_unique<ceres::Problem>(problem_options);
    // All frames are in the problem, also those that nothing observes: Ceres' damping leaves these at their start.
    for (std::size_t f = 0; f < frames_; ++f) ceres_->AddParameterBlock(frame(f), kPoseBlock, &manifold_);
    add_chain();
    add_registrations();
    add_absolute();
    add_points();
  }

  JointResult solve() {
    JointResult result;
    for (int round = 0; round < options_.rounds; ++round) {
      reweight(round);
      // A round needs only a few iterations, as the next weights change the problem anyway.
      result.iterations += run(round + 1 == options_.rounds ? options_.last_iterations : options_.iterations, result);
    }
    for (std::size_t f = 0; f < frames_; ++f) result.frames.push_back(from_block(frame(f)));
    for (std::size_t p = 0; p < input_.points.size(); ++p) result.points.emplace_back(point(p));
    for (std::size_t i = 0; i < input_.registrations.size(); ++i)
      result.registration_residual.push_back(std::sqrt(registration_squares(i)));
    result.registration_weight = registration_weight_;
    result.position_weight = position_weight_;
    if (!options_.covariance_of.empty()) result.covariances = covariances();
    return result;
  }

 private:
  double* frame(std::size_t row) { return &values_[kPoseBlock * row]; }
  double* frame(FrameIndex index) { return frame(static_cast<std::size_t>(index.value)); }
  double* point(std::size_t row) { return &values_[kPoseBlock * frames_ + 3 * row]; }

  void add_chain() {
    for (const ChainLink& link : input_.chain) {
      Matrix6 white = Matrix6::Identity();
      // Chain links are independent in rotation and position, registrations have a full covariance.
      white.topLeftCorner<3, 3>() /= link.rotation_sigma_rad;
      white.bottomRightCorner<3, 3>() /= link.position_sigma_m;
      add_relative({link.pose, white, link.in_ground, &one_}, link.from, link.to);
    }
  }

  void add_registrations() {
    for (std::size_t i = 0; i < input_.registrations.size(); ++i) {
      const RegistrationLink& link = input_.registrations[i];
      registration_white_.push_back(whitening(link.covariance));
      add_relative({link.pose, registration_white_[i], false, &registration_weight_[i]}, link.from, link.to);
    }
  }

  void add_relative(const LinkResidual& r, FrameIndex from, FrameIndex to) {
    ceres_->AddResidualBlock(
        new ceres::AutoDiffCostFunction<LinkResidual, 6, kPoseBlock, kPoseBlock>(new LinkResidual(r)), nullptr,
        frame(from), frame(to));
  }

  void add_absolute() {
    for (const ResectedFrame& r : input_.resections)
      ceres_->AddResidualBlock(new ceres::AutoDiffCostFunction<ResectedResidual, 6, kPoseBlock>(
                                   new ResectedResidual{r.pose, whitening(r.covariance)}),
                               nullptr, frame(r.frame));
    // n neighbours with the sigma sqrt(n) s weigh as much as one with s.
    const double attitude =
        1 / (options_.attitude_sigma_deg * kDegree * std::sqrt(static_cast<double>(options_.position_neighbours)));
    for (std::size_t f = 0; f < frames_; ++f) {
      if (options_.use_positions && input_.located[f])
        ceres_->AddResidualBlock(new ceres::AutoDiffCostFunction<PositionResidual, 3, kPoseBlock>(
                                     new PositionResidual{input_.start[f].centre, &inverse_position_sigma_[f]}),
                                 nullptr, frame(f));
      if (options_.use_attitudes)
        ceres_->AddResidualBlock(new ceres::AutoDiffCostFunction<AttitudeResidual, 3, kPoseBlock>(
                                     new AttitudeResidual{input_.start[f].rotation, attitude}),
                                 nullptr, frame(f));
    }
  }

  void add_points() {
    std::size_t views = 0;
    for (const PathPoint& p : input_.points) views += p.views.size();
    view_weight_.assign(views, 1);
    std::size_t row = 0;
    for (std::size_t p = 0; p < input_.points.size(); ++p) {
      for (const PathPoint::View& view : input_.points[p].views)
        ceres_->AddResidualBlock(new ceres::AutoDiffCostFunction<RayResidualOfPoint, 2, kPoseBlock, 3>(
                                     new RayResidualOfPoint{view.ray, 1 / view.sigma_px, &view_weight_[row++]}),
                                 nullptr, frame(view.frame), point(p));
      if (input_.points[p].known)
        ceres_->AddResidualBlock(new ceres::AutoDiffCostFunction<PointResidual, 3, 3>(
                                     new PointResidual{input_.points[p].position, input_.points[p].sigma}),
                                 nullptr, point(p));
    }
  }

  double registration_squares(std::size_t i) {
    const RegistrationLink& link = input_.registrations[i];
    std::array<double, 6> r;
    LinkResidual{link.pose, registration_white_[i], false, &one_}(frame(link.from), frame(link.to), r.data());
    return Eigen::Map<const Eigen::Matrix<double, 6, 1>>(r.data()).squaredNorm();
  }

  void reweight(int round) {
    if (options_.robust_registrations) {
      const double scale =
          falling(options_.first_registration_scale, options_.registration_scale, round, options_.rounds);
      for (std::size_t i = 0; i < registration_weight_.size(); ++i)
        // q is the mean of the six squares.
        registration_weight_[i] = round == 0 ? 1 : geman_mcclure(registration_squares(i) / 6, scale);
    }
    reweight_positions(round);
    reweight_views(round);
  }

  // Weights positions by the mean squared residuals of their neighbours in the pass. The means are differences of
  // running sums.
  void reweight_positions(int round) {
    if (!options_.use_positions) return;
    const double sigma = falling(options_.first_position_sigma_m, options_.position_sigma_m, round, options_.rounds);
    const std::size_t half = static_cast<std::size_t>(options_.position_neighbours) / 2;
    for (std::size_t begin = 0, end = 0; begin < frames_; begin = end) {
      while (end < frames_ && input_.pass[end] == input_.pass[begin]) ++end;
      // Running sums, so that a window of any width takes one subtraction.
      std::vector<double> sums(end - begin + 1, 0), counts(end - begin + 1, 0);
      for (std::size_t f = begin; f < end; ++f) {
        const Eigen::Vector3d off = Eigen::Map<const Eigen::Vector3d>(frame(f) + 4) - input_.start[f].centre;
        sums[f - begin + 1] = sums[f - begin] + (input_.located[f] ? off.squaredNorm() / (3 * sigma * sigma) : 0);
        counts[f - begin + 1] = counts[f - begin] + (input_.located[f] ? 1 : 0);
      }
      for (std::size_t f = begin; f < end; ++f) {
        const std::size_t low = f - begin > half ? f - begin - half : 0,
                          high = std::min(end - begin, f - begin + half + 1);
        const double count = std::max(1.0, counts[high] - counts[low]);
        // A single position cannot be tested: its error is that of its neighbours.
        const double q = round == 0 ? 0 : (sums[high] - sums[low]) / count;
        position_weight_[f] = input_.located[f] ? geman_mcclure(q, options_.position_scale) : 0;
        inverse_position_sigma_[f] = std::sqrt(position_weight_[f] / count) / sigma;
      }
    }
  }

  // Each observation of a control point has a weight of its own: a wrong one concerns one image.
  void reweight_views(int round) {
    const double scale = falling(options_.first_image_scale, options_.image_scale, round, options_.rounds);
    std::size_t row = 0;
    for (std::size_t p = 0; p < input_.points.size(); ++p)
      for (const PathPoint::View& view : input_.points[p].views) {
        std::array<double, 2> r;
        RayResidualOfPoint{view.ray, 1 / view.sigma_px, &one_}(frame(view.frame), point(p), r.data());
        view_weight_[row++] = round == 0 ? 1 : geman_mcclure((r[0] * r[0] + r[1] * r[1]) / 2, scale);
      }
  }

  // Runs one round and returns its number of iterations (Ceres counts the start as one).
  int run(int iterations, JointResult& result) {
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
    options.num_threads = 1;
    options.max_num_iterations = iterations;
    options.function_tolerance = 1e-9;
    options.parameter_tolerance = 1e-12;
    options.initial_trust_region_radius = 1e8;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, ceres_.get(), &summary);
    if (!summary.IsSolutionUsable()) throw ComputeError("the trajectory could not be adjusted: " + summary.message);
    result.cost = summary.final_cost;
    return static_cast<int>(summary.iterations.size()) - 1;
  }

  // The blocks of the inverse of the normal matrix at the frames asked for, in the tangent space (w, d) of
  // PoseIncrement. Without resections, positions or control the normal matrix is singular.
  std::vector<Matrix6> covariances() {
    ceres::Covariance::Options options;
    options.num_threads = 1;
    ceres::Covariance covariance(options);
    std::vector<std::pair<const double*, const double*>> blocks;
    for (const FrameIndex f : options_.covariance_of) blocks.emplace_back(frame(f), frame(f));
    if (!covariance.Compute(blocks, ceres_.get()))
      throw ComputeError("the trajectory's covariance cannot be computed: nothing fixes its datum");
    std::vector<Matrix6> result;
    for (const FrameIndex f : options_.covariance_of) {
      Eigen::Matrix<double, 6, 6, Eigen::RowMajor> block;
      covariance.GetCovarianceBlockInTangentSpace(frame(f), frame(f), block.data());
      result.push_back(block);
    }
    return result;
  }

  const JointInput& input_;
  const JointOptions& options_;
  std::size_t frames_;
  const double one_ = 1;
  std::vector<double> values_;  // one allocation, because Ceres orders parameter blocks by their addresses
  std::vector<double> registration_weight_, position_weight_, inverse_position_sigma_, view_weight_;
  std::vector<Matrix6> registration_white_;
  PoseManifold manifold_;
  std::unique_ptr<ceres::Problem> ceres_;
};

void check(const JointInput& input) {
  const auto frames = static_cast<std::int64_t>(input.start.size());
  const auto there = [&](FrameIndex f) { return f.value >= 0 && f.value < frames; };
  bool whole = input.pass.size() == input.start.size() && input.located.size() == input.start.size();
  for (const ChainLink& link : input.chain)
    whole &= there(link.from) && there(link.to) && link.rotation_sigma_rad > 0 && link.position_sigma_m > 0;
  for (const RegistrationLink& link : input.registrations) whole &= there(link.from) && there(link.to);
  for (const ResectedFrame& r : input.resections) whole &= there(r.frame);
  for (const PathPoint& p : input.points)
    for (const PathPoint::View& view : p.views) whole &= there(view.frame);
  if (!whole) throw InputError("trajectory: an observation names a frame that is not there or has no sigma");
}

}  // namespace

void JointOptions::check() const {
  if (!(registration_scale > 0 && first_registration_scale >= registration_scale))
    throw InputError("first_registration_scale must not be below registration_scale, both positive");
  if (!(position_sigma_m > 0 && first_position_sigma_m >= position_sigma_m))
    throw InputError("first_position_sigma_m must not be below position_sigma_m, both positive");
  if (!(position_scale > 0)) throw InputError("position_scale must be positive");
  if (!(attitude_sigma_deg > 0)) throw InputError("attitude_sigma_deg must be positive");
  if (position_neighbours < 1) throw InputError("position_neighbours must be at least 1");
  if (!(image_scale > 0 && first_image_scale >= image_scale))
    throw InputError("first_image_scale must not be below image_scale, both positive");
  if (rounds < 1 || iterations < 1 || last_iterations < 1)
    throw InputError("rounds, iterations and last_iterations must be at least 1");
}

JointResult adjust_jointly(const JointInput& input, const JointOptions& options) {
  check(input);
  return JointProblem(input, options).solve();
}

}  // namespace megablock
