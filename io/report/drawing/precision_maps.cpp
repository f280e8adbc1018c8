// Draws the maps of the coverage of the ground and of the precision of the frames.
//
// An error ellipse shows the covariance C of east and north: C u = lambda u gives the semi-axes sqrt(lambda_1) >=
// sqrt(lambda_2), the sigmas along the directions u_1 and u_2. The true position lies inside with a probability of 1 -
// exp(-1/2) = 39 %. The bar is the sigma of the height.
#include <fmt/core.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "io/report/drawing/drawing.h"
#include "io/report/drawing/html.h"
#include "io/report/drawing/plane.h"

namespace megablock::report {

namespace {

constexpr double kMostCells = 56, kLeastCells = 8;  // number of cells along the longer side of the map
constexpr double kPointsPerCell = 12;               // mean number, so that an empty cell is no accident
constexpr std::size_t kCoveragePoints = 200000;     // at most so many points are used
constexpr std::size_t kEllipses = 1500;             // at most so many ellipses are drawn
constexpr std::size_t kNamesAtATime = 64;           // ellipses between two calls of after_reading

// The colour classes of the coverage: 1, 2, 3, 4, 5 to 6, 7 to 9, 10 and more images.
constexpr std::array<int, 7> kSteps = {1, 2, 3, 4, 5, 7, 10};
constexpr std::array<const char*, 7> kShades = {"#b3261e", "#e08214", "#fdd49e", "#c7e3a8",
                                                "#7fc07f", "#3f9a6a", "#14685a"};

std::size_t shade_of(std::int64_t images) {
  std::size_t shade = 0;
  while (shade + 1 < kSteps.size() && images >= kSteps[shade + 1]) ++shade;
  return shade;
}

double cell_size(const BlockResult& result, const Plane& plane) {
  const double points = std::min(static_cast<double>(result.points.size()), static_cast<double>(kCoveragePoints));
  // n points on W x H units: a cell of c x c has n c^2 / (W H) of them on average, if they are spread evenly.
  const double cell = std::sqrt(kMapWidth * plane.height * kPointsPerCell / std::max(1.0, points));
  const double longer = std::max(kMapWidth, plane.height);
  return std::clamp(cell, longer / kMostCells, longer / kLeastCells);
}

class Coverage {
 public:
  Coverage(const BlockResult& result, const FrameSelection& selected, const Plane& plane,
           const std::function<void()>& after_reading)
      : plane_(plane), cell_(cell_size(result, plane)) {
    columns_ = static_cast<int>(std::ceil(kMapWidth / cell_));
    rows_ = static_cast<int>(std::ceil(plane.height / cell_));
    points_.assign(static_cast<std::size_t>(columns_ * rows_), 0);
    rays_ = images_ = points_;
    gather(result, selected, after_reading);
  }

  std::string svg() const {
    std::string body;
    for (int r = 0; r < rows_; ++r)
      for (int c = 0; c < columns_; ++c) {
        const auto cell = static_cast<std::size_t>(r * columns_ + c);
        if (points_[cell] == 0) continue;
        body += fmt::format(
            "<rect x={:.1f} y={:.1f} width={:.1f} height={:.1f} fill=\"{}\"><title>{} images; {} tie points with {} "
            "rays "
            "on average</title></rect>",
            c * cell_, r * cell_, cell_ + 0.2, std::min(cell_ + 0.2, plane_.height - r * cell_),
            kShades[shade_of(images_[cell])], count(images_[cell]), count(points_[cell]),
            fixed(static_cast<double>(rays_[cell]) / static_cast<double>(points_[cell]), 1));
      }
    return body;
  }

 private:
  void gather(const BlockResult& result, const FrameSelection& selected, const std::function<void()>& after_reading) {
    if (result.kept.size() != result.tracks.image.size()) return;
    const std::size_t step = 1 + result.points.size() / kCoveragePoints;
    // Pairs of cell and image as one number: sorted and made distinct, they count the images of each cell.
    std::vector<std::int64_t> seen;  // image + cell * images
    const auto images = std::ssize(result.block.images);
    seen.reserve(result.tracks.image.size() / step);
    for (std::size_t t = 0; t < result.points.size() && t + 1 < result.tracks.begin.size(); t += step) {
      if (t / step % kTracksAtATime == 0) after_reading();
      if (!result.points[t].allFinite()) continue;
      const Eigen::Vector2d p = plane_.at(result.points[t].head<2>());
      if (!plane_.shows(p)) continue;
      const auto cell = static_cast<std::size_t>(std::min(rows_ - 1, static_cast<int>(p.y() / cell_)) * columns_ +
                                                 std::min(columns_ - 1, static_cast<int>(p.x() / cell_)));
      std::int64_t rays = 0;
      for (std::int64_t o = result.tracks.begin[t]; o < result.tracks.begin[t + 1]; ++o) {
        const ImageIndex image = result.tracks.image[static_cast<std::size_t>(o)];
        if (!result.kept[static_cast<std::size_t>(o)] || !selected(result.block.images[image].frame)) continue;
        ++rays;
        seen.push_back(image.value + static_cast<std::int64_t>(cell) * images);
      }
      if (rays == 0) continue;
      ++points_[cell];
      rays_[cell] += rays;
    }
    std::sort(seen.begin(), seen.end());
    seen.erase(std::unique(seen.begin(), seen.end()), seen.end());
    for (const std::int64_t key : seen) ++images_[static_cast<std::size_t>(key / images)];
  }

