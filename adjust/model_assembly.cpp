#include "adjust/model_assembly.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "adjust/shared_places.h"
#include "adjust/similarity_equations.h"
#include "geometry/chi_square.h"
#include "geometry/median.h"
#include "geometry/rotation.h"
#include "io/disjoint_sets.h"
#include "io/error.h"

namespace megablock {

void AssemblyOptions::check() const {
  links.check();
  if (max_iterations < 1) throw InputError("assembly: max_iterations must be at least 1");
}

namespace {

// Median of a chi-square variable.
double chi_square_median(int degrees) { return chi_square_quantile(0.5, degrees); }

// How many times larger than their sigmas say squares of these degrees of freedom are, by their median; at least 1.
double inflation(const std::vector<double>& squares, int degrees) {
  return std::max(1.0, median(squares) / chi_square_median(degrees));
}

// With M: x -> s R x + t from another frame, a step xi of that frame's target is this times xi in the other frame.
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

// Models by their numbers, what they hold by its number and about its centroid.
class Assembly {
 public:
  Assembly(const std::vector<Model>& models, const AssemblyOptions& options)
      : options_(options), row_of_(models.size()) {
    std::iota(row_of_.begin(), row_of_.end(), 0);
    std::sort(row_of_.begin(), row_of_.end(),
              [&](std::int32_t a, std::int32_t b) { return models[nth(a)].number < models[nth(b)].number; });
    for (const std::int32_t m : row_of_) {
      check(models[nth(m)]);
      if (!models_.empty() && models_.back().number == models[nth(m)].number)
        throw InputError(fmt::format("assembly: model {} is given twice", models[nth(m)].number));
      models_.push_back(models[nth(m)]);
      reduce(models_.back());
    }
    places_ = shared_places(models_);
  }

  AssembledModels run() {
    find_links();
    chain();
    if (options_.joint) {
      average_links();
      find_parts();
      adjust();
    }
    return result();
  }

 private:
  void reduce(Model& model) {
    const auto by_number = [](const auto& a, const auto& b) { return a.number < b.number; };
    std::sort(model.points.begin(), model.points.end(), by_number);
    std::sort(model.images.begin(), model.images.end(), by_number);
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    const auto count = static_cast<double>(model.points.size() + model.images.size());
    for (const ModelPoint& p : model.points) centre += p.position / count;
    for (const ModelImage& i : model.images) centre += i.pose.centre / count;
    for (ModelPoint& p : model.points) p.position -= centre;
    for (ModelImage& i : model.images) i.pose.centre -= centre;
    centres_.push_back(centre);
  }

  void find_links() {
    std::map<std::pair<std::int32_t, std::int32_t>, SharedRows> shared;
    for (const SharedPlace& place : places_)
      for (std::size_t i = 0; i < place.entries.size(); ++i)
        for (std::size_t j = i + 1; j < place.entries.size(); ++j) {
          SharedRows& rows = shared[{place.entries[i].model, place.entries[j].model}];
          (place.image ? rows.images : rows.points).emplace_back(place.entries[i].row, place.entries[j].row);
        }
    for (const auto& [models, rows] : shared)
      if (const auto link = fit_model_link(models_, models.first, models.second, rows, options_.links))
        links_.push_back(*link);
  }

