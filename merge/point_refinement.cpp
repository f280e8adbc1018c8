#include "merge/point_refinement.h"

#include <Eigen/Cholesky>
#include <limits>
#include <optional>
#include <vector>

#include "adjust/residual_squares.h"
#include "geometry/triangulation.h"
#include "merge/point_equations.h"

namespace megablock {

namespace {

constexpr int kMaxSteps = 100;
constexpr double kMaxDamping = 1e6;

class PointRefiner {
 public:
  // `views`: of the state's images (image_views).
  PointRefiner(const TileProblem& problem, TileState& state, const std::vector<ImageView>& views, double settled)
      : problem_(problem),
        state_(state),
        settled_squared_(settled * settled),
        views_(views),
        prior_(prior_rows(problem)) {}

  void refine(std::int64_t point) {
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
  const std::vector<ImageView>& views_;
  std::vector<std::int64_t> prior_;
  std::vector<Ray> rays_;  // of the point at hand
};

// Observations of points one after the other: their loss, and whether one lies beyond the corner (Cauchy's loss has
// none: all of it is tail) or behind its camera.
class LossSums {
 public:
  explicit LossSums(const RobustLoss& loss) : loss_(loss) {}
  void add(std::int64_t point, double squares) {
    if (point != point_) finish();
    point_ = point;
    const auto [rho, first, second] = loss_.evaluate(squares);
    of_point_ += std::isfinite(squares) ? rho : std::numeric_limits<double>::infinity();
    in_tail_ |= !std::isfinite(squares) || second < 0;
  }
  void finish() {
    if (in_tail_) {
      tail_.push_back(point_);
    } else {
      settled_ += of_point_;
    }
    of_point_ = 0;
    in_tail_ = false;
  }
  double settled() const { return settled_; }  // of all other points
  const std::vector<std::int64_t>& tail() const { return tail_; }

 private:
  RobustLoss loss_;
  std::int64_t point_ = -1;
  double of_point_ = 0, settled_ = 0;
  bool in_tail_ = false;
  std::vector<std::int64_t> tail_;
};

}  // namespace

double refine_points(const TileProblem& problem, const TilePlan& plan, TileState& state, double settled) {
  if (problem.image_loss.kind == RobustLoss::Kind::kNone) return evaluate_cost(problem, state);
  ResidualSquares residuals(problem, state);
  LossSums sums(problem.image_loss);
  for (const auto& cell : plan.points)
    residuals.visit(cell, [&](std::int64_t point, std::int64_t, double squares) { sums.add(point, squares); });
  sums.finish();
  if (!sums.tail().empty()) {
    PointRefiner refiner(problem, state, residuals.views(), settled);
    for (const std::int64_t point : sums.tail()) refiner.refine(point);
  }
  double images = sums.settled();
  residuals.visit(sums.tail(), [&](std::int64_t, std::int64_t, double squares) {
    images +=
        std::isfinite(squares) ? problem.image_loss.evaluate(squares)[0] : std::numeric_limits<double>::infinity();
  });
  return 0.5 * images + other_cost(problem, state);
}

}  // namespace megablock
