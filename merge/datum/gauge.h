// Finds the directions of the datum that the observations of the block leave free, and fixes them by minimal
// constraints. Covariances are expressed under inner constraints. Every free direction is reported.
//
// A similarity of the ground (rotation phi about the component's centroid c, shift L t, scale 1 + s; L its extent)
// moves
//
//     points   dX = phi x (X - c) + L t + s (X - c)
//     frames   dw = -phi,  dC = phi x (C - c) + L t + s (C + R'C_0 - c)
//     mounts   dC_m = s (C_m - C_0),   C_0 that of the rig's first mount, which is held and so moves with the frame
//
// and changes no image residual (the scale only where two held mounts of a rig do not fix it). What the other residuals
// say of it is the 7 x 7 matrix sum (J N)'(J N) over the priors. Its null space is free: 7 directions for single
// cameras without priors, 6 with held rigs, 1 for positions on one straight line, 4 with attitudes only. So are
// rotations that the priors give to no better than a radian and scales that they give to no better than a factor
// (positions within their own noise of a straight line): the system linearised at hand says nothing of them.
// It belongs to a connected component of the block and is found before every pass; pivots that vanish in spite of it
// (front.h) are unknowns that too few observations determine, reported as such. Components that see a free mount in
// common have one scale: it is free when none of them is told it, and then it is one direction of all of them.
//
// Minimal constraints: one frame is held along the free directions, a second one along what is left (the scale, of one
// of the components that have it in common), each by adding D^1/2 P D^1/2 to its own 6 x 6 block: no coupling, no dense
// rows, nothing added to the gradient, and the decrement stays as it is.
#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <string>
#include <vector>

#include "adjust/problem/tile_problem.h"
#include "merge/tile/condense.h"

namespace megablock {

using Matrix37 = Eigen::Matrix<double, 3, 7>;
using Matrix67 = Eigen::Matrix<double, 6, 7>;
using Matrix77 = Eigen::Matrix<double, 7, 7>;

// Part of a tile that hangs together: what the tile says of its component's datum.
struct GaugePart {
  std::vector<std::int64_t> boundary_frames;  // global frame indices that other tiles may share, ascending
  std::int64_t frames = 0;                    // of the part, boundary ones included
  std::int64_t lowest_frame = -1;             // global index
  Eigen::Vector3d lowest_centre = Eigen::Vector3d::Zero();
  std::array<std::int64_t, 6> extreme_frames{};  // smallest and largest east, north, up
  Eigen::Matrix<double, 3, 6> extreme_centres = Eigen::Matrix<double, 3, 6>::Zero();
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  // of `normal`
  double extent = 1;                                 // of `normal`, metres
  Matrix77 normal = Matrix77::Zero();                // sum (J N)'(J N) over the part's residuals
  Matrix77 held = Matrix77::Zero();                  // sum N_C'N_C over held positions, N_C their rows of N
  std::vector<UnknownId> mounts;                     // free ones that its points are seen by and a scale moves
};

// Of one tile, parts by lowest frame.
struct TileGauge {
  std::vector<GaugePart> parts;
  Bytes to_bytes() const;
  static TileGauge from_bytes(const Bytes& bytes);
};
TileGauge tile_gauge(const TileProblem& problem, const TilePlan& plan, const TileState& state);

// C + R'C_0 of a frame row.
Eigen::Vector3d reference_place(const TileProblem& problem, const TileState& state, std::size_t frame);

// Movement by a similarity about `centre`, columns (phi, t, s). `reference`: the frame's reference place.
Matrix67 similarity_of_frame(const Eigen::Vector3d& position, const Eigen::Vector3d& reference,
                             const Eigen::Vector3d& centre, double extent);
Matrix37 similarity_of_point(const Eigen::Vector3d& position, const Eigen::Vector3d& centre, double extent);
Matrix67 similarity_of_mount(const TileProblem& problem, const TileState& state, std::size_t mount);

// A connected component of the block.
struct BlockComponent {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double extent = 1;
  std::int64_t frames = 0;  // boundary frames counted once per tile
  std::int64_t lowest_frame = -1;
  // The further right-hand sides of its free directions, 0 (complete) to 7, a common scale last.
  std::vector<std::int64_t> columns;
  Matrix77 directions = Matrix77::Zero();  // first of its columns: combinations of (phi, t, s) that are free
  std::int64_t defect = 0;                 // of the block, by this component: a common scale counts in one of them
  // Projection on the combinations that move no held position: what a step may move as a whole (block_motion.h).
  Matrix77 movable = Matrix77::Identity();
  Eigen::Vector3d pivot = Eigen::Vector3d::Zero();  // about which: centroid of the held positions, else the centre
  // N, restricted to the free directions: a column for each of `columns`.
  using FreeMoves = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic>;
  FreeMoves move_frame(const Eigen::Vector3d& position, const Eigen::Vector3d& reference) const;
  FreeMoves move_point(const Eigen::Vector3d& position) const;
  FreeMoves free_part(const Matrix67& similarity) const;
  Eigen::Matrix<double, 6, 1> weights() const;  // W
};

// Holds one frame along `count` directions.
struct GaugeConstraint {
  std::int64_t frame = -1;
  std::int64_t count = 0;
  Matrix67 directions = Matrix67::Zero();
};

struct BlockGauge {
  std::vector<BlockComponent> components;
  std::vector<GaugeConstraint> constraints;
  std::vector<std::vector<std::int64_t>> part_component;  // [tiles][parts] row of components
  std::int64_t defect() const;                            // sum over components = further right-hand sides
  bool free() const { return defect() > 0; }
};
// From all tiles, in tile order.
BlockGauge make_gauge(const std::vector<TileGauge>& tiles);

// Component of every frame row of a tile; nullptr: untouched, or its datum is complete.
std::vector<const BlockComponent*> free_component_of_frame(const BlockGauge& gauge, std::int64_t tile,
                                                           const TilePlan& plan);

// What one tile adds: its constraints, and (when asked for) the rows W N of the frames that it owns.
TileDatum tile_datum(const BlockGauge& gauge, std::int64_t tile, const TileProblem& problem, const TilePlan& plan,
                     const TileState& state, bool with_columns);

// For the report.
struct GaugeReport {
  std::int64_t defect = 0;        // of the datum
  std::int64_t undetermined = 0;  // scalar unknowns held because too little observes them
  std::string text = "fixed by priors";
};
using UnknownName = std::function<std::string(const UnknownId&)>;
GaugeReport judge_gauge(
    const SubtreeSums& root, const BlockGauge& gauge = {},
    const UnknownName& name = [](const UnknownId& id) { return describe(id); });

}  // namespace megablock