  // Agreeing points times the share of triangles that close, one half without triangles.
  std::vector<double> trust() const {
    std::map<std::pair<std::int32_t, std::int32_t>, std::size_t> link_of;
    std::vector<std::vector<std::int32_t>> above(models_.size());  // linked models of higher row, ascending
    std::vector<Block7> covariances;
    for (std::size_t l = 0; l < links_.size(); ++l) {
      link_of[{links_[l].a, links_[l].b}] = l;
      above[nth(links_[l].a)].push_back(links_[l].b);
      covariances.push_back(links_[l].information.inverse());
    }
    struct Triangle {
      std::array<std::size_t, 3> links;
      double squares;
    };
    std::vector<Triangle> triangles;
    for (std::size_t ab = 0; ab < links_.size(); ++ab) {
      const std::int32_t a = links_[ab].a, b = links_[ab].b;
      for (const std::int32_t c : above[nth(b)]) {
        const auto found = link_of.find({a, c});
        if (found == link_of.end()) continue;
        const std::size_t ac = found->second, bc = link_of.at({b, c});
        // c -> b -> a -> c, in c.
        const Similarity loop = links_[ac].similarity.inverse() * (links_[ab].similarity * links_[bc].similarity);
        const Block7 through = step_through(links_[bc].similarity);
        const Block7 covariance = covariances[bc] + covariances[ac] + through * covariances[ab] * through.transpose();
        const SimilarityStep gap = step_of(loop);
        triangles.push_back({{ab, ac, bc}, gap.dot(covariance.ldlt().solve(gap))});
      }
    }
    std::vector<double> squares;
    for (const Triangle& t : triangles) squares.push_back(t.squares);
    const double limit = inflation(squares, 7) * chi_square_quantile(options_.links.rejection_probability, 7);
    std::vector<int> count(links_.size(), 0), closed(links_.size(), 0);
    for (const Triangle& t : triangles)
      for (const std::size_t l : t.links) ++count[l], closed[l] += t.squares <= limit;
    std::vector<double> result(links_.size());
    for (std::size_t l = 0; l < links_.size(); ++l) result[l] = links_[l].agreeing * (closed[l] + 0.5) / (count[l] + 1);
    return result;
  }

  // Spanning tree of the most trusted links, from the lowest model of each part.
  void chain() {
    const std::vector<double> value = trust();
    std::vector<std::size_t> order(links_.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](std::size_t i, std::size_t j) { return value[i] > value[j]; });
    DisjointSets joined(static_cast<std::int32_t>(models_.size()));
    std::vector<std::vector<std::size_t>> tree(models_.size());
    for (const std::size_t l : order)
      if (joined.unite(links_[l].a, links_[l].b))
        for (const std::int32_t m : {links_[l].a, links_[l].b}) tree[nth(m)].push_back(l);
    similarity_.assign(models_.size(), Similarity());
    reference_.assign(models_.size(), -1);
    for (std::int32_t first = 0; first < std::ssize(models_); ++first) {
      if (reference_[nth(first)] >= 0) continue;
      reference_[nth(first)] = first;
      similarity_[nth(first)].translation = centres_[nth(first)];
      for (std::vector<std::int32_t> open{first}; !open.empty();) {
        const std::int32_t from = open.back();
        open.pop_back();
        for (const std::size_t l : tree[nth(from)]) {
          const ModelLink& link = links_[l];
          const std::int32_t to = link.a == from ? link.b : link.a;
          if (reference_[nth(to)] >= 0) continue;
          similarity_[nth(to)] =
              similarity_[nth(from)] * (link.a == from ? link.similarity : link.similarity.inverse());
          reference_[nth(to)] = first;
          open.push_back(to);
        }
      }
    }
  }

  std::vector<std::uint8_t> held() const {
    std::vector<std::uint8_t> result(models_.size());
    for (std::int32_t m = 0; m < std::ssize(models_); ++m) result[nth(m)] = reference_[nth(m)] == m;
    return result;
  }

  void move(const std::vector<SimilarityStep>& steps) {
    for (std::size_t m = 0; m < steps.size(); ++m) similarity_[m] = move_in_model(similarity_[m], steps[m]);
  }

  // What the models' similarities say of a link that they do not agree in, in b.
  SimilarityStep gap(const ModelLink& link) const {
    return step_of(link.similarity.inverse() * (similarity_[nth(link.a)].inverse() * similarity_[nth(link.b)]));
  }
  std::vector<double> link_squares() const {
    std::vector<double> result;
    for (const ModelLink& link : links_) {
      const SimilarityStep e = gap(link);
      result.push_back(e.dot(link.information * e));
    }
    return result;
  }

