// Computes the three steps of baselines.h by these formulas. For a common track with the rays a, b (unit, ground axes)
// and the base t = C_b - C_a:
//
//     d_a a - d_b b = t,   n = a x b,   d_a = (t x b)'n / n'n,   d_b = (t x a)'n / n'n
//     |t'n| / |t x a| = sine of the angle by which b misses the plane of t and a
//
// Step 1 minimises sum w (t'n)^2 with w = (1 + x^2)^-2 / |t x a|^2, the weight of Geman and McClure for the angle x in
// units of 1.5 times the median angle. |t x a| is bounded by 0.02, since the plane is undetermined at the epipole.
//
// Step 2. Two baselines e, f at one image see the same distance D of a track there, in units of their lengths l. So
// log(l_f / l_e) = log(D / l_e) - log(D / l_f), of which the median over the common tracks is taken. Logarithms make
// the equations linear, and errors of scale equal for long and short baselines.
//
// Step 3 is linear in the centres. Axes are independent, with the same pattern and Cauchy weights from the length of
// the whole residual.
#include "adjust/orientation/steps/baselines.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <tuple>

#include "geometry/numbers/angles.h"
#include "geometry/numbers/decompositions.h"
#include "geometry/numbers/median.h"
#include "io/base/disjoint_sets.h"

