#include "adjust/orientation/steps/rotation_averaging.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "tests/support/adjust/orientation_scene.h"

namespace megablock {
namespace {

using orientation_scene::normal_vector;

struct Graph {
  std::vector<Eigen::Quaterniond> truth;
  std::vector<RelativeRotation> edges;
  std::vector<std::optional<RotationPrior>> priors;
};

// A chain with links to the next `reach` nodes; a share of the rotations is anything.
Graph chain(std::int32_t nodes, std::int32_t reach, double noise_deg, double wrong) {
  Graph graph;
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (std::int32_t i = 0; i < nodes; ++i) graph.truth.push_back(rotation_exp<double>(normal_vector(random)));
  for (std::int32_t i = 0; i < nodes; ++i)
    for (std::int32_t j = i + 1; j < std::min(nodes, i + reach + 1); ++j) {
      const Eigen::Quaterniond exact =
          graph.truth[static_cast<std::size_t>(j)] * graph.truth[static_cast<std::size_t>(i)].conjugate();
      const bool is_wrong = j > i + 1 && uniform(random) < wrong;
      const double spread = is_wrong ? 1.5 : noise_deg * kDegree;
      graph.edges.push_back({i, j, rotation_update(exact, spread * normal_vector(random)), 100});
    }
  graph.priors.resize(static_cast<std::size_t>(nodes));
  return graph;
}

// Largest rotation error after the best common world rotation (that of the first node).
double largest_error_deg(const Graph& graph, const AveragedRotations& found, bool in_ground) {
  Eigen::Quaterniond gauge = Eigen::Quaterniond::Identity();
  if (!in_ground) gauge = found.rotation[0]->conjugate() * graph.truth[0];
  double largest = 0;
  for (std::size_t i = 0; i < graph.truth.size(); ++i)
    largest = std::max(largest, rotation_angle(*found.rotation[i] * gauge, graph.truth[i]) / kDegree);
  return largest;
}

TEST(RotationAveraging, ExactRotationsAreReproduced) {
  const Graph graph = chain(40, 4, 0, 0.3);
  const auto found = average_rotations(40, graph.edges, graph.priors, 5 * kDegree);
  EXPECT_LT(largest_error_deg(graph, found, false), 1e-3) << "wrong edges have hardly any weight";
  for (std::size_t e = 0; e < graph.edges.size(); ++e) {
    const auto& edge = graph.edges[e];
    const Eigen::Quaterniond exact =
        graph.truth[static_cast<std::size_t>(edge.b)] * graph.truth[static_cast<std::size_t>(edge.a)].conjugate();
    const double error = rotation_angle(exact, edge.rotation) / kDegree;
    if (std::abs(error - 5) > 0.1) {
      EXPECT_EQ(found.kept[e], error < 5) << error;
    }
  }
}

TEST(RotationAveraging, NoiseAveragesOut) {
  // With 20 edges per node the error is far below that of a single relative rotation.
  const Graph graph = chain(30, 29, 1, 0.1);
  const auto found = average_rotations(30, graph.edges, graph.priors, 10 * kDegree);
  EXPECT_LT(largest_error_deg(graph, found, false), 1.2);
}

// Angle between where the nodes see down and where it is, and the error of their relative rotation.
struct ChainError {
  double level_deg = 0, relative_deg = 0;
};
ChainError chain_error(const Graph& graph, const AveragedRotations& found) {
  ChainError error;
  const Eigen::Vector3d down = -Eigen::Vector3d::UnitZ();
  for (std::size_t i = 0; i < graph.truth.size(); ++i) {
    error.level_deg = std::max(error.level_deg, (*found.rotation[i] * down - graph.truth[i] * down).norm() / kDegree);
    const Eigen::Quaterniond turn = found.rotation[i]->conjugate() * graph.truth[i];
    const Eigen::Quaterniond first = found.rotation[0]->conjugate() * graph.truth[0];
    error.relative_deg = std::max(error.relative_deg, rotation_angle(turn, first) / kDegree);
  }
  return error;
}

std::vector<KnownVertical> verticals_of(const Graph& graph, double noise_deg, double wrong) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::vector<KnownVertical> verticals;
  for (std::size_t i = 0; i < graph.truth.size(); ++i) {
    const Eigen::Quaterniond off = rotation_exp<double>(noise_deg * kDegree * normal_vector(random));
    Eigen::Vector3d seen = off * (graph.truth[i] * -Eigen::Vector3d::UnitZ());
    if (uniform(random) < wrong) seen = normal_vector(random).normalized();
    verticals.push_back({static_cast<std::int32_t>(i), seen, -Eigen::Vector3d::UnitZ(), noise_deg * kDegree});
  }
  return verticals;
}

TEST(RotationAveraging, SigmasOfTheMatchesWeigh) {
  // A third of the edges, with as many inliers as the others, is ten times as bad, and says so.
  double with = 0, without = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    Graph graph = chain(40, 4, 0.2, 0);
    std::mt19937_64 random(seed);
    for (std::size_t e = 0; e < graph.edges.size(); e += 3)
      graph.edges[e].rotation = rotation_update(graph.edges[e].rotation, 2 * kDegree * normal_vector(random));
    const auto error = [&] {
      return largest_error_deg(graph, average_rotations(40, graph.edges, graph.priors, 20 * kDegree), false) / 20;
    };
    without += error();
    for (std::size_t e = 0; e < graph.edges.size(); ++e) graph.edges[e].sigma_rad = (e % 3 == 0 ? 2 : 0.2) * kDegree;
    with += error();
  }
  std::printf("mean of largest errors %.2f deg without the sigmas, %.2f with them\n", without, with);
  EXPECT_LT(with, 0.8 * without);
}

