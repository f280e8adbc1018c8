// Viewing cones of simulated drives with ten cameras: against dense sample points.
#include "partition/views/cones.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "geometry/camera/camera.h"
#include "io/simulate/blocks/simulate.h"
#include "partition/candidates/candidates.h"

namespace megablock {
namespace {

// Two drives of 20 frames with ten cameras, there and back along the same streets.
Block street() {
  SimulationOptions options = SimulationOptions::of(SimulationOptions::Scene::kStereopolis);
  options.frames = 40;
  options.points_per_frame = 10;
  options.bridge = false;
  options.street_spacing_m = 60;
  return simulate_block(options).block;
}

Pose pose_of(const Block& block, ImageIndex image) {
  return camera_pose(*block.frames[block.images[image].frame].given_pose, block.mount_of(image).pose);
}

double distance(const Block& block, ImageIndex a, ImageIndex b) {
  return (pose_of(block, a).centre - pose_of(block, b).centre).norm();
}

// Whether two cones meet, by dense points of a's cone, projected through the full camera model.
bool cones_meet(const Block& block, ImageIndex a, ImageIndex b, double range) {
  const Pose from = pose_of(block, a), by = pose_of(block, b);
  const Camera &ca = block.cameras[block.camera_of(a)], &cb = block.cameras[block.camera_of(b)];
  for (double u = 0.02; u < 1; u += 0.04)
    for (double v = 0.02; v < 1; v += 0.04) {
      const auto ray = viewing_ray(ca.intrinsics, {u * ca.width, v * ca.height});
      for (double d = 0.5; d <= range; d += 0.5) {
        const Eigen::Vector3d inside = to_inside(by, from.centre + from.rotation.conjugate() * (d * *ray));
        if (inside.norm() > range) continue;
        const Eigen::Vector2d p = project(cb.intrinsics, inside);
        if (p.allFinite() && p.x() >= 0 && p.y() >= 0 && p.x() <= cb.width && p.y() <= cb.height) return true;
      }
    }
  return false;
}

TEST(ViewingCones, PairsOfARigAreNearAndSeeTheSame) {
  const Block block = street();
  const CandidateGraph graph = candidate_pairs(block, {}, {});
  std::size_t checked = 0, across = 0;
  std::vector<int> partners(block.images.size(), 0);
  for (const ImagePair& pair : graph.pairs) {
    const Image &a = block.images[pair.a], &b = block.images[pair.b];
    if (a.frame == b.frame) continue;
    EXPECT_LE(distance(block, pair.a, pair.b), 30.0);
    if (checked++ % 7 == 0) {
      EXPECT_TRUE(cones_meet(block, pair.a, pair.b, 30)) << block.name_of(pair.a) << ' ' << block.name_of(pair.b);
    }
    across += block.frames[a.frame].pass != block.frames[b.frame].pass;
    for (const ImageIndex image : {pair.a, pair.b}) ++partners[static_cast<std::size_t>(image.value)];
  }
  EXPECT_GE(*std::min_element(partners.begin(), partners.end()), 6);  // at the ends of the drives cameras look away
  EXPECT_LE(checked, 14 * block.images.size());
  // The other drive also gets partners.
  EXPECT_GT(across, checked / 4);
  EXPECT_LT(across, checked * 3 / 4);
}

// Pairs are decided per camera, not per frame: of two frames side by side, the cameras to the right never meet those to
// the left.
TEST(ViewingCones, CamerasThatLookApartAreNoPairs) {
  const Block block = street();
  const ViewingCones cones(block, 30);
  const auto image = [&](std::int64_t frame, const std::string& camera) {
    ImageIndex i(0);
    while (block.images[i].frame != FrameIndex(frame) || block.cameras[block.camera_of(i)].name != camera) ++i.value;
    return i;
  };
  EXPECT_EQ(cones.overlap(image(3, "c31"), image(4, "c32")), 0);
  // The one looks ahead of the front frame, the other behind the rear frame.
  EXPECT_EQ(cones.overlap(image(4, "c22"), image(3, "c42")), 0);
  const double next = cones.overlap(image(3, "c22"), image(4, "c22"));
  EXPECT_GT(next, 0.2);
  EXPECT_GT(next, cones.overlap(image(3, "c22"), image(6, "c22")));
  EXPECT_EQ(cones.overlap(image(3, "c22"), image(4, "c21")), cones.overlap(image(4, "c21"), image(3, "c22")));
}

TEST(ViewingCones, ALimitOfDistanceHolds) {
  const Block block = street();
  CandidateOptions options;
  options.max_pair_distance_m = 6;
  std::size_t pairs = 0;
  for (const ImagePair& pair : candidate_pairs(block, {}, options).pairs) {
    EXPECT_LE(distance(block, pair.a, pair.b), 6.0);
    ++pairs;
  }
  EXPECT_GT(pairs, 200u);
  options.max_pair_distance_m = -2;
  EXPECT_THROW(options.check(), std::exception);
}

}  // namespace
}  // namespace megablock
