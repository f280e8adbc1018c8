// The frames, cameras and mounts of the trial state are known before the first point, so that the images of the new
// state can be prepared once (`seen_`). A portion then takes each batch of points through the whole way: linearise at
// the old state, solve for the steps, move the points, and evaluate the new residuals in the same lanes. Without a loss
// there is no tail to refine, and the cost is computed by the common function afterwards.
#include "merge/step/tile_trial.h"

#include <memory>
#include <utility>

#include "adjust/lanes/tile_cost.h"
#include "geometry/threads/workers.h"
#include "merge/plan/point_portions.h"
#include "merge/plan/unknowns.h"
#include "merge/tile/point_equations.h"

namespace megablock {

class TileTrialMaker::Work {
 public:
  Work(const BlockGauge& gauge, const std::vector<BlockMotion>& motions, std::int64_t tile, const TileProblem& problem,
       const TilePlan& plan, const TileState& state, const Sweep& sweep, const TileStep& step, double settled)
      : problem_(problem),
        state_(state),
        sweep_(sweep),
        settled_(settled),
        robust_(problem.image_loss.kind != RobustLoss::Kind::kNone),
        motion_(gauge, motions, tile, problem, plan),
        trial_{motion_.unknowns(state, step.unknowns), 0, step.damping_norm},
        seen_(problem, trial_.state),
        unknowns_(plan, step.unknowns.values.data()),
        tables_(problem, plan, state),
        equations_([this] { return std::make_unique<PointEquations>(problem_, state_, tables_); }),
        portions_(plan),
        damping_norms_(at(portions_.size()), 0),
        losses_(at(portions_.size()), LossSums(problem.image_loss)) {}
  std::int64_t portions() const { return portions_.size(); }
  void visit(std::int64_t portion);
  TileTrial take();

 private:
  const TileProblem& problem_;
  const TileState& state_;
  const Sweep sweep_;
  const double settled_;
  const bool robust_;
  const TileMotion motion_;
  TileTrial trial_;
  const SeenImages seen_;  // views of the new state
  const UnknownMotions unknowns_;
  const PointTables tables_;
  PerThread<PointEquations> equations_;
  const PointPortions portions_;
  std::vector<double> damping_norms_;  // [portions]
  std::vector<LossSums> losses_;       // [portions]
};

void TileTrialMaker::Work::visit(std::int64_t portion) {
  PointEquations& equations = equations_.mine();
  std::vector<Eigen::Vector3d>& points = trial_.state.points;
  double damping_norm = 0;
  LossSums loss(problem_.image_loss);
  for (std::span<const std::int32_t> rest = portions_[portion]; !rest.empty();) {
    rest = rest.subspan(equations.linearise(rest, sweep_));
    equations.steps(unknowns_, points);
    for (std::size_t i = 0; i < equations.points().size(); ++i) {
      const std::int64_t p = equations.points()[i].point;
      damping_norm += equations.diagonal(i).dot(points[at(p)].cwiseAbs2());
      // The step of the point was written to the place of its new position; it ends its life here.
      points[at(p)] = motion_.point(state_, p, points[at(p)]);
    }
    if (!robust_) continue;
    const std::span<const double> squares = equations.squares_of(seen_, points);
    for (const PointEquations::Point& point : equations.points())
      loss.add(point.point, squares.subspan(at(point.first), at(point.observation_count())));
  }
  damping_norms_[at(portion)] = damping_norm;
  losses_[at(portion)] = std::move(loss);
}

TileTrial TileTrialMaker::Work::take() {
  for (const double norm : damping_norms_) trial_.damping_norm += norm;
  trial_.cost =
      robust_ ? refine_tail(problem_, trial_.state, seen_, losses_, settled_) : evaluate_cost(problem_, trial_.state);
  return std::move(trial_);
}

TileTrialMaker::TileTrialMaker(const BlockGauge& gauge, const std::vector<BlockMotion>& motions, std::int64_t tile,
                               const TileProblem& problem, const TilePlan& plan, const TileState& state,
                               const Sweep& sweep, const TileStep& step, double settled)
    : work_(std::make_unique<Work>(gauge, motions, tile, problem, plan, state, sweep, step, settled)) {}

TileTrialMaker::~TileTrialMaker() = default;

std::int64_t TileTrialMaker::portions() const { return work_->portions(); }

void TileTrialMaker::visit(std::int64_t portion) { work_->visit(portion); }

TileTrial TileTrialMaker::take() { return work_->take(); }

TileTrial try_step(const BlockGauge& gauge, const std::vector<BlockMotion>& motions, std::int64_t tile,
                   const TileProblem& problem, const TilePlan& plan, const TileState& state, const Sweep& sweep,
                   const TileStep& step, double settled) {
  TileTrialMaker trial(gauge, motions, tile, problem, plan, state, sweep, step, settled);
  visit_in_parallel(trial.portions(), [&](std::int64_t portion) { trial.visit(portion); });
  return trial.take();
}

}  // namespace megablock