// Mean square of what the average makes of the edges, less the truth, in sigmas of the edges: 1 for least squares with
// the right weights, as the sum has 3 (nodes - 1) degrees of freedom.
double normalised_error(const Graph& graph, const AveragedRotations& found) {
  double sum = 0;
  for (const RelativeRotation& edge : graph.edges) {
    const auto a = static_cast<std::size_t>(edge.a), b = static_cast<std::size_t>(edge.b);
    const double error = rotation_angle(*found.rotation[b] * found.rotation[a]->conjugate(),
                                        graph.truth[b] * graph.truth[a].conjugate());
    sum += std::pow(error / edge.sigma_rad, 2);
  }
  return sum / (3 * static_cast<double>(graph.truth.size() - 1));
}

TEST(RotationAveraging, ErrorsAreThoseOfTheSigmas) {
  for (const double wrong : {0.0, 0.1}) {
    double mean = 0;
    std::mt19937_64 random(7);
    std::uniform_real_distribution<double> uniform(0, 1);
    for (int trial = 0; trial < 40; ++trial) {
      Graph graph = chain(40, 6, 0, wrong);
      for (RelativeRotation& edge : graph.edges) {
        edge.inliers = 1e6;                                              // what the matches do not say is little
        edge.sigma_rad = 0.2 * kDegree * std::pow(15, uniform(random));  // to 3 degrees
        edge.rotation = rotation_update(edge.rotation, edge.sigma_rad * normal_vector(random));
      }
      mean += normalised_error(graph, average_rotations(40, graph.edges, graph.priors, 20 * kDegree)) / 40;
    }
    std::printf("%2.0f %% of the edges wrong: normalised error %.2f\n", 100 * wrong, mean);
    EXPECT_GT(mean, 0.85);
    EXPECT_LT(mean, 1.2);
  }
}

