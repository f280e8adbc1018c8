// The mathematics is in rotation_averaging.h; here are its parts and their weights.
//
//     likely_ones()         leaves out verticals, and weakens edges, that contradict the others
//     tree_start()          rotations along the maximum spanning tree of trust()
//     turn_to_...()         one common rotation, to the priors or to the verticals
//     Averager              reweighted least squares
//     average_rotations()   drops edges that are far from the average, and averages again
//
// The variance of an edge with n inliers is v = kVariance / (1 + n) + sigma^2. kVariance gives 100 inliers a sigma of
// half a degree: errors of calibration and outliers do not show in the covariance sigma^2 of the matches
// (docs/developer/decisions.md, "Pairs of images").
//
// With e = |Log(R_j' R_ij R_i)|, the weights of the equations w_j - w_i = e are
//
//     L1             1 / (sqrt(v) max(e, kSmallest))
//     Geman-McClure  1 / (v (1 + e^2 / s^2)^2),   s^2 = kScale^2 + (kSigmas^2) v
//
// L1 is convex in its linearised form and comes first; Geman and McClure's loss forgets what is far off, and would
// forget good edges of a poor start.
#include "adjust/orientation/steps/rotation_averaging.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

#include "adjust/orientation/steps/orientation_graph.h"
#include "geometry/numbers/angles.h"
#include "geometry/transform/rotation_fit.h"
#include "io/base/disjoint_sets.h"

