#include "merge/point_refinement.h"

#include <Eigen/Cholesky>
#include <limits>
#include <optional>
#include <vector>

#include "geometry/triangulation.h"
#include "merge/point_equations.h"

namespace megablock {

namespace {

constexpr int kMaxSteps = 100;
constexpr double kMaxDamping = 1e6;

class PointRefiner {
 public:
  PointRefiner(const TileProblem& problem, TileState& state, double settled)
      : problem_(problem),
        state_(state),
        settled_squared_(settled * settled),
        views_(image_views(problem, state)),
        prior_(prior_rows(problem)) {}

  void refine(std::int64_t point) {
    if (!in_tail(point)) return;
    Eigen::Vector3d& position = state_.points[static_cast<std::size_t>(point)];
    Equations now = equations(point, position);
    if (!std::isfinite(now.cost)) {
      const auto start = intersection(point);
      if (!start) return;
      now = equations(point, *start);
      if (!std::isfinite(now.cost)) return;
      position = *start;
    }
    double damping = 1e-4;
    bool raised = false;
    for (int step = 0; step < kMaxSteps && now.decrement_squared() > settled_squared_; ++step) {
      const Eigen::Vector3d trial = position + now.step(damping);
      Equations next = equations(point, trial);
      if (next.cost < now.cost) {
        position = trial;
        now = next;
        if (!raised) damping /= 10;  // else it is just right
        raised = false;
      } else {
        damping *= 10;
        raised = true;
        if (damping > kMaxDamping) return;
      }
    }
  }

 private:
  struct Equations {
    double cost = 0;
    Eigen::Matrix3d reweighted = Eigen::Matrix3d::Zero();  // rho' alone
    Eigen::Matrix3d curved = Eigen::Matrix3d::Zero();      // with the loss's curvature
    Eigen::Vector3d b = Eigen::Vector3d::Zero();

    double decrement_squared() const { return b.dot(reweighted.ldlt().solve(b)); }
    Eigen::Vector3d step(double damping) const {
      return (curved + damping * Eigen::Matrix3d(reweighted.diagonal().asDiagonal())).ldlt().solve(b);
    }
  };

  std::optional<Eigen::Vector3d> intersection(std::int64_t point) {
    rays_.clear();
    for (std::int64_t row = problem_.begin[point]; row < problem_.begin[point + 1]; ++row) {
      if (!problem_.kept[row]) continue;
      const ImageView& view = views_[problem_.image[row].value];
      const auto direction = viewing_ray(*view.intrinsics, {problem_.x[row], problem_.y[row]});
      if (!direction) return std::nullopt;
      const Eigen::Matrix3d to_ground = view.rotation.transpose();
      rays_.push_back({view.centre + to_ground * view.shift, to_ground * *direction});
    }
    return intersect_rays(rays_);
  }

  // Whether an observation lies beyond the corner or behind its camera; most points are settled by this.
  bool in_tail(std::int64_t point) const {
    if (problem_.image_loss.kind == RobustLoss::Kind::kCauchy) return true;  // it has no corner
    for (std::int64_t row = problem_.begin[point]; row < problem_.begin[point + 1]; ++row) {
      if (!problem_.kept[row]) continue;
      const Eigen::Vector2d difference =
          views_[problem_.image[row].value].difference_px(state_.points[point], {problem_.x[row], problem_.y[row]});
      const double squares = (problem_.inverse_sigma[row] * difference).squaredNorm();
      if (!std::isfinite(squares) || problem_.image_loss.evaluate(squares)[2] < 0) return true;
    }
    return false;
  }

  Equations equations(std::int64_t point, const Eigen::Vector3d& position) const {
    Equations e;
    for (std::int64_t row = problem_.begin[point]; row < problem_.begin[point + 1]; ++row) {
      if (!problem_.kept[row]) continue;
      const ImageView& view = views_[problem_.image[row].value];
      CameraResidual r;
      if (!linearise_in_camera(view, position, {problem_.x[row], problem_.y[row]}, problem_.inverse_sigma[row], false,
                               r)) {
        e.cost = std::numeric_limits<double>::infinity();
        return e;
      }
      const Eigen::Matrix<double, 2, 3> by_point = r.by_camera * view.rotation;
      const double squares = r.residual.squaredNorm();
      const auto rho = problem_.image_loss.evaluate(squares);
      const Eigen::Vector3d along = by_point.transpose() * r.residual;
      const Eigen::Matrix3d whole = rho[1] * (by_point.transpose() * by_point);
      e.cost += 0.5 * rho[0];
      e.b -= rho[1] * along;
      e.reweighted += whole;
      e.curved += whole;
      if (rho[2] < 0) {
        e.curved += std::max(2 * rho[2], -rho[1] / squares) * (along * along.transpose());
      }
    }
    if (const std::int64_t i = prior_[static_cast<std::size_t>(point)]; i >= 0) {
      const auto& term = problem_.point_priors[static_cast<std::size_t>(i)];
      const Eigen::Vector3d weight = term.sigma.cwiseInverse(), r = point_prior_residual(position, term);
      e.cost += 0.5 * r.squaredNorm();
      e.b -= weight.cwiseProduct(r);
      for (Eigen::Matrix3d* normal : {&e.reweighted, &e.curved}) normal->diagonal() += weight.cwiseAbs2();
    }
    return e;
  }

  const TileProblem& problem_;
  TileState& state_;
  const double settled_squared_;
  std::vector<ImageView> views_;
  std::vector<std::int64_t> prior_;
  std::vector<Ray> rays_;  // of the point at hand
};

}  // namespace

void refine_points(const TileProblem& problem, const TilePlan& plan, TileState& state, double settled) {
  if (problem.image_loss.kind == RobustLoss::Kind::kNone) return;
  PointRefiner refiner(problem, state, settled);
  for (const auto& cell : plan.points)
    for (std::int64_t point : cell) refiner.refine(point);
}

}  // namespace megablock