// A chain wanders off, about the vertical only where the nodes see it; one tenth of them see it elsewhere.
TEST(RotationAveraging, VerticalsLevelAChain) {
  const Graph graph = chain(200, 1, 0.5, 0);
  const auto without = average_rotations(200, graph.edges, graph.priors, 10 * kDegree);
  EXPECT_GT(chain_error(graph, without).relative_deg, 4);
  for (const double wrong : {0.0, 0.1}) {
    const auto with = average_rotations(200, graph.edges, graph.priors, 10 * kDegree, verticals_of(graph, 0.1, wrong));
    const ChainError error = chain_error(graph, with);
    EXPECT_LT(error.level_deg, wrong > 0 ? 2.0 : 0.4) << "nodes without a vertical hang on edges of 0.9 degrees";
    EXPECT_LT(error.relative_deg, chain_error(graph, without).relative_deg) << wrong;
    EXPECT_EQ(std::count(with.kept.begin(), with.kept.end(), 0), 0);
  }
}

// Beside each relative rotation another one that is anything, and nothing but the verticals tells which.
TEST(RotationAveraging, VerticalsTellWrongEdges) {
  Graph graph = chain(30, 1, 0.2, 0);
  const std::vector<RelativeRotation> wrong = chain(30, 1, 60, 0).edges;
  const auto edges = static_cast<std::ptrdiff_t>(graph.edges.size());
  for (RelativeRotation edge : wrong) {
    edge.inliers = 120;
    graph.edges.push_back(edge);
  }
  const auto found = average_rotations(30, graph.edges, graph.priors, 10 * kDegree, verticals_of(graph, 0.1, 0));
  EXPECT_LT(chain_error(graph, found).level_deg, 1);
  EXPECT_EQ(std::count(found.kept.begin(), found.kept.begin() + edges, 1), edges);
}

// With priors and held nodes the heading is known too.
TEST(RotationAveraging, VerticalsBesidePriors) {
  for (const double sigma : {0.0, 5 * kDegree}) {
    Graph graph = chain(60, 2, 0.3, 0);
    graph.priors[5] = RotationPrior{graph.truth[5], sigma};
    const auto found = average_rotations(60, graph.edges, graph.priors, 10 * kDegree, verticals_of(graph, 0.05, 0.1));
    EXPECT_LT(chain_error(graph, found).level_deg, 0.5);
    EXPECT_LT(largest_error_deg(graph, found, true), 5);
  }
}

TEST(RotationAveraging, PriorsGiveTheGround) {
  Graph graph = chain(40, 5, 0.2, 0.1);
  std::mt19937_64 random(2);
  for (std::size_t i = 0; i < graph.truth.size(); ++i)
    graph.priors[i] = RotationPrior{rotation_update(graph.truth[i], 2 * kDegree * normal_vector(random)), 2 * kDegree};
  graph.priors[7]->rotation = rotation_update(graph.truth[7], {2, 0, 0});
  const auto found = average_rotations(40, graph.edges, graph.priors, 10 * kDegree);
  EXPECT_LT(largest_error_deg(graph, found, true), 1.5);
}

TEST(RotationAveraging, HeldRotationsStay) {
  Graph graph = chain(20, 4, 0.2, 0);
  for (std::size_t i : {3u, 4u, 15u}) graph.priors[i] = RotationPrior{graph.truth[i], 0};
  const auto found = average_rotations(20, graph.edges, graph.priors, 10 * kDegree);
  for (std::size_t i : {3u, 4u, 15u}) EXPECT_EQ(found.rotation[i]->coeffs(), graph.truth[i].coeffs());
  EXPECT_LT(largest_error_deg(graph, found, true), 1.5);
}

TEST(RotationAveraging, OnlyTheLargestPartIsAveraged) {
  Graph graph = chain(20, 4, 0.2, 0);
  std::erase_if(graph.edges, [](const auto& e) { return e.a < 6 && e.b >= 6; });
  const auto found = average_rotations(20, graph.edges, graph.priors, 10 * kDegree);
  for (std::size_t i = 0; i < 20; ++i) EXPECT_EQ(found.rotation[i].has_value(), i >= 6);
  graph.priors[2] = RotationPrior{graph.truth[2], 0};
  const auto held = average_rotations(20, graph.edges, graph.priors, 10 * kDegree);
  for (std::size_t i = 0; i < 20; ++i) EXPECT_EQ(held.rotation[i].has_value(), i < 6);
}

}  // namespace
}  // namespace megablock
