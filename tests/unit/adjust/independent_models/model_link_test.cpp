// Links of two models: their similarities, and the covariances of these.
#include "adjust/independent_models/model_link.h"

#include <gtest/gtest.h>

#include <random>

#include "adjust/independent_models/model_assembly.h"
#include "adjust/independent_models/similarity_equations.h"
#include "geometry/numbers/chi_square.h"
#include "geometry/similarity/similarity_adjustment.h"
#include "tests/support/adjust/model_grid.h"

namespace megablock {
namespace {

using model_grid::ModelGrid;

// What a link says of its errors, about the origin of its model, whose sigmas are too small by factors of their own.
TEST(ModelLinks, InformationOfLinksIsThatOfTheirErrors) {
  for (const bool images : {false, true}) {
    constexpr int kPairs = 300;
    double squares = 0;
    for (int pair = 0; pair < kPairs; ++pair) {
      model_grid::Options scene;
      scene.rows = 1;
      scene.columns = 2;
      scene.images_per_side = images ? 12 : 0;
      scene.sigma = 0.3;
      scene.rotation_sigma = 5e-4;
      scene.seed = static_cast<unsigned>(500 + pair);
      ModelGrid grid(scene);
      for (Model& model : grid.models) {
        if (images) model.points.clear();
        for (ModelPoint& p : model.points) p.sigma /= 3;
        for (ModelImage& i : model.images) i.centre_sigma /= 3, i.rotation_sigma /= 5;
      }
      AssemblyOptions options;
      options.links.scale_sigmas = true;
      const AssembledModels found = assemble_models(grid.models, options);
      ASSERT_EQ(found.links.size(), 1u);
      const ModelLink& link = found.links.front();
      const SimilarityStep error =
          step_of(link.similarity.inverse() * (grid.gauges[nth(link.a)] * grid.gauges[nth(link.b)].inverse()));
      squares += error.dot(link.information * error) / 7 / kPairs;
    }
    std::printf("[ reached  ] links by %s: normalised error %.3f\n", images ? "images" : "points", std::sqrt(squares));
    EXPECT_NEAR(std::sqrt(squares), 1, 0.1);
  }
}

// Errors on both sides, of some places four times those of others: a link is the Gauss-Helmert solution over what
// agrees. The robust closed form, whose weights take from what is right too, is less exact. In the metric of the
// covariance of the Gauss-Helmert solution, over seven.
TEST(ModelLinks, LinksAreThoseOfGaussHelmert) {
  constexpr int kPairs = 300;
  double apart = 0, of_links = 0, of_gauss_helmert = 0, of_robust = 0;
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  for (int pair = 0; pair < kPairs; ++pair) {
    model_grid::Options scene;
    scene.rows = 1;
    scene.columns = 2;
    scene.images_per_side = 0;
    scene.sigma = 3;  // of 2000
    scene.seed = static_cast<unsigned>(900 + pair);
    ModelGrid grid(scene);
    for (Model& model : grid.models)
      for (ModelPoint& p : model.points) {
        if (random() % 2) continue;
        const double x = normal(random), y = normal(random), z = normal(random);
        p.position += std::sqrt(15.0) * p.sigma * Eigen::Vector3d(x, y, z);
        p.sigma *= 4;
      }
    // About their own centres steps are small, and errors linear.
    for (std::size_t m = 0; m < grid.models.size(); ++m) {
      const Eigen::Vector3d middle = grid.models[m].points.front().position;
      for (ModelPoint& p : grid.models[m].points) p.position -= middle;
      grid.gauges[m].translation -= middle;
    }
    const AssembledModels found = assemble_models(grid.models);
    ASSERT_EQ(found.links.size(), 1u);
    const ModelLink& link = found.links.front();
    const Model &a = grid.models[nth(link.a)], &b = grid.models[nth(link.b)];
    const Similarity truth = grid.gauges[nth(link.a)] * grid.gauges[nth(link.b)].inverse();

    std::map<std::int64_t, ModelPoint> of_a;
    for (const ModelPoint& p : a.points) of_a.emplace(p.number, p);
    std::vector<PointPair> pairs;
    std::vector<Eigen::Vector3d> from, to;
    std::vector<double> sigma;
    for (const ModelPoint& p : b.points) {
      const auto other = of_a.find(p.number);
      if (other == of_a.end()) continue;
      const ModelPoint& q = other->second;
      from.push_back(p.position), to.push_back(q.position);
      sigma.push_back(std::hypot(q.sigma, link.similarity.scale * p.sigma));
      if ((link.similarity(p.position) - q.position).squaredNorm() <
          chi_square_quantile(LinkOptions().rejection_probability, 3) * sigma.back() * sigma.back())
        pairs.push_back({p.position, q.position, p.sigma * p.sigma * Eigen::Matrix3d::Identity(),
                         q.sigma * q.sigma * Eigen::Matrix3d::Identity()});
    }
    EXPECT_EQ(static_cast<int>(pairs.size()), link.agreeing);
    const auto adjusted = adjust_similarity(link.similarity, pairs);
    const auto robust = fit_similarity_robust(from, to, sigma);
    ASSERT_TRUE(adjusted && robust);
    // Steps of similarity.h: right increment, logarithm of the scale, shift.
    const auto squares = [&](const Similarity& s, const Similarity& t) {
      SimilarityStep step;
      step << rotation_log<double>(t.rotation.conjugate() * s.rotation), std::log(s.scale / t.scale),
          s.translation - t.translation;
      return step.dot(adjusted->covariance.ldlt().solve(step)) / 7 / kPairs;
    };
    apart += squares(link.similarity, adjusted->similarity);
    of_links += squares(link.similarity, truth);
    of_gauss_helmert += squares(adjusted->similarity, truth);
    of_robust += squares(*robust, truth);
  }
  std::printf(
      "[ reached  ] squared errors: links %.3f, Gauss-Helmert %.3f, robust closed form %.3f; links apart from "
      "Gauss-Helmert %.2g\n",
      of_links, of_gauss_helmert, of_robust, apart);
  EXPECT_LT(apart, 0.01);
  EXPECT_NEAR(of_links, 1, 0.15);
  EXPECT_NEAR(of_gauss_helmert, 1, 0.15);
}

// Sigmas that are too small by ten, and more wrong points than right ones; then three images alone.
TEST(ModelLinks, LinksOfOpenSigmasFindWhatAgrees) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  const auto vector = [&] { return Eigen::Vector3d(normal(random), normal(random), normal(random)); };
  const Similarity truth{2, rotation_exp<double>({0.3, -0.2, 1}), {10, 20, 30}};
  std::vector<Model> models{{1, {}, {}}, {2, {}, {}}};
  SharedRows shared;
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d x = 300 * vector();
    models[1].points.push_back({i, x, 0.01});
    models[0].points.push_back({i, truth(x) + (i % 5 < 3 ? 200 : 0.2) * vector(), 0.02});
    shared.points.emplace_back(i, i);
  }
  LinkOptions options;
  options.scale_sigmas = true;
  const auto link = fit_model_link(models, 0, 1, shared, options);
  ASSERT_TRUE(link);
  EXPECT_NEAR(link->agreeing, 40, 1);
  EXPECT_LT((link->similarity({0, 0, 0}) - truth({0, 0, 0})).norm(), 0.2);