namespace megablock {

namespace {

using Edges = std::vector<RelativeRotation>;
using Priors = std::vector<std::optional<RotationPrior>>;
using Verticals = std::vector<KnownVertical>;

struct Neighbour {
  std::int32_t node;
  std::int32_t edge;
};

// Neighbours of every node, ascending by node; of parallel edges the one with most inliers.
std::vector<std::vector<Neighbour>> adjacency(std::int32_t nodes, const Edges& edges,
                                              const std::vector<std::uint8_t>& kept) {
  std::vector<std::vector<Neighbour>> result(row(nodes));
  for (std::size_t e = 0; e < edges.size(); ++e) {
    if (!kept[e]) continue;
    result[row(edges[e].a)].push_back({edges[e].b, static_cast<std::int32_t>(e)});
    result[row(edges[e].b)].push_back({edges[e].a, static_cast<std::int32_t>(e)});
  }
  for (auto& list : result) {
    std::sort(list.begin(), list.end(), [&](const Neighbour& p, const Neighbour& q) {
      const double ip = edges[row(p.edge)].inliers, iq = edges[row(q.edge)].inliers;
      return std::tuple(p.node, -ip, p.edge) < std::tuple(q.node, -iq, q.edge);
    });
    list.erase(std::unique(list.begin(), list.end(), [](const auto& p, const auto& q) { return p.node == q.node; }),
               list.end());
  }
  return result;
}

Eigen::Quaterniond along(const RelativeRotation& edge, std::int32_t from) {
  return edge.a == from ? edge.rotation : edge.rotation.conjugate();
}

constexpr double kVariance = 0.25 * kDegree * kDegree * 100;  // of a rotation from one inlier

}  // namespace

double variance_of(const RelativeRotation& edge) {
  return kVariance / (1 + edge.inliers) + edge.sigma_rad * edge.sigma_rad;
}

namespace {

// The number of inliers at which the variance would be the same without the noise of the matches.
double effective_inliers(const RelativeRotation& edge) { return std::max(0.0, kVariance / variance_of(edge) - 1); }

// The edges and verticals that agree with the others.
struct Likely {
  Edges edges;
  Verticals verticals;
};

// Leaves out a vertical if less than a quarter of the edges of its node, weighted by inliers, agree with it. An edge
// that the remaining verticals at its ends contradict counts a tenth.
Likely likely_ones(std::int32_t nodes, const Edges& edges, const Verticals& verticals) {
  constexpr double kAgree = 5 * kDegree, kFewest = 0.25, kDiscount = 0.1;
  std::vector<std::int32_t> vertical(row(nodes), -1);  // of several the last
  for (std::size_t v = 0; v < verticals.size(); ++v) vertical[row(verticals[v].node)] = static_cast<std::int32_t>(v);
  std::vector<double> agreeing(row(nodes), 0), all(row(nodes), 0);
  const auto tested = [&](const RelativeRotation& edge) {
    return vertical[row(edge.a)] >= 0 && vertical[row(edge.b)] >= 0;
  };
  const auto agrees = [&](const RelativeRotation& edge) {
    const auto &a = verticals[row(vertical[row(edge.a)])], &b = verticals[row(vertical[row(edge.b)])];
    return (edge.rotation * a.seen - b.seen).norm() < kAgree;
  };
  for (const RelativeRotation& edge : edges) {
    if (!tested(edge)) continue;
    // An edge with verticals at both ends tests both of them. Which of the two is wrong shows at their other edges.
    for (const std::int32_t node : {edge.a, edge.b}) {
      all[row(node)] += edge.inliers;
      if (agrees(edge)) agreeing[row(node)] += edge.inliers;
    }
  }
  Likely likely{edges, {}};
  for (const KnownVertical& v : verticals)
    // A vertical without any tested edge has 0 >= 0 and stays.
    if (agreeing[row(v.node)] >= kFewest * all[row(v.node)])
      likely.verticals.push_back(v);
    else
      vertical[row(v.node)] = -1;
  for (RelativeRotation& edge : likely.edges)
    if (tested(edge) && !agrees(edge)) edge.inliers *= kDiscount;
  return likely;
}

// Inliers times the share of the edge's triangles that close within 5 degrees (one half without triangles).
std::vector<double> trust(std::int32_t nodes, const Edges& edges) {
  const auto neighbours = adjacency(nodes, edges, std::vector<std::uint8_t>(edges.size(), 1));
  constexpr double kClosed = 5 * kDegree;
  std::vector<double> result(edges.size());
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const RelativeRotation& edge = edges[e];
    const auto &of_a = neighbours[row(edge.a)], &of_b = neighbours[row(edge.b)];
    int triangles = 0, closed = 0;
    for (std::size_t i = 0, j = 0; i < of_a.size() && j < of_b.size();) {
      if (of_a[i].node != of_b[j].node) {
        of_a[i].node < of_b[j].node ? ++i : ++j;
        continue;
      }
      const Eigen::Quaterniond to_c = along(edges[row(of_a[i].edge)], edge.a);
      const Eigen::Quaterniond to_c_by_b = along(edges[row(of_b[j].edge)], edge.b) * edge.rotation;
      ++triangles;
      if (rotation_angle(to_c, to_c_by_b) < kClosed) ++closed;
      ++i, ++j;
    }
    // With one half added for an open triangle, a single closed one is not trusted without reserve.
    result[e] = effective_inliers(edge) * (closed + 0.5) / (triangles + 1);
  }
  return result;
}

bool held(const Priors& priors, std::size_t node) { return priors[node] && priors[node]->sigma_rad == 0; }

// 1 for the nodes to average: those connected to held ones, else the largest part.
std::vector<std::uint8_t> reachable(std::int32_t nodes, const Edges& edges, const std::vector<std::uint8_t>& kept,
                                    const Priors& priors) {
  DisjointSets sets(nodes);
  for (std::size_t e = 0; e < edges.size(); ++e)
    if (kept[e]) sets.unite(edges[e].a, edges[e].b);
  std::vector<std::int32_t> size(row(nodes), 0);
  std::vector<std::uint8_t> anchored(row(nodes), 0);
  bool any_held = false;
  for (std::int32_t i = 0; i < nodes; ++i) {
    const std::size_t root = row(sets.find(i));
    ++size[root];
    if (held(priors, row(i))) anchored[root] = 1, any_held = true;
  }
  if (!any_held && nodes > 0)
    anchored[static_cast<std::size_t>(std::max_element(size.begin(), size.end()) - size.begin())] = 1;
  std::vector<std::uint8_t> result(row(nodes));
  for (std::int32_t i = 0; i < nodes; ++i) result[row(i)] = anchored[row(sets.find(i))];
  return result;
}

// Rotations along the maximum spanning tree. Held nodes count as one node from the beginning.
std::vector<Eigen::Quaterniond> tree_start(std::int32_t nodes, const Edges& edges, const Priors& priors,
                                           const std::vector<std::uint8_t>& active) {
  const std::vector<double> value = trust(nodes, edges);
  std::vector<std::int32_t> order(edges.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(),
            [&](auto p, auto q) { return std::tuple(-value[row(p)], p) < std::tuple(-value[row(q)], q); });
  DisjointSets sets(nodes);
  std::int32_t first_held = -1;
  for (std::int32_t i = 0; i < nodes; ++i)
    // Paths between held nodes must not enter the tree: their rotations are known.
    if (held(priors, row(i))) first_held < 0 ? void(first_held = i) : void(sets.unite(first_held, i));
  std::vector<std::uint8_t> in_tree(edges.size(), 0);
  for (std::int32_t e : order)
    if (sets.unite(edges[row(e)].a, edges[row(e)].b)) in_tree[row(e)] = 1;

  const auto neighbours = adjacency(nodes, edges, in_tree);
  // R_n = R_in R_i from node to node, from the held nodes or, without any, from the first active one.
  std::vector<Eigen::Quaterniond> rotation(row(nodes), Eigen::Quaterniond::Identity());
  std::vector<std::uint8_t> done(row(nodes), 0);
  std::vector<std::int32_t> queue;
  for (std::int32_t i = 0; i < nodes; ++i)
    if (held(priors, row(i))) {
      rotation[row(i)] = priors[row(i)]->rotation;
      done[row(i)] = 1;
      queue.push_back(i);
    }
  for (std::int32_t i = 0; i < nodes && queue.empty(); ++i)
    if (active[row(i)]) {
      done[row(i)] = 1;
      queue.push_back(i);
    }
  for (std::size_t next = 0; next < queue.size(); ++next) {
    const std::int32_t i = queue[next];
    for (const Neighbour& n : neighbours[row(i)]) {
      if (done[row(n.node)]) continue;
      rotation[row(n.node)] = (along(edges[row(n.edge)], i) * rotation[row(i)]).normalized();
      done[row(n.node)] = 1;
      queue.push_back(n.node);
    }
  }
  return rotation;
}

// Turns all rotations by the one world rotation that brings most of them to their priors.
void turn_to_priors(const Priors& priors, const std::vector<std::uint8_t>& active,
                    std::vector<Eigen::Quaterniond>& rotation) {
  std::vector<Eigen::Quaterniond> candidates;  // R_i G = R_prior
  for (std::size_t i = 0; i < rotation.size(); ++i)
    if (active[i] && priors[i]) candidates.push_back((rotation[i].conjugate() * priors[i]->rotation).normalized());
  if (candidates.empty()) return;
  constexpr double kSpread = 5 * kDegree;
  const auto cost = [&](const Eigen::Quaterniond& g) {
    double sum = 0;
    for (const auto& c : candidates) sum += std::log1p(std::pow(rotation_angle(g, c) / kSpread, 2));
    return sum;
  };
  Eigen::Quaterniond best = candidates.front();
  double best_cost = cost(best);
  const std::size_t stride = 1 + candidates.size() / 100;
  for (std::size_t i = stride; i < candidates.size(); i += stride)
    if (const double c = cost(candidates[i]); c < best_cost) best = candidates[i], best_cost = c;
  // The mean by reweighting: with E = G' c the error of candidate c, G moves by the weighted mean of Log E.
  for (int iteration = 0; iteration < 50; ++iteration) {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    double weights = 0;
    for (const auto& c : candidates) {
      const Eigen::Vector3d e = rotation_log<double>(best.conjugate() * c);
      const double w = 1 / (kSpread * kSpread + e.squaredNorm());
      mean += w * e;
      weights += w;
    }
    best = rotation_update(best, mean / weights);
    if ((mean / weights).norm() < 1e-12) break;
  }
  for (auto& r : rotation) r = (r * best).normalized();
}

// Turns the direction of down as most nodes see it to that of the world, by the smallest rotation.
void turn_to_verticals(const Verticals& verticals, const std::vector<std::uint8_t>& active,
                       std::vector<Eigen::Quaterniond>& rotation) {
  struct Seen {
    Eigen::Vector3d from, to;  // world axes as they are, and as they should be
  };
  std::vector<Seen> seen;
  for (const KnownVertical& v : verticals)
    if (active[row(v.node)]) seen.push_back({rotation[row(v.node)].conjugate() * v.seen, v.ground});
  if (seen.empty()) return;
  constexpr double kSpread = 5 * kDegree;
  // A single vertical leaves the turn about itself open; the smallest rotation is taken. The averaging then refines the
  // two level angles.
  const auto turn_of = [](const Seen& s) { return rotation_between(s.to, s.from); };
  const auto cost = [&](const Eigen::Quaterniond& g) {
    double sum = 0;
    for (const Seen& s : seen) sum += std::log1p((g * s.to - s.from).squaredNorm() / (kSpread * kSpread));
    return sum;
  };
  Eigen::Quaterniond best = turn_of(seen.front());
  double best_cost = cost(best);
  const std::size_t stride = 1 + seen.size() / 100;
  for (std::size_t i = stride; i < seen.size(); i += stride)
    if (const double c = cost(turn_of(seen[i])); c < best_cost) best = turn_of(seen[i]), best_cost = c;
  for (auto& r : rotation) r = (r * best).normalized();
}

// The reweighted iterations over the active nodes. Increments about x and y are solved for with the verticals, those
// about z without them. Where there are no verticals, all three are one system.
class Averager {
 public:
  Averager(const Edges& edges, const std::vector<std::uint8_t>& kept, const Priors& priors, const Verticals& verticals,
           const std::vector<std::uint8_t>& active, std::vector<Eigen::Quaterniond>& rotation)
      : edges_(edges), kept_(kept), priors_(priors), active_(active), rotation_(rotation) {
    for (const KnownVertical& v : verticals)
      if (active[row(v.node)]) verticals_.push_back(v);
    bool anchored = false;
    for (std::size_t i = 0; i < rotation.size(); ++i) anchored |= active[i] && priors[i].has_value();
    number(level_, anchored || !verticals_.empty());
    number(heading_, anchored);
  }

