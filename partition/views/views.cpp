#include "partition/views/views.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>
#include <string_view>
#include <tuple>
#include <utility>

#include "geometry/numbers/median.h"
#include "partition/views/kd_tree.h"

namespace megablock {

namespace {

constexpr double kDownward = 0.35;        // sine: a direction at least 20 degrees below the horizon
constexpr double kMostSlant = 4;          // a footprint is at most this many heights away
constexpr double kHorizontalDepth = 3;    // assumed depth of horizontal views, in spacings of frames
constexpr double kSpacingPerSide = 0.25;  // assumed spacing over the footprint's side: 75 % overlap
constexpr double kDoubtfulSteps = 10;     // in usual steps
constexpr double kDoubtfulSigmas = 6;
constexpr std::ptrdiff_t kOrderWindow = 2;   // neighbours in the order of acquisition that a position is compared with
constexpr std::ptrdiff_t kPlaceWindow = 10;  // neighbours between which a missing position is assumed

bool is_digit(char c) { return c >= '0' && c <= '9'; }

// Compares names so that numbers in them count by value: img_9 before img_10. Names equal in this sense are compared
// plainly.
bool natural_less(std::string_view a, std::string_view b) {
  std::size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (is_digit(a[i]) && is_digit(b[j])) {
      // Without leading zeros, the number with more digits is larger, and equal lengths compare as text.
      const auto digits = [](std::string_view text, std::size_t& at) {
        while (at < text.size() && text[at] == '0') ++at;
        const std::size_t begin = at;
        while (at < text.size() && is_digit(text[at])) ++at;
        return text.substr(begin, at - begin);
      };
      const std::string_view x = digits(a, i), y = digits(b, j);
      if (x.size() != y.size()) return x.size() < y.size();
      if (x != y) return x < y;
    } else {
      if (a[i] != b[j]) return static_cast<unsigned char>(a[i]) < static_cast<unsigned char>(b[j]);
      ++i;
      ++j;
    }
  }
  if (a.size() - i != b.size() - j) return a.size() - i < b.size() - j;
  return a < b;
}

bool name_before(const Block& block, ImageIndex a, ImageIndex b) {
  return natural_less(block.image_names[a], block.image_names[b]);
}

// Rank of every image in this order of names.
IndexedVector<ImageIndex, std::int64_t> name_ranks(const Block& block) {
  std::vector<ImageIndex> order;
  order.reserve(block.images.size());
  for (std::size_t i = 0; i < block.images.size(); ++i) order.emplace_back(static_cast<std::int64_t>(i));
  std::sort(order.begin(), order.end(), [&](ImageIndex a, ImageIndex b) { return name_before(block, a, b); });
  IndexedVector<ImageIndex, std::int64_t> ranks(block.images.size(), 0);
  for (std::size_t r = 0; r < order.size(); ++r) ranks[order[r]] = static_cast<std::int64_t>(r);
  return ranks;
}

// Median distance of a frame to the nearest other frame, metres.
double frame_spacing(const Block& block) {
  std::vector<Eigen::Vector2d> centres;
  for (const Frame& frame : block.frames) {
    if (frame.position_prior)
      centres.emplace_back(frame.position_prior->position.head<2>());
    else if (frame.given_pose)
      centres.emplace_back(frame.given_pose->centre.head<2>());
  }
  const KdTree tree(centres);
  std::vector<double> distances;
  for (const Eigen::Vector2d& centre : centres) {
    const auto apart = [&](std::int64_t i) { return centres[static_cast<std::size_t>(i)] != centre; };
    for (const KdTree::Neighbour& n : tree.nearest(centre, 1, std::numeric_limits<double>::infinity(), apart))
      distances.push_back(std::sqrt(n.squared_distance));
  }
  return median(std::move(distances));
}

double ground_height(const Block& block) {
  std::vector<double> heights;
  for (const ControlPoint& point : block.control_points)
    if (std::isfinite(point.position.z())) heights.push_back(point.position.z());
  return heights.empty() ? std::numeric_limits<double>::quiet_NaN() : median(std::move(heights));
}

// Distance from the projection centre to the scene along the viewing direction.
double depth_of(const View& view, double height, double spacing) {
  const double down = -view.direction.z();
  if (down < kDownward) return kHorizontalDepth * spacing;
  return std::min(height / down, kMostSlant * height);
}

View view_of(const Block& block, ImageIndex image, double spacing, double ground) {
  const Frame& frame = block.frames[block.images[image].frame];
  const Mount& mount = block.mount_of(image);
  View view;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  if (frame.position_prior) {
    position = frame.position_prior->position;
    view.sigma = frame.position_prior->sigma.head<2>().norm();
  } else if (frame.given_pose) {
    position = frame.given_pose->centre;
  }
  view.located = view.placed = frame.position_prior || frame.given_pose;
  view.directed = frame.attitude_prior || frame.given_pose;
  view.centre = view.place = position.head<2>();
  if (!view.directed) return view;
  const Eigen::Quaterniond rotation =
      frame.attitude_prior ? frame.attitude_prior->rotation_cw : frame.given_pose->rotation;
  view.direction = (mount.pose.rotation * rotation).conjugate() * Eigen::Vector3d::UnitZ();
  if (!view.located) return view;
  const Camera& camera = block.cameras[mount.camera];
  double height = position.z() - ground;
  // Without control, or with positions below it, the height follows from the usual overlap of the frames.
  if (!(height > 0))
    height = spacing / kSpacingPerSide * camera.intrinsics[kFocal] / std::min(camera.width, camera.height);
  const Eigen::Vector2d to_footprint = depth_of(view, height, spacing) * view.direction.head<2>();
  view.reach = to_footprint.norm();
  view.place += to_footprint;
  return view;
}

// `before(a, b)` compares images by name.
template <typename Before>
std::vector<std::vector<ImageIndex>> passes_of(const Block& block, const Before& before) {
  std::map<std::tuple<std::int64_t, std::int64_t, int>, std::vector<ImageIndex>> groups;
  for (std::size_t i = 0; i < block.images.size(); ++i) {
    const ImageIndex image(static_cast<std::int64_t>(i));
    const Frame& frame = block.frames[block.images[image].frame];
    groups[{frame.pass, frame.rig.value, block.images[image].mount}].push_back(image);
  }
  std::vector<std::vector<ImageIndex>> passes;
  for (auto& [key, images] : groups) {
    // Times are copied beside the images, because the tables of the block may be mapped from a file, whose pages may
    // leave memory meanwhile.
    std::vector<std::pair<double, ImageIndex>> order;
    order.reserve(images.size());
    for (const ImageIndex image : images) order.emplace_back(block.frames[block.images[image].frame].time_s, image);
    const bool timed = std::all_of(order.begin(), order.end(), [](const auto& i) { return std::isfinite(i.first); });
    std::sort(order.begin(), order.end(), [&](const auto& a, const auto& b) {
      return timed && a.first != b.first ? a.first < b.first : before(a.second, b.second);
    });
    for (std::size_t i = 0; i < order.size(); ++i) images[i] = order[i].second;
    passes.push_back(std::move(images));
  }
  return passes;
}

// Marks positions as doubtful if no located neighbour in the order of acquisition is within ten usual steps or six
// standard deviations, whichever is more.
void find_doubtful(const std::vector<ImageIndex>& pass, Views& views) {
  std::vector<ImageIndex> located;
  for (ImageIndex image : pass)
    if (views.of_image[image].located) located.push_back(image);
  const auto count = static_cast<std::ptrdiff_t>(located.size());
  const auto at = [&](std::ptrdiff_t i) -> View& { return views.of_image[located[static_cast<std::size_t>(i)]]; };
  std::vector<double> steps;
  for (std::ptrdiff_t i = 1; i < count; ++i) steps.push_back((at(i).centre - at(i - 1).centre).norm());
  const double usual = median(std::move(steps));
  for (std::ptrdiff_t i = 0; i < count && count > 2; ++i) {
    double nearest = std::numeric_limits<double>::infinity();
    for (std::ptrdiff_t j = std::max<std::ptrdiff_t>(0, i - kOrderWindow); j <= std::min(count - 1, i + kOrderWindow);
         ++j)
      if (j != i) nearest = std::min(nearest, (at(i).centre - at(j).centre).norm());
    at(i).doubtful = nearest > std::max(kDoubtfulSteps * usual, kDoubtfulSigmas * at(i).sigma);
  }
}

// Assumes a place for images without a position, or with a doubtful one: the middle between the nearest good ones of
// their pass.
void place_between(const std::vector<ImageIndex>& pass, Views& views) {
  const auto count = static_cast<std::ptrdiff_t>(pass.size());
  const auto at = [&](std::ptrdiff_t i) -> View& { return views.of_image[pass[static_cast<std::size_t>(i)]]; };
  const auto good = [&](std::ptrdiff_t i) { return at(i).located && !at(i).doubtful; };
  for (std::ptrdiff_t i = 0; i < count; ++i) {
    if (good(i)) continue;
    // The nearest good image before and after, within a window.
    std::vector<Eigen::Vector2d> beside;
    for (std::ptrdiff_t direction : {-1, 1})
      for (std::ptrdiff_t d = 1; d <= kPlaceWindow; ++d) {
        const std::ptrdiff_t j = i + direction * d;
        if (j < 0 || j >= count) break;
        if (!good(j)) continue;
        beside.push_back(at(j).place);
        break;
      }
    if (beside.empty()) continue;
    at(i).place = (beside.front() + beside.back()) / 2;
    at(i).placed = true;
  }
}

}  // namespace

