#include "geometry/numbers/straight_line.h"

#include "geometry/numbers/decompositions.h"

namespace megablock {

std::optional<Eigen::Vector3d> straight_line(const Eigen::Matrix3d& scatter) {
  constexpr double kNarrow = 0.03;  // width over length
  // The eigenvalues of the scatter are sums of squares: their roots are in the ratio of the rms widths.
  const SymmetricEigen eigen = symmetric_eigen(scatter);
  if (!(eigen.values(1) <= kNarrow * kNarrow * eigen.values(2))) return {};
  return eigen.vectors.col(2);
}

}  // namespace megablock