  void run() {
    if (level_.count == 0) return;
    static constexpr double kSmallest = 0.05 * kDegree;
    constexpr int kL1Iterations = 15, kIterations = 100;
    const auto l1 = [](double e, double variance) { return std::sqrt(variance) / std::max(e, kSmallest); };
    const auto geman_mcclure = [](double e, double variance) {
      return std::pow(1 + e * e / (kScale * kScale + kSigmas * kSigmas * variance), -2);
    };
    for (int i = 0; i < kL1Iterations; ++i)
      if (iterate(l1, 1) < 1e-6) break;
    for (int i = 0; i < kIterations; ++i)
      if (iterate(geman_mcclure, 2) < 1e-12) break;
  }

 private:
  static constexpr double kScale = 2 * kDegree, kSigmas = 3;
  struct System {
    std::vector<std::int32_t> unknown;  // number of the node's unknown; -1: none
    std::int32_t count = 0;
    bool analysed = false;
    Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver;
  };
  // w_b - w_a = e of weight w; a negative: w_b = e.
  struct Equation {
    std::int32_t a, b;
    double weight;
    Eigen::Vector3d error;
  };

  // Without an anchor the first node carries the gauge.
  void number(System& system, bool anchored) const {
    system.unknown.assign(rotation_.size(), -1);
    for (std::size_t i = 0; i < rotation_.size(); ++i) {
      if (!active_[i] || held(priors_, i)) continue;
      if (anchored) system.unknown[i] = system.count++;
      anchored = true;
    }
  }

