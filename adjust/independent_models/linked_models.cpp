// Judges links by closing triangles. For the links S_ab (b -> a), S_bc (c -> b) and S_ac (c -> a), errors as steps in
// the models b, c, c respectively, the loop is
//
//     S_ac^-1 S_ab S_bc = E(T xi_ab + xi_bc - xi_ac),   T = step_through(S_bc),
//
// and its squared length in its covariance is chi-square with seven degrees of freedom. A wrong link agrees with
// itself: only loops reveal it. In a block whose stated errors are too small, no triangle would close; the limit is
// therefore multiplied by the factor by which the median exceeds that of chi-square (inflation()).
//
// The width of the loss in average_links() is the value that chi-square(7) exceeds with one per cent, inflated in the
// same way. A good link, with squares of about 7, keeps half of its weight; one of ten times the width a hundredth.
#include "adjust/independent_models/linked_models.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>

#include "adjust/independent_models/similarity_equations.h"
#include "geometry/numbers/chi_square.h"
#include "geometry/numbers/median.h"
#include "geometry/transform/rotation.h"
#include "io/base/disjoint_sets.h"
#include "io/base/error.h"
#include "io/evaluation/parts.h"

namespace megablock {
namespace {

// The median of a chi-square variable.
double chi_square_median(int degrees) { return chi_square_quantile(0.5, degrees); }

// With M: x -> s R x + t from another frame, a step xi in the target frame of M is this matrix times xi in the other
// frame: M^-1 E(w, q, d) M = E(R'w, q, R'(w x t + q t + d) / s).
Block7 step_through(const Similarity& m) {
  const Eigen::Matrix3d back = m.rotation.conjugate().toRotationMatrix();
  Block7 result = Block7::Zero();
  result.topLeftCorner<3, 3>() = back;
  result(3, 3) = 1;
  result.bottomLeftCorner<3, 3>() = -back * skew(m.translation) / m.scale;
  result.block<3, 1>(4, 3) = back * m.translation / m.scale;
  result.bottomRightCorner<3, 3>() = back / m.scale;
  return result;
}

// Moves the coordinates of a model to their centroid, which it returns.
Eigen::Vector3d reduce(Model& model) {
  const auto by_number = [](const auto& a, const auto& b) { return a.number < b.number; };
  std::sort(model.points.begin(), model.points.end(), by_number);
  std::sort(model.images.begin(), model.images.end(), by_number);
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  const auto count = static_cast<double>(model.points.size() + model.images.size());
  for (const ModelPoint& p : model.points) centre += p.position / count;
  for (const ModelImage& i : model.images) centre += i.pose.centre / count;
  for (ModelPoint& p : model.points) p.position -= centre;
  for (ModelImage& i : model.images) i.pose.centre -= centre;
  return centre;
}

void find_links(LinkedModels& linked, const LinkOptions& options) {
  std::map<std::pair<std::int32_t, std::int32_t>, SharedRows> shared;
  for (const SharedPlace& place : linked.places)
    for (std::size_t i = 0; i < place.entries.size(); ++i)
      for (std::size_t j = i + 1; j < place.entries.size(); ++j) {
        SharedRows& rows = shared[{place.entries[i].model, place.entries[j].model}];
        // Every two models that share a place are candidates for a link. Places are ascending, and so are their rows.
        (place.image ? rows.images : rows.points).emplace_back(place.entries[i].row, place.entries[j].row);
      }
  for (const auto& [models, rows] : shared)
    if (const auto link = fit_model_link(linked.models, models.first, models.second, rows, options))
      linked.links.push_back(*link);
}

// The trust in each link: the number of inliers times the share of triangles that close (one half without triangles).
std::vector<double> trust(const LinkedModels& linked, const LinkOptions& options) {
  std::map<std::pair<std::int32_t, std::int32_t>, std::size_t> link_of;
  std::vector<std::vector<std::int32_t>> above(linked.models.size());  // linked models in higher rows, ascending
  std::vector<Block7> covariances;
  for (std::size_t l = 0; l < linked.links.size(); ++l) {
    link_of[{linked.links[l].a, linked.links[l].b}] = l;
    above[nth(linked.links[l].a)].push_back(linked.links[l].b);
    covariances.push_back(linked.links[l].information.inverse());
  }
  struct Triangle {
    std::array<std::size_t, 3> links;
    double squares;
  };
  std::vector<Triangle> triangles;
  for (std::size_t ab = 0; ab < linked.links.size(); ++ab) {
    const std::int32_t a = linked.links[ab].a, b = linked.links[ab].b;
    for (const std::int32_t c : above[nth(b)]) {
      const auto found = link_of.find({a, c});
      if (found == link_of.end()) continue;
      const std::size_t ac = found->second, bc = link_of.at({b, c});
      // The loop c -> b -> a -> c, expressed in c.
      const Similarity loop =
          linked.links[ac].similarity.inverse() * (linked.links[ab].similarity * linked.links[bc].similarity);
      const Block7 through = step_through(linked.links[bc].similarity);
      const Block7 covariance = covariances[bc] + covariances[ac] + through * covariances[ab] * through.transpose();
      const SimilarityStep gap = step_of(loop);
      triangles.push_back({{ab, ac, bc}, gap.dot(covariance.ldlt().solve(gap))});
    }
  }
  std::vector<double> squares;
  for (const Triangle& t : triangles) squares.push_back(t.squares);
  const double limit = inflation(squares, 7) * chi_square_quantile(options.rejection_probability, 7);
  std::vector<int> count(linked.links.size(), 0), closed(linked.links.size(), 0);
  for (const Triangle& t : triangles)
    for (const std::size_t l : t.links) ++count[l], closed[l] += t.squares <= limit;
  std::vector<double> result(linked.links.size());
  for (std::size_t l = 0; l < linked.links.size(); ++l)
    // As in rotation_averaging.cpp, one half is added for an open triangle.
    result[l] = linked.links[l].agreeing * (closed[l] + 0.5) / (count[l] + 1);
  return result;
}

// Chains the similarities along the spanning tree of the most trusted links, from the lowest model of each part.
void chain(LinkedModels& linked, const LinkOptions& options) {
  const std::vector<double> value = trust(linked, options);
  std::vector<std::size_t> order(linked.links.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t i, std::size_t j) { return value[i] > value[j]; });
  DisjointSets joined(static_cast<std::int32_t>(linked.models.size()));
  std::vector<std::vector<std::size_t>> tree(linked.models.size());
  for (const std::size_t l : order)
    if (joined.unite(linked.links[l].a, linked.links[l].b))
      for (const std::int32_t m : {linked.links[l].a, linked.links[l].b}) tree[nth(m)].push_back(l);
  linked.similarity.assign(linked.models.size(), Similarity());
  linked.reference.assign(linked.models.size(), -1);
  for (std::int32_t first = 0; first < std::ssize(linked.models); ++first) {
    if (linked.reference[nth(first)] >= 0) continue;
    linked.reference[nth(first)] = first;
    // The frame of the part is that of its first model as given, not the one about its centroid.
    linked.similarity[nth(first)].translation = linked.centre[nth(first)];
    for (std::vector<std::int32_t> open{first}; !open.empty();) {
      const std::int32_t from = open.back();
      open.pop_back();
      for (const std::size_t l : tree[nth(from)]) {
        const ModelLink& link = linked.links[l];
        const std::int32_t to = link.a == from ? link.b : link.a;
        if (linked.reference[nth(to)] >= 0) continue;
        linked.similarity[nth(to)] =
            linked.similarity[nth(from)] * (link.a == from ? link.similarity : link.similarity.inverse());
        linked.reference[nth(to)] = first;
        open.push_back(to);
      }
    }
  }
}

// The misclosure of a link under the similarities of its two models, in b.
SimilarityStep gap(const LinkedModels& linked, const ModelLink& link) {
  return step_of(link.similarity.inverse() *
                 (linked.similarity[nth(link.a)].inverse() * linked.similarity[nth(link.b)]));
}

std::vector<double> link_squares(const LinkedModels& linked) {
  std::vector<double> result;
  for (const ModelLink& link : linked.links) {
    const SimilarityStep e = gap(linked, link);
    result.push_back(e.dot(link.information * e));
  }
  return result;
}

}  // namespace

