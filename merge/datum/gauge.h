// Finds the directions of the datum that the observations of the block leave free, and fixes them by minimal
// constraints. Covariances are expressed under inner constraints. Every free direction is reported.
//
// similarity_information.h says how a similarity moves the unknowns (the matrix N) and what the observations tell of
// it, by the 7 x 7 matrix sum (J N)'(J N) of their residuals. Its null space is free: 7 directions for single cameras
// without priors, 6 with held rigs, 1 for positions on one straight line, 4 with attitudes only. A rotation also counts
// as free when the priors give it no better than to a radian, and a scale when they give it no better than to a factor
// (positions that are within their own noise of a straight line): the linearised system says nothing of such
// directions. A block that has held as many rotations, or a scale, goes on to hold them until the priors give them to a
// quarter of that. Otherwise a direction near the limit would be held and released in turns, and the iterations would
// not end.
//
// The free directions belong to a connected component of the block, and are found before every sweep up. Pivots that
// vanish in spite of the datum (front.h) are unknowns that too few observations determine; they are reported as such.
// Components that see a free mount in common have a common scale. It is free when the priors of none of them fix it,
// and it is then one direction of all of them together.
//
// The minimal constraints hold one frame along the free directions, and a second frame along the directions that the
// first cannot hold (the scale, in one of the components that have it in common). With N_f the six rows of N of a
// frame, D the diagonal of its own 6 x 6 block and B = Q'D^1/2, Q an orthonormal basis of the columns of D^1/2 N_f,
// each adds B'B = D^1/2 Q Q'D^1/2 to this block: the constraint B x_f = 0 with the weight of the observations of the
// frame. B N is regular. Then, for normal equations H x = b with b = -J'r and so N'b = 0,
//
//     (H + B'B)^-1 b is a solution x of H x = b with B x = 0,    b'(H + B'B)^-1 b = b'x,
//
// whatever the weight. The constraints thus move no adjusted observation and leave the decrement unchanged. They couple
// no unknowns, make no dense rows and add nothing to the gradient. A rotation or a scale that priors give, but hardly,
// is held in the same way, although for it neither H N nor N'b is quite zero. The constraint must then bear the pull of
// the priors. B'B has the weight kFirmly in such a component, because of the pull (N'b)^2 over this weight stays in the
// decrement.
#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <string>
#include <vector>

#include "adjust/problem/tile_problem.h"
#include "adjust/terms/similarity_information.h"
#include "merge/tile/condense.h"

