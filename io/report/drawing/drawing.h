// Drawings of the report, as SVG text.
#pragma once

#include <string>
#include <vector>

#include "io/evaluation/figures.h"
#include "io/report/drawing/plane.h"

namespace megablock::report {

// Vertical bars over equal bins. `bell_sigma` > 0: the normal curve of that sigma and the same area over it.
struct BarChart {
  const Histogram& histogram;
  std::string x_title, y_title;
  int decimals = 0;             // of the bins' labels
  bool open_ended = true;       // the last bin holds all beyond it
  bool centred_labels = false;  // label bins by their lower value (counts) instead of their limits
  double bell_sigma = 0;
};
std::string draw(const BarChart& chart);

// Mean residual of each part of the sensor as arrows, exaggerated; the number of observations as shade.
// The caption says the scale.
struct FieldDrawing {
  std::string svg, caption;
};
FieldDrawing draw(const ResidualField& field, const Camera& camera);
// How many measurements lie in each part of the sensor, with the borders of its quadrants.
std::string draw_density(const ResidualField& field, const Camera& camera);

// Horizontal GNSS residuals in plan, and the vertical ones in block order.
std::string draw_horizontal(const std::vector<PositionResidual>& residuals);
std::string draw_vertical(const std::vector<PositionResidual>& residuals);

// Of the selected frames: coloured by tile, boundary frames ringed, those not oriented; tie points as a background,
// links between frames; control and check points when the frames are `placed` in the ground frame. Layers carry classes
// that the page's script shows and hides. `unit`: of lengths. `after_reading` as in ReportContext, here and below.
std::string draw_map(const BlockResult& result, const FrameSelection& selected, const char* unit, bool placed,
                     const std::function<void()>& after_reading);
std::string map_legend(const BlockResult& result, const Figures& figures);

// Images that see tie points in each cell of the ground, and the mean number of rays to these.
std::string draw_coverage(const BlockResult& result, const FrameSelection& selected, const char* unit,
                          const std::function<void()>& after_reading);
std::string coverage_legend();

// Horizontal error ellipses of the frames' positions and bars for the sigma of the height, exaggerated; the caption
// says how much. Empty without covariances.
FieldDrawing draw_ellipses(const BlockResult& result, const FrameSelection& selected, const char* unit,
                           const std::function<void()>& after_reading);

// A step of 1, 2 or 5 times a power of ten that divides `range` into at most `parts`.
double round_step(double range, int parts);

// The largest 1, 2 or 5 times a power of ten that is not above `value`; 1 for what is not positive.
double step_below(double value);
// "exaggerated 20-fold", "reduced tenfold", "drawn to scale".
std::string exaggeration_text(double exaggeration);

}  // namespace megablock::report
