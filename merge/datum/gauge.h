// Finds the directions of the datum that the observations of the block leave free, and fixes them by minimal
// constraints. Covariances are expressed under inner constraints. Every free direction is reported.
// A similarity of the ground has the rotation phi about the centroid c of a component, the shift L t and the scale 1 +
// s, where L is the extent of the component. It moves
//
//     points   dX = phi x (X - c) + L t + s (X - c)
//     frames   dw = -phi,  dC = phi x (C - c) + L t + s (C + R'C_0 - c)
//     mounts   dC_m = s (C_m - C_0),   C_0 that of the rig's first mount, which is held and so moves with the frame
//
// and changes no image residual; the scale only where two held mounts of a rig do not fix it. With N the matrix of
// these movements, the priors determine the similarity by the 7 x 7 matrix sum (J N)'(J N) of their residuals. Its null
// space is free: 7 directions for single cameras without priors, 6 with held rigs, 1 for positions on one straight
// line, 4 with attitudes only. A rotation also counts as free when the priors give it no better than to a radian, and a
// scale when they give it no better than to a factor (positions that are within their own noise of a straight line):
// the linearised system says nothing of such directions.
//
// The free directions belong to a connected component of the block, and are found before every sweep up. Pivots that
// vanish in spite of the datum (front.h) are unknowns that too few observations determine; they are reported as such.
// Components that see a free mount in common have a common scale. It is free when the priors of none of them fix it,
// and it is then one direction of all of them together.
//
// The minimal constraints hold one frame along the free directions, and a second frame along the directions that the
// first cannot hold (the scale, in one of the components that have it in common). Each adds D^1/2 P D^1/2 to the
// frame's own 6 x 6 block, where D is the diagonal of that block and P the projection on the directions. This couples
// no unknowns, makes no dense rows, adds nothing to the gradient, and leaves the decrement unchanged.
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

// A part of a tile that holds together, with the tile's information about the datum of its component.
struct GaugePart {
  std::vector<std::int64_t> boundary_frames;  // frames that other tiles may share, ascending indices of the block
  std::int64_t frames = 0;                    // number of frames of the part, boundary frames included
  std::int64_t lowest_frame = -1;             // index in the block
  Eigen::Vector3d lowest_centre = Eigen::Vector3d::Zero();
  std::array<std::int64_t, 6> extreme_frames{};  // indices of the frames with the smallest and largest east, north, up
  Eigen::Matrix<double, 3, 6> extreme_centres = Eigen::Matrix<double, 3, 6>::Zero();
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  // c of `normal`
  double extent = 1;                                 // L of `normal`, metres
  Matrix77 normal = Matrix77::Zero();                // sum (J N)'(J N) over the part's residuals
  Matrix77 held = Matrix77::Zero();  // sum N_C'N_C over held positions; N_C: the rows of N of a position
  std::vector<UnknownId> mounts;     // free mounts that see points of the part and that a scale moves
};

// The parts of one tile, by their lowest frame.
struct TileGauge {
  std::vector<GaugePart> parts;
  Bytes to_bytes() const;
  static TileGauge from_bytes(const Bytes& bytes);
};
TileGauge tile_gauge(const TileProblem& problem, const TilePlan& plan, const TileState& state);

// The reference place C + R'C_0 of a frame row.
Eigen::Vector3d reference_place(const TileProblem& problem, const TileState& state, std::size_t frame);

// The movement by a similarity about `centre`, with columns (phi, t, s). `reference` is the reference place of the
// frame.
Matrix67 similarity_of_frame(const Eigen::Vector3d& position, const Eigen::Vector3d& reference,
                             const Eigen::Vector3d& centre, double extent);
Matrix37 similarity_of_point(const Eigen::Vector3d& position, const Eigen::Vector3d& centre, double extent);
Matrix67 similarity_of_mount(const TileProblem& problem, const TileState& state, std::size_t mount);

// A connected component of the block.
struct BlockComponent {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double extent = 1;
  std::int64_t frames = 0;  // a frame on the separator counts once for each tile
  std::int64_t lowest_frame = -1;
  // The numbers of the further right-hand sides of its free directions: none when its datum is complete, at most 7, a
  // common scale last.
  std::vector<std::int64_t> columns;
  Matrix77 directions = Matrix77::Zero();  // first of its columns: the free combinations of (phi, t, s)
  std::int64_t defect = 0;  // its share of the block's defect: a common scale counts in one component only
  // The projection on the combinations that move no held position. A step may move the component along them as a whole
  // (block_motion.h).
  Matrix77 movable = Matrix77::Identity();
  // The centre of these movements: the centroid of the held positions, else the centre.
  Eigen::Vector3d pivot = Eigen::Vector3d::Zero();
  // N restricted to the free directions, with a column for each of `columns`.
  using FreeMoves = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic>;
  FreeMoves move_frame(const Eigen::Vector3d& position, const Eigen::Vector3d& reference) const;
  FreeMoves move_point(const Eigen::Vector3d& position) const;
  FreeMoves free_part(const Matrix67& similarity) const;
  Eigen::Matrix<double, 6, 1> weights() const;  // diagonal of W
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
  std::int64_t defect() const;  // sum over the components = number of further right-hand sides
  bool free() const { return defect() > 0; }
};
// Finds the datum of the block from all tiles, in tile order.
BlockGauge make_gauge(const std::vector<TileGauge>& tiles);

// The component of every frame row of a tile; nullptr: the row is untouched, or the datum of its component is complete.
std::vector<const BlockComponent*> free_component_of_frame(const BlockGauge& gauge, std::int64_t tile,
                                                           const TilePlan& plan);

// The part of the datum that one tile adds: its constraints and, if asked for, the rows W N of the frames that it owns.
TileDatum tile_datum(const BlockGauge& gauge, std::int64_t tile, const TileProblem& problem, const TilePlan& plan,
                     const TileState& state, bool with_columns);

// The datum in words and numbers, for the report.
struct GaugeReport {
  std::int64_t defect = 0;        // of the datum
  std::int64_t undetermined = 0;  // scalar unknowns held because too few observations determine them
  std::string text = "fixed by priors";
};
using UnknownName = std::function<std::string(const UnknownId&)>;
GaugeReport judge_gauge(
    const SubtreeSums& root, const BlockGauge& gauge = {},
    const UnknownName& name = [](const UnknownId& id) { return describe(id); });

}  // namespace megablock