namespace megablock {

namespace {

struct TrackRay {
  std::int32_t track;
  Eigen::Vector3d ray;  // ground axes
};
using ImageRays = std::vector<std::vector<TrackRay>>;  // per image, ascending by track

ImageRays rays_of_images(const OrientationGraph& graph, const std::vector<std::optional<Eigen::Quaterniond>>& rotations,
                         const std::vector<Eigen::Vector3d>& rays) {
  ImageRays result(graph.images.size());
  for (std::int64_t t = 0; t < graph.track_count(); ++t)
    for (auto o = graph.begin[static_cast<std::size_t>(t)]; o < graph.begin[static_cast<std::size_t>(t) + 1]; ++o) {
      const std::size_t image = row(graph.observations[static_cast<std::size_t>(o)].image);
      const Eigen::Vector3d& ray = rays[static_cast<std::size_t>(o)];
      if (rotations[image] && ray.squaredNorm() > 0)
        result[image].push_back({static_cast<std::int32_t>(t), rotations[image]->conjugate() * ray});
    }
  return result;
}

struct CommonTrack {
  std::int32_t track;
  Eigen::Vector3d a, b;  // rays
};

std::vector<CommonTrack> common_tracks(const std::vector<TrackRay>& a, const std::vector<TrackRay>& b) {
  std::vector<CommonTrack> result;
  for (std::size_t i = 0, j = 0; i < a.size() && j < b.size();) {
    if (a[i].track == b[j].track)
      result.push_back({a[i].track, a[i].ray, b[j].ray}), ++i, ++j;
    else
      a[i].track < b[j].track ? ++i : ++j;
  }
  return result;
}

// The angle by which each pair of rays misses the plane through the baseline, in radians to first order.
double epipolar_angle(const CommonTrack& c, const Eigen::Vector3d& t) {
  return std::abs(t.dot(c.a.cross(c.b))) / std::max(t.cross(c.a).norm(), 0.02);
}

// The unit direction of the baseline. Its sign puts most points in front. Empty when the rays do not determine it.
std::optional<Eigen::Vector3d> baseline_direction(const std::vector<CommonTrack>& common,
                                                  const Eigen::Vector3d& start) {
  // The smallest width of the loss. Exact rays would otherwise have a width of zero.
  constexpr double kSmallest = 0.02 * kDegree;
  // Iterates eigenvector and weights. Without a start all weights are one in the first iteration.
  const auto refine = [&](std::optional<Eigen::Vector3d> t) {
    for (int iteration = 0; iteration < 15; ++iteration) {
      double scale = kSmallest;
      if (t) {
        std::vector<double> angles;
        for (const auto& c : common) angles.push_back(epipolar_angle(c, *t));
        scale = std::max(kSmallest, 1.5 * median(angles));
      }
      Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
      for (const auto& c : common) {
        const Eigen::Vector3d n = c.a.cross(c.b);
        double weight = 1;
        if (t) {
          const double angle = epipolar_angle(c, *t) / scale, across = std::max(t->cross(c.a).norm(), 0.02);
          weight = 1 / (across * across * std::pow(1 + angle * angle, 2));
        }
        normal += weight * n * n.transpose();
      }
      const Eigen::Vector3d next = symmetric_eigen3(normal).vectors.col(0);
      const double change = t ? next.cross(*t).norm() : 1;
      t = next;
      if (change < 1e-12) break;
    }
    return *t;
  };
  // Cauchy's loss of 0.2 degrees. It is fixed, so that two results with scales of their own can be compared.
  const auto cost = [&](const Eigen::Vector3d& t) {
    double sum = 0;
    for (const auto& c : common) sum += std::log1p(std::pow(epipolar_angle(c, t) / (0.2 * kDegree), 2));
    return sum;
  };
  // Two starts: all equations with equal weights, and the base of the pair. The first one fails where many matches are
  // wrong, the second where the pair took a wrong twin.
  Eigen::Vector3d best = refine(std::nullopt);
  if (start.squaredNorm() > 0)
    if (const Eigen::Vector3d other = refine(start); cost(other) < cost(best)) best = other;

  int forward = 0, backward = 0;
  for (const auto& c : common) {
    // From d_a a - d_b b = t follow d_a ~ (t x b).(a x b) and d_b ~ (t x a).(a x b).
    const Eigen::Vector3d n = c.a.cross(c.b);
    const double da = best.cross(c.b).dot(n), db = best.cross(c.a).dot(n);
    if (da > 0 && db > 0) ++forward;
    if (da < 0 && db < 0) ++backward;
  }
  if (backward > forward) best = -best;
  // The direction must put half of the tracks before both images, or it is none.
  if (2 * std::max(forward, backward) < static_cast<int>(common.size())) return std::nullopt;
  return best;
}

struct Depth {
  std::int32_t track;
  double logarithm;  // of the distance in units of the baseline
};

struct MeasuredBaseline {
  std::int32_t a, b;
  Eigen::Vector3d direction;
  double sigma;                         // of the direction, by the pair's matches
  std::vector<Depth> depth_a, depth_b;  // ascending by track
};

// Depths in units of the base, as logarithms, at both ends.
void measure_depths(const std::vector<CommonTrack>& common, MeasuredBaseline& baseline) {
  constexpr double kSmallestAngle = 1 * kDegree, kLargestError = 1.5 * kDegree;
  for (const auto& c : common) {
    const Eigen::Vector3d n = c.a.cross(c.b);
    const double n2 = n.squaredNorm();
    // The distance of a track whose rays meet at less than a degree is too inexact.
    if (n2 < std::pow(std::sin(kSmallestAngle), 2) || epipolar_angle(c, baseline.direction) > kLargestError) continue;
    const double da = baseline.direction.cross(c.b).dot(n) / n2, db = baseline.direction.cross(c.a).dot(n) / n2;
    if (!(da > 0 && db > 0)) continue;
    baseline.depth_a.push_back({c.track, std::log(da)});
    baseline.depth_b.push_back({c.track, std::log(db)});
  }
}

constexpr std::size_t kFewestTracks = 8;  // of a baseline, and shared by two baselines

// Keeps the `limit` baselines with most depths at either end.
void keep_best(std::size_t images, std::size_t limit, std::vector<MeasuredBaseline>& baselines) {
  std::vector<std::vector<std::size_t>> of_image(images);
  for (std::size_t e = 0; e < baselines.size(); ++e) {
    of_image[row(baselines[e].a)].push_back(e);
    of_image[row(baselines[e].b)].push_back(e);
  }
  std::vector<std::uint8_t> keep(baselines.size(), 0);
  for (auto& list : of_image) {
    std::sort(list.begin(), list.end(), [&](std::size_t p, std::size_t q) {
      const auto np = baselines[p].depth_a.size(), nq = baselines[q].depth_a.size();
      return np != nq ? np > nq : p < q;
    });
    // A baseline stays if it is among the best of either of its images, so that no image loses all of its baselines to
    // images with better ones.
    for (std::size_t i = 0; i < std::min(limit, list.size()); ++i) keep[list[i]] = 1;
  }
  std::vector<MeasuredBaseline> kept;
  for (std::size_t e = 0; e < baselines.size(); ++e)
    if (keep[e]) kept.push_back(std::move(baselines[e]));
  baselines = std::move(kept);
}

// Logarithm of length(f) / length(e) from the depths at their common image, with the number of tracks behind it.
struct LengthRatio {
  std::int32_t e, f;
  double logarithm, tracks;
};

// Every two baselines at an image, with at least kFewestTracks common tracks. Depths are ascending by track, so that
// two lists are merged.
std::vector<LengthRatio> length_ratios(std::size_t images, const std::vector<MeasuredBaseline>& baselines) {
  struct End {
    std::int32_t baseline;
    const std::vector<Depth>* depths;
  };
  std::vector<std::vector<End>> ends(images);
  for (std::size_t e = 0; e < baselines.size(); ++e) {
    ends[row(baselines[e].a)].push_back({static_cast<std::int32_t>(e), &baselines[e].depth_a});
    ends[row(baselines[e].b)].push_back({static_cast<std::int32_t>(e), &baselines[e].depth_b});
  }
  std::vector<LengthRatio> result;
  std::vector<double> differences;
  for (const auto& list : ends)
    for (std::size_t i = 0; i < list.size(); ++i)
      for (std::size_t j = i + 1; j < list.size(); ++j) {
        differences.clear();
        const auto &p = *list[i].depths, &q = *list[j].depths;
        for (std::size_t k = 0, l = 0; k < p.size() && l < q.size();) {
          if (p[k].track == q[l].track)
            differences.push_back(p[k].logarithm - q[l].logarithm), ++k, ++l;
          else
            p[k].track < q[l].track ? ++k : ++l;
        }
        if (differences.size() >= kFewestTracks)
          result.push_back({list[i].baseline, list[j].baseline, median(differences),
                            // A ratio counts by its tracks; those of fifty and more count alike.
                            static_cast<double>(std::min<std::size_t>(differences.size(), 50))});
      }
  return result;
}

// Logarithms of the lengths of the largest connected part; empty for the others.
std::vector<std::optional<double>> solve_lengths(std::size_t count, const std::vector<LengthRatio>& ratios) {
  DisjointSets sets(static_cast<std::int32_t>(count));
  for (const auto& r : ratios) sets.unite(r.e, r.f);
  std::vector<std::int32_t> size(count, 0);
  for (std::size_t e = 0; e < count; ++e) ++size[row(sets.find(static_cast<std::int32_t>(e)))];
  // Ratios leave a common scale open: one baseline of the largest part has the length 1.
  const auto largest = static_cast<std::int32_t>(std::max_element(size.begin(), size.end()) - size.begin());

  std::vector<std::int32_t> unknown(count, -1);
  std::int32_t unknowns = 0;
  for (std::size_t e = 0; e < count; ++e)
    if (const auto i = static_cast<std::int32_t>(e); i != largest && sets.find(i) == largest) unknown[e] = unknowns++;

  Eigen::VectorXd value = Eigen::VectorXd::Zero(unknowns);
  const auto value_of = [&](std::int32_t e) { return unknown[row(e)] < 0 ? 0.0 : value[unknown[row(e)]]; };
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver;
  constexpr int kIterations = 20;
  for (int iteration = 0; iteration < kIterations && unknowns > 0; ++iteration) {
    std::vector<Eigen::Triplet<double>> entries;
    Eigen::VectorXd right = Eigen::VectorXd::Zero(unknowns);
    for (const auto& r : ratios) {
      if (sets.find(r.e) != largest) continue;
      const double error = r.logarithm - (value_of(r.f) - value_of(r.e));
      // L1 by reweighting. The bound of 0.01, one per cent of a length, keeps the weight finite.
      const double weight = r.tracks / (iteration == 0 ? 1 : std::max(0.01, std::abs(error)));
      const std::int32_t e = unknown[row(r.e)], f = unknown[row(r.f)];
      if (e >= 0) entries.emplace_back(e, e, weight), right[e] -= weight * r.logarithm;
      if (f >= 0) entries.emplace_back(f, f, weight), right[f] += weight * r.logarithm;
      if (e >= 0 && f >= 0) entries.emplace_back(std::max(e, f), std::min(e, f), -weight);
    }
    Eigen::SparseMatrix<double> normal(unknowns, unknowns);
    normal.setFromTriplets(entries.begin(), entries.end());
    if (iteration == 0) solver.analyzePattern(normal);
    solver.factorize(normal);
    if (solver.info() != Eigen::Success) break;
    value = solver.solve(right);
  }
  std::vector<std::optional<double>> result(count);
  for (std::size_t e = 0; e < count; ++e)
    if (const auto i = static_cast<std::int32_t>(e); sets.find(i) == largest) result[e] = value_of(i);
  return result;
}

}  // namespace

std::vector<Baseline> measure_baselines(const OrientationGraph& graph,
                                        const std::vector<std::optional<Eigen::Quaterniond>>& rotations,
                                        const std::vector<std::uint8_t>& usable,
                                        const std::vector<Eigen::Vector3d>& rays) {
  const ImageRays image_rays = rays_of_images(graph, rotations, rays);
  std::vector<MeasuredBaseline> baselines;
  for (std::size_t e = 0; e < graph.edges.size(); ++e) {
    const auto& edge = graph.edges[e];
    // A pair without a base (rotation only) has no direction to refine.
    if (!usable[e] || !rotations[row(edge.a)] || !rotations[row(edge.b)] || edge.baseline.squaredNorm() == 0) continue;
    const auto common = common_tracks(image_rays[row(edge.a)], image_rays[row(edge.b)]);
    if (common.size() < kFewestTracks) continue;
    const auto direction = baseline_direction(common, rotations[row(edge.a)]->conjugate() * edge.baseline);
    if (!direction) continue;
    MeasuredBaseline baseline{edge.a, edge.b, *direction, edge.baseline_sigma, {}, {}};
    measure_depths(common, baseline);
    if (baseline.depth_a.size() >= kFewestTracks) baselines.push_back(std::move(baseline));
  }
  // The ratios are quadratic in the baselines of an image.
  constexpr std::size_t kBaselinesPerImage = 20;
  keep_best(graph.images.size(), kBaselinesPerImage, baselines);

  std::vector<Baseline> result;
  if (baselines.empty()) return result;
  const auto lengths = solve_lengths(baselines.size(), length_ratios(graph.images.size(), baselines));
  for (std::size_t e = 0; e < baselines.size(); ++e)
    if (lengths[e])
      result.push_back(
          {baselines[e].a, baselines[e].b, baselines[e].direction, std::exp(*lengths[e]), baselines[e].sigma});
  return result;
}

namespace {

// Solves step 3 for the nodes that are connected to a prior, or to the largest part.
class CentreNetwork {
 public:
  CentreNetwork(std::int32_t nodes, const std::vector<CentreDifference>& differences,
                const std::vector<std::optional<CentrePrior>>& priors)
      : differences_(differences),
        priors_(priors),
        reached_(row(nodes), 0),
        unknown_(row(nodes), -1),
        centre_(row(nodes), Eigen::Vector3d::Zero()) {
    DisjointSets sets(nodes);
    for (const auto& d : differences) sets.unite(d.a, d.b);
    std::vector<std::int32_t> size(row(nodes), 0);
    std::vector<std::uint8_t> anchored(row(nodes), 0);
    bool any_prior = false;
    for (std::int32_t i = 0; i < nodes; ++i) {
      ++size[row(sets.find(i))];
      // Without a prior the sum of all equations leaves a shift open; the lowest node of the largest part is then held
      // at the origin.
      if (priors[row(i)]) anchored[row(sets.find(i))] = 1, any_prior = true;
    }
    const auto origin = static_cast<std::int32_t>(std::max_element(size.begin(), size.end()) - size.begin());
    if (!any_prior) anchored[row(origin)] = 1;
    for (std::int32_t i = 0; i < nodes; ++i) {
      reached_[row(i)] = anchored[row(sets.find(i))];
      if (reached_[row(i)] && (any_prior || i != origin)) unknown_[row(i)] = unknowns_++;
    }
    for (const auto& d : differences) extent_ = std::max(extent_, d.offset.norm());
  }

