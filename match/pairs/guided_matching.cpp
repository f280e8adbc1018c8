#include "match/pairs/guided_matching.h"

#include <algorithm>
#include <cmath>

#include "geometry/intersection/triangulation.h"
#include "geometry/numbers/median.h"
#include "io/block/tracks.h"
#include "match/nearest/nearest.h"
#include "match/nearest/nearest_kernel.h"

namespace megablock {

namespace {

constexpr double kCell = 16;       // pixels, side of the cells of the keypoint grid
constexpr double kStep = 12;       // pixels, step along the epipolar line
constexpr int kDepths = 16;        // pieces of the line, at equal differences of inverse distance
constexpr double kBandSigmas = 3;  // half of the width of the band
// Cosine between a descriptor and the assumed next one, where geometry leaves none.
constexpr double kRivalCosine = 0.75;

Eigen::Vector2d position(const Keypoint& k) { return {from_fixed_pixel(k.x), from_fixed_pixel(k.y)}; }

// The keypoints of an image, sorted into square cells.
class KeypointGrid {
 public:
  KeypointGrid(const std::vector<Keypoint>& keypoints, const Camera& camera)
      : columns_(static_cast<std::int64_t>(camera.width / kCell) + 1),
        rows_(static_cast<std::int64_t>(camera.height / kCell) + 1),
        begin_(static_cast<std::size_t>(columns_ * rows_) + 1, 0),
        members_(keypoints.size()),
        visit_(begin_.size(), -1) {
    std::vector<std::size_t> cell;
    for (const Keypoint& k : keypoints) {
      cell.push_back(static_cast<std::size_t>(row(position(k).y()) * columns_ + column(position(k).x())));
      ++begin_[cell.back() + 1];
    }
    for (std::size_t c = 1; c < begin_.size(); ++c) begin_[c] += begin_[c - 1];
    std::vector<std::int32_t> next(begin_.begin(), begin_.end() - 1);
    for (std::size_t i = 0; i < keypoints.size(); ++i)
      members_[static_cast<std::size_t>(next[cell[i]]++)] = static_cast<std::int32_t>(i);
  }

  // Calls visitor(keypoint) for the keypoints in the cells around a place. A cell is visited once for each value of
  // `visit`.
  template <typename Visitor>
  void around(const Eigen::Vector2d& place, double reach, std::int32_t visit, const Visitor& visitor) {
    for (std::int64_t r = row(place.y() - reach); r <= row(place.y() + reach); ++r)
      for (std::int64_t c = column(place.x() - reach); c <= column(place.x() + reach); ++c) {
        const auto cell = static_cast<std::size_t>(r * columns_ + c);
        if (visit_[cell] == visit) continue;
        visit_[cell] = visit;
        for (std::int32_t m = begin_[cell]; m < begin_[cell + 1]; ++m) visitor(members_[static_cast<std::size_t>(m)]);
      }
  }

 private:
  std::int64_t column(double x) const {
    return std::clamp<std::int64_t>(static_cast<std::int64_t>(x / kCell), 0, columns_ - 1);
  }
  std::int64_t row(double y) const {
    return std::clamp<std::int64_t>(static_cast<std::int64_t>(y / kCell), 0, rows_ - 1);
  }

  std::int64_t columns_, rows_;
  std::vector<std::int32_t> begin_, members_;
  std::vector<std::int32_t> visit_;  // [cells] the last visit
};

std::int32_t squared_distance(const SiftDescriptor& a, const SiftDescriptor& b) {
  std::int32_t sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const std::int32_t d = std::int32_t{a[i]} - std::int32_t{b[i]};
    sum += d * d;
  }
  return sum;
}

double norm(const SiftDescriptor& d) {
  std::int64_t sum = 0;
  for (const std::int64_t v : d) sum += v * v;
  return std::sqrt(static_cast<double>(sum));
}

// Matches the features of a with those of b along their epipolar lines.
class GuidedMatcher {
 public:
  GuidedMatcher(const ImageFeatures& a, const ImageFeatures& b, const Camera& camera_a, const Camera& camera_b,
                const TrustedPair& pair, const MatchOptions& options)
      : a_(a),
        b_(b),
        camera_a_(camera_a),
        camera_b_(camera_b),
        pair_(pair),
        options_(options),
        focal_(0.5 * (camera_a.intrinsics[kFocal] + camera_b.intrinsics[kFocal])),
        grid_(b.keypoints, camera_b),
        of_a_(lists(a.keypoints.size())),
        of_b_(lists(b.keypoints.size())) {}

  GuidedMatches run() {
    std::vector<double> widths;
    for (std::size_t row = 0; row < a_.keypoints.size(); ++row) {
      const auto ray = ground_ray(pair_.a, camera_a_.intrinsics, position(a_.keypoints[row]));
      if (ray) widths.push_back(compare_along(*ray, static_cast<std::int32_t>(row)));
    }
    result_.half_width_px = median(std::move(widths));
    // A match must pass the ratio test in the lists of both features.
    for (std::size_t row = 0; row < a_.keypoints.size(); ++row)
      for (std::size_t n = 0; n < k(); ++n) {
        const std::int32_t other = of_a_.row[row * of_a_.k + n];
        const auto this_row = static_cast<std::int32_t>(row);
        if (other >= 0 && accepts(of_a_, row, other, a_.descriptors[row]) &&
            accepts(of_b_, static_cast<std::size_t>(other), this_row, b_.descriptors[static_cast<std::size_t>(other)]))
          result_.matches.emplace_back(this_row, other);
      }
    std::sort(result_.matches.begin(), result_.matches.end());
    return std::move(result_);
  }