  void average_links() {
    constexpr int kIterations = 100;
    constexpr double kSettled = 1e-3;  // sigmas
    const double narrow = chi_square_quantile(0.01, 7);
    SimilarityEquations equations(held());
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      const std::vector<double> squares = link_squares();
      const double width = narrow * inflation(squares, 7);
      equations.clear();
      for (std::size_t l = 0; l < links_.size(); ++l) {
        const ModelLink& link = links_[l];
        const SimilarityStep e = gap(link);
        const double weight = std::pow(1 + squares[l] / width, -2);
        const Block7 through = step_through(link.similarity), weighted = weight * link.information;
        equations.add(link.b, link.b, weighted);
        equations.add(link.a, link.a, through.transpose() * weighted * through);
        equations.add(link.b, link.a, -weighted * through);
        equations.add(link.a, link.b, -through.transpose() * weighted);
        equations.add(link.b, -weighted * e);
        equations.add(link.a, through.transpose() * weighted * e);
      }
      if (equations.factorise() >= 0)
        throw ComputeError("assembly: the models' links do not determine their similarities");
      if (move_and_measure(equations, equations.solution()) < kSettled * std::sqrt(width / narrow)) break;
    }
    const std::vector<double> squares = link_squares();
    const double limit = inflation(squares, 7) * chi_square_quantile(options_.links.rejection_probability, 7);
    for (std::size_t l = 0; l < links_.size(); ++l) links_[l].kept = squares[l] <= limit;
  }

  // The longest step of a model.
  double move_and_measure(const SimilarityEquations& equations, const std::vector<SimilarityStep>& steps) {
    double longest = 0;
    for (std::int32_t m = 0; m < std::ssize(models_); ++m)
      longest = std::max(longest, equations.length(m, steps[nth(m)]));
    if (!std::isfinite(longest)) throw ComputeError("assembly: the adjustment of the models does not converge");
    move(steps);
    return longest;
  }

  // What hangs together by links that are kept, each part in the frame of its lowest model; places split accordingly.
  void find_parts() {
    DisjointSets joined(static_cast<std::int32_t>(models_.size()));
    for (const ModelLink& link : links_)
      if (link.kept) joined.unite(link.a, link.b);
    for (std::int32_t m = 0; m < std::ssize(models_); ++m) reference_[nth(m)] = joined.find(m);
    std::vector<Similarity> back(models_.size());
    for (std::int32_t m = 0; m < std::ssize(models_); ++m)
      if (reference_[nth(m)] == m)
        back[nth(m)] = Similarity{1, Eigen::Quaterniond::Identity(), centres_[nth(m)]} * similarity_[nth(m)].inverse();
    for (std::int32_t m = 0; m < std::ssize(models_); ++m)
      similarity_[nth(m)] = reference_[nth(m)] == m ? Similarity{1, Eigen::Quaterniond::Identity(), centres_[nth(m)]}
                                                    : back[nth(reference_[nth(m)])] * similarity_[nth(m)];
    std::vector<SharedPlace> split;
    for (const SharedPlace& place : places_) {
      std::map<std::int32_t, SharedPlace> parts;
      for (const auto& entry : place.entries) parts[reference_[nth(entry.model)]].entries.push_back(entry);
      for (auto& [reference, part] : parts) {
        part.image = place.image;
        if (part.entries.size() > 1) split.push_back(std::move(part));
      }
    }
    places_ = std::move(split);
  }

