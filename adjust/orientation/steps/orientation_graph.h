// Gives initial orientation its input: the frames, images, relative orientations and tracks of one component, in local
// numbers. Frames and images are ordered by name, tracks by length and then by their first observations, so that the
// numbers do not depend on the order of the images in the block.
// Internal to adjust/: it is not installed.
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "adjust/orientation/steps/orientation_options.h"
#include "adjust/problem/tile_problem.h"
#include "io/block/features.h"

namespace megablock {

// A local number as an index of the standard library, which is unsigned.
inline std::size_t row(std::int32_t i) { return static_cast<std::size_t>(i); }

struct OrientationGraph {
  struct FrameNode {
    FrameIndex index;
    std::optional<Pose> given;              // oriented beforehand; this pose stays
    std::optional<PositionPrior> position;  // for given frames, their own position
    std::optional<AttitudePrior> attitude;
  };
  struct ImageNode {
    ImageIndex index;
    std::int32_t frame = -1;
    std::int32_t camera = -1;  // row of `cameras`
    Pose mount;
    const SeenVertical* vertical = nullptr;  // of the block
  };
  // Relative orientation of camera b with respect to camera a.
  struct Relative {
    Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  // camera a -> camera b
    // Unit direction from a to b in the axes of camera a; zero: rotation only.
    Eigen::Vector3d baseline = Eigen::Vector3d::Zero();
    double rotation_sigma = 0, baseline_sigma = 0;  // by the noise of the matches, per axis, rad; 0: not known
  };
  struct PairEdge : Relative {
    std::int32_t a = -1, b = -1;  // rows of `images`, a < b
    double inliers = 0;
    bool has_twin = false;
    Relative twin;  // the second orientation that fits the matches of a plane
  };
  // Observations of a track: rows [begin[t], begin[t + 1]); images ascending.
  struct Observation {
    std::int32_t image = -1;
    Eigen::Vector2d pixel;
  };

  std::vector<FrameNode> frames;
  std::vector<ImageNode> images;
  std::vector<CameraIndex> cameras;
  std::vector<PairEdge> edges;  // of images of different frames, ascending by (a, b)
  std::vector<std::int64_t> begin;
  std::vector<Observation> observations;

  std::int64_t track_count() const { return static_cast<std::int64_t>(begin.size()) - 1; }
  std::int32_t frame_count() const { return static_cast<std::int32_t>(frames.size()); }
};

// Keeps the longest tracks until every pair of images has `tracks_per_pair` of them and there are 20 000 in all.
OrientationGraph make_orientation_graph(const Block& block, const BlockState& start,
                                        const std::vector<FrameIndex>& frames, const std::vector<VerifiedPair>& pairs,
                                        const TrackSet& tracks, const OrientationOptions& options);

// Unit viewing directions of all observations in camera axes; zero where the distortion cannot be inverted.
std::vector<Eigen::Vector3d> viewing_rays(const OrientationGraph& graph, const std::vector<Intrinsics>& cameras);

}  // namespace megablock