  const Plane& plane_;
  double cell_;
  int columns_ = 0, rows_ = 0;
  std::vector<std::int64_t> points_, rays_, images_;  // [cells]
};

struct Ellipse {
  Eigen::Vector2d place;    // on the drawing
  double major, minor, up;  // sigmas, metres
  double angle;             // of the major axis on the drawing, degrees
  const std::string* name;
};

std::vector<Ellipse> ellipses_of(const BlockResult& result, const FrameSelection& selected, const Plane& plane,
                                 const std::function<void()>& after_reading) {
  constexpr std::int64_t kAtATime = 1 << 13;  // frames
  std::vector<Ellipse> all;
  for (FrameIndex f(0); result.frame_covariance.contains(f); ++f.value) {
    if (f.value % kAtATime == 0) after_reading();
    if (!selected(f) || !oriented(result, f)) continue;
    const Eigen::Matrix3d c = result.frame_covariance[f].bottomRightCorner<3, 3>();
    if (!c.allFinite() || !(c.trace() > 0)) continue;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(c.topLeftCorner<2, 2>());
    const Eigen::Vector2d major = axes.eigenvectors().col(1);
    all.push_back({plane.at(result.state.frames[f].centre.head<2>()), std::sqrt(std::max(0.0, axes.eigenvalues()[1])),
                   std::sqrt(std::max(0.0, axes.eigenvalues()[0])), std::sqrt(std::max(0.0, c(2, 2))),
                   // y points down in the drawing, so angles change their sign.
                   -std::atan2(major.y(), major.x()) * 180 / std::numbers::pi, &result.block.frames[f].name});
  }
  return all;
}

std::string draw(const Ellipse& e, double pixels_per_metre, const LengthUnit& unit) {
  std::string svg = fmt::format(
      "<g transform=\"translate({:.1f} {:.1f})\"><title>{}: {} × {} {}, up {} {}</title>"
      "<ellipse rx={:.1f} ry={:.1f} transform=\"rotate({:.1f})\"/>",
      e.place.x(), e.place.y(), escape(*e.name), sigma_text(e.major * unit.factor), sigma_text(e.minor * unit.factor),
      unit.name, sigma_text(e.up * unit.factor), unit.name, e.major * pixels_per_metre, e.minor * pixels_per_metre,
      e.angle);
  return svg + fmt::format("<path d=\"M0 0v{:.1f}\"/></g>", -e.up * pixels_per_metre);
}

}  // namespace

std::string draw_coverage(const BlockResult& result, const FrameSelection& selected, const char* unit,
                          const std::function<void()>& after_reading) {
  const auto plane = plane_of(result, selected, false, after_reading);
  if (!plane) return "";
  return open_map(*plane, "Images that see each place") + Coverage(result, selected, *plane, after_reading).svg() +
         coordinate_grid(*plane, unit) + scale_bar(*plane, unit) + "</svg>";
}

std::string coverage_legend() {
  std::string keys = "<span class=muted>images that see the place:</span>";
  for (std::size_t s = 0; s < kSteps.size(); ++s) {
    const bool last = s + 1 == kSteps.size();
    const int high = last ? 0 : kSteps[s + 1] - 1;
    keys += fmt::format("<span class=key><i style=\"background:{};border-radius:2px\"></i>{}</span>", kShades[s],
                        last                ? fmt::format("{} and more", kSteps[s])
                        : high == kSteps[s] ? fmt::format("{}", high)
                                            : fmt::format("{} to {}", kSteps[s], high));
  }
  return "<p class=legend>" + keys + "</p>";
}

FieldDrawing draw_ellipses(const BlockResult& result, const FrameSelection& selected, const char* unit_name,
                           const std::function<void()>& after_reading) {
  const auto plane = plane_of(result, selected, false, after_reading);
  if (!plane) return {};
  const std::vector<Ellipse> all = ellipses_of(result, selected, *plane, after_reading);
  if (all.empty()) return {};
  std::vector<double> sizes;
  for (const Ellipse& e : all) sizes.push_back(std::max(e.major, e.up));
  const double typical = spread(sizes).p95;
  if (!(typical > 0)) return {};
  // The 95 % quantile of the sigmas is drawn 0.3 of the mean distance between frames long, so that ellipses of
  // neighbours, which are two sigmas long, do not overlap. It is never longer than the margin of the map.
  const double spacing = std::sqrt(kMapWidth * plane->height / static_cast<double>(all.size()));
  const double wanted = std::min(kMapWidth / 28, 0.3 * spacing) / (typical * plane->scale);
  const double exaggeration = step_below(wanted);
  const LengthUnit unit = length_unit(typical, unit_name);
  const std::size_t step = 1 + all.size() / kEllipses;
  std::string body;
  for (std::size_t i = 0; i < all.size(); i += step) {
    if (i / step % kNamesAtATime == 0) after_reading();
    body += draw(all[i], plane->scale * exaggeration, unit);
  }
  FieldDrawing drawing;
  drawing.svg = open_map(*plane, "Error ellipses") + coordinate_grid(*plane, unit_name) + "<g class=ellipses>" + body +
                "</g>" + scale_bar(*plane, unit_name) + "</svg>";
  drawing.caption =
      fmt::format("Positions of the frames: ellipse of one sigma in plan and, as a bar, the sigma of the height, {}.{}",
                  exaggeration_text(exaggeration),
                  step > 1 ? " Every " + count(static_cast<std::int64_t>(step)) + "th frame." : "");
  return drawing;
}

}  // namespace megablock::report
