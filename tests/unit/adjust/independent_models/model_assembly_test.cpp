// Models of a known grid, each in a frame of its own, come together again.
#include "adjust/independent_models/model_assembly.h"

#include <gtest/gtest.h>

#include <map>
#include <random>

#include "adjust/independent_models/shared_places.h"
#include "adjust/independent_models/similarity_equations.h"
#include "io/base/error.h"
#include "tests/support/adjust/model_grid.h"

namespace megablock {
namespace {

using model_grid::ModelGrid;

model_grid::Options small_grid() {
  model_grid::Options options;
  options.rows = options.columns = 3;
  options.images_per_side = 10;
  options.points_per_side = 12;
  return options;
}

TEST(ModelAssembly, ExactModelsFitTogether) {
  model_grid::Options options = small_grid();
  options.sigma = options.rotation_sigma = 1e-7;
  const ModelGrid grid(options);
  const AssembledModels found = assemble_models(grid.models);
  const model_grid::Errors errors = grid.errors(found);
  EXPECT_LT(errors.corner, 1e-5);
  EXPECT_EQ(found.rejected, 0);
  EXPECT_EQ(found.links.size(), 20u);
}

// Errors in the metric of their covariance, over many blocks: what is given as covariance is one.
TEST(ModelAssembly, CovariancesAreThoseOfRepeatedBlocks) {
  for (const bool images : {false, true}) {
    constexpr int kBlocks = 60;
    double squares = 0, variance = 0;
    for (int block = 0; block < kBlocks; ++block) {
      model_grid::Options options = small_grid();
      options.seed = static_cast<unsigned>(100 + block);
      if (!images) options.images_per_side = 0;
      const ModelGrid grid(options);
      const AssembledModels found = assemble_models(grid.models);
      squares += grid.errors(found).mean_squares / kBlocks;
      variance += found.sigma0 * found.sigma0 / kBlocks;
    }
    std::printf("[ reached  ] mean square of corners %.3f, variance factor %.4f\n", squares, variance);
    EXPECT_NEAR(squares, 1, 0.2);  // errors of a block go together
    EXPECT_NEAR(variance, 1, 0.01);
  }
}

// Weighted squares of points about the places that suit the similarities best, written down once more.
double cost_of(const std::vector<Model>& models, const std::vector<Similarity>& similarities) {
  std::map<std::int64_t, std::vector<std::pair<std::size_t, const ModelPoint*>>> shared;
  for (std::size_t m = 0; m < models.size(); ++m)
    for (const ModelPoint& p : models[m].points) shared[p.number].emplace_back(m, &p);
  double cost = 0;
  for (const auto& [number, entries] : shared) {
    Eigen::Vector3d place = Eigen::Vector3d::Zero();
    double weights = 0;
    for (const auto& [m, p] : entries) {
      const double weight = 1 / std::pow(p->sigma * similarities[m].scale, 2);
      place += weight * similarities[m](p->position);
      weights += weight;
    }
    place /= weights;
    for (const auto& [m, p] : entries)
      cost += (similarities[m].inverse()(place) - p->position).squaredNorm() / std::pow(p->sigma, 2);
  }
  return cost;
}

TEST(ModelAssembly, EndsAtTheMinimum) {
  model_grid::Options options = small_grid();
  options.images_per_side = 0;
  const ModelGrid grid(options);
  const AssembledModels found = assemble_models(grid.models);
  ASSERT_EQ(found.rejected, 0);
  const double least = cost_of(grid.models, found.similarity);
  EXPECT_NEAR(std::sqrt(least / static_cast<double>(found.redundancy)), found.sigma0, 1e-9);
  for (const std::size_t m : {1, 4, 8}) {
    const Eigen::Vector3d middle = grid.models[m].points.front().position;
    for (int k = 0; k < 7; ++k) {
      double slope[2];
      for (const int sign : {-1, 1}) {
        // A tenth of a sigma or so.
        SimilarityStep step = SimilarityStep::Zero();
        step(k) = sign * (k < 4 ? 1e-6 : 1e-3);
        std::vector<Similarity> moved = found.similarity;
        moved[m] = similarity_update(moved[m], step);
        moved[m].translation += found.similarity[m](middle) - moved[m](middle) + step.tail<3>();
        slope[sign > 0] = cost_of(grid.models, moved) - least;
      }
      EXPECT_GT(slope[0], 0) << m << ' ' << k;
      EXPECT_GT(slope[1], 0) << m << ' ' << k;
      EXPECT_NEAR(slope[0] / slope[1], 1, 0.05) << m << ' ' << k;
    }
  }
}

TEST(ModelAssembly, WrongPointsAndLinksAreLeftOut) {
  model_grid::Options options;
  options.rows = options.columns = 5;
  options.images_per_side = 0;
  options.wrong_points = 0.1;
  options.wrong_links = 0.1;
  const ModelGrid grid(options);
  const AssembledModels found = assemble_models(grid.models);
  EXPECT_EQ(grid.wrong_links_kept(found), 0);
  EXPECT_EQ(grid.right_links_removed(found), 0);
  EXPECT_LT(grid.errors(found).normalised, 5);
  EXPECT_NEAR(found.sigma0, 1, 0.05);
}

// The smallest models: pairs of images, each as long as its own base, joined by the image and the points that
// successive ones share.
TEST(ModelAssembly, PairsOfImagesJoinIntoAStrip) {
  constexpr int kImages = 10;
  constexpr double kSigma = 1e-3;  // of points and centres, bases
  std::mt19937_64 random(71);
  std::normal_distribution<double> gauss;
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto noise = [&](double sigma) {
    return Eigen::Vector3d(sigma * gauss(random), sigma * gauss(random), sigma * gauss(random));
  };
  std::vector<Pose> images;
  for (int i = 0; i < kImages; ++i)
    images.push_back({rotation_exp<double>(noise(0.2)), Eigen::Vector3d(i, 0, 0) + noise(0.2)});
  std::vector<Eigen::Vector3d> points;
  for (int p = 0; p < 300; ++p)
    points.emplace_back(0.5 * (kImages - 1) * (1 + 1.2 * uniform(random)), 2 * uniform(random), 5 + uniform(random));

  std::vector<Model> models;
  std::vector<double> bases;
  for (int k = 0; k + 1 < kImages; ++k) {
    const Pose &first = images[static_cast<std::size_t>(k)], &second = images[static_cast<std::size_t>(k) + 1];
    bases.push_back((second.centre - first.centre).norm());
    const auto in_model = [&](const Eigen::Vector3d& x) {
      return Eigen::Vector3d(first.rotation * (x - first.centre) / bases.back());
    };
    Model model;
    model.number = k;
    for (std::size_t p = 0; p < points.size(); ++p)
      if (std::abs(points[p].x() - k - 0.5) < 1.5)
        model.points.push_back({static_cast<std::int64_t>(p), in_model(points[p]) + noise(kSigma), kSigma});
    for (const int i : {k, k + 1}) {
      const Pose& image = images[static_cast<std::size_t>(i)];
      const Pose seen{rotation_exp<double>(noise(kSigma)) * image.rotation * first.rotation.conjugate(),
                      in_model(image.centre) + noise(kSigma)};
      model.images.push_back({i, seen, kSigma, kSigma});
    }
    models.push_back(model);
  }

  const AssembledModels found = assemble_models(models);
  for (std::size_t k = 0; k < models.size(); ++k) {
    ASSERT_EQ(found.part[k], 0);
    EXPECT_NEAR(found.similarity[k].scale, bases[k] / bases[0], 0.01);
    for (const ModelImage& image : models[k].images) {
      const Pose& truth = images[static_cast<std::size_t>(image.number)];
      const Eigen::Vector3d expected = images[0].rotation * (truth.centre - images[0].centre) / bases[0];
      EXPECT_LT((found.similarity[k](image.pose.centre) - expected).norm(), 0.03) << k << ' ' << image.number;
    }
  }
  EXPECT_EQ(found.rejected, 0);
  EXPECT_NEAR(found.sigma0, 1, 0.1);
}

TEST(ModelAssembly, OrderOfModelsAndPointsDoesNotMatter) {
  model_grid::Options options = small_grid();
  options.wrong_points = 0.05;
  const ModelGrid grid(options);
  const AssembledModels first = assemble_models(grid.models);
  for (const unsigned seed : {1u, 2u}) {
    const AssembledModels other = assemble_models(grid.shuffled(seed));
    const auto place = grid.place_when_shuffled(seed);
    for (std::size_t m = 0; m < place.size(); ++m) {
      EXPECT_EQ(first.similarity[m].scale, other.similarity[place[m]].scale);
      EXPECT_EQ(first.similarity[m].rotation.coeffs(), other.similarity[place[m]].rotation.coeffs());
      EXPECT_EQ(first.similarity[m].translation, other.similarity[place[m]].translation);
      EXPECT_EQ(first.covariance[m], other.covariance[place[m]]);
    }
    EXPECT_EQ(first.sigma0, other.sigma0);
  }
}

TEST(ModelAssembly, CovariancesAreBlocksOfTheInverse) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  constexpr int kModels = 9;
  std::vector<std::uint8_t> held(kModels, 0);
  held[2] = 1;
  SimilarityEquations equations(held);
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(7 * kModels, 7 * kModels);
  const auto add = [&](int m, int n, const Block7& block) {
    equations.add(m, n, block);
    dense.block<7, 7>(7 * m, 7 * n) += block;
  };
  for (int m = 0; m < kModels; ++m)
    for (const int n : {m, (m + 1) % kModels, (m + 3) % kModels}) {
      const Block7 block = Block7::NullaryExpr([&](auto, auto) { return normal(random); });
      if (m == n) {
        add(m, m, block * block.transpose() + 60 * Block7::Identity());
      } else {
        add(m, n, block);
        add(n, m, block.transpose());
      }
    }
  for (int i = 14; i < 21; ++i) {
    dense.row(i).setZero();
    dense.col(i).setZero();
    dense(i, i) = 1;
  }
  ASSERT_EQ(equations.factorise(), -1);
  const Eigen::MatrixXd inverse = dense.inverse();
  const std::vector<Block7> found = equations.covariances();
  for (int m = 0; m < kModels; ++m) {
    const Block7 expected = held[nth(m)] ? Block7::Zero() : Block7(inverse.block<7, 7>(7 * m, 7 * m));
    EXPECT_LT((found[nth(m)] - expected).norm(), 1e-14) << m;
  }
}

// One model is two hundred times worse than its sigmas say: its links, which find the size of their errors themselves,
// hold, and not one of its places agrees with the others.
TEST(ModelAssembly, GoesOnWithoutAModelThatLosesItsPlaces) {
  model_grid::Options scene = small_grid();
  scene.images_per_side = 0;
  ModelGrid grid(scene);
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal;
  const std::size_t bad = 4;
  for (ModelPoint& p : grid.models[bad].points)
    p.position += 200 * p.sigma * Eigen::Vector3d(normal(random), normal(random), normal(random));
  AssemblyOptions options;
  options.links.scale_sigmas = true;
  const AssembledModels found = assemble_models(grid.models, options);
  EXPECT_EQ(found.lost, std::vector<std::int64_t>{grid.models[bad].number});
  EXPECT_EQ(found.part[bad], grid.models[bad].number);
  EXPECT_EQ(found.similarity[bad].scale, 1);
  EXPECT_TRUE(found.converged);
  for (const ModelLink& link : found.links)
    EXPECT_EQ(link.kept, nth(link.a) != bad && nth(link.b) != bad) << link.a << ' ' << link.b;
  for (std::size_t m = 0; m < grid.models.size(); ++m)
    if (m != bad) {
      EXPECT_EQ(found.part[m], grid.models[0].number);
      const Similarity truth = grid.gauges[0] * grid.gauges[m].inverse();
      EXPECT_NEAR(found.similarity[m].scale / truth.scale, 1, 1e-3) << m;
    }
  EXPECT_NEAR(found.sigma0, 1, 0.1);
}

TEST(ModelAssembly, SaysThatItHasNotConverged) {
  const ModelGrid grid(small_grid());
  AssemblyOptions options;
  const AssembledModels whole = assemble_models(grid.models, options);
  EXPECT_TRUE(whole.converged);
  EXPECT_TRUE(whole.lost.empty());
  EXPECT_LT(whole.iterations, options.max_iterations);
  options.max_iterations = 1;
  const AssembledModels once = assemble_models(grid.models, options);
  EXPECT_FALSE(once.converged);
  EXPECT_EQ(once.iterations, 1);
}

// A street: the images that pieces share stand on a line, and only their attitudes say how it turns about that line.
std::vector<Model> pieces_of_a_street(int shared) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  const auto vector = [&]() -> Eigen::Vector3d { return {normal(random), normal(random), normal(random)}; };
  std::vector<Model> models;
  for (int m = 0; m < 4; ++m) {
    const Similarity gauge{std::exp(normal(random)), rotation_exp<double>(vector()), 100 * vector()};
    models.push_back({m, {}, {}});
    for (int f = m * (20 - shared); f < m * (20 - shared) + 20; ++f) {
      Pose pose = gauge(Pose{rotation_exp<double>({0, 0.1 * f, 0}), {5.0 * f, 0, 0}});
      pose.rotation = rotation_update(pose.rotation, 1e-4 * vector());
      pose.centre += 0.01 * gauge.scale * vector();
      models.back().images.push_back({f, pose, 0.01 * gauge.scale, 1e-4});
    }
  }
  return models;
}

