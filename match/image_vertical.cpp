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

// Of the axis of these lines by each parameter of the camera: by a hundredth of what it may be wrong by.
Eigen::Matrix3Xd derivatives_by_camera(const std::vector<ImageLine>& lines, const Camera& camera,
                                       const Eigen::Vector3d& down) {
  const IntrinsicSigmas weak = weak_sigmas(camera.intrinsics, 0.3 * camera.intrinsics[kFocal], camera.width);
  Eigen::Matrix3Xd result = Eigen::Matrix3Xd::Zero(3, camera.intrinsics.size());
  for (int p = 0; p < camera.intrinsics.size(); ++p) {
    const auto at = static_cast<std::size_t>(p);
    const double step = 0.01 * weak[at];
    if (!(step > 0)) continue;
    const auto down_at = [&](double change) -> std::optional<Eigen::Vector3d> {
      Intrinsics changed = camera.intrinsics;
      changed[at] += change;
      const auto fit = fit_axis(planes_of(lines, changed));
      if (!fit) return std::nullopt;
      return fit->axis.direction.dot(down) < 0 ? Eigen::Vector3d(-fit->axis.direction) : fit->axis.direction;
    };
    const auto above = down_at(step), below = down_at(-step);
    if (above && below) result.col(p) = (*above - *below) / (2 * step);
  }
  return result;
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
  result.roll = vertical->roll;
  result.lines = static_cast<int>(point.lines.size());
  result.variance_factor = point.weighted_squares / static_cast<double>(std::max<std::int64_t>(1, point.redundancy));
  result.down.covariance *= std::max(1.0, result.variance_factor);
  std::vector<ImageLine> own;
  for (const int i : point.lines) own.push_back(lines[static_cast<std::size_t>(i)]);
  result.by_camera = derivatives_by_camera(own, camera, result.down.direction);
  result.log10_nfa = point.log10_nfa;
  return result;
}

}  // namespace megablock
