#include "partition/candidates/candidates.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <tuple>

#include "io/base/error.h"
#include "io/text/plausible.h"
#include "partition/candidates/cells.h"
#include "partition/views/cones.h"
#include "partition/views/kd_tree.h"
#include "partition/views/views.h"

namespace megablock {

namespace {

constexpr int kSectors = 8;
constexpr std::size_t kSearchFactor = 4;  // candidates that are examined for each neighbour wanted
// Limit of a sector's nearest, as a multiple of the distance of the farthest wanted neighbour.
constexpr double kSectorDistance = 3;
constexpr double kRigDistance = 30;     // metres, default of max_pair_distance_m for rigs with poses
constexpr double kConeRange = 30;       // metres: how far cameras of rigs see, if there is no limit
constexpr double kLeastOverlap = 0.03;  // of two cones that makes a pair
// Frames of one pass belong to one visit of a place if they are at most this many frames and seconds apart.
constexpr std::int64_t kVisitFrames = 25;
constexpr double kVisitSeconds = 60;
constexpr double kConeMargin = 5 * std::numbers::pi / 180;  // overlap that two images of a frame need, radians

// One search for the candidate pairs of a block. run() collects pairs by each rule and removes duplicates.
class PairFinder {
 public:
  PairFinder(const Block& block, const GlobalDescriptors& descriptors, const CandidateOptions& options)
      : block_(block),
        descriptors_(descriptors),
        options_(options),
        views_(views_of(block)),
        rig_distance_m_(options.max_pair_distance_m < 0 ? kRigDistance : options.max_pair_distance_m),
        cones_(block, rig_distance_m_ > 0 ? rig_distance_m_ : kConeRange) {
    for (std::size_t i = 0; i < block.images.size(); ++i) images_.emplace_back(static_cast<std::int64_t>(i));
    by_rank_ = images_;
    std::sort(by_rank_.begin(), by_rank_.end(),
              [&](ImageIndex a, ImageIndex b) { return view(a).rank < view(b).rank; });
  }

  std::vector<ImagePair> run() {
    // Without any position a small block takes all pairs; a large one relies on order and similarity.
    const bool any_located = std::any_of(images_.begin(), images_.end(), [&](auto i) { return view(i).located; });
    if (!any_located && small()) {
      add_all();
    } else {
      add_nearest();
      add_intersecting();
      add_order();
      add_similar();
    }
    add_within_frames();
    std::sort(pairs_.begin(), pairs_.end());
    pairs_.erase(std::unique(pairs_.begin(), pairs_.end()), pairs_.end());
    return std::move(pairs_);
  }
  const Views& views() const { return views_; }

 private:
  const View& view(ImageIndex image) const { return views_.of_image[image]; }
  bool small() const { return static_cast<int>(images_.size()) < options_.exhaustive_below; }
  bool same_frame(ImageIndex a, ImageIndex b) const { return block_.images[a].frame == block_.images[b].frame; }
  void add(ImageIndex a, ImageIndex b) { pairs_.push_back({std::min(a, b), std::max(a, b)}); }

  void add_all() {
    for (ImageIndex a : images_)
      for (ImageIndex b(a.value + 1); b < block_.images.next_index(); ++b.value)
        if (!same_frame(a, b)) add(a, b);
  }

  // Whether the viewing cone of the image is known and its position is not doubtful.
  bool coned(ImageIndex image) const { return cones_.has(image) && !view(image).doubtful; }

  // Whether two images belong to one visit: frames of one pass that follow one another.
  bool same_visit(ImageIndex a, ImageIndex b) const {
    const FrameIndex fa = block_.images[a].frame, fb = block_.images[b].frame;
    const Frame &x = block_.frames[fa], &y = block_.frames[fb];
    return x.pass == y.pass && std::abs(fa.value - fb.value) <= kVisitFrames &&
           !(std::abs(x.time_s - y.time_s) > kVisitSeconds);
  }