  models = {{1, {}, {}}, {2, {}, {}}};
  shared = {};
  for (int i = 0; i < 3; ++i) {
    const Pose pose{rotation_exp<double>(vector()), {100.0 * i, 0, 0}};
    Pose moved = truth(pose);
    moved.rotation = rotation_update(moved.rotation, 1e-3 * vector());
    models[1].images.push_back({i, pose, 0.01, 1e-4});
    models[0].images.push_back({i, moved, 0.02, 1e-4});
    shared.images.emplace_back(i, i);
  }
  const auto by_images = fit_model_link(models, 0, 1, shared, options);
  ASSERT_TRUE(by_images);
  EXPECT_LT(rotation_angle(by_images->similarity.rotation, truth.rotation), 3e-3);
}

// How meaningful it is that images agree is told by their places alone, which is careful: of few images as many have to
// agree as of points. It costs nothing, as those few are found among samples of which most places agree, where points
// of the same places are not: attitudes make hypotheses, and take away what does not fit.
TEST(ModelLinks, FewImagesAreFoundWhoseChanceIsThatOfPlaces) {
  std::mt19937_64 random(8);
  std::normal_distribution<double> normal;
  const auto vector = [&] { return Eigen::Vector3d(normal(random), normal(random), normal(random)); };
  const Similarity truth{2, rotation_exp<double>({0.3, -0.2, 1}), {10, 20, 30}};
  LinkOptions options;
  options.scale_sigmas = true;
  for (const auto& [right, all] :
       {std::pair(3, 4), std::pair(3, 5), std::pair(4, 6), std::pair(5, 8), std::pair(5, 15)}) {
    std::vector<Model> images{{1, {}, {}}, {2, {}, {}}}, points = images;
    SharedRows of_images, of_points;
    for (int i = 0; i < all; ++i) {
      const Pose pose{rotation_exp<double>(vector()), 300 * vector()};
      Pose moved = truth(pose);
      moved.centre += (i < right ? 0.02 : 200) * vector();
      moved.rotation = rotation_update(moved.rotation, (i < right ? 1e-4 : 1) * vector());
      images[1].images.push_back({i, pose, 0.01, 1e-4});
      images[0].images.push_back({i, moved, 0.02, 1e-4});
      points[1].points.push_back({i, pose.centre, 0.01});
      points[0].points.push_back({i, moved.centre, 0.02});
      of_images.images.emplace_back(i, i);
      of_points.points.emplace_back(i, i);
    }
    const auto by_images = fit_model_link(images, 0, 1, of_images, options);
    ASSERT_TRUE(by_images) << right << " of " << all;
    EXPECT_EQ(by_images->agreeing, right) << right << " of " << all;
    EXPECT_LT(rotation_angle(by_images->similarity.rotation, truth.rotation), 2e-4) << right << " of " << all;
    const auto by_points = fit_model_link(points, 0, 1, of_points, options);
    EXPECT_EQ(by_points && by_points->agreeing == right, right > 4) << right << " of " << all;
  }
}

}  // namespace
}  // namespace megablock
