// In this file `of_means` is sum n_c |r_c|^2, `squares` the sum of all |r|^2, `scatter` the degrees of freedom 2 (n -
// C) of the pooled variance, `degrees` 2C - p. Empty cells count neither as cells nor as freedom.
#include "adjust/calibration/residual_structure.h"

#include <algorithm>
#include <cmath>

#include "geometry/numbers/chi_square.h"

namespace megablock {

namespace {

// With twenty residuals a cell the pooled variance has some nineteen times as many degrees of freedom as the test
// itself, so that T is as good as chi-square.
constexpr double kPerCell = 20;  // least mean number of residuals in a cell
constexpr int kMostCells = 16;   // along the longer side
constexpr int kFewestCells = 3;

// Square cells, as many as the number of residuals allows.
ResidualField empty_field(std::size_t residuals, int width, int height) {
  const double area = static_cast<double>(width) * height, longer = std::max(width, height);
  const double cells = std::max(1.0, static_cast<double>(residuals) / kPerCell);
  // The side of a square cell, in pixels: as large as twenty residuals a cell require, at least a sixteenth of the
  // sensor.
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
    // n_c |r_c|^2 = |sum of the residuals|^2 / n_c.
    of_means += field.sum[c].squaredNorm() / static_cast<double>(field.count[c]);
    ++cells;
  }
  const double n = static_cast<double>(residuals.size()), scatter = 2 * (n - cells);
  const double degrees = 2 * cells - parameters;
  if (!(degrees > 0) || !(scatter > degrees) || !(squares > of_means)) return result;
  // Squares about the means of the cells are all squares minus those of the means (the theorem of Steiner).
  const double variance = (squares - of_means) / scatter;
  result.statistic = of_means / variance;
  result.degrees = degrees;
  result.probability = chi_square_exceeds(result.statistic, degrees);
  result.structure_px = std::sqrt(std::max(0.0, (result.statistic - degrees) * variance / n));
  return result;
}

}  // namespace megablock