  // Pairs of images of rigs whose viewing cones intersect.
  void add_intersecting() {
    std::vector<ImageIndex> coned_images;
    std::vector<Eigen::Vector2d> centres;
    for (ImageIndex image : by_rank_) {
      if (!coned(image)) continue;
      coned_images.push_back(image);
      centres.push_back(cones_.centre(image).head<2>());
    }
    // All coned images within the radius are examined, and the overlap of the cones decides.
    const KdTree tree(centres);
    const double radius = rig_distance_m_ > 0 ? rig_distance_m_ : kConeRange;
    for (std::size_t i = 0; i < coned_images.size(); ++i) {
      const ImageIndex image = coned_images[i];
      const auto admits = [&](std::int64_t other) {
        return !same_frame(image, coned_images[static_cast<std::size_t>(other)]);
      };
      std::vector<std::vector<Overlap>> visits;
      for (const KdTree::Neighbour& n : tree.nearest(centres[i], coned_images.size(), radius, admits)) {
        const ImageIndex other = coned_images[static_cast<std::size_t>(n.point)];
        if ((cones_.centre(image) - cones_.centre(other)).norm() > radius) continue;
        const double overlap = cones_.overlap(image, other);
        if (overlap < kLeastOverlap) continue;
        const auto visit = std::find_if(visits.begin(), visits.end(),
                                        [&](const auto& v) { return same_visit(v.front().image, other); });
        (visit == visits.end() ? visits.emplace_back() : *visit).push_back({overlap, view(other).rank, other});
      }
      for (const ImageIndex other : best_of_each(std::move(visits))) add(image, other);
    }
  }

  struct Overlap {
    double share;
    std::int64_t rank;
    ImageIndex image;
    bool operator<(const Overlap& o) const { return share != o.share ? share > o.share : rank < o.rank; }
  };
  // At most `neighbours` images: the best of each visit, then the second best of each, and so on. The visit with the
  // largest overlap begins.
  std::vector<ImageIndex> best_of_each(std::vector<std::vector<Overlap>> visits) const {
    for (auto& visit : visits) std::sort(visit.begin(), visit.end());
    std::sort(visits.begin(), visits.end(), [](const auto& a, const auto& b) { return a.front() < b.front(); });
    std::vector<ImageIndex> best;
    for (std::size_t round = 0, before = 1; best.size() != before; ++round) {
      before = best.size();
      for (const auto& visit : visits)
        if (round < visit.size() && std::ssize(best) < options_.neighbours) best.push_back(visit[round].image);
    }
    return best;
  }

  // Whether both images look in about the same direction, as far as it is known.
  bool views_agree(ImageIndex a, ImageIndex b) const {
    if (!view(a).directed || !view(b).directed) return true;
    return view(a).direction.dot(view(b).direction) >= std::cos(options_.max_view_angle_deg * std::numbers::pi / 180);
  }
  bool near_enough(ImageIndex a, ImageIndex b) const {
    if (options_.max_pair_distance_m <= 0 || !view(a).located || view(a).doubtful) return true;
    return (view(a).centre - view(b).centre).norm() <= options_.max_pair_distance_m;
  }

  // Pairs by distance on the ground.
  void add_nearest() {
    std::vector<ImageIndex> located;
    std::vector<Eigen::Vector2d> places;
    double reach = 0;
    for (ImageIndex image : by_rank_) {
      if (!view(image).located) continue;
      located.push_back(image);
      // A doubtful position is also used as it is: it may be right, and other images may be near it.
      places.push_back(view(image).doubtful ? view(image).centre : view(image).place);
      reach = std::max(reach, view(image).reach);
    }
    const KdTree tree(places);
    const double radius = options_.max_pair_distance_m > 0 ? options_.max_pair_distance_m + 2 * reach
                                                           : std::numeric_limits<double>::infinity();
    const auto link = [&](ImageIndex image, const Eigen::Vector2d& place) {
      const auto admits = [&](std::int64_t other) {
        const ImageIndex b = located[static_cast<std::size_t>(other)];
        return !same_frame(image, b) && views_agree(image, b) && near_enough(image, b) && !(coned(image) && coned(b));
      };
      const auto wanted = static_cast<std::size_t>(options_.neighbours);
      const auto found = tree.nearest(place, kSearchFactor * wanted, radius, admits);
      for (std::size_t n : all_round(place, found, places))
        add(image, located[static_cast<std::size_t>(found[n].point)]);
    };
    for (ImageIndex image : by_rank_) {
      if (view(image).placed) link(image, view(image).place);
      if (view(image).located && view(image).doubtful) link(image, view(image).centre);
    }
  }

