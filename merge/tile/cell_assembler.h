// Fills the front of a cell with its points, which are eliminated on the way, and its other observations.
//
// Per point (point_equations.h) K_ij -= Y_i Y_j' of shared unknowns goes to the front at once, that of two frames to a
// block apart (pair_blocks.h). Added to the front once per cell are these blocks and what only concerns one frame or
// the shared unknowns of one camera in one mount, J'J and -J'r: of a frame G'(V_f - T T')G and G'(b_f - T z) of its
// sights, T = V_f C^-T. By its blocks, with R = V_f - T T', the first is [u]x R [u]x', -[u]x R and R. Further the
// diagonal of J'J (point_kernels::FrameValue).
#pragma once

#include <vector>

#include "merge/front/front.h"
#include "merge/tile/pair_blocks.h"
#include "merge/tile/point_equations.h"

namespace megablock {

// Adds the block of two unknowns at (row, column) of the front, transposed when it would lie above the diagonal; of a
// diagonal block (row = column) the lower triangle alone counts.
void add_block(Front& front, std::int64_t row, std::int64_t column, const Eigen::Ref<const Eigen::MatrixXd>& block);

class CellAssembler {
 public:
  // `pair_blocks`: room for what points add between frames.
  CellAssembler(const TilePlan& plan, Front& front, PairBlocks& pair_blocks);
  void add_points(PointEquations& equations);  // after linearise()
  void add_term(const TermResidual& term);
  // Adds what was summed apart; the front is complete then. `diagonal`: of J'J over plan.unknowns, grows by the cell's.
  void finish(std::vector<double>& diagonal);

 private:
  struct SharedSum {
    ImageUnknowns unknowns;
    std::vector<double> normal;  // [width x (width + 1)]: lower triangle of J'J, then J'r
  };

  void add_sums(const PointEquations& equations);
  void add_shared(const PointEquations& equations, std::size_t i);
  // Three columns over the rows of an unknown.
  struct Factor {
    std::int64_t unknown = -1;
    int rows = 0, stride = 0;
    const double* values = nullptr;
  };
  // A B' from the front
  void subtract_outer(const point_kernels::Kernels& kernels, const Factor& a, const Factor& b);
  void add_pairs();
  // An unknown's own J'J (lower triangle), with its diagonal.
  void add_normal(std::int64_t unknown, const Eigen::Ref<const Eigen::MatrixXd>& normal);

  const TilePlan& plan_;
  Front& front_;
  std::vector<std::int64_t> rows_;             // of TilePlan::unknowns in the front (first row of each, -1: not in it)
  std::vector<FrameSum> frames_;               // [plan.unknowns]
  std::vector<SharedSum> shared_;              // by ImageUnknowns::calibration
  std::vector<PointEquations::Block> blocks_;  // of the point at hand
  std::vector<std::int64_t> frame_rows_;       // of the cell's frames in the front, ascending
  std::vector<std::int64_t> numbers_;          // [plan.unknowns] of frames among them
  PairBlocks& pair_blocks_;                    // by these numbers
  std::vector<std::int64_t> sight_frames_;     // [sights] of the points at hand, by these numbers
};

}  // namespace megablock
