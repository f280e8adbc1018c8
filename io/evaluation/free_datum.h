// Compares poses whose datum is free: the similarity that takes its place, and the covariances after it.
//
// Errors x = (w, d) of the poses of a free block are known up to N a, the movement by a similarity a (phi, t, s)
// about a centre c:
//
//     w -= phi,    d += phi x (C - c) + t + s (C - c).
//
// A fit with the weights W leaves x - N (N'WN)^-1 N'W x = S x. Its covariance is S C S', the S-transformation (Baarda
// 1973), with C from any datum. Without it, errors in one datum are divided by sigmas of another: in a block of 12
// images the ratios of rotations are then about 2 where 1 is right.
//
// Weights: positions alone (0, 0, 0, 1, 1, 1). Positions on one line leave the rotation about it open; there the
// weights are (1, 1, 1, 1/L^2, ...), L the extent, and attitudes take part in the fit.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "geometry/similarity/similarity.h"
#include "io/result/result.h"

namespace megablock {

enum class DatumFit { kPositions, kPoses };

// Least squares with these weights. Empty for fewer than two different places, with kPositions for fewer than three.
std::optional<Similarity> fit_datum(std::span<const Pose> from, std::span<const Pose> to, DatumFit fit);
// Whether the positions determine a similarity: they are not on one line to 1e-4 of its length.
bool determine_similarity(std::span<const Pose> poses);

// S C S' of a covariance of all poses together [6 poses x 6 poses].
Eigen::MatrixXd after_fit(const Eigen::MatrixXd& covariance, std::span<const Pose> poses, DatumFit fit);

// The covariances [frames] of poses of the result after the fit of these frames, in the ground frame of the result.
struct DatumCovariances {
  std::vector<BlockResult::Matrix6> frames;  // empty: there are none
  std::string note;  // why there are none, or in which datum they are instead; empty: all is well
};
enum class SigmaKind { kFormal, kEmpirical };
DatumCovariances covariances_after_fit(const BlockResult& result, std::span<const FrameIndex> frames, DatumFit fit,
                                       SigmaKind kind = SigmaKind::kFormal);
// The covariances of these frames as they stand in the result; empty: there are none.
DatumCovariances stated_covariances(const BlockResult& result, std::span<const FrameIndex> frames,
                                    SigmaKind kind = SigmaKind::kFormal);

}  // namespace megablock
