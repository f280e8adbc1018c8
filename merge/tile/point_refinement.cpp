// Minimises the cost of a point X at held poses, with its residuals r_k and their derivatives J_k by X (prior
// included), s = |r_k|^2:
//
//     f(X) = 1/2 sum rho(s),   b = -f' = -sum rho' J'r,   f'' ~ sum rho' J'J + 2 rho'' (J'r)(J'r)'
//
// `reweighted` leaves out the second term. `curved` has it, but with 2 rho'' >= -rho' / s, so that the curvature along
// a residual, rho' + 2 s rho'', is not negative. The sweeps over the block keep a tenth of rho' there
// (kLeastCurvature), so that their normal equations stay positive definite; here damping does that. The steps are those
// of Levenberg and Marquardt,
//
//     (curved + mu diag(reweighted)) x = b,   mu /= 10 after a lower cost, mu *= 10 otherwise,
//
// and end when the root of the decrement b'V^-1 b, V = `reweighted`, is below the limit, in sigmas of the point as
// covariances state them. All points of a chunk make one trial at a time, so that their observations fill the lanes
// together.
#include "merge/tile/point_refinement.h"

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "adjust/lanes/residual_squares.h"
#include "adjust/lanes/tile_cost.h"
#include "adjust/terms/prior_loss.h"
#include "geometry/intersection/triangulation.h"
#include "geometry/numbers/decompositions.h"
#include "geometry/threads/workers.h"
#include "merge/plan/point_portions.h"
#include "merge/tile/point_equations.h"

namespace megablock {

namespace {

constexpr int kMaxSteps = 100;
constexpr double kLeastDamping = 1e-4, kMostDamping = 1e6;
constexpr std::size_t kAtOnce = 256;  // points at a time: their data stay in the second cache

// The cost of a point at held poses, with its derivatives.
struct PointCost {
  double images = 0, prior = 0;                          // infinite where a camera cannot project the point
  Eigen::Matrix3d reweighted = Eigen::Matrix3d::Zero();  // with weights rho' alone
  Eigen::Matrix3d curved = Eigen::Matrix3d::Zero();      // with the curvature of the loss
  Eigen::Vector3d b = Eigen::Vector3d::Zero();

  double whole() const { return images + prior; }
  bool finite() const { return std::isfinite(whole()); }
  double decrement_squared() const { return b.dot(solve_symmetric3(reweighted, b)); }
  Eigen::Vector3d step(double damping) const {
    return solve_symmetric3(curved + damping * Eigen::Matrix3d(reweighted.diagonal().asDiagonal()), b);
  }

  void add(const RobustLoss& loss, const Eigen::Vector2d& residual, const Eigen::Matrix<double, 2, 3>& by_point) {
    if (residual.allFinite())
      add_to(images, loss, residual, by_point);
    else
      images = std::numeric_limits<double>::infinity();
  }
  void add_prior(const RobustLoss& loss, const TileProblem::PointTerm& term, const Eigen::Vector3d& position) {
    add_to(prior, loss, point_prior_residual(position, term), Eigen::Matrix3d(term.sigma.cwiseInverse().asDiagonal()));
  }

 private:
  template <int Size>
  void add_to(double& part, const RobustLoss& loss, const Eigen::Matrix<double, Size, 1>& residual,
              const Eigen::Matrix<double, Size, 3>& by_point) {
    const double squares = residual.squaredNorm();
    const auto rho = loss.evaluate(squares);
    const Eigen::Vector3d along = by_point.transpose() * residual;
    const Eigen::Matrix3d normal = rho[1] * (by_point.transpose() * by_point);
    part += 0.5 * rho[0];
    b -= rho[1] * along;
    reweighted += normal;
    curved += normal;
    if (rho[2] < 0) curved += std::max(2 * rho[2], -rho[1] / squares) * (along * along.transpose());
  }
};

// A place at which the cost of a point is wanted.
struct Trial {
  std::int64_t point = -1;
  Eigen::Vector3d position;
};

// Computes the costs of many points at once, with their observations in lanes.
class PointCosts {
 public:
  PointCosts(const TileProblem& problem, const SeenImages& images)
      : problem_(problem), views_(images.views), lane_views_(images.lanes), prior_(prior_rows(problem)) {
    lanes_.reserve(ObservationLanes::kUsual);
  }

