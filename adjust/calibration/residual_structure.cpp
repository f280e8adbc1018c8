#include "adjust/calibration/residual_structure.h"

#include <algorithm>
#include <cmath>

#include "geometry/numbers/chi_square.h"

namespace megablock {

namespace {

constexpr double kPerCell = 20;  // least mean number of residuals in a cell
constexpr int kMostCells = 16;   // along the longer side
constexpr int kFewestCells = 3;

// Square cells, as many as the number of residuals allows.
ResidualField empty_field(std::size_t residuals, int width, int height) {
  const double area = static_cast<double>(width) * height, longer = std::max(width, height);
  const double cells = std::max(1.0, static_cast<double>(residuals) / kPerCell);
  const double side = std::max(std::sqrt(area / cells), longer / kMostCells);
  ResidualField field;
  field.columns = std::max(kFewestCells, static_cast<int>(width / side));
  field.rows = std::max(kFewestCells, static_cast<int>(height / side));
  const auto count = static_cast<std::size_t>(field.columns * field.rows);
  field.sum.assign(count, Eigen::Vector2d::Zero());
  field.count.assign(count, 0);
  return field;
}

}  // namespace

ResidualStructure residual_structure(const std::vector<ResidualAtPixel>& residuals, int width, int height,
                                     int parameters) {
  ResidualStructure result;
  ResidualField& field = result.field = empty_field(residuals.size(), width, height);
  double squares = 0;
  for (const ResidualAtPixel& r : residuals) {
    const int column = std::clamp(static_cast<int>(r.pixel.x() / width * field.columns), 0, field.columns - 1);
    const int row = std::clamp(static_cast<int>(r.pixel.y() / height * field.rows), 0, field.rows - 1);
    const auto cell = static_cast<std::size_t>(row * field.columns + column);
    field.sum[cell] += r.residual;
    ++field.count[cell];
    squares += r.residual.squaredNorm();
  }
  field.squares = squares;
  field.observations = result.residuals = std::ssize(residuals);

  double of_means = 0, cells = 0;
  for (std::size_t c = 0; c < field.count.size(); ++c) {
    if (field.count[c] == 0) continue;
    of_means += field.sum[c].squaredNorm() / static_cast<double>(field.count[c]);
    ++cells;
  }
  const double n = static_cast<double>(residuals.size()), scatter = 2 * (n - cells);
  const double degrees = 2 * cells - parameters;
  if (!(degrees > 0) || !(scatter > degrees) || !(squares > of_means)) return result;
  const double variance = (squares - of_means) / scatter;
  result.statistic = of_means / variance;
  result.degrees = degrees;
  result.probability = chi_square_exceeds(result.statistic, degrees);
  result.structure_px = std::sqrt(std::max(0.0, (result.statistic - degrees) * variance / n));
  return result;
}

}  // namespace megablock
