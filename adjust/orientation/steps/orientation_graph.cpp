// The graph must be the same however the block lists its images, so that everything is sorted by names and contents:
// images and frames by name, cameras by their first image, edges by their ends, tracks by their length and then by
// their observations.
#include "adjust/orientation/steps/orientation_graph.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>
#include <tuple>
#include <unordered_map>

#include "adjust/orientation/steps/plane_twins.h"
#include "io/base/error.h"
#include "io/block/held_priors.h"
#include "io/block/observed_poses.h"

namespace megablock {

namespace {

// Rows of images and frames by global index; -1 where the component does not hold them.
struct Rows {
  IndexedVector<ImageIndex, std::int32_t> image;
  IndexedVector<FrameIndex, std::int32_t> frame;
};

// Numbers the images of the component by name. Frames and cameras are numbered by the first image that belongs to them,
// so that their numbers follow from names as well. Returns the numbers by the indices of the block.
Rows add_frames_and_images(const Block& block, const BlockState& start, const std::vector<FrameIndex>& frames,
                           const OrientationOptions& options, OrientationGraph& graph) {
  Rows rows;
  rows.image.assign(block.images.size(), -1);
  rows.frame.assign(block.frames.size(), -1);
  for (FrameIndex frame : frames) {
    if (!block.frames.contains(frame)) throw InputError("a frame of the component is not in the block");
    rows.frame[frame] = 0;
  }

  std::vector<ImageIndex> images;
  for (ImageIndex i(0); block.images.contains(i); ++i.value)
    if (rows.frame[block.images[i].frame] == 0) images.push_back(i);
  std::sort(images.begin(), images.end(),
            [&](ImageIndex a, ImageIndex b) { return block.image_names[a] < block.image_names[b]; });

  std::fill(rows.frame.begin(), rows.frame.end(), -1);
  std::vector<std::pair<std::string, std::int32_t>> camera_of;
  IndexedVector<CameraIndex, std::int32_t> camera_row;
  camera_row.assign(block.cameras.size(), -1);
  for (ImageIndex image : images) {
    const FrameIndex frame = block.images[image].frame;
    if (rows.frame[frame] < 0) {
      rows.frame[frame] = graph.frame_count();
      OrientationGraph::FrameNode node{frame, {}, {}, {}};
      const Frame& given = block.frames[frame];
      if (options.observations.use_position_priors && given.position_prior)
        node.position = comparable(loosened(*given.position_prior, block, given.rig));
      if (options.observations.use_attitude_priors && given.attitude_prior)
        node.attitude = comparable(loosened(*given.attitude_prior, block, given.rig));
      if (start.oriented[frame]) {
        constexpr double kSigma = 0.01;  // metres
        node.given = start.frames[frame];
        // A given pose serves as a known position, for the similarity to the ground. A centimetre is far below the
        // errors of first centres.
        node.position = PositionPrior{node.given->centre, Eigen::Vector3d::Constant(kSigma), Eigen::Vector3d::Zero()};
      }
      graph.frames.push_back(std::move(node));
    }
    const CameraIndex camera = block.camera_of(image);
    if (camera_row[camera] < 0) {
      camera_row[camera] = static_cast<std::int32_t>(graph.cameras.size());
      graph.cameras.push_back(camera);
    }
    rows.image[image] = static_cast<std::int32_t>(graph.images.size());
    const auto mount = static_cast<std::size_t>(block.images[image].mount);
    graph.images.push_back(
        {image, rows.frame[frame], camera_row[camera], start.mounts[block.frames[frame].rig][mount], nullptr});
  }
  for (const SeenVertical& vertical : block.verticals)
    if (const std::int32_t image = rows.image[vertical.image]; image >= 0)
      graph.images[static_cast<std::size_t>(image)].vertical = &vertical;
  return rows;
}

// Empty where the stored matrix is not a rotation or not a number. `turned`: of a with respect to b.
std::optional<OrientationGraph::Relative> relative_of(const PairOrientation& stored, bool turned) {
  const auto& wxyz = stored.rotation_wxyz;
  const auto &of_rotation = stored.rotation_covariance, &of_base = stored.base_covariance;
  Eigen::Quaterniond rotation(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
  if (!(rotation.norm() > 0.5)) return std::nullopt;
  rotation.normalize();
  const Eigen::Vector3d translation(stored.translation[0], stored.translation[1], stored.translation[2]);
  // X_b = R X_a + t: the centre of b in a is -R' t, that of a in b is t.
  OrientationGraph::Relative relative;
  relative.rotation = turned ? rotation.conjugate() : rotation;
  relative.baseline = turned ? translation : Eigen::Vector3d(-(rotation.conjugate() * translation));
  if (!(relative.baseline.norm() > 0.5)) relative.baseline.setZero();
  // The diagonal of the stored covariance (upper triangle by rows), averaged: three angles of the rotation, and two of
  // the base, whose covariance has rank two.
  relative.rotation_sigma = std::sqrt(std::max(0.0, (of_rotation[0] + of_rotation[3] + of_rotation[5]) / 3));
  relative.baseline_sigma = std::sqrt(std::max(0.0, (of_base[0] + of_base[3] + of_base[5]) / 2));
  return relative;
}

// Pairs without a rotation, and pairs of one frame, whose orientation its mounts give, are no edges.
void add_edges(const std::vector<VerifiedPair>& pairs, const Rows& rows, OrientationGraph& graph) {
  for (const VerifiedPair& pair : pairs) {
    if (pair.model == PairModel::kNone) continue;
    const std::int32_t a = rows.image[pair.a], b = rows.image[pair.b];
    if (a < 0 || b < 0 ||
        graph.images[static_cast<std::size_t>(a)].frame == graph.images[static_cast<std::size_t>(b)].frame)
      continue;
    const auto relative = relative_of(pair, b < a);
    if (!relative) continue;
    OrientationGraph::PairEdge edge;
    static_cast<OrientationGraph::Relative&>(edge) = *relative;
    edge.a = std::min(a, b);
    edge.b = std::max(a, b);
    if (pair.model == PairModel::kRotationOnly) edge.baseline.setZero();
    edge.inliers = static_cast<double>(pair.feature_a.size());
    if (const auto twin = pair.twin ? relative_of(*pair.twin, b < a) : std::nullopt) {
      edge.has_twin = true;
      edge.twin = *twin;
    }
    graph.edges.push_back(edge);
  }
  std::sort(graph.edges.begin(), graph.edges.end(),
            [](const auto& e, const auto& f) { return std::tie(e.a, e.b, e.inliers) < std::tie(f.a, f.b, f.inliers); });
}

struct SortedTrack {
  std::vector<std::array<std::int32_t, 3>> rows;  // image, x, y; ascending
  bool operator<(const SortedTrack& other) const {
    if (rows.size() != other.rows.size()) return rows.size() > other.rows.size();
    return rows < other.rows;
  }
};

// Chooses tracks greedily: the longest first, until every pair of images has its number of them. A track counts for all
// of its pairs.
void add_tracks(const TrackSet& tracks, const Rows& rows, std::int64_t tracks_per_pair, OrientationGraph& graph) {
  std::vector<SortedTrack> candidates;
  for (std::size_t t = 0; t < tracks.id.size(); ++t) {
    SortedTrack track;
    for (auto o = static_cast<std::size_t>(tracks.begin[t]); o < static_cast<std::size_t>(tracks.begin[t + 1]); ++o)
      if (const std::int32_t image = rows.image[tracks.image[o]]; image >= 0)
        track.rows.push_back({image, tracks.x[o], tracks.y[o]});
    if (track.rows.size() < 2) continue;
    std::sort(track.rows.begin(), track.rows.end());
    candidates.push_back(std::move(track));
  }
  // The longest tracks come first: they connect most images, and each pair takes its share of them.
  std::sort(candidates.begin(), candidates.end());

  std::unordered_map<std::uint64_t, std::int64_t> used;  // per pair of images
  graph.begin = {0};
  for (const SortedTrack& track : candidates) {
    bool wanted = false;
    for (std::size_t i = 0; i < track.rows.size(); ++i)
      for (std::size_t j = i + 1; j < track.rows.size(); ++j) {
        const std::uint64_t key =
            static_cast<std::uint64_t>(track.rows[i][0]) << 32 | static_cast<std::uint64_t>(track.rows[j][0]);
        // A track is wanted if any pair of its images still lacks tracks.
        if (used[key]++ < tracks_per_pair) wanted = true;
      }
    constexpr std::size_t kFewTracks = 20000;  // a block of few pairs can afford more tracks of each pair
    if (!wanted && graph.begin.size() > kFewTracks) continue;
    for (const auto& [image, x, y] : track.rows)
      graph.observations.push_back({image, {from_fixed_pixel(x), from_fixed_pixel(y)}});
    graph.begin.push_back(static_cast<std::int64_t>(graph.observations.size()));
  }
}

}  // namespace

OrientationGraph make_orientation_graph(const Block& block, const BlockState& start,
                                        const std::vector<FrameIndex>& frames, const std::vector<VerifiedPair>& pairs,
                                        const TrackSet& tracks, const OrientationOptions& options) {
  OrientationGraph graph;
  const Rows rows = add_frames_and_images(block, start, frames, options, graph);
  add_edges(pairs, rows, graph);
  choose_twins_by_planes(graph);
  add_tracks(tracks, rows, options.tracks_per_pair, graph);
  return graph;
}

std::vector<Eigen::Vector3d> viewing_rays(const OrientationGraph& graph, const std::vector<Intrinsics>& cameras) {
  std::vector<Eigen::Vector3d> rays;
  rays.reserve(graph.observations.size());
  for (const auto& observation : graph.observations) {
    const auto& image = graph.images[static_cast<std::size_t>(observation.image)];
    rays.push_back(viewing_ray(cameras[static_cast<std::size_t>(image.camera)], observation.pixel)
                       .value_or(Eigen::Vector3d::Zero()));
  }
  return rays;
}

}  // namespace megablock
