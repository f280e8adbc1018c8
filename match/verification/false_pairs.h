// Finds pairs of images that show different things which look alike: two facades of a courtyard, the sides of a tower,
// two rows of the same houses. Their matches agree with an orientation, so that two-view verification accepts them.
// A block that believes them is torn, or folded onto itself.
//
// Two signs give a false pair away. The first is missing correspondences (N. Jiang, P. Tan and L.-F. Cheong, "Seamless
// structure from motion by missing correspondences", CVPR 2012; J. Heinly, E. Dunn and J.-M. Frahm, "Correcting for
// duplicate scene structure in sparse 3D reconstruction", ECCV 2014). A feature of image a that two other images have
// found again is a good one. Where it lies among the matches of the pair (a, b), b shows its surroundings, and should
// have found it as well. With n such features in both images, of which m are matched in the pair,
//
//     q = m / n                                                                     (the share that is found again)
//
// is 0.5 to 0.8 for pairs that show the same, up to intersection angles of 50 degrees. Where two facades differ in some
// details it is lower, because these details are found again in true pairs alone. `Among` means: at least three other
// matches of the pair within 4 % of the extent of the image.
//
// How much lower depends on the scene, so a second sign must agree: rotations along a cycle of pairs that do not close
// (C. Zach, M. Klopschitz and M. Pollefeys, "Disambiguating visual relations using loop constraints", CVPR 2010). The
// pairs with the largest q form a spanning tree of the images. Each other pair closes one cycle with it, of which it
// has the smallest q. With the rotations R_i that follow from the tree, a pair is false where
//
//     |Log(R_b' R_ab R_a)| > 20 degrees + 1 degree for each pair of the cycle, and
//     q < 0.75 min q of the tree's part of the cycle, by more than four sigmas of the two shares.
//
// A plane is explained by two orientations, and nobody knows which is right (brighton_beach without positions: of seven
// true pairs that did not close by more than 20 degrees, all were planes). So such a pair closes its cycle if either
// of its two rotations does.
//
// The tree is built with q less two sigmas, so that pairs of few features do not make it. Pairs of fewer than 30
// features are false where their cycle does not close; they would be the next best bridge between the parts that look
// alike. Pairs with a q between are left to rotation averaging, where the true pairs now outweigh them.
//
// Blocks of few contradictions keep all their pairs, since averaging leaves single ones out: at least five pairs and
// a twentieth of all must be false by both signs. So do blocks whose q are alike, where nothing tells which is wrong.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <vector>

#include "io/base/index.h"
#include "io/block/features.h"

namespace megablock {

struct PairEvidence {
  ImageIndex a, b;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  // camera a -> camera b
  std::int64_t expected = 0, found = 0;                          // n and m of the head of this file
  std::optional<Eigen::Quaterniond> twin = std::nullopt;         // the other rotation of a plane
};

// `keypoints` [images]. Matched features are rows of them. The result does not depend on the threads.
std::vector<PairEvidence> evidence_of_pairs(const std::vector<VerifiedPair>& pairs,
                                            const IndexedVector<ImageIndex, std::vector<Keypoint>>& keypoints,
                                            int threads);

struct FalsePairs {
  std::vector<std::uint8_t> is_false;  // [pairs] all 0 where there are too few
  std::int64_t open = 0;               // pairs whose cycle does not close
  std::int64_t proven = 0;             // those of them whose q is clearly lower as well
  std::int64_t count() const;          // of the false pairs
};

FalsePairs find_false_pairs(const std::vector<PairEvidence>& pairs);

}  // namespace megablock