  // A place's position and attitude, from the entries that are kept.
  struct Mean {
    Eigen::Vector3d position;
    Eigen::Quaterniond rotation;
    double weight = 0, rotation_weight = 0;
  };
  Mean mean(const SharedPlace& place) const {
    Mean m{Eigen::Vector3d::Zero(), Eigen::Quaterniond::Identity(), 0, 0};
    for (const auto& e : place.entries) {
      if (!e.kept) continue;
      if (m.weight == 0 && place.image) m.rotation = e.rotation * similarity_[nth(e.model)].rotation.conjugate();
      m.position += weight(e) * similarity_[nth(e.model)](e.position);
      m.weight += weight(e);
      m.rotation_weight += rotation_weight(e);
    }
    m.position /= m.weight;
    for (int iteration = 0; iteration < 3 && place.image; ++iteration) {
      Eigen::Vector3d turn = Eigen::Vector3d::Zero();
      for (const auto& e : place.entries)
        if (e.kept)
          turn += rotation_weight(e) / m.rotation_weight *
                  rotation_log<double>(m.rotation.conjugate() * e.rotation *
                                       similarity_[nth(e.model)].rotation.conjugate());
      m.rotation = rotation_update(m.rotation, turn);
    }
    return m;
  }
  double weight(const SharedPlace::Entry& e) const {
    const double sigma = e.sigma * similarity_[nth(e.model)].scale;
    return 1 / (sigma * sigma);
  }
  static double rotation_weight(const SharedPlace::Entry& e) {
    return e.rotation_sigma > 0 ? 1 / (e.rotation_sigma * e.rotation_sigma) : 0;
  }
  Eigen::Vector3d in_model(const SharedPlace::Entry& e, const Eigen::Vector3d& position) const {
    const Similarity& s = similarity_[nth(e.model)];
    return s.rotation.conjugate() * (position - s.translation) / s.scale;
  }
  Eigen::Vector3d turn_in_model(const SharedPlace::Entry& e, const Eigen::Quaterniond& rotation) const {
    return rotation_log<double>(e.rotation.conjugate() * rotation * similarity_[nth(e.model)].rotation);
  }

  // Squares of the misfit of an entry over their expectation were the similarities known.
  struct Misfit {
    double place = 0, turn = 0;
  };
  Misfit misfit(const SharedPlace::Entry& e, const Mean& m) const {
    constexpr double kAlone = 1e-12;
    const double free = std::max(kAlone, 1 - weight(e) / m.weight);
    Misfit result{(in_model(e, m.position) - e.position).squaredNorm() / (e.sigma * e.sigma * free)};
    if (e.rotation_sigma > 0) {
      const double turn_free = std::max(kAlone, 1 - rotation_weight(e) / m.rotation_weight);
      result.turn = turn_in_model(e, m.rotation).squaredNorm() * rotation_weight(e) / turn_free;
    }
    return result;
  }
  // Limits of good places and attitudes.
  Misfit limits() const {
    std::vector<double> all_places, turns;
    for (const SharedPlace& place : places_) {
      if (!any_kept(place)) continue;
      const Mean m = mean(place);
      for (const auto& e : place.entries) {
        if (!e.kept) continue;
        const Misfit misfit = this->misfit(e, m);
        all_places.push_back(misfit.place);
        if (place.image) turns.push_back(misfit.turn);
      }
    }
    const double good = chi_square_quantile(options_.links.rejection_probability, 3);
    return {good * inflation(all_places, 3), good * inflation(turns, 3)};
  }

  // Tests every entry anew; how many changed.
  std::int64_t screen() {
    const Misfit limit = limits();
    std::int64_t changed = 0;
    for (SharedPlace& place : places_) {
      const std::vector<SharedPlace::Entry> before = place.entries;
      for (auto& e : place.entries) e.kept = true;
      for (std::size_t left = place.entries.size(); left > 1;) {
        const Mean m = mean(place);
        SharedPlace::Entry* worst = nullptr;
        double largest = 1;
        for (auto& e : place.entries) {
          if (!e.kept) continue;
          const Misfit misfit = this->misfit(e, m);
          const double over = std::max(misfit.place / limit.place, misfit.turn / limit.turn);
          if (over > largest) worst = &e, largest = over;
        }
        if (worst == nullptr) break;
        worst->kept = false;
        if (--left == 1)
          for (auto& e : place.entries) e.kept = false;
      }
      for (std::size_t i = 0; i < before.size(); ++i) changed += before[i].kept != place.entries[i].kept;
    }
    return changed;
  }
  static bool any_kept(const SharedPlace& place) {
    return std::any_of(place.entries.begin(), place.entries.end(), [](const auto& e) { return e.kept; });
  }

