// Draws the charts and maps of the report, as SVG text.
//
// Exaggeration: sigmas and residuals are far smaller than the things they belong to. They are drawn at the scale of the
// map or sensor times a factor, which is 1, 2 or 5 times a power of ten so that readers can undo it; the caption states
// it.
// Internal to io/: it is not installed.
#pragma once

#include <string>
#include <vector>

#include "io/evaluation/figures.h"
#include "io/report/drawing/plane.h"

namespace megablock::report {

// Vertical bars over equal bins. If `bell_sigma` > 0, a normal curve with this sigma and the same area is drawn on top.
struct BarChart {
  const Histogram& histogram;
  std::string x_title, y_title;
  int decimals = 0;             // decimals of the labels
  bool open_ended = true;       // the last bin also counts all larger values
  bool centred_labels = false;  // true: a bin is labelled with its lower value (a count); false: bins have their limits
  double bell_sigma = 0;
};
std::string draw(const BarChart& chart);

// Draws the mean residual of each part of the sensor as an exaggerated arrow, on a shade for the number of
// observations. The caption tells the scale.
struct FieldDrawing {
  std::string svg, caption;
};
FieldDrawing draw(const ResidualField& field, const Camera& camera);
// Draws the number of observations in each part of the sensor, and the borders of its quadrants.
std::string draw_density(const ResidualField& field, const Camera& camera);

// Draw the horizontal GNSS residuals in plan, and the vertical ones in block order.
std::string draw_horizontal(const std::vector<PositionResidual>& residuals);
std::string draw_vertical(const std::vector<PositionResidual>& residuals);

// Draws the selected frames: coloured by tile, with rings around separator frames, and crosses for frames that are not
// oriented. Tie points are the background; links between frames are drawn too, and control and check points if the
// frames are `placed` in the ground frame. The layers have classes, so that the script of the page can hide them.
// `unit` is that of lengths. `after_reading` is that of ReportContext, here and below.
std::string draw_map(const BlockResult& result, const FrameSelection& selected, const char* unit, bool placed,
                     const std::function<void()>& after_reading);
std::string map_legend(const BlockResult& result, const Figures& figures);

// Draws, for each cell of the ground, the number of images that see its tie points. The label also gives the mean
// number of rays to these points.
std::string draw_coverage(const BlockResult& result, const FrameSelection& selected, const char* unit,
                          const std::function<void()>& after_reading);
std::string coverage_legend();

// Draws the horizontal error ellipses of the frames, and bars for the sigmas of their heights, both exaggerated by a
// factor that the caption tells. Empty without covariances.
FieldDrawing draw_ellipses(const BlockResult& result, const FrameSelection& selected, const char* unit,
                           const std::function<void()>& after_reading);

// The step of 1, 2 or 5 times a power of ten that divides `range` into at most `parts`.
double round_step(double range, int parts);

// The largest 1, 2 or 5 times a power of ten that is at most `value`; 1 for a value that is not positive.
double step_below(double value);
// "exaggerated 20-fold", "reduced tenfold", "drawn to scale".
std::string exaggeration_text(double exaggeration);

}  // namespace megablock::report
