// Fills the front of a cell with the contributions of its points, which are eliminated on the way, and of its other
// observations.
//
// For each point (point_equations.h), K_ij -= Y_i Y_j' goes to the front at once where i or j is a shared unknown.
// Between two frames it goes to a block outside the front (pair_blocks.h). Once per cell these blocks are added to the
// front, and so are the sums that concern one frame, or the shared unknowns of one camera in one mount. The latter are
// J'J and -J'r. The sums of a frame run over its points, with T = V_f C^-T: G'(V_f - T T')G, G'(b_f - T z), and the
// diagonal of J'J (point_kernels::FrameValue). With R = V_f - T T', the first of them has the blocks [u]x R [u]x',
// -[u]x R and R.
#pragma once

#include <vector>

#include "merge/front/front.h"
#include "merge/tile/pair_blocks.h"
#include "merge/tile/point_equations.h"

namespace megablock {

// Adds the block of two unknowns at (row, column) of the front. A block above the diagonal is added transposed; of a
// diagonal block (row = column) only the lower triangle is read.
void add_block(Front& front, std::int64_t row, std::int64_t column, const Eigen::Ref<const Eigen::MatrixXd>& block);

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
  std::vector<std::int64_t> sight_frames_;     // [groups] numbers of the frames of the present points
};

}  // namespace megablock