TEST(ModelAssembly, ImagesOnALineAreEnough) {
  const std::vector<Model> models = pieces_of_a_street(5);
  const AssembledModels found = assemble_models(models);
  for (std::size_t m = 1; m < 4; ++m) {
    EXPECT_EQ(found.part[m], 0);
    for (int i = 0; i < 5; ++i) {
      const Pose here = found.similarity[m](models[m].images[static_cast<std::size_t>(i)].pose);
      const Pose there = found.similarity[m - 1](models[m - 1].images[static_cast<std::size_t>(15 + i)].pose);
      EXPECT_LT((here.centre - there.centre).norm(), 0.1 * found.similarity[1].scale);
      EXPECT_LT(rotation_angle(here.rotation, there.rotation), 1e-3);
    }
  }
}

TEST(ModelAssembly, WhatDoesNotHangTogetherMakesParts) {
  const AssembledModels apart = assemble_models(pieces_of_a_street(1));  // one image each is not enough
  for (std::size_t m = 0; m < 4; ++m) {
    EXPECT_EQ(apart.part[m], static_cast<std::int64_t>(m));
    EXPECT_EQ(apart.similarity[m].scale, 1);
    EXPECT_EQ(apart.covariance[m], SimilarityCovariance::Zero());
  }
  EXPECT_TRUE(assemble_models({}).similarity.empty());

  std::vector<Model> line = {{1, {}, {}}, {2, {}, {}}};  // points on one line leave a turn open
  for (int i = 0; i < 20; ++i)
    for (Model& model : line) model.points.push_back({i, {1.0 * i, 2.0 * i, 0}, 0.01});
  EXPECT_EQ(assemble_models(line).part[1], 2);
}

TEST(ModelAssembly, RefusesBadInput) {
  const std::vector<Model> good = pieces_of_a_street(5);
  const auto refused = [&](auto change, const std::string& why) {
    std::vector<Model> models = good;
    change(models);
    try {
      assemble_models(models);
      ADD_FAILURE() << why;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find(why), std::string::npos) << error.what();
    }
  };
  refused([](auto& m) { m[1].number = 0; }, "model 0 is given twice");
  refused([](auto& m) { m[1].images[3].pose.centre.x() = NAN; }, "not finite");
  refused([](auto& m) { m[1].images[3].rotation_sigma = 0; }, "sigmas must be positive");
  refused([](auto& m) { m[1].images[3].number = m[1].images[4].number; }, "given twice");
  refused([](auto& m) { m[2].points.push_back({1, {0, 0, 0}, -1}); }, "sigma must be positive");
  AssemblyOptions options;
  options.links.min_share = 2;
  EXPECT_THROW(assemble_models(good, options), InputError);
}

}  // namespace
}  // namespace megablock
