// Puts the graph into the tables of a tile and solves it with Ceres once. Screening is not done here:
// intersect_tracks() has tested the observations, and the loss forgets those that are far off. Cauchy's loss for
// positions and verticals stands in for those of the project, because start values are worse than what these losses are
// made for.
#include "adjust/orientation/steps/coarse_adjustment.h"

#include <ceres/ordered_groups.h>
#include <ceres/solver.h>

#include <cmath>

#include "adjust/terms/vertical_terms.h"
#include "adjust/tile/ceres_problem.h"
#include "io/base/error.h"

namespace megablock {

namespace {

// The graph's oriented part as a tile; `frame_row` maps graph frames to rows of the problem, -1: not oriented.
struct CoarseTile {
  TileProblem problem;
  TileState state;
  std::vector<std::int32_t> frame_row;
  std::vector<std::size_t> track;  // of each point
};

void add_frames(const OrientationGraph& graph, const OrientationValues& values, bool use_positions, CoarseTile& tile) {
  tile.frame_row.assign(graph.frames.size(), -1);
  for (std::size_t f = 0; f < graph.frames.size(); ++f) {
    if (!values.frames[f]) continue;
    const LocalFrame row(static_cast<std::int32_t>(tile.problem.frames.size()));
    tile.frame_row[f] = row.value;
    tile.problem.frames.push_back(graph.frames[f].index);
    tile.state.frames.push_back(*values.frames[f]);
    if (graph.frames[f].given) continue;
    if (graph.frames[f].position && use_positions) tile.problem.positions.push_back({row, *graph.frames[f].position});
    if (graph.frames[f].attitude) tile.problem.attitudes.push_back({row, *graph.frames[f].attitude});
  }
}

// Parameters that are free and have a finite sigma keep their prior; mounts are held, and every image has a row of its
// own for its mount.
void add_cameras(const Block& block, const OrientationGraph& graph, const OrientationValues& values,
                 const CoarseOptions& options, CoarseTile& tile) {
  tile.problem.cameras = graph.cameras;
  tile.problem.camera_free = options.camera_free;
  tile.state.cameras = values.cameras;
  for (std::size_t c = 0; c < graph.cameras.size(); ++c) {
    const Camera& camera = block.cameras[graph.cameras[c]];
    TileProblem::IntrinsicTerm term{LocalCamera(static_cast<std::int32_t>(c)), camera.intrinsics, {}};
    bool any = false;
    for (int p = 0; p < camera.intrinsics.size(); ++p) {
      const auto k = static_cast<std::size_t>(p);
      const double sigma = camera.prior_sigma[k];
      // Parameters that are held here need no prior.
      const bool stated = sigma > 0 && std::isfinite(sigma) && contains(options.camera_free[c], p);
      term.sigma[k] = stated ? sigma : std::numeric_limits<double>::infinity();
      any |= stated;
    }
    if (any) tile.problem.intrinsic_priors.push_back(term);
  }
  const auto reference = [&](RigIndex rig) { return block.rigs[rig].mounts.front().pose.centre; };
  for (const FrameIndex frame : tile.problem.frames)
    tile.problem.reference_of_frame.push_back(reference(block.frames[frame].rig));
  // A row per image keeps the tables simple; mounts are held here.
  for (std::size_t i = 0; i < graph.images.size(); ++i) {
    const auto& image = graph.images[i];
    const RigIndex rig = block.frames[graph.frames[static_cast<std::size_t>(image.frame)].index].rig;
    tile.problem.mounts.push_back({rig, block.images[image.index].mount});
    tile.problem.reference_of_mount.push_back(reference(rig));
    tile.state.mounts.push_back(image.mount);
    tile.problem.images.push_back({image.index, LocalFrame(tile.frame_row[static_cast<std::size_t>(image.frame)]),
                                   LocalCamera(image.camera), static_cast<std::int32_t>(i)});
  }
  tile.problem.mount_free.assign(tile.problem.mounts.size(), 0);
}

void add_verticals(const Block& block, const OrientationGraph& graph, CoarseTile& tile) {
  const GroundVertical ground(block.ground);
  for (std::size_t i = 0; i < graph.images.size(); ++i) {
    const auto& image = graph.images[i];
    const std::int32_t frame = tile.frame_row[static_cast<std::size_t>(image.frame)];
    if (image.vertical == nullptr || frame < 0 || graph.frames[static_cast<std::size_t>(image.frame)].given) continue;
    tile.problem.verticals.push_back(
        vertical_term(*image.vertical, ground, tile.state.frames[static_cast<std::size_t>(frame)].centre));
    tile.problem.verticals.back().image = LocalImage(static_cast<std::int32_t>(i));
  }
}

// Points with a position and their kept observations. An observation without a frame, or behind its camera, is left
// out.
void add_points(const OrientationGraph& graph, const OrientationValues& values, double inverse_sigma,
                CoarseTile& tile) {
  TileProblem& problem = tile.problem;
  problem.begin = {0};
  for (std::size_t t = 0; t < values.points.size(); ++t) {
    if (!values.points[t]) continue;
    for (auto o = static_cast<std::size_t>(graph.begin[t]); o < static_cast<std::size_t>(graph.begin[t + 1]); ++o) {
      if (!values.kept[o]) continue;
      const std::int32_t image = graph.observations[o].image;
      const auto camera = values.camera(graph, image);
      if (!camera) continue;
      const Intrinsics& intrinsics =
          values.cameras[static_cast<std::size_t>(graph.images[static_cast<std::size_t>(image)].camera)];
      // Ceres refuses a start at which a residual cannot be evaluated.
      if (!project(intrinsics, to_inside(*camera, *values.points[t])).allFinite()) continue;
      problem.image.push_back(LocalImage(image));
      problem.x.push_back(graph.observations[o].pixel.x());
      problem.y.push_back(graph.observations[o].pixel.y());
    }
    problem.points.push_back({PointRole::kTie, static_cast<std::int64_t>(t)});
    problem.begin.push_back(static_cast<std::int64_t>(problem.image.size()));
    tile.state.points.push_back(*values.points[t]);
    tile.track.push_back(t);
  }
  problem.inverse_sigma.assign(problem.image.size(), inverse_sigma);
  problem.kept.assign(problem.image.size(), 1);
}

}  // namespace

void adjust_coarsely(const Block& block, const OrientationGraph& graph, const CoarseOptions& options,
                     OrientationValues& values) {
  CoarseTile tile;
  add_frames(graph, values, options.use_positions, tile);
  add_cameras(block, graph, values, options, tile);
  add_verticals(block, graph, tile);
  add_points(graph, values, 1 / options.observations.image_sigma_px, tile);
  // The scale is given in pixels; the residuals of a tile are in sigmas.
  tile.problem.image_loss = {RobustLoss::Kind::kCauchy, options.loss_scale_px / options.observations.image_sigma_px};
  tile.problem.position_loss = {RobustLoss::Kind::kCauchy, 3.0};
  tile.problem.vertical_loss = {RobustLoss::Kind::kCauchy, 3.0};

  CeresOptions ceres_options;
  ceres_options.derivatives = CeresOptions::Derivatives::kAnalytic;
  CeresTile ceres(tile.problem, tile.state, ceres_options);
  for (std::size_t f = 0; f < graph.frames.size(); ++f)
    if (tile.frame_row[f] >= 0 && graph.frames[f].given &&
        ceres.problem().HasParameterBlock(ceres.frame(tile.frame_row[f])))
      ceres.problem().SetParameterBlockConstant(ceres.frame(tile.frame_row[f]));

  ceres::Solver::Options solver;
  constexpr std::size_t kDenseFrames = 200;  // below, dense is faster
  solver.linear_solver_type = tile.state.frames.size() <= kDenseFrames ? ceres::DENSE_SCHUR : ceres::SPARSE_SCHUR;
  solver.dense_linear_algebra_library_type = ceres::LAPACK;
  solver.linear_solver_ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  std::vector<double*> blocks;
  ceres.problem().GetParameterBlocks(&blocks);
  for (double* block_values : blocks)
    solver.linear_solver_ordering->AddElementToGroup(block_values, ceres.is_point(block_values) ? 0 : 1);
  solver.max_num_iterations = options.max_iterations;
  solver.function_tolerance = options.function_tolerance;
  solver.num_threads = 1;
  solver.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &ceres.problem(), &summary);
  if (!summary.IsSolutionUsable()) throw ComputeError("the coarse adjustment failed: " + summary.message);

  ceres.store(tile.state);
  for (std::size_t f = 0; f < graph.frames.size(); ++f)
    if (tile.frame_row[f] >= 0) values.frames[f] = tile.state.frames[static_cast<std::size_t>(tile.frame_row[f])];
  values.cameras = tile.state.cameras;
  for (std::size_t p = 0; p < tile.track.size(); ++p) values.points[tile.track[p]] = tile.state.points[p];
}

}  // namespace megablock
