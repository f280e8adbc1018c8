#include "match/image_vertical.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "match/image_file.h"

namespace megablock {

namespace {

std::string size_of(const cv::Mat& picture) { return fmt::format("{} x {}", picture.cols, picture.rows); }

std::vector<InterpretationPlane> planes_of(const std::vector<ImageLine>& lines, const Intrinsics& camera) {
  std::vector<InterpretationPlane> planes;
  planes.reserve(lines.size());
  for (const ImageLine& line : lines)
    if (const auto plane = interpretation_plane(line, camera)) planes.push_back(*plane);
  return planes;
}

// Adds what each parameter of the camera, wrong by its prior sigma, does to the axis of these lines: by a hundredth of
// it.
void add_camera_errors(const std::vector<ImageLine>& lines, const Camera& camera, AxisDirection& down) {
  const IntrinsicSigmas weak = weak_sigmas(camera.intrinsics, 0.3 * camera.intrinsics[kFocal], camera.width);
  for (int p = 0; p < camera.intrinsics.size(); ++p) {
    const auto at = static_cast<std::size_t>(p);
    double sigma = camera.prior_sigma[at];
    if (!std::isfinite(sigma)) sigma = weak[at];  // free without prior
    if (!(sigma > 0)) continue;
    Intrinsics changed = camera.intrinsics;
    changed[at] += 0.01 * sigma;
    const auto fit = fit_axis(planes_of(lines, changed));
    if (!fit) continue;
    const double sign = fit->axis.direction.dot(down.direction) < 0 ? -1 : 1;
    const Eigen::Vector3d change = (sign * fit->axis.direction - down.direction) / 0.01;
    down.covariance += change * change.transpose();
  }
}

}  // namespace

ImageVertical find_image_vertical(const std::string& path, const Camera& camera, const VerticalPrior& prior,
                                  std::uint64_t seed, const SegmentOptions& options) {
  options.check();
  ImageVertical result;
  const GreyImage image = read_grey_image(path);
  result.failure = image.failure;
  if (!result.failure.empty()) return result;
  if (image.pixels.cols != camera.width || image.pixels.rows != camera.height) {
    result.failure =
        fmt::format("has {} pixels, its camera {} x {}", size_of(image.pixels), camera.width, camera.height);
    return result;
  }
  GreyImage mask;
  if (!camera.mask_path.empty()) {
    mask = read_grey_image(camera.mask_path);
    if (mask.failure.empty() && mask.pixels.size() != image.pixels.size())
      mask.failure = "has " + size_of(mask.pixels) + " pixels, the image " + size_of(image.pixels);
    if (!mask.failure.empty()) {
      result.failure = "mask " + camera.mask_path + ": " + mask.failure;
      return result;
    }
  }
  std::vector<LineSegment> segments;
  try {
    segments = find_line_segments(image.pixels, mask.pixels, options);
  } catch (const cv::Exception& e) {
    result.failure = "no segments: " + e.err;
    return result;
  }
  result.segments = static_cast<int>(segments.size());
  std::vector<ImageLine> lines;  // that have a plane
  std::vector<InterpretationPlane> planes;
  for (const LineSegment& segment : segments)
    if (const auto plane = interpretation_plane(segment.line, camera.intrinsics)) {
      lines.push_back(segment.line);
      planes.push_back(*plane);
    }

  VanishingOptions search;
  search.seed = seed;
  const VanishingPoints found = find_vanishing_points(planes, search);
  result.vanishing_points = static_cast<int>(found.points.size());
  const auto vertical = find_vertical(found.points, prior);
  if (!vertical) return result;
  const VanishingPoint& point = found.points[static_cast<std::size_t>(vertical->point)];
  result.found = true;
  result.down = vertical->down;
  result.lines = static_cast<int>(point.lines.size());
  result.variance_factor = point.weighted_squares / static_cast<double>(std::max<std::int64_t>(1, point.redundancy));
  result.down.covariance *= std::max(1.0, result.variance_factor);
  std::vector<ImageLine> own;
  for (const int i : point.lines) own.push_back(lines[static_cast<std::size_t>(i)]);
  add_camera_errors(own, camera, result.down);
  result.log10_nfa = point.log10_nfa;
  return result;
}

}  // namespace megablock
