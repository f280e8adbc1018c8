#include "io/block/residual_field.h"

#include <algorithm>
#include <cmath>

namespace megablock {

ResidualField::ResidualField(const Camera& camera, int cells) {
  const double cell = std::max(camera.width, camera.height) / static_cast<double>(cells);
  columns = std::clamp(static_cast<int>(std::lround(camera.width / cell)), 1, cells);
  rows = std::clamp(static_cast<int>(std::lround(camera.height / cell)), 1, cells);
  sum.assign(static_cast<std::size_t>(columns * rows), Eigen::Vector2d::Zero());
  count.assign(sum.size(), 0);
}

void ResidualField::add(const Camera& camera, const Eigen::Vector2d& pixel, const Eigen::Vector2d& residual) {
  const auto cell = [](double position, int size, int cells) {
    return std::clamp(static_cast<int>(position / size * cells), 0, cells - 1);
  };
  const int row = cell(pixel.y(), camera.height, rows), column = cell(pixel.x(), camera.width, columns);
  const auto place = static_cast<std::size_t>(row * columns + column);
  sum[place] += residual;
  ++count[place];
  squares += residual.squaredNorm();
  ++observations;
}

Eigen::Vector2d ResidualField::mean(int row, int column) const {
  const auto cell = static_cast<std::size_t>(row * columns + column);
  return count[cell] ? Eigen::Vector2d(sum[cell] / static_cast<double>(count[cell])) : Eigen::Vector2d::Zero();
}

}  // namespace megablock