  void start(const std::vector<std::optional<Eigen::Vector3d>>& values) {
    weighted_ = !values.empty();
    for (std::size_t i = 0; i < values.size(); ++i)
      if (values[i]) centre_[i] = *values[i];
  }

  // Solves once, with weights from the present residuals, and returns the largest change. The first solution has
  // weights only if there is a start.
  std::optional<double> iterate() {
    std::vector<double> of_difference, of_prior(priors_.size(), 0.0);
    for (const auto& d : differences_)
      of_difference.push_back(weight((centre_[row(d.b)] - centre_[row(d.a)] - d.offset).norm() / d.sigma));
    for (std::size_t i = 0; i < priors_.size(); ++i)
      if (priors_[i])
        // Cauchy's scale is three sigmas for positions, one sigma for baselines.
        of_prior[i] = weight((centre_[i] - priors_[i]->position).cwiseQuotient(priors_[i]->sigma).norm() / 3);
    std::vector<Eigen::Vector3d> next = centre_;
    for (int axis = 0; axis < 3; ++axis)
      if (!solve_axis(axis, of_difference, of_prior, next)) return std::nullopt;
    double largest = 0;
    for (std::size_t i = 0; i < next.size(); ++i) largest = std::max(largest, (next[i] - centre_[i]).norm());
    centre_ = std::move(next);
    weighted_ = true;
    return largest;
  }