  // One weighted solution; returns the largest increment. Verticals are good to tenths of a degree, or wrong. Their
  // weights fall off from the start, at first slowly (power 1), so that they also reach nodes that have drifted away.
  template <typename Weight>
  double iterate(Weight robust, int vertical_power) {
    std::vector<Equation> equations;
    for (std::size_t k = 0; k < edges_.size(); ++k) {
      const RelativeRotation& edge = edges_[k];
      if (!kept_[k] || !active_[row(edge.a)]) continue;
      const Eigen::Vector3d e = error(edge);
      equations.push_back({edge.a, edge.b, robust(e.norm(), variance_of(edge)) / variance_of(edge), e});
    }
    for (std::size_t i = 0; i < rotation_.size(); ++i)
      if (active_[i] && !held(priors_, i) && priors_[i]) {
        const Eigen::Vector3d e = rotation_log<double>(rotation_[i].conjugate() * priors_[i]->rotation);
        // The weight of a prior, 1 / (sigma^2 + e^2), is that of Cauchy's loss with the scale of one sigma.
        const double sigma = priors_[i]->sigma_rad;
        equations.push_back({-1, static_cast<std::int32_t>(i), 1 / (sigma * sigma + e.squaredNorm()), e});
      }
    Eigen::MatrixX3d step = Eigen::MatrixX3d::Zero(std::ssize(rotation_), 3);
    if (verticals_.empty()) {
      // Without verticals the three axes have the same matrix, and one factor solves all of them.
      solve(level_, equations, 0, 3, step);
    } else {
      // Verticals add to the diagonal of the axes x and y only. The heading has another matrix and its own numbers,
      // since it needs a gauge where verticals fix the level.
      solve(heading_, equations, 2, 1, step);
      for (const KnownVertical& v : verticals_) {
        // w = g x now, brought from the sine of the angle to the angle itself.
        const Eigen::Vector3d now = rotation_[row(v.node)].conjugate() * v.seen, cross = v.ground.cross(now);
        const double angle = std::atan2(cross.norm(), v.ground.dot(now));
        const Eigen::Vector3d e = cross.norm() > 0 ? Eigen::Vector3d(angle / cross.norm() * cross) : cross;
        constexpr double kPlumb = 0.1 * kDegree;  // accuracy of upright edges
        equations.push_back({-1, v.node,
                             std::pow(1 + angle * angle / (kScale * kScale), -vertical_power) /
                                 (v.sigma_rad * v.sigma_rad + kPlumb * kPlumb),
                             e});
      }
      solve(level_, equations, 0, 2, step);
    }
    double largest = 0;
    for (std::size_t i = 0; i < rotation_.size(); ++i) {
      const Eigen::Vector3d w = step.row(static_cast<Eigen::Index>(i)).transpose();
      if (w.isZero(0)) continue;
      rotation_[i] = rotation_update(rotation_[i], w);
      largest = std::max(largest, w.norm());
    }
    return largest;
  }