  void adjust() {
    constexpr double kSettled = 1e-6;  // sigmas
    const std::vector<std::int32_t> linked = reference_;
    SimilarityEquations equations(held());
    converged_ = false;
    while (iterations_ < options_.max_iterations && !converged_) {
      const std::int64_t changed = iterations_ < options_.max_iterations / 2 ? screen() : 0;
      ++iterations_;
      factorise(equations);
      converged_ = move_and_measure(equations, equations.solution()) < kSettled && changed == 0;
    }
    factorise(equations);
    find_lost(linked);
    if (options_.covariances) covariance_ = equations.covariances();
  }

  // Where they leave similarities open, of fewer models.
  void factorise(SimilarityEquations& equations) {
    linearise(equations);
    for (std::int32_t open; (open = equations.factorise()) >= 0;) {
      take_apart(open);
      equations.hold(held());
      linearise(equations);
    }
  }

  // By the equations that two models still have in common; where that joins them all, the open model goes alone.
  void take_apart(std::int32_t open) {
    std::map<std::pair<std::int32_t, std::int32_t>, int> common;
    for (const SharedPlace& place : places_)
      for (std::size_t i = 0; i < place.entries.size(); ++i)
        for (std::size_t j = i + 1; j < place.entries.size(); ++j)
          if (place.entries[i].kept && place.entries[j].kept)
            common[{place.entries[i].model, place.entries[j].model}] += place.image ? 6 : 3;
    DisjointSets joined(static_cast<std::int32_t>(models_.size()));
    for (const auto& [pair, equations] : common)
      if (equations >= 7) joined.unite(pair.first, pair.second);
    bool split = false;
    for (ModelLink& link : links_) {
      if (!link.kept || joined.find(link.a) == joined.find(link.b)) continue;
      link.kept = false;
      split = true;
    }
    for (ModelLink& link : links_)
      if (!split && (link.a == open || link.b == open)) link.kept = false;
    find_parts();
  }

  // Of each part as it was linked the largest piece is the part, all others are lost to it.
  void find_lost(const std::vector<std::int32_t>& linked) {
    std::map<std::int32_t, std::map<std::int32_t, int>> pieces;
    for (std::size_t m = 0; m < linked.size(); ++m) ++pieces[linked[m]][reference_[m]];
    for (std::size_t m = 0; m < linked.size(); ++m) {
      const auto& of_part = pieces[linked[m]];
      const auto largest = std::max_element(of_part.begin(), of_part.end(),
                                            [](const auto& a, const auto& b) { return a.second < b.second; });
      if (reference_[m] != largest->first) lost_.push_back(models_[m].number);
    }
  }

  void linearise(SimilarityEquations& equations) {
    equations.clear();
    weighted_squares_ = 0;
    redundancy_ = 0;
    for (std::int32_t m = 0; m < std::ssize(models_); ++m) redundancy_ -= reference_[nth(m)] == m ? 0 : 7;
    struct Rows {
      std::int32_t model;
      Eigen::Matrix<double, 7, 3> by_place, by_attitude;  // J' W B
    };
    std::vector<Rows> rows;
    for (const SharedPlace& place : places_) {
      if (!any_kept(place)) continue;
      const Mean m = mean(place);
      rows.clear();
      for (const auto& e : place.entries) {
        if (!e.kept) continue;
        const Similarity& s = similarity_[nth(e.model)];
        const Eigen::Matrix3d back = s.rotation.conjugate().toRotationMatrix();
        const Eigen::Vector3d z = in_model(e, m.position), r = z - e.position;
        const Eigen::Matrix<double, 3, 7> by_step = by_model_step(z);
        const double w = 1 / (e.sigma * e.sigma);
        Block7 own = w * by_step.transpose() * by_step;
        SimilarityStep right = -w * by_step.transpose() * r;
        Rows row{e.model, w / s.scale * by_step.transpose() * back, Eigen::Matrix<double, 7, 3>::Zero()};
        weighted_squares_ += w * r.squaredNorm();
        if (place.image) {
          const double v = rotation_weight(e);
          const Eigen::Vector3d turn = turn_in_model(e, m.rotation);
          own.topLeftCorner<3, 3>().diagonal().array() += v;
          right.head<3>() -= v * turn;
          row.by_attitude.topRows<3>() = v * back;
          weighted_squares_ += v * turn.squaredNorm();
        }
        equations.add(e.model, e.model, own);
        equations.add(e.model, right);
        rows.push_back(row);
      }
      redundancy_ += (place.image ? 6 : 3) * (std::ssize(rows) - 1);
      for (const Rows& i : rows)
        for (const Rows& j : rows) {
          Block7 block = -i.by_place * j.by_place.transpose() / m.weight;
          if (place.image) block -= i.by_attitude * j.by_attitude.transpose() / m.rotation_weight;
          equations.add(i.model, j.model, block);
        }
    }
  }

