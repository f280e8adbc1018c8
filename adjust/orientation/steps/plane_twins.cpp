// In the notation of plane_twins.h, R and t are of the orientation of an edge (rotation a -> b, base in camera b), S
// and u of its twin. p = t - (t'u) u lies in the plane of t and u and is at right angles to u. It gives n ~ (S - R)' p.
// For the twin, (R - S)' (u - (t'u) t) gives v. p't and m are positive, so that both normals come out with their sign.
//
// The choice is a vote. Each edge of an image asks the strongest edges of the same image how well their normals agree
// with its own two. An edge changes over where the votes for its other normal are clearly more, and the votes are
// counted again with the new choices.
#include "adjust/orientation/steps/plane_twins.h"

#include <algorithm>
#include <array>
#include <optional>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "geometry/numbers/angles.h"

namespace megablock {

namespace {

using Normals = std::array<Eigen::Vector3d, 2>;  // by the orientation of an edge, and by its twin

// The two normals in the axes of image a. Empty where the two base directions are alike.
std::optional<Normals> normals_of(const OrientationGraph::PairEdge& edge) {
  const Eigen::Matrix3d r = edge.rotation.toRotationMatrix(), s = edge.twin.rotation.toRotationMatrix();
  const Eigen::Vector3d t = -(r * edge.baseline), u = -(s * edge.twin.baseline);
  const double along = t.dot(u), across = t.squaredNorm() * u.squaredNorm() - along * along;
  constexpr double kAlike = 0.01;  // six degrees
  if (!(across > kAlike)) return std::nullopt;
  const Normals normals{(s - r).transpose() * (t - along * u), (r - s).transpose() * (u - along * t)};
  if (!(normals[0].norm() > 0) || !(normals[1].norm() > 0)) return std::nullopt;
  return Normals{normals[0].normalized(), normals[1].normalized()};
}

struct SeenNormals {
  std::size_t edge;
  Normals normal;  // in the image's axes
};

constexpr int kRounds = 10;
// A twin is chosen if it agrees better by this factor than the present choice, and by this number of fully agreeing
// witnesses. Where hills leave few pairs a twin, a single witness may agree by chance.
constexpr double kClearly = 1.5, kWitnesses = 0.75;

// The agreement of two normals, from 0 to 1.
double agreement(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  constexpr double kReach = 8 * kDegree;
  return 1 / (1 + (a - b).squaredNorm() / (kReach * kReach));
}

}  // namespace

void choose_twins_by_planes(OrientationGraph& graph, std::size_t witnesses) {
  std::vector<std::vector<SeenNormals>> seen(graph.images.size());  // the strongest pairs of each image first
  for (std::size_t e = 0; e < graph.edges.size(); ++e) {
    const OrientationGraph::PairEdge& edge = graph.edges[e];
    if (!edge.has_twin) continue;
    const auto normals = normals_of(edge);
    if (!normals) continue;
    seen[row(edge.a)].push_back({e, *normals});
    // The normals in the axes of image b.
    seen[row(edge.b)].push_back({e, {edge.rotation * (*normals)[0], edge.twin.rotation * (*normals)[1]}});
  }
  const auto stronger = [&](const SeenNormals& one, const SeenNormals& other) {
    const OrientationGraph::PairEdge &p = graph.edges[one.edge], &q = graph.edges[other.edge];
    return std::tuple(-p.inliers, p.a, p.b) < std::tuple(-q.inliers, q.a, q.b);
  };
  for (std::vector<SeenNormals>& of_image : seen) std::sort(of_image.begin(), of_image.end(), stronger);
  // In the first iteration the better fitting normal of each witness counts, later the chosen one.
  std::vector<std::uint8_t> by_twin(graph.edges.size(), 0);
  // All edges vote with the choices of the round before. The order of the edges then does not matter.
  for (int round = 0; round < kRounds; ++round) {
    std::vector<std::array<double, 2>> votes(graph.edges.size(), {0, 0});
    for (const std::vector<SeenNormals>& of_image : seen)
      for (const SeenNormals& one : of_image)
        for (const SeenNormals& other : std::span(of_image).first(std::min(witnesses, of_image.size()))) {
          if (one.edge == other.edge) continue;
          const Eigen::Vector3d &chosen = other.normal[by_twin[other.edge]], &left = other.normal[!by_twin[other.edge]];
          for (std::size_t t = 0; t < 2; ++t) {
            const double agrees = agreement(one.normal[t], chosen);
            votes[one.edge][t] += round > 0 ? agrees : std::max(agrees, agreement(one.normal[t], left));
          }
        }
    bool changed = false;
    for (std::size_t e = 0; e < graph.edges.size(); ++e) {
      const std::uint8_t now = by_twin[e];
      if (!(votes[e][!now] > kClearly * votes[e][now] + kWitnesses)) continue;
      by_twin[e] = !now;
      changed = true;
    }
    if (!changed) break;
  }
  for (std::size_t e = 0; e < graph.edges.size(); ++e)
    if (OrientationGraph::PairEdge& edge = graph.edges[e]; by_twin[e])
      std::swap<OrientationGraph::Relative>(edge, edge.twin);
}

}  // namespace megablock