  // Some columns of the increments of all nodes.
  static void solve(System& system, const std::vector<Equation>& equations, int first, int columns,
                    Eigen::MatrixX3d& step) {
    if (system.count == 0) return;
    std::vector<Eigen::Triplet<double>> entries;
    Eigen::MatrixXd right = Eigen::MatrixXd::Zero(system.count, columns);
    const auto add = [&](std::int32_t i, double w, const Eigen::Vector3d& e) {
      if (i < 0) return;
      entries.emplace_back(i, i, w);
      right.row(i) += w * e.segment(first, columns).transpose();
    };
    for (const Equation& equation : equations) {
      const std::int32_t a = equation.a < 0 ? -1 : system.unknown[row(equation.a)];
      const std::int32_t b = system.unknown[row(equation.b)];
      add(a, equation.weight, -equation.error);
      add(b, equation.weight, equation.error);
      // The lower triangle of the graph Laplacian: the factorisation reads no more.
      if (a >= 0 && b >= 0) entries.emplace_back(std::max(a, b), std::min(a, b), -equation.weight);
    }
    Eigen::SparseMatrix<double> normal(system.count, system.count);
    normal.setFromTriplets(entries.begin(), entries.end());
    // The weights change with each iteration, the pattern does not.
    if (!system.analysed) system.solver.analyzePattern(normal), system.analysed = true;
    system.solver.factorize(normal);
    if (system.solver.info() != Eigen::Success) return;
    const Eigen::MatrixXd solution = system.solver.solve(right);
    for (std::size_t i = 0; i < system.unknown.size(); ++i)
      if (system.unknown[i] >= 0)
        step.row(static_cast<Eigen::Index>(i)).segment(first, columns) = solution.row(system.unknown[i]);
  }

  Eigen::Vector3d error(const RelativeRotation& edge) const {
    return rotation_log<double>(rotation_[row(edge.b)].conjugate() * edge.rotation * rotation_[row(edge.a)]);
  }

  const Edges& edges_;
  const std::vector<std::uint8_t>& kept_;
  const Priors& priors_;
  Verticals verticals_;  // of active nodes
  const std::vector<std::uint8_t>& active_;
  std::vector<Eigen::Quaterniond>& rotation_;
  System level_, heading_;
};

}  // namespace

AveragedRotations average_rotations(std::int32_t nodes, const Edges& measured, const Priors& priors,
                                    double max_error_rad, const Verticals& seen) {
  const auto [edges, verticals] = likely_ones(nodes, measured, seen);
  AveragedRotations result;
  result.kept.assign(edges.size(), 1);
  auto active = reachable(nodes, edges, result.kept, priors);
  std::vector<Eigen::Quaterniond> rotation = tree_start(nodes, edges, priors, active);
  bool any_held = false, any_prior = false;
  for (std::size_t i = 0; i < priors.size(); ++i) {
    any_held |= held(priors, i);
    any_prior |= active[i] && priors[i].has_value();
  }
  if (!any_held && !any_prior) turn_to_verticals(verticals, active, rotation);
  if (!any_held) turn_to_priors(priors, active, rotation);

  constexpr int kRounds = 3;  // of dropping edges and averaging again
  for (int round = 0; round < kRounds; ++round) {
    Averager(edges, result.kept, priors, verticals, active, rotation).run();
    bool changed = false;
    for (std::size_t e = 0; e < edges.size(); ++e) {
      if (!active[row(edges[e].a)]) continue;
      const Eigen::Quaterniond average = rotation[row(edges[e].b)] * rotation[row(edges[e].a)].conjugate();
      // An edge that was dropped may come back when the average has moved.
      const std::uint8_t keep = rotation_angle(average, edges[e].rotation) <= max_error_rad;
      changed |= keep != result.kept[e];
      result.kept[e] = keep;
    }
    // Nodes that only dropped edges connected are no longer averaged.
    active = reachable(nodes, edges, result.kept, priors);
    if (!changed) break;
  }
  result.rotation.resize(row(nodes));
  for (std::size_t i = 0; i < rotation.size(); ++i)
    if (active[i]) result.rotation[i] = rotation[i];
  return result;
}

}  // namespace megablock
