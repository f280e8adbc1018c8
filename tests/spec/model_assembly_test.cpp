// Acceptance test of the joint adjustment of independent models (M51, M52): 400 models of 250 images in a grid of
// 20 x 20, sides of 2000 units, 20 % overlap, places known to 0.1 unit; 5 % of the shared points wrong, and 5 % of the
// links: half of those between neighbours that agree in another similarity, half between blocks that are nowhere near.
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>

#include "reached.h"
#include "tests/support/adjust/model_grid.h"

namespace megablock {
namespace {

using model_grid::ModelGrid;

bool same_bits(const Similarity& a, const Similarity& b) {
  return a.scale == b.scale && a.rotation.coeffs() == b.rotation.coeffs() && a.translation == b.translation;
}

TEST(Spec, AT33SubBlocksAssembled) {
  model_grid::Options scene;
  scene.rows = scene.columns = 20;
  scene.images_per_side = std::sqrt(250.0);
  scene.wrong_points = scene.wrong_links = 0.05;
  const ModelGrid grid(scene);
  std::printf("[ scene    ] %zu models, %.0f images and %.0f points each, %zu links, %zu wrong\n", grid.models.size(),
              grid.images_per_model(), grid.points_per_model(), grid.links.size(), grid.wrong.size());

  const auto start = std::chrono::steady_clock::now();
  const AssembledModels assembled = assemble_models(grid.models);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  std::printf("[ reached  ] %.1f s, sigma0 %.4f, %lld of %lld shared places left out\n", seconds, assembled.sigma0,
              static_cast<long long>(assembled.rejected), static_cast<long long>(assembled.shared));
  const model_grid::Errors joint = grid.errors(assembled);
  expect_at_most(joint.normalised, 5, "largest corner error in sigmas of its covariance");
  expect_at_most(joint.scale, 1e-4, "largest scale error");
  expect_at_most(grid.wrong_links_kept(assembled), 0, "wrong links kept");
  expect_at_most(grid.right_links_removed(assembled), 0, "right links removed");
  // Blocks that meet at a corner alone share some 25 places.
  expect_at_least(grid.right_links_found(assembled), 0.99 * static_cast<double>(grid.links.size()) - 37,
                  "right links found");
  expect_within(assembled.sigma0, 1, 0.02, "sigma0");

  AssemblyOptions chaining;
  chaining.joint = chaining.covariances = false;
  const model_grid::Errors chained = grid.errors(assemble_models(grid.models, chaining));
  std::printf("[ reached  ] corners: jointly %.3f rms, %.3f largest; chained %.3f rms, %.3f largest, scale %.2g\n",
              joint.corner_rms, joint.corner, chained.corner_rms, chained.corner, chained.scale);
  expect_at_least(chained.corner_rms / joint.corner_rms, 2, "corners chained over those adjusted jointly, rms");

  for (const unsigned shuffle : {1u, 2u}) {
    const AssembledModels again = assemble_models(grid.shuffled(shuffle));
    const std::vector<std::size_t> place = grid.place_when_shuffled(shuffle);
    ASSERT_EQ(again.covariance.size(), grid.models.size());
    for (std::size_t m = 0; m < grid.models.size(); ++m) {
      ASSERT_TRUE(same_bits(assembled.similarity[m], again.similarity[place[m]])) << shuffle << ' ' << m;
      ASSERT_EQ(assembled.covariance[m], again.covariance[place[m]]) << shuffle << ' ' << m;
    }
  }
}

}  // namespace
}  // namespace megablock