double half_opening(const Camera& camera) {
  const Intrinsics& k = camera.intrinsics;
  if (is_panorama(k.model())) return std::numbers::pi;
  if (sees_sideways(k.model())) {
    const double radius = 0.5 * std::max(camera.width, camera.height);
    const auto ray = viewing_ray(k, {k[kPrincipalX] + radius, k[kPrincipalY]});
    return ray ? std::acos(ray->z()) : std::numbers::pi;
  }
  return std::atan(0.5 * std::max(camera.width, camera.height) / camera.intrinsics[kFocal]);
}

// This version needs no ranks of names: where all frames have times, no name is compared.
std::vector<std::vector<ImageIndex>> passes_of(const Block& block) {
  return passes_of(block, [&](ImageIndex a, ImageIndex b) { return name_before(block, a, b); });
}

Views views_of(const Block& block) {
  Views views;
  const double spacing = frame_spacing(block), ground = ground_height(block);
  for (std::size_t i = 0; i < block.images.size(); ++i)
    views.of_image.push_back(view_of(block, ImageIndex(static_cast<std::int64_t>(i)), spacing, ground));
  const IndexedVector<ImageIndex, std::int64_t> ranks = name_ranks(block);
  for (ImageIndex i(0); ranks.contains(i); ++i.value) views.of_image[i].rank = ranks[i];
  views.passes = passes_of(block, [&](ImageIndex a, ImageIndex b) { return ranks[a] < ranks[b]; });
  for (const std::vector<ImageIndex>& pass : views.passes) {
    find_doubtful(pass, views);
    place_between(pass, views);
  }
  return views;
}

}  // namespace megablock