  AssembledModels result() const {
    AssembledModels result;
    const std::size_t count = models_.size();
    result.similarity.resize(count);
    result.part.resize(count);
    if (!covariance_.empty()) result.covariance.resize(count);
    for (std::size_t m = 0; m < count; ++m) {
      const std::size_t row = nth(row_of_[m]);
      Similarity whole = similarity_[m];
      whole.translation -= whole.scale * (whole.rotation * centres_[m]);
      if (reference_[m] == static_cast<std::int32_t>(m)) whole = Similarity();
      result.similarity[row] = whole;
      result.part[row] = models_[nth(reference_[m])].number;
      if (covariance_.empty()) continue;
      Block7 to_common = Block7::Identity();
      to_common.bottomRightCorner<3, 3>() = whole.scale * whole.rotation.toRotationMatrix();
      result.covariance[row] =
          covariance_about_origin(whole, centres_[m], to_common * covariance_[m] * to_common.transpose());
    }
    for (ModelLink link : links_) {
      Similarity& s = link.similarity;
      s.translation += centres_[nth(link.a)] - s.scale * (s.rotation * centres_[nth(link.b)]);
      // xi about the centroid of b, as of xi about its origin.
      Block7 about_centroid = Block7::Identity();
      about_centroid.bottomLeftCorner<3, 4>() << -skew(centres_[nth(link.b)]), centres_[nth(link.b)];
      link.information = about_centroid.transpose() * link.information * about_centroid;
      link.a = row_of_[nth(link.a)];
      link.b = row_of_[nth(link.b)];
      result.links.push_back(link);
    }
    for (const SharedPlace& place : places_)
      for (const auto& e : place.entries) ++result.shared, result.rejected += !e.kept;
    result.lost = lost_;
    result.iterations = iterations_;
    result.converged = converged_;
    result.redundancy = redundancy_;
    if (redundancy_ > 0) result.sigma0 = std::sqrt(weighted_squares_ / static_cast<double>(redundancy_));
    return result;
  }

  const AssemblyOptions& options_;
  std::vector<std::int32_t> row_of_;  // [models] where it was given
  std::vector<Model> models_;         // by number
  std::vector<Eigen::Vector3d> centres_;
  std::vector<SharedPlace> places_;
  std::vector<ModelLink> links_;
  std::vector<Similarity> similarity_;   // [models] of what is about the centre
  std::vector<std::int32_t> reference_;  // [models] the model whose frame is the part's
  std::vector<Block7> covariance_;       // [models] of xi
  std::vector<std::int64_t> lost_;
  int iterations_ = 0;
  bool converged_ = true;
  double weighted_squares_ = 0;
  std::int64_t redundancy_ = 0;
};

}  // namespace

AssembledModels assemble_models(const std::vector<Model>& models, const AssemblyOptions& options) {
  options.check();
  return Assembly(models, options).run();
}

}  // namespace megablock
