#include "match/images/image_vertical.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "match/images/image_file.h"

namespace megablock {

namespace {

std::string size_of(const cv::Mat& image) { return fmt::format("{} x {}", image.cols, image.rows); }

std::vector<InterpretationPlane> planes_of(const std::vector<ImageLine>& lines, const Intrinsics& camera) {
  std::vector<InterpretationPlane> planes;
  planes.reserve(lines.size());
  for (const ImageLine& line : lines)
    if (const auto plane = interpretation_plane(line, camera)) planes.push_back(*plane);
  return planes;
}

// Derivatives of the axis of these lines by the parameters of the camera: central differences with a hundredth of the
// plausible error of each parameter.
Eigen::Matrix3Xd derivatives_by_camera(const std::vector<ImageLine>& lines, const Camera& camera,
                                       const Eigen::Vector3d& down) {
  const IntrinsicSigmas weak = weak_sigmas(camera.intrinsics, 0.3 * camera.intrinsics[kFocal], camera.width,
                                           free_parameters(camera.intrinsics.model()));
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

// Settings of one search.
struct Look {
  SegmentOptions segments;
  VanishingOptions search;
};

// The searches to make. For a large image there are two. The first is in the reduced image, with shorter edges, and
// accepts every vanishing point that is expected by accident at most once per image.
std::vector<Look> looks_at(const cv::Mat& image, const SegmentOptions& options, std::uint64_t seed) {
  constexpr double kReducedMegapixels = 0.5, kShortestPx = 20, kTimesLarger = 4;
  Look whole{options, {}};
  whole.search.seed = seed;
  if (std::min(1e-6 * static_cast<double>(image.total()), options.max_megapixels) < kTimesLarger * kReducedMegapixels)
    return {whole};
  Look reduced = whole;
  reduced.segments.max_megapixels = kReducedMegapixels;
  reduced.segments.min_length_px = std::min(kShortestPx, options.min_length_px);
  reduced.search.max_log10_nfa = 0;
  return {reduced, whole};
}

struct EdgesSeen {
  int segments = 0;
  std::vector<ImageLine> lines;  // lines of the segments that have a plane
  VanishingPoints found;         // of these lines
  std::optional<Vertical> vertical;
};

EdgesSeen edges_seen(const cv::Mat& image, const cv::Mat& mask, const Camera& camera, const VerticalPrior& prior,
                     const Look& look) {
  EdgesSeen seen;
  std::vector<InterpretationPlane> planes;
  const std::vector<LineSegment> segments = find_line_segments(image, mask, look.segments);
  seen.segments = static_cast<int>(segments.size());
  for (const LineSegment& segment : segments)
    if (const auto plane = interpretation_plane(segment.line, camera.intrinsics)) {
      seen.lines.push_back(segment.line);
      planes.push_back(*plane);
    }
  seen.found = find_vanishing_points(planes, look.search);
  seen.vertical = find_vertical(seen.found.points, prior);
  return seen;
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
    mask = read_mask(camera.mask_path);
    if (mask.failure.empty() && mask.pixels.size() != image.pixels.size())
      mask.failure = "has " + size_of(mask.pixels) + " pixels, the image " + size_of(image.pixels);
    if (!mask.failure.empty()) {
      result.failure = "mask " + camera.mask_path + ": " + mask.failure;
      return result;
    }
  }
  EdgesSeen seen;
  try {
    for (const Look& look : looks_at(image.pixels, options, seed)) {
      seen = edges_seen(image.pixels, mask.pixels, camera, prior, look);
      // Without any segment, the edges may be too short for the reduced image.
      if (!seen.vertical && seen.segments > 0) break;
    }
  } catch (const cv::Exception& e) {
    result.failure = "line segments could not be found: " + e.err;
    return result;
  }
  result.segments = seen.segments;
  result.vanishing_points = static_cast<int>(seen.found.points.size());
  if (!seen.vertical) return result;
  const Vertical& vertical = *seen.vertical;
  const VanishingPoint& point = seen.found.points[static_cast<std::size_t>(vertical.point)];
  result.found = true;
  result.down = vertical.down;
  result.roll = vertical.roll;
  result.lines = static_cast<int>(point.lines.size());
  result.variance_factor = point.weighted_squares / static_cast<double>(std::max<std::int64_t>(1, point.redundancy));
  result.down.covariance *= std::max(1.0, result.variance_factor);
  std::vector<ImageLine> own;
  for (const int i : point.lines) own.push_back(seen.lines[static_cast<std::size_t>(i)]);
  result.by_camera = derivatives_by_camera(own, camera, result.down.direction);
  result.log10_nfa = point.log10_nfa;
  return result;
}

}  // namespace megablock