  // Selects from `found` (ascending by distance): first the nearest of each of eight sectors, so that a dense flight
  // line is also linked to the next line, then the nearest of the others.
  std::vector<std::size_t> all_round(const Eigen::Vector2d& place, const std::vector<KdTree::Neighbour>& found,
                                     const std::vector<Eigen::Vector2d>& places) const {
    const auto wanted = std::min(static_cast<std::size_t>(options_.neighbours), found.size());
    if (wanted == 0) return {};
    const double farthest = kSectorDistance * kSectorDistance * found[wanted - 1].squared_distance;
    std::array<bool, kSectors> seen{};
    std::vector<std::uint8_t> taken(found.size(), 0);
    std::vector<std::size_t> result;
    for (std::size_t n = 0; n < found.size() && result.size() < wanted; ++n) {
      if (found[n].squared_distance == 0 || found[n].squared_distance > farthest) continue;
      const Eigen::Vector2d d = places[static_cast<std::size_t>(found[n].point)] - place;
      const double turn = std::atan2(d.y(), d.x()) / (2 * std::numbers::pi) + 0.5 + 0.5 / kSectors;
      bool& filled = seen[static_cast<std::size_t>(turn * kSectors) % kSectors];
      if (filled) continue;
      filled = true;
      taken[n] = 1;
      result.push_back(n);
    }
    for (std::size_t n = 0; n < found.size() && result.size() < wanted; ++n)
      if (!taken[n]) result.push_back(n);
    return result;
  }

  // Pairs of images that follow one another in the order of acquisition.
  void add_order() {
    const auto span = static_cast<std::size_t>(options_.order_neighbours);
    for (const std::vector<ImageIndex>& pass : views_.passes)
      for (std::size_t i = 0; i < pass.size(); ++i)
        for (std::size_t j = i + 1; j < pass.size() && j <= i + span; ++j)
          if (!same_frame(pass[i], pass[j]) && !(coned(pass[i]) && coned(pass[j]))) add(pass[i], pass[j]);
  }

  // Pairs of each image without a position, or with a doubtful one, with the images of the most similar global
  // descriptors. The descriptors are compared as integers, because the result must not depend on the order of
  // additions.
  void add_similar() {
    std::vector<ImageIndex> sought;
    for (ImageIndex image : by_rank_)
      if (!view(image).located || view(image).doubtful) sought.push_back(image);
    if (sought.empty()) return;
    constexpr float scale = 4096;  // the sum of 128 products of at most 2^24 stays below 2^31 for unit vectors
    const std::size_t count = descriptors_.size();
    std::vector<std::array<std::int16_t, 128>> codes(count);
    std::vector<std::uint8_t> described(count, 0);
    for (std::size_t i = 0; i < count; ++i) {
      const std::array<float, 128>& descriptor = descriptors_[ImageIndex(static_cast<std::int64_t>(i))];
      for (std::size_t k = 0; k < 128; ++k) {
        codes[i][k] = static_cast<std::int16_t>(std::lround(std::clamp(descriptor[k], -1.f, 1.f) * scale));
        described[i] |= codes[i][k] != 0;
      }
    }
    for (ImageIndex image : sought) {
      if (count > 0 && described[static_cast<std::size_t>(image.value)])
        add_most_alike(image, codes, described);
      else if (small() && !view(image).located)
        add_against_all(image);
    }
  }