double inflation(const std::vector<double>& squares, int degrees) {
  return std::max(1.0, median(squares) / chi_square_median(degrees));
}

std::vector<std::uint8_t> LinkedModels::held() const {
  std::vector<std::uint8_t> result(models.size());
  for (std::int32_t m = 0; m < std::ssize(models); ++m) result[nth(m)] = reference[nth(m)] == m;
  return result;
}

double LinkedModels::move(const SimilarityEquations& equations) {
  const std::vector<SimilarityStep> steps = equations.solution();
  double longest = 0;
  for (std::int32_t m = 0; m < std::ssize(models); ++m) longest = std::max(longest, equations.length(m, steps[nth(m)]));
  if (!std::isfinite(longest)) throw ComputeError("assembly: the adjustment of the models does not converge");
  for (std::size_t m = 0; m < steps.size(); ++m) similarity[m] = move_in_model(similarity[m], steps[m]);
  return longest;
}

void LinkedModels::find_parts() {
  DisjointSets joined(static_cast<std::int32_t>(models.size()));
  for (const ModelLink& link : links)
    if (link.kept) joined.unite(link.a, link.b);
  for (std::int32_t m = 0; m < std::ssize(models); ++m) reference[nth(m)] = joined.find(m);
  // A part keeps its shape: all of its models move by the similarity that takes its lowest model to where it was given.
  std::vector<Similarity> back(models.size());
  for (std::int32_t m = 0; m < std::ssize(models); ++m)
    if (reference[nth(m)] == m)
      back[nth(m)] = Similarity{1, Eigen::Quaterniond::Identity(), centre[nth(m)]} * similarity[nth(m)].inverse();
  for (std::int32_t m = 0; m < std::ssize(models); ++m)
    similarity[nth(m)] = reference[nth(m)] == m ? Similarity{1, Eigen::Quaterniond::Identity(), centre[nth(m)]}
                                                : back[nth(reference[nth(m)])] * similarity[nth(m)];
  // A place that models of two parts share is a place of each part; with a single model it says nothing.
  std::vector<SharedPlace> split;
  for (const SharedPlace& place : places) {
    std::map<std::int32_t, SharedPlace> parts;
    for (const auto& entry : place.entries) parts[reference[nth(entry.model)]].entries.push_back(entry);
    for (auto& [first, part] : parts) {
      part.image = place.image;
      if (part.entries.size() > 1) split.push_back(std::move(part));
    }
  }
  places = std::move(split);
}

