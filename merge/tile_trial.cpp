#include "merge/tile_trial.h"

#include <memory>
#include <utility>

#include "geometry/workers.h"
#include "merge/point_equations.h"
#include "merge/point_portions.h"
#include "merge/unknowns.h"

namespace megablock {

TileTrial try_step(const BlockGauge& gauge, const std::vector<BlockMotion>& motions, std::int64_t tile,
                   const TileProblem& problem, const TilePlan& plan, const TileState& state, const Pass& pass,
                   const TileStep& step, double settled) {
  const bool robust = problem.image_loss.kind != RobustLoss::Kind::kNone;
  const TileMotion motion(gauge, motions, tile, problem, plan);
  TileTrial trial{motion.unknowns(state, step.unknowns), 0, step.damping_norm};
  std::vector<Eigen::Vector3d>& points = trial.state.points;
  const SeenImages seen(problem, trial.state);
  const UnknownMotions unknowns(plan, step.unknowns.values.data());
  const PointTables tables(problem, plan, state);
  PerThread<PointEquations> all_equations([&] { return std::make_unique<PointEquations>(problem, state, tables); });
  const PointPortions portions(plan);
  std::vector<double> damping_norms(at(portions.size()), 0);
  std::vector<LossSums> losses(at(portions.size()), LossSums(problem.image_loss));
  visit_in_parallel(portions.size(), [&](std::int64_t portion) {
    PointEquations& equations = all_equations.mine();
    double damping_norm = 0;
    LossSums loss(problem.image_loss);
    for (std::span<const std::int32_t> rest = portions[portion]; !rest.empty();) {
      rest = rest.subspan(equations.linearise(rest, pass));
      equations.steps(unknowns, points);
      for (std::size_t i = 0; i < equations.points().size(); ++i) {
        const std::int64_t p = equations.points()[i].point;
        damping_norm += equations.diagonal(i).dot(points[at(p)].cwiseAbs2());
        points[at(p)] = motion.point(state, p, points[at(p)]);
      }
      if (!robust) continue;
      const std::span<const double> squares = equations.squares_of(seen, points);
      for (const PointEquations::Point& point : equations.points())
        loss.add(point.point, squares.subspan(at(point.first), at(point.observation_count())));
    }
    damping_norms[at(portion)] = damping_norm;
    losses[at(portion)] = std::move(loss);
  });
  for (const double norm : damping_norms) trial.damping_norm += norm;
  trial.cost = robust ? refine_tail(problem, trial.state, seen, losses, settled) : evaluate_cost(problem, trial.state);
  return trial;
}

}  // namespace megablock
