// Gives the equations of the determinant method pair by pair (coplanarity_adjustment.h): one row for every pair of the
// cameras that see a point, one column for every free parameter.
// Internal to adjust/: it is not installed.
#pragma once

#include "adjust/coplanarity/coplanarity_network.h"

namespace megablock {

// The columns of the free parameters: angles camera by camera, then image coordinates observation by observation; -1:
// held.
struct FreeColumns {
  std::vector<std::int64_t> angle, image;  // [3 x cameras], [2 x observations]
  std::int64_t angles = 0, count = 0;

  explicit FreeColumns(const CoplanarityNetwork& network);
  bool holds_angles() const { return angles < std::ssize(angle); }
  bool frees_images() const { return count > angles; }
};

// The number of rows.
std::int64_t pair_count(const CoplanarityNetwork& network);

// Calls use(first observation, second observation) for every pair of every point, in the order of the rows.
template <typename Use>
void visit_pairs(const CoplanarityNetwork& network, std::int64_t point, Use use) {
  const auto end = static_cast<std::size_t>(network.begin[static_cast<std::size_t>(point) + 1]);
  for (auto a = static_cast<std::size_t>(network.begin[static_cast<std::size_t>(point)]); a < end; ++a)
    for (std::size_t b = a + 1; b < end; ++b) use(a, b);
}

CoplanarityDeterminant determinant(const CoplanarityNetwork& network, std::size_t a, std::size_t b);

// |m| |d_1| |d_2|, the size of the determinant where the three vectors are far from coplanar.
double scale_of_determinant(const CoplanarityNetwork& network, std::size_t a, std::size_t b);

// Calls use(column, derivative) for the free parameters of a pair.
template <typename Use>
void visit_derivatives(const CoplanarityNetwork& network, const FreeColumns& free, std::size_t a, std::size_t b,
                       const CoplanarityDeterminant& f, Use use) {
  const auto side = [&](std::size_t observation, const Eigen::Matrix<double, 1, 5>& by) {
    const auto camera = static_cast<std::size_t>(network.camera[observation]);
    for (std::size_t k = 0; k < 3; ++k)
      if (const std::int64_t c = free.angle[3 * camera + k]; c >= 0) use(c, by[static_cast<Eigen::Index>(k)]);
    for (std::size_t k = 0; k < 2; ++k)
      if (const std::int64_t c = free.image[2 * observation + k]; c >= 0) use(c, by[static_cast<Eigen::Index>(3 + k)]);
  };
  side(a, f.by_first);
  side(b, f.by_second);
}

}  // namespace megablock