// Models are sorted by number first. Everything after that goes by rows, and has the same bits in any order of input.
LinkedModels link_models(const std::vector<Model>& models, const LinkOptions& options) {
  LinkedModels linked;
  linked.given.resize(models.size());
  std::iota(linked.given.begin(), linked.given.end(), 0);
  std::sort(linked.given.begin(), linked.given.end(),
            [&](std::int32_t a, std::int32_t b) { return models[nth(a)].number < models[nth(b)].number; });
  for (const std::int32_t m : linked.given) {
    check(models[nth(m)]);
    if (!linked.models.empty() && linked.models.back().number == models[nth(m)].number)
      throw InputError(fmt::format("assembly: model {} is given twice", models[nth(m)].number));
    linked.models.push_back(models[nth(m)]);
    linked.centre.push_back(reduce(linked.models.back()));
  }
  linked.places = shared_places(linked.models);
  find_links(linked, options);
  chain(linked, options);
  return linked;
}

void average_links(LinkedModels& linked, const LinkOptions& options) {
  constexpr int kIterations = 100;
  constexpr double kSettled = 1e-3;  // sigmas
  const double narrow = chi_square_quantile(0.01, 7);
  SimilarityEquations equations(linked.held());
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const std::vector<double> squares = link_squares(linked);
    const double width = narrow * inflation(squares, 7);
    equations.clear();
    for (std::size_t l = 0; l < linked.links.size(); ++l) {
      const ModelLink& link = linked.links[l];
      const SimilarityStep e = gap(linked, link);
      // The weight of Geman and McClure. It has no corner, so that weights change smoothly from one iteration to the
      // next.
      const double weight = std::pow(1 + squares[l] / width, -2);
      const Block7 through = step_through(link.similarity), weighted = weight * link.information;
      // e changes by xi_b - T xi_a, so that the rows of b have P and those of a -T'P.
      equations.add(link.b, link.b, weighted);
      equations.add(link.a, link.a, through.transpose() * weighted * through);
      equations.add(link.b, link.a, -weighted * through);
      equations.add(link.a, link.b, -through.transpose() * weighted);
      equations.add(link.b, -weighted * e);
      equations.add(link.a, through.transpose() * weighted * e);
    }
    if (equations.factorise() >= 0)
      throw ComputeError("assembly: the models' links do not determine their similarities");
    if (linked.move(equations) < kSettled * std::sqrt(width / narrow)) break;
  }
  const std::vector<double> squares = link_squares(linked);
  const double limit = inflation(squares, 7) * chi_square_quantile(options.rejection_probability, 7);
  for (std::size_t l = 0; l < linked.links.size(); ++l) linked.links[l].kept = squares[l] <= limit;
  linked.find_parts();
}

}  // namespace megablock
