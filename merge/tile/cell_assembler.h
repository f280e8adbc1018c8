// Fills the front of a cell with the contributions of its points, which are eliminated on the way, and of its other
// observations.
//
// For each point (point_equations.h), K_ij -= Y_i Y_j' goes to the front at once where i or j is a shared unknown.
// Between two frames it goes to a block outside the front (pair_blocks.h). Once per cell these blocks are added to the
// front, and so are the sums that concern one frame, or the shared unknowns of one camera in one mount. The latter are
// J'J and -J'r.
//
// The observations of a point in one frame add J_f'J_f = G'V_f G to the block of the frame, and the elimination of the
// point subtracts Y_f Y_f' = G'T T'G with T = V_f C^-T. Both have G outside, so that only the 3 x 3 matrix R = V_f - T
// T' is left of them, and the 6 x 6 block is made of three sums over the points:
//
//     G'R G = | [u]x R [u]x'   -[u]x R |       right-hand side G'(b_f - T z)
//             | .                R     |,
//
// The diagonal of J'J, which damping needs, is summed beside them (point_kernels::FrameValue).
#pragma once

#include <vector>

#include "merge/front/front.h"
#include "merge/tile/pair_blocks.h"
#include "merge/tile/point_equations.h"

namespace megablock {

// Adds the block of two unknowns at (row, column) of the front. A block above the diagonal is added transposed; of a
// diagonal block (row = column) only the lower triangle is read.
void add_block(Front& front, std::int64_t row, std::int64_t column, const Eigen::Ref<const Eigen::MatrixXd>& block);

// It serves one cell and one front: points and terms are added in the order of the plan, and finish() ends it.
class CellAssembler {
 public:
  // `pair_blocks` gives the memory for the blocks between two frames.
  CellAssembler(const TilePlan& plan, Front& front, PairBlocks& pair_blocks);
  void add_points(PointEquations& equations);  // after linearise()
  void add_term(const TermResidual& term);
  // Adds the blocks and sums outside the front; the front is then complete. `diagonal` is that of J'J over
  // plan.unknowns, and the diagonal of the cell is added to it.
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
  // Subtracts A B' from the front.
  void subtract_outer(const point_kernels::Kernels& kernels, const Factor& a, const Factor& b);
  void add_pairs();
  // Adds an unknown's own J'J (lower triangle) and its diagonal.
  void add_normal(std::int64_t unknown, const Eigen::Ref<const Eigen::MatrixXd>& normal);

  const TilePlan& plan_;
  Front& front_;
  std::vector<std::int64_t> rows_;             // first row of each of TilePlan::unknowns in the front, -1: not in it
  std::vector<FrameSum> frames_;               // [plan.unknowns]
  std::vector<SharedSum> shared_;              // by ImageUnknowns::calibration
  std::vector<PointEquations::Block> blocks_;  // of the present point
  std::vector<std::int64_t> frame_rows_;       // rows of the cell's frames in the front, ascending
  std::vector<std::int64_t> numbers_;          // [plan.unknowns] number of each frame among frame_rows_
  PairBlocks& pair_blocks_;                    // by these numbers
  std::vector<std::int64_t> group_frames_;     // [groups] numbers of the frames of the present points
};

}  // namespace megablock
