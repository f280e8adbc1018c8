#include "adjust/orientation/steps/plane_twins.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "geometry/two_view/homography.h"
#include "tests/support/adjust/orientation_scene.h"

namespace megablock {
namespace {

using namespace orientation_scene;

struct TwinScene {
  OrientationGraph graph;
  std::vector<Eigen::Quaterniond> truth;  // [edges]
  std::size_t with_twin = 0, wrong = 0;   // edges; those of which the wrong orientation comes first
  std::size_t count_wrong() const {
    std::size_t count = 0;
    for (std::size_t e = 0; e < truth.size(); ++e) count += rotation_angle(graph.edges[e].rotation, truth[e]) > kDegree;
    return count;
  }
};

// Images in any place above a plane, in narrow views of it; of every pair's homography both orientations, one of them
// first by chance. Rotations have errors of `noise_deg` for each axis.
TwinScene above_a_plane(double noise_deg, unsigned seed, int images = 12) {
  TwinScene scene;
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<Pose> poses;
  for (int i = 0; i < images; ++i) {
    const Eigen::Quaterniond down = looking({0, 0, -1}, {uniform(random), uniform(random), 0});
    poses.push_back({rotation_update(down, 0.1 * normal_vector(random)),
                     {10 * uniform(random), 10 * uniform(random), 100 + 8 * uniform(random)}});
  }
  scene.graph.images.resize(poses.size());
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 40; ++i) points.emplace_back(5 * uniform(random), 5 * uniform(random), 0);
  for (std::int32_t a = 0; a < std::ssize(poses); ++a)
    for (std::int32_t b = a + 1; b < std::ssize(poses); ++b) {
      std::vector<Eigen::Vector3d> rays_a, rays_b;
      for (const auto& p : points) {
        rays_a.push_back(to_inside(poses[row(a)], p).normalized());
        rays_b.push_back(to_inside(poses[row(b)], p).normalized());
      }
      const auto found = visible_orientations(fit_homography(rays_a, rays_b).value(), rays_a);
      const Eigen::Quaterniond truth = poses[row(b)].rotation * poses[row(a)].rotation.conjugate();
      OrientationGraph::PairEdge edge;
      edge.a = a;
      edge.b = b;
      edge.inliers = static_cast<double>(50 + (31 * a + 17 * b + 7 * a * b) % 100);
      const auto relative = [&](const RelativeOrientation& o) {
        OrientationGraph::Relative result;
        result.baseline = -(o.rotation.conjugate() * o.base);
        result.rotation = rotation_update(o.rotation, noise_deg * kDegree * normal_vector(random));
        return result;
      };
      static_cast<OrientationGraph::Relative&>(edge) = relative(found.front().orientation);
      if (found.size() > 1) {
        edge.has_twin = true;
        edge.twin = relative(found[1].orientation);
        if (random() % 2) std::swap<OrientationGraph::Relative>(edge, edge.twin);
        ++scene.with_twin;
      }
      scene.graph.edges.push_back(edge);
      scene.truth.push_back(truth);
    }
  scene.wrong = scene.count_wrong();
  return scene;
}

TEST(PlaneTwins, NormalsOfOtherPairsDecide) {
  for (const double noise_deg : {0.0, 0.1}) {
    std::size_t with_twin = 0, wrong = 0, still = 0;
    for (unsigned seed = 1; seed <= 10; ++seed) {
      TwinScene scene = above_a_plane(noise_deg, seed);
      with_twin += scene.with_twin;
      wrong += scene.wrong;
      choose_twins_by_planes(scene.graph);
      still += scene.count_wrong();
    }
    std::printf("rotations good to %.1f deg: of %zu pairs with a twin %zu begin wrong, %zu end so\n", noise_deg,
                with_twin, wrong, still);
    EXPECT_GT(wrong, with_twin / 4);
    EXPECT_LE(still, with_twin / 50);
  }
}

TEST(PlaneTwins, TheOrderOfPairsDoesNotMatter) {
  TwinScene scene = above_a_plane(0.1, 3), turned = above_a_plane(0.1, 3);
  std::reverse(turned.graph.edges.begin(), turned.graph.edges.end());
  choose_twins_by_planes(scene.graph);
  choose_twins_by_planes(turned.graph);
  std::reverse(turned.graph.edges.begin(), turned.graph.edges.end());
  for (std::size_t e = 0; e < scene.graph.edges.size(); ++e)
    EXPECT_EQ(scene.graph.edges[e].rotation.coeffs(), turned.graph.edges[e].rotation.coeffs());
}

// The strongest pairs of an image decide as all of them do.
TEST(PlaneTwins, AFewWitnessesSayWhatAllSay) {
  for (const auto& [images, witnesses] : {std::pair(12, std::size_t{8}), std::pair(90, kTwinWitnesses)}) {
    TwinScene few = above_a_plane(0.1, 5, images), all = above_a_plane(0.1, 5, images);
    choose_twins_by_planes(few.graph, witnesses);
    choose_twins_by_planes(all.graph, all.graph.edges.size());
    std::size_t different = 0;
    for (std::size_t e = 0; e < all.graph.edges.size(); ++e)
      different += few.graph.edges[e].rotation.coeffs() != all.graph.edges[e].rotation.coeffs();
    // Of the large scene's 4 000 pairs one is as good in either order.
    EXPECT_LE(different, all.with_twin / 2000) << images << " images";
    EXPECT_GT(all.wrong, all.with_twin / 4);
    EXPECT_LE(few.count_wrong(), few.with_twin / 50);
  }
}

// A pair of its own is left as it is.
TEST(PlaneTwins, OnePairAloneKeepsItsOrder) {
  TwinScene scene = above_a_plane(0, 1);
  std::erase_if(scene.graph.edges, [](const auto& edge) { return !edge.has_twin; });
  ASSERT_FALSE(scene.graph.edges.empty());
  scene.graph.edges.resize(1);
  const Eigen::Quaterniond before = scene.graph.edges[0].rotation;
  choose_twins_by_planes(scene.graph);
  EXPECT_EQ(scene.graph.edges[0].rotation.coeffs(), before.coeffs());
}

}  // namespace
}  // namespace megablock