  void evaluate(std::span<const Trial> trials, std::vector<PointCost>& costs) {
    costs.assign(trials.size(), {});
    for (std::size_t t = 0; t < trials.size(); ++t) {
      const auto& [point, position] = trials[t];
      for (std::int64_t row = problem_.begin[point]; row < problem_.begin[point + 1]; ++row) {
        if (!problem_.kept[row]) continue;
        sources_[static_cast<std::size_t>(lanes_.size())] = {t, row};
        lanes_.add(lane_views_[problem_.image[row].value], position, problem_.x[row], problem_.y[row],
                   problem_.inverse_sigma[row]);
        if (lanes_.size() == ObservationLanes::kUsual) flush(trials, costs);
      }
      if (const std::int64_t i = prior_[static_cast<std::size_t>(point)]; i >= 0) {
        const TileProblem::PointTerm& term = problem_.point_priors[static_cast<std::size_t>(i)];
        costs[t].add_prior(loss_of(problem_, term), term, position);
      }
    }
    flush(trials, costs);
  }

 private:
  struct Source {
    std::size_t trial;
    std::int64_t row;
  };

  void flush(std::span<const Trial> trials, std::vector<PointCost>& costs) {
    lanes_.linearise();
    for (std::int64_t lane = 0; lane < lanes_.size(); ++lane) {
      const auto [trial, row] = sources_[static_cast<std::size_t>(lane)];
      PointCost& cost = costs[trial];
      if (lane_views_[problem_.image[row].value].simple) {
        cost.add(problem_.image_loss, lanes_.residual(lane), lanes_.by_point(lane));
      } else {
        add_other(trials[trial].position, row, cost);
      }
    }
    lanes_.clear();
  }
  // Adds an observation of a camera model that the lanes do not have.
  void add_other(const Eigen::Vector3d& position, std::int64_t row, PointCost& cost) const {
    const ImageView& view = views_[problem_.image[row].value];
    CameraResidual r;
    if (linearise_in_camera(view, position, {problem_.x[row], problem_.y[row]}, problem_.inverse_sigma[row], false,
                            r)) {
      cost.add(problem_.image_loss, r.residual, r.by_camera * view.rotation);
    } else {
      cost.images = std::numeric_limits<double>::infinity();
    }
  }

  const TileProblem& problem_;
  const std::vector<ImageView>& views_;
  const std::vector<LaneView>& lane_views_;
  std::vector<std::int64_t> prior_;
  ObservationLanes lanes_;
  std::array<Source, ObservationLanes::kUsual> sources_;
};

class PointRefiner {
 public:
  // `images` belong to the state and outlive the object.
  PointRefiner(const TileProblem& problem, TileState& state, const SeenImages& images, double settled)
      : problem_(problem),
        state_(state),
        settled_squared_(settled * settled),
        views_(images.views),
        costs_(problem, images) {}

  // Moves points to their optimum. Returns the cost of their observations there.
  double refine(std::span<const std::int64_t> points) {
    start(points);
    while (!trials_.empty()) {
      costs_.evaluate(trials_, costs_of_trials_);
      for (std::size_t t = 0; t < trials_.size(); ++t) judge(of_trial_[t], trials_[t].position, costs_of_trials_[t]);
      take_steps();
    }
    double images = 0;
    for (const Work& work : works_) {
      state_.points[static_cast<std::size_t>(work.point)] = work.position;
      images += work.cost.images;
    }
    return images;
  }

 private:
  struct Work {
    std::int64_t point = -1;
    Eigen::Vector3d position;
    PointCost cost;
    double damping = kLeastDamping;
    bool raised = false;
    int steps = 0;
    bool done = false;
  };

  void start(std::span<const std::int64_t> points) {
    works_.clear();
    trials_.clear();
    for (const std::int64_t point : points) trials_.push_back({point, state_.points[static_cast<std::size_t>(point)]});
    costs_.evaluate(trials_, costs_of_trials_);
    for (std::size_t t = 0; t < trials_.size(); ++t)
      works_.push_back({trials_[t].point, trials_[t].position, costs_of_trials_[t]});
    trials_.clear();
    of_trial_.clear();
    for (std::size_t w = 0; w < works_.size(); ++w) {
      // A point behind a camera starts from the intersection of its rays. If that has a finite cost, it is not done
      // after all.
      works_[w].done = !works_[w].cost.finite();
      if (!works_[w].done) continue;
      if (const auto position = intersection(works_[w].point)) try_position(w, *position);
    }
    costs_.evaluate(trials_, costs_of_trials_);
    for (std::size_t t = 0; t < trials_.size(); ++t) {
      if (!costs_of_trials_[t].finite()) continue;
      Work& work = works_[of_trial_[t]];
      work.position = trials_[t].position;
      work.cost = costs_of_trials_[t];
      work.done = false;
    }
    take_steps();
  }

  void try_position(std::size_t work, const Eigen::Vector3d& position) {
    trials_.push_back({works_[work].point, position});
    of_trial_.push_back(work);
  }