  bool run() {
    constexpr int kIterations = 50;
    for (int i = 0; i < kIterations && unknowns_ > 0; ++i) {
      const auto change = iterate();
      if (!change) return false;
      if (*change < 1e-10 * extent_) break;
    }
    return true;
  }

  std::vector<std::optional<Eigen::Vector3d>> centres() const {
    std::vector<std::optional<Eigen::Vector3d>> result(centre_.size());
    for (std::size_t i = 0; i < result.size(); ++i)
      if (reached_[i]) result[i] = centre_[i];
    return result;
  }

 private:
  double weight(double error) const { return weighted_ ? 1 / (1 + error * error) : 1; }  // Cauchy

  // The normal equations of one axis: a graph Laplacian of the differences, plus the priors on its diagonal.
  bool solve_axis(int axis, const std::vector<double>& of_difference, const std::vector<double>& of_prior,
                  std::vector<Eigen::Vector3d>& next) const {
    std::vector<Eigen::Triplet<double>> entries;
    Eigen::VectorXd right = Eigen::VectorXd::Zero(unknowns_);
    for (std::size_t k = 0; k < differences_.size(); ++k) {
      const CentreDifference& d = differences_[k];
      const std::int32_t a = unknown_[row(d.a)], b = unknown_[row(d.b)];
      const double w = of_difference[k] / (d.sigma * d.sigma);
      if (a >= 0) entries.emplace_back(a, a, w), right[a] -= w * d.offset[axis];
      if (b >= 0) entries.emplace_back(b, b, w), right[b] += w * d.offset[axis];
      if (a >= 0 && b >= 0) entries.emplace_back(std::max(a, b), std::min(a, b), -w);
    }
    for (std::size_t i = 0; i < priors_.size(); ++i) {
      if (!priors_[i] || unknown_[i] < 0) continue;
      const double w = of_prior[i] / (priors_[i]->sigma[axis] * priors_[i]->sigma[axis]);
      entries.emplace_back(unknown_[i], unknown_[i], w);
      right[unknown_[i]] += w * priors_[i]->position[axis];
    }
    Eigen::SparseMatrix<double> normal(unknowns_, unknowns_);
    normal.setFromTriplets(entries.begin(), entries.end());
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(normal);
    if (solver.info() != Eigen::Success) return false;
    const Eigen::VectorXd solution = solver.solve(right);
    for (std::size_t i = 0; i < unknown_.size(); ++i)
      if (unknown_[i] >= 0) next[i][axis] = solution[unknown_[i]];
    return true;
  }

  const std::vector<CentreDifference>& differences_;
  const std::vector<std::optional<CentrePrior>>& priors_;
  std::vector<std::uint8_t> reached_;
  std::vector<std::int32_t> unknown_;  // number of the node's unknown; -1: none
  std::int32_t unknowns_ = 0;
  std::vector<Eigen::Vector3d> centre_;
  double extent_ = 0;
  bool weighted_ = false;
};

}  // namespace

std::vector<std::optional<Eigen::Vector3d>> solve_centres(std::int32_t nodes,
                                                          const std::vector<CentreDifference>& differences,
                                                          const std::vector<std::optional<CentrePrior>>& priors,
                                                          const std::vector<std::optional<Eigen::Vector3d>>& start) {
  CentreNetwork network(nodes, differences, priors);
  network.start(start);
  if (!network.run()) return std::vector<std::optional<Eigen::Vector3d>>(row(nodes));
  return network.centres();
}

}  // namespace megablock
