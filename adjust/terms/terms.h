// Declares the table of observation types. Every loop over the observations of a tile uses it, whatever their types
// are.
//
// A row of a type (one position, one line ...) gives the unknowns that it touches, its residual r (divided by its
// sigma, no unit) with derivatives by them, its robust loss, and its information about the datum. Costs, plans of
// tiles, normal equations, covariances, redundancies, datum, sigma scales and the Ceres reference are loops over the
// table. Image observations are not in it: there are a thousand of them for each row of any other type, and the kernels
// of adjust/lanes and merge/tile are made for them.
//
// To add a type (docs/developer/add-observation.md):
//   1. write a source file in adjust/terms: the mathematics at its head, a class derived from ObservationType, and a
//      function that returns the one object of it;
//   2. add one line to the table in terms.cpp;
//   3. give it its kinds (name, word) in io/block/observation_statistics.h;
//   4. where it is a number between two frames, give it a row in io/block/frame_measurements.cpp: the project file, the
//      block's file, tiles and fingerprints then know it.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <variant>
#include <vector>

#include "adjust/problem/tile_problem.h"
#include "io/block/observation_statistics.h"
#include "io/block/observed_poses.h"

namespace ceres {
class CostFunction;
}

namespace megablock {

// The rows of the problem's tables on which a residual depends, whether they are held or not.
struct TermUnknowns {
  std::array<std::int32_t, 2> frame{-1, -1};
  int frame_count = 0;
  std::array<std::int32_t, 2> mounts{-1, -1};  // -1: none
  std::int32_t camera = -1;                    // -1: none
  std::int64_t point = -1;                     // the tile or cell that owns the point owns the row
};

// A linearised row, or a part of it that has a loss of its own. Everything is divided by sigma; no loss is applied.
struct LinearTerm {
  using Jacobian = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 6, kMaxIntrinsics>;
  enum class By : std::uint8_t { kFrame, kMount, kCamera };
  struct Block {
    By by = By::kFrame;
    std::int32_t row = -1;  // row of the problem's table
    Jacobian jacobian;      // by the 6 of a pose, or by all parameters of a camera
  };
  Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, 6, 1> residual;
  double squares = 0;  // |r|^2, summed in the order of the type
  int number = 0;      // number of scalar observations; an axis without a sigma is none
  std::array<Block, 3> blocks;
  int block_count = 0;
  std::array<ObservationKind, 6> kinds{};  // [residual]
  RobustLoss loss;

  template <int kRows>
  void set_residual(const Eigen::Matrix<double, kRows, 1>& r) {
    residual = r;
    squares = r.squaredNorm();
    number = kRows;
  }
  template <typename Derived>
  void add_block(By by, std::int32_t row, const Eigen::MatrixBase<Derived>& jacobian) {
    Block& block = blocks[static_cast<std::size_t>(block_count++)];
    block.by = by;
    block.row = row;
    block.jacobian = jacobian;
  }
};
using TermVisit = std::function<void(const LinearTerm&)>;

// The residual of an observed position, with the derivatives by the frame, the receiver and the shift of its group
// (position_terms.cpp). Without a loss.
LinearTerm linearise_position(const TileProblem::PositionTerm& term, const TileState& state);

// The information of a row about the place, direction and scale of the part of the block that holds `frame`.
struct TermDatum {
  std::int32_t frame = -1;  // -1: none
  // The derivative by the pose of `frame`, where all frames of the row move as one body. A held prior counts with a
  // firm sigma (comparable() in io/block/held_priors.h), so that it does not hide all others.
  std::variant<std::monostate, Eigen::Matrix<double, 1, 6>, Eigen::Matrix<double, 2, 6>, Eigen::Matrix<double, 3, 6>>
      by_frame;
  bool holds_place = false;
  // The row observes the length of the base from `frame` to this frame, and thus only the scale. It is stored
  // separately, because the other directions would cancel only up to rounding.
  std::int32_t base_to = -1;
  double base_sigma_m = 0;
};

// A factor for the sigmas of each kind of observation. Groups of positions (io/block/observed_poses.h) may have factors
// of their own in place of those of the kind.
struct SigmaScales {
  static constexpr std::size_t kMostGroups = 32;
  std::array<double, kObservationKinds> of;
  std::int64_t group_count = 0;
  std::array<PositionScale, kMostGroups> groups{};  // the first group_count, ascending
  SigmaScales() { of.fill(1); }
  double& operator[](ObservationKind kind) { return of[static_cast<std::size_t>(kind)]; }
  double operator[](ObservationKind kind) const { return of[static_cast<std::size_t>(kind)]; }
  std::span<const PositionScale> of_groups() const { return {groups.data(), static_cast<std::size_t>(group_count)}; }
  // The factors of the positions of a group, or of those without one.
  PositionScale of_positions(RigIndex group) const;
  // Whether a group has factors of its own, or may get them.
  bool has_place_for(RigIndex group) const;
  // Gives a group factors of its own, if there is place for it.
  void set_positions(const PositionScale& scale);
  // Multiplies by the factors of `change`. It has all groups that these factors have.
  void multiply(const SigmaScales& change);
  // Whether a factor, or its inverse, is larger than this one.
  bool differ_by(double factor) const;
  bool matter() const { return differ_by(1.02); }  // a smaller factor changes a weight by 4 % at most
};

class ObservationType {
 public:
  virtual ~ObservationType() = default;
  virtual std::size_t count(const TileProblem& problem) const = 0;  // number of rows
  virtual TermUnknowns unknowns(const TileProblem& problem, std::size_t row) const = 0;
  // Calls `visit` once, or once for each part; not at all for a row that takes no part.
  virtual void linearise(const TileProblem& problem, const TileState& state, std::size_t row,
                         const TermVisit& visit) const = 0;
  virtual TermDatum datum(const TileProblem&, const TileState&, std::size_t) const { return {}; }
  // The loss of a row, for Ceres: the same as linearise() gives with the row.
  virtual RobustLoss loss(const TileProblem&, std::size_t) const { return {}; }
  // Multiplies the sigmas of all rows, if they may be estimated (observation_statistics.h says which).
  virtual void scale_sigmas(TileProblem&, const SigmaScales&) const {}
  // A cost function for Ceres by automatic differentiation. Its blocks are those of unknowns(): frames, mounts, camera,
  // point. The caller owns it.
  virtual ceres::CostFunction* automatic(const TileProblem& problem, std::size_t row) const = 0;
};

// Normal equations, sums of squares and Ceres add their observations in this order, on which the bits of a sum depend.
std::span<const ObservationType* const> observation_types();
// The order in which costs are summed: relative poses come before lines and verticals there.
std::span<const ObservationType* const> observation_types_of_cost();

// A row of a type in the table.
struct TermRow {
  std::int32_t type = 0, row = 0;
};

}  // namespace megablock