namespace megablock {

// A part of a tile that holds together, with the tile's information about the datum of its component. It is small, and
// every rank gathers the parts of all tiles: the datum of the block follows from them alone.
struct GaugePart : SimilarityInformation {
  std::vector<std::int64_t> boundary_frames;  // frames that other tiles may share, ascending indices of the block
  std::int64_t frames = 0;                    // number of frames of the part, separator frames included
  std::int64_t lowest_frame = -1;             // index in the block
  Eigen::Vector3d lowest_centre = Eigen::Vector3d::Zero();
  // The second frame of the minimal constraints, far from the first one, is chosen among these.
  std::array<std::int64_t, 6> extreme_frames{};  // indices of the frames with the smallest and largest east, north, up
  Eigen::Matrix<double, 3, 6> extreme_centres = Eigen::Matrix<double, 3, 6>::Zero();
  std::vector<UnknownId> mounts;  // free mounts that see points of the part and that a scale moves
};

// The parts of one tile, by their lowest frame.
struct TileGauge {
  std::vector<GaugePart> parts;
  Bytes to_bytes() const;
  static TileGauge from_bytes(const Bytes& bytes);
};
// Needs all tables of the tile, also those that may lie in scratch (tile_store.h).
TileGauge tile_gauge(const TileProblem& problem, const TilePlan& plan, const TileState& state);

// The weight of constraints that hold a direction against priors. The other directions of the frame lose six digits.
inline constexpr double kFirmly = 1e6;

// A connected component of the block.
struct BlockComponent {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double extent = 1;
  std::int64_t frames = 0;  // a frame on the separator counts once for each tile
  std::int64_t lowest_frame = -1;
  // The numbers of its free directions among those of the block: none when its datum is complete, at most 7, a common
  // scale last.
  std::vector<std::int64_t> columns;
  Matrix77 directions = Matrix77::Zero();  // first of its columns: the free combinations of (phi, t, s)
  std::int64_t defect = 0;  // its share of the block's defect: a common scale counts in one component only
  HeldAgainstPriors against_priors;
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
  // Squares of rotations (rad) and of positions (in extents) weigh alike.
  Eigen::Matrix<double, 6, 1> weights() const;           // diagonal of W
  Eigen::Matrix<double, 6, 1> position_weights() const;  // the same for positions, 0 for rotations
  // N with all seven columns, whichever of them are free.
  Matrix67 similarity(const Eigen::Vector3d& position, const Eigen::Vector3d& reference) const;
};

// Holds one frame along `count` directions. The columns of `directions` are independent combinations of the columns of
// N_f.
struct GaugeConstraint {
  std::int64_t frame = -1;
  std::int64_t count = 0;
  double weight = 1;  // of B'B
  Matrix67 directions = Matrix67::Zero();
};

struct BlockGauge {
  std::vector<BlockComponent> components;
  std::vector<GaugeConstraint> constraints;
  std::vector<std::vector<std::int64_t>> part_component;  // [tiles][parts] row of components
  std::int64_t defect() const;                            // sum over the components
  bool free() const { return defect() > 0; }
  HeldAgainstPriors against_priors() const;  // of all components
  // The rows of the components whose datum is not complete.
  std::vector<std::size_t> free_components() const;
};
// Finds the datum of the block from all tiles, in tile order. The result has the same bits on every rank, as it depends
// on the gathered parts alone. `held_before`: by earlier data of the block.
BlockGauge make_gauge(const std::vector<TileGauge>& tiles, const HeldAgainstPriors& held_before = {});

// The component of every frame row of a tile; nullptr: the row is untouched, or the datum of its component is complete.
std::vector<const BlockComponent*> free_component_of_frame(const BlockGauge& gauge, std::int64_t tile,
                                                           const TilePlan& plan);

// The further right-hand sides of a sweep over a block with a free datum.
enum class DatumColumns : std::int32_t {
  kNone = 0,
  kSimilarities = 1,  // those of the S-transformations (inner_constraints.h)
  kFrames = 2         // unit vectors: the columns of the covariance that belong to the frames
};

// The part of the datum that one tile adds: its constraints and, with kSimilarities, the rows W N of the frames that it
// owns. Every frame is owned by one tile of the block, so that each constraint is added once.
TileDatum tile_datum(const BlockGauge& gauge, std::int64_t tile, const TileProblem& problem, const TilePlan& plan,
                     const TileState& state, DatumColumns columns);
// The further right-hand sides of kFrames: the unit vectors of the frames that the tile owns. `frames`: those of the
// whole block, ascending; frame k has the columns 6 k to 6 k + 5.
Step unit_columns(const UnknownList& frames, const TilePlan& plan);

// The datum in words and numbers, for the report.
struct GaugeReport {
  std::int64_t defect = 0;        // of the datum
  std::int64_t undetermined = 0;  // scalar unknowns held because too few observations determine them
  std::string text = "fixed by priors";
};
using UnknownName = std::function<std::string(const UnknownId&)>;
// `root` has the sums at the root of a sweep with lambda = 0. Without a gauge, as where fronts are eliminated alone,
// vanished pivots stand for the free datum.
GaugeReport judge_gauge(
    const SubtreeSums& root, const BlockGauge& gauge = {},
    const UnknownName& name = [](const UnknownId& id) { return describe(id); });

}  // namespace megablock