  void add_most_alike(ImageIndex image, const std::vector<std::array<std::int16_t, 128>>& codes,
                      const std::vector<std::uint8_t>& described) {
    std::vector<std::tuple<std::int32_t, std::int64_t, ImageIndex>> found;  // (-similarity, rank, image)
    const auto& mine = codes[static_cast<std::size_t>(image.value)];
    for (ImageIndex other : images_) {
      const auto o = static_cast<std::size_t>(other.value);
      if (!described[o] || same_frame(image, other)) continue;
      std::int32_t product = 0;
      for (std::size_t k = 0; k < 128; ++k) product += std::int32_t{mine[k]} * codes[o][k];
      found.emplace_back(-product, view(other).rank, other);
    }
    // Ties are broken by the rank of the name, which makes the result independent of the order of images.
    const std::size_t wanted = std::min(static_cast<std::size_t>(options_.descriptor_neighbours), found.size());
    std::partial_sort(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(wanted), found.end());
    for (std::size_t n = 0; n < wanted; ++n) add(image, std::get<2>(found[n]));
  }

  void add_against_all(ImageIndex image) {
    for (ImageIndex other : images_)
      if (!same_frame(image, other)) add(image, other);
  }

  // Pairs of images of one frame.
  void add_within_frames() {
    IndexedVector<FrameIndex, std::vector<ImageIndex>> of_frame(block_.frames.size());
    for (ImageIndex image : images_) of_frame[block_.images[image].frame].push_back(image);
    for (const std::vector<ImageIndex>& frame : of_frame)
      for (std::size_t i = 0; i < frame.size(); ++i)
        for (std::size_t j = i + 1; j < frame.size(); ++j)
          if (cones_overlap(frame[i], frame[j])) add(frame[i], frame[j]);
  }
  bool cones_overlap(ImageIndex a, ImageIndex b) const {
    const auto axis = [&](ImageIndex i) {
      return Eigen::Vector3d(block_.mount_of(i).pose.rotation.conjugate() * Eigen::Vector3d::UnitZ());
    };
    const double angle = std::acos(std::clamp(axis(a).dot(axis(b)), -1.0, 1.0));
    const double reach =
        half_opening(block_.cameras[block_.camera_of(a)]) + half_opening(block_.cameras[block_.camera_of(b)]);
    return angle < reach - kConeMargin;
  }

  const Block& block_;
  const GlobalDescriptors& descriptors_;
  const CandidateOptions& options_;
  Views views_;
  double rig_distance_m_;
  ViewingCones cones_;
  std::vector<ImageIndex> images_, by_rank_;
  std::vector<ImagePair> pairs_;
};

// Groups pairs into cells by the midpoint of their places on the ground; pairs without any place by the ranks of their
// images.
std::vector<std::vector<std::int64_t>> cells_of_pairs(const std::vector<ImagePair>& pairs, const Views& views,
                                                      std::int64_t limit) {
  std::array<std::vector<Eigen::Vector2d>, 2> places;
  std::array<std::vector<std::int64_t>, 2> rows;
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    const View &a = views.of_image[pairs[p].a], &b = views.of_image[pairs[p].b];
    const bool ranked = !a.placed && !b.placed;
    const auto [low, high] = std::minmax(a.rank, b.rank);
    Eigen::Vector2d place(static_cast<double>(low), static_cast<double>(high));
    if (!ranked) place = a.placed && b.placed ? Eigen::Vector2d((a.place + b.place) / 2) : a.placed ? a.place : b.place;
    places[ranked].push_back(place);
    rows[ranked].push_back(static_cast<std::int64_t>(p));
  }
  std::vector<std::vector<std::int64_t>> cells;
  for (std::size_t kind : {0, 1})
    for (std::vector<std::int64_t>& cell : cells_of(places[kind], limit)) {
      for (std::int64_t& row : cell) row = rows[kind][static_cast<std::size_t>(row)];
      cells.push_back(std::move(cell));
    }
  return cells;
}

void append_cell(CandidateGraph& graph, const std::vector<std::int64_t>& rows) {
  graph.cell_pairs.insert(graph.cell_pairs.end(), rows.begin(), rows.end());
  graph.cell_begin.push_back(static_cast<std::int64_t>(graph.cell_pairs.size()));
}

void check_descriptors(const Block& block, const GlobalDescriptors& descriptors) {
  if (descriptors.empty() || descriptors.size() == block.images.size()) return;
  throw ComputeError("candidate pairs: " + std::to_string(descriptors.size()) + " global descriptors for " +
                     std::to_string(block.images.size()) + " images; one per image or none is needed");
}

}  // namespace