 private:
  std::size_t k() const { return static_cast<std::size_t>(options_.k_best); }
  Neighbours lists(std::size_t rows) const {
    const std::size_t size = rows * (k() + 1);
    return {k() + 1, std::vector<std::int32_t>(size, Neighbours::kFar), std::vector<std::int32_t>(size, -1)};
  }

  // Compares a feature with all features near its epipolar line. Returns the half width of the band at the middle of
  // the line. The line is computed as a polygon, because distortion bends it.
  double compare_along(const Ray& ray, std::int32_t row) {
    const double nearest = 1 / options_.min_distance_m, farthest = 1 / options_.max_distance_m;
    Eigen::Vector2d before = Eigen::Vector2d::Zero();
    bool begun = false;  // `before` is a point in or near the image
    double middle = 0;
    for (int d = 0; d <= kDepths; ++d) {
      const double inverse = nearest + (farthest - nearest) * d / kDepths;
      const double width = kBandSigmas * pair_.epipolar_sigma_px(focal_, 1 / inverse);
      if (d == kDepths / 2) middle = width;
      const Eigen::Vector3d inside = to_inside(pair_.b, ray.origin + ray.direction / inverse);
      Eigen::Vector2d here = no_pixel();
      if (inside.z() > 0.1 * inside.norm()) here = project(camera_b_.intrinsics, inside);
      const bool there = near_image(here, width);
      if (there && begun) compare_piece(before, here, width, row);
      before = here;
      begun = there;
    }
    return middle;
  }

  // Points farther outside than a quarter of the image are left out, because the distortion may fold back there.
  bool near_image(const Eigen::Vector2d& p, double width) const {
    const double x = width + 0.25 * camera_b_.width, y = width + 0.25 * camera_b_.height;
    return p.allFinite() && p.x() > -x && p.x() < camera_b_.width + x && p.y() > -y && p.y() < camera_b_.height + y;
  }

  void compare_piece(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double width, std::int32_t row) {
    const Eigen::Vector2d along = to - from;
    const double length = along.norm();
    const Eigen::Vector2d direction = length > 1e-9 ? Eigen::Vector2d(along / length) : Eigen::Vector2d::UnitX();
    const int steps = std::max(1, static_cast<int>(std::ceil(length / kStep)));
    // Visits the cells along the piece; the exact distance from the line then decides for each keypoint.
    for (int s = 0; s <= steps; ++s) {
      const Eigen::Vector2d place = from + along * s / steps;
      if (place.x() < -width || place.y() < -width || place.x() > camera_b_.width + width ||
          place.y() > camera_b_.height + width)
        continue;
      grid_.around(place, width + kStep, row, [&](std::int32_t other) {
        const Eigen::Vector2d off = position(b_.keypoints[static_cast<std::size_t>(other)]) - place;
        if (std::abs(direction.x() * off.y() - direction.y() * off.x()) <= width) compare(row, other);
      });
    }
  }

  // Updates the lists of nearest neighbours of both features.
  void compare(std::int32_t row, std::int32_t other) {
    const auto i = static_cast<std::size_t>(row), j = static_cast<std::size_t>(other);
    const std::int32_t distance = squared_distance(a_.descriptors[i], b_.descriptors[j]);
    ++result_.compared;
    nearest_kernel::insert(&of_a_.distance[i * of_a_.k], &of_a_.row[i * of_a_.k], 1, of_a_.k, distance, other);
    nearest_kernel::insert(&of_b_.distance[j * of_b_.k], &of_b_.row[j * of_b_.k], 1, of_b_.k, distance, row);
  }

  // The ratio test: the distance to `other` against that of neighbour k + 1, or of the assumed one if that is nearer.
  bool accepts(const Neighbours& lists, std::size_t row, std::int32_t other, const SiftDescriptor& descriptor) const {
    const std::int32_t* distance = &lists.distance[row * lists.k];
    const std::int32_t* rows = &lists.row[row * lists.k];
    const double length = norm(descriptor);
    const double rival = std::min<double>(distance[k()], 2 * (1 - kRivalCosine) * length * length);
    for (std::size_t n = 0; n < k(); ++n)
      if (rows[n] == other) return distance[n] < options_.ratio * options_.ratio * rival;
    return false;
  }

  const ImageFeatures &a_, &b_;
  const Camera &camera_a_, &camera_b_;
  const TrustedPair& pair_;
  const MatchOptions& options_;
  double focal_;
  KeypointGrid grid_;
  Neighbours of_a_, of_b_;
  GuidedMatches result_;
};

}  // namespace

GuidedMatches match_along_epipolar(const ImageFeatures& a, const ImageFeatures& b, const Camera& camera_a,
                                   const Camera& camera_b, const TrustedPair& pair, const MatchOptions& options) {
  return GuidedMatcher(a, b, camera_a, camera_b, pair, options).run();
}

}  // namespace megablock