  // Makes the next trial of every point that is not done.
  void take_steps() {
    trials_.clear();
    of_trial_.clear();
    for (std::size_t w = 0; w < works_.size(); ++w) {
      Work& work = works_[w];
      // The condition is negated, so that a decrement that is no number ends the iteration.
      work.done |= work.steps == kMaxSteps || !(work.cost.decrement_squared() > settled_squared_);
      if (work.done) continue;
      ++work.steps;
      try_position(w, work.position + work.cost.step(work.damping));
    }
  }

  // Accepts a trial that lowers the cost; an infinite cost never does.
  void judge(std::size_t index, const Eigen::Vector3d& position, const PointCost& cost) {
    Work& work = works_[index];
    if (cost.whole() < work.cost.whole()) {
      work.position = position;
      work.cost = cost;
      if (!work.raised) work.damping /= 10;  // a damping that was just raised stays
      work.raised = false;
    } else {
      work.damping *= 10;
      work.raised = true;
      work.done = work.damping > kMostDamping;
    }
  }

  // Intersects the rays of all kept observations in the ground frame. A ray begins at the centre of the camera, C +
  // R'C_m.
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

  const TileProblem& problem_;
  TileState& state_;
  const double settled_squared_;
  const std::vector<ImageView>& views_;
  PointCosts costs_;
  // These belong to the present points.
  std::vector<Work> works_;
  std::vector<Trial> trials_;
  std::vector<std::size_t> of_trial_;  // [trials_] index in works_
  std::vector<PointCost> costs_of_trials_;
  std::vector<Ray> rays_;
};

}  // namespace

void LossSums::add(std::int64_t point, std::span<const double> squares) {
  double sum = 0;
  bool usual = true;
  for (const double s : squares) {
    sum += s;
    usual &= s <= usual_squares_;
  }
  if (usual) {  // the usual case: all that remains is to add up
    settled_ += sum;
    return;
  }
  double cost = 0;
  bool in_tail = false;
  for (const double s : squares) {
    const auto [rho, first, second] = loss_.evaluate(s);
    cost += std::isfinite(s) ? rho : std::numeric_limits<double>::infinity();
    in_tail |= !std::isfinite(s) || second < 0;
  }
  // The whole point goes to the tail: its cost is computed anew after it has moved.
  if (in_tail)
    tail_.push_back(point);
  else
    settled_ += cost;
}

double refine_tail(const TileProblem& problem, TileState& state, const SeenImages& images,
                   const std::vector<LossSums>& sums, double settled) {
  double cost = 0;
  std::vector<std::int64_t> tail;
  for (const LossSums& part : sums) {
    cost += 0.5 * part.settled();
    tail.insert(tail.end(), part.tail().begin(), part.tail().end());
  }
  PerThread<PointRefiner> refiners([&] { return std::make_unique<PointRefiner>(problem, state, images, settled); });
  // Chunks and portions have fixed borders, and their sums are added in order: the bits do not depend on the threads.
  std::vector<double> costs((tail.size() + kAtOnce - 1) / kAtOnce);
  visit_in_parallel(std::ssize(costs), [&](std::int64_t chunk) {
    const auto rest = std::span<const std::int64_t>(tail).subspan(static_cast<std::size_t>(chunk) * kAtOnce);
    costs[static_cast<std::size_t>(chunk)] = refiners.mine().refine(rest.first(std::min(kAtOnce, rest.size())));
  });
  for (const double of_chunk : costs) cost += of_chunk;
  return cost + other_cost(problem, state);
}

double refine_points(const TileProblem& problem, const TilePlan& plan, TileState& state, double settled) {
  if (problem.image_loss.kind == RobustLoss::Kind::kNone) return evaluate_cost(problem, state);
  const SeenImages seen(problem, state);
  PerThread<ResidualSquares> residuals([&] { return std::make_unique<ResidualSquares>(problem, state, seen); });
  const PointPortions portions(plan);
  std::vector<LossSums> of_portions(static_cast<std::size_t>(portions.size()), LossSums(problem.image_loss));
  visit_in_parallel(portions.size(), [&](std::int64_t portion) {
    LossSums& sums = of_portions[static_cast<std::size_t>(portion)];
    std::int64_t last = -1;
    std::vector<double> of_point;
    const auto finish = [&] {
      if (!of_point.empty()) sums.add(last, of_point);
      of_point.clear();
    };
    residuals.mine().visit(portions[portion], [&](std::int64_t point, std::int64_t, double squares) {
      if (point != last) finish();
      last = point;
      of_point.push_back(squares);
    });
    finish();
  });
  return refine_tail(problem, state, seen, of_portions, settled);
}

}  // namespace megablock