void CandidateOptions::check() const {
  const auto require = [](bool ok, const char* message) {
    if (!ok) throw InputError(message);
  };
  require(neighbours >= 1, "neighbours must be at least 1");
  if (max_pair_distance_m != -1)
    require_within(max_pair_distance_m, {0, 1e8}, "max_pair_distance_m",
                   " (metres; 0 = no limit) or be -1 (30 for rigs with poses)");
  require(max_view_angle_deg > 0 && max_view_angle_deg <= 180, "max_view_angle_deg must be within 0 and 180 degrees");
  require(order_neighbours >= 0, "order_neighbours must not be negative");
  require(descriptor_neighbours >= 0, "descriptor_neighbours must not be negative");
  require(exhaustive_below >= 0, "exhaustive_below must not be negative");
  require(cell_pairs >= 1, "cell_pairs must be at least 1");
}

CandidateGraph candidate_pairs(const Block& block, const GlobalDescriptors& global_descriptors,
                               const CandidateOptions& options) {
  CandidateGraph none;
  none.cell_begin = {0};
  return extend_candidates(none, block, global_descriptors, options, ImageIndex(0));
}

CandidateGraph extend_candidates(const CandidateGraph& previous, const Block& block,
                                 const GlobalDescriptors& global_descriptors, const CandidateOptions& options,
                                 ImageIndex first_new_image) {
  options.check();
  check_descriptors(block, global_descriptors);
  for (const ImagePair& pair : previous.pairs)
    if (pair.b >= first_new_image)
      throw InputError("candidate pairs: the earlier pairs name images that the earlier block does not have");
  PairFinder finder(block, global_descriptors, options);
  // The whole block is searched, but only pairs with a new image are added: earlier pairs keep their cells, whose
  // results exist.
  std::vector<ImagePair> added = finder.run();
  std::erase_if(added, [&](const ImagePair& pair) { return pair.b < first_new_image; });

  CandidateGraph graph;
  std::merge(previous.pairs.begin(), previous.pairs.end(), added.begin(), added.end(), std::back_inserter(graph.pairs));
  const auto row_of = [&](const ImagePair& pair) {
    return std::lower_bound(graph.pairs.begin(), graph.pairs.end(), pair) - graph.pairs.begin();
  };
  graph.cell_begin = {0};
  const auto append = [&](const std::vector<ImagePair>& pairs, auto begin, auto end) {
    std::vector<std::int64_t> rows;
    for (auto row = begin; row != end; ++row) rows.push_back(row_of(pairs[static_cast<std::size_t>(*row)]));
    append_cell(graph, rows);
  };
  for (std::size_t c = 0; c + 1 < previous.cell_begin.size(); ++c)
    append(previous.pairs, previous.cell_pairs.begin() + previous.cell_begin[c],
           previous.cell_pairs.begin() + previous.cell_begin[c + 1]);
  for (const std::vector<std::int64_t>& cell : cells_of_pairs(added, finder.views(), options.cell_pairs))
    append(added, cell.begin(), cell.end());
  return graph;
}

}  // namespace megablock
