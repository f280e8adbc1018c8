// Eliminates the places from the normal equations. With J = by_model_step(z) the derivative of S^-1 X by the step of
// its model, z = S^-1 X, the residual r of an entry changes by J xi + (R'/s) dX. The normal matrix of X is (sum 1 / (s
// sigma)^2) I, the `weight` of its Mean, and the eliminated equations are
//
//     N_mm += w J'J,   N_mn -= B_m B_n' / weight,   B_m = w / s J'R',   w = 1 / sigma^2
//
// X itself is the weighted mean of S x, so that the right side has no term of X. Attitudes are treated in the same way:
// Log(Q'A R) changes by w + R' da.
//
// The test of an entry. The residual of an entry from the weighted mean of all has the variance sigma^2 (1 - w / sum
// w). Its square over that is chi-square with three degrees of freedom, up to the factor by which all stated sigmas are
// too small (inflation()).
#include "adjust/independent_models/place_adjustment.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "adjust/independent_models/similarity_equations.h"
#include "geometry/numbers/chi_square.h"
#include "geometry/transform/rotation.h"
#include "io/base/disjoint_sets.h"
#include "io/evaluation/parts.h"

namespace megablock {
namespace {

class PlaceEquations {
 public:
  PlaceEquations(LinkedModels& linked, const PlaceAdjustmentOptions& options) : linked_(linked), options_(options) {}

  PlaceAdjustment run() {
    constexpr double kSettled = 1e-6;  // sigmas
    const std::vector<std::int32_t> as_linked = linked_.reference;
    SimilarityEquations equations(linked_.held());
    result_.converged = false;
    while (result_.iterations < options_.max_iterations && !result_.converged) {
      // Verdicts stay in the second half, so that the iteration comes to an end.
      const std::int64_t changed = result_.iterations < options_.max_iterations / 2 ? screen() : 0;
      ++result_.iterations;
      factorise(equations);
      result_.converged = linked_.move(equations) < kSettled && changed == 0;
    }
    factorise(equations);
    find_lost(as_linked);
    if (options_.covariances) result_.covariance = equations.covariances();
    return result_;
  }

 private:
  // The position and the attitude of a place, as means of the kept entries.
  struct Mean {
    Eigen::Vector3d position;
    Eigen::Quaterniond rotation;
    double weight = 0, rotation_weight = 0;
  };
  // X = sum w S x / sum w with w = 1 / (s sigma)^2. The attitude starts at that of the first kept entry.
  Mean mean(const SharedPlace& place) const {
    Mean m{Eigen::Vector3d::Zero(), Eigen::Quaterniond::Identity(), 0, 0};
    for (const auto& e : place.entries) {
      if (!e.kept) continue;
      if (m.weight == 0 && place.image) m.rotation = e.rotation * linked_.similarity[nth(e.model)].rotation.conjugate();
      m.position += weight(e) * linked_.similarity[nth(e.model)](e.position);
      m.weight += weight(e);
      m.rotation_weight += rotation_weight(e);
    }
    m.position /= m.weight;
    // The mean of rotations that differ by little: three iterations bring it to rounding.
    for (int iteration = 0; iteration < 3 && place.image; ++iteration) {
      Eigen::Vector3d turn = Eigen::Vector3d::Zero();
      for (const auto& e : place.entries)
        if (e.kept)
          turn += rotation_weight(e) / m.rotation_weight *
                  rotation_log<double>(m.rotation.conjugate() * e.rotation *
                                       linked_.similarity[nth(e.model)].rotation.conjugate());
      m.rotation = rotation_update(m.rotation, turn);
    }
    return m;
  }
  double weight(const SharedPlace::Entry& e) const {
    const double sigma = e.sigma * linked_.similarity[nth(e.model)].scale;
    return 1 / (sigma * sigma);
  }
  static double rotation_weight(const SharedPlace::Entry& e) {
    return e.rotation_sigma > 0 ? 1 / (e.rotation_sigma * e.rotation_sigma) : 0;
  }
  Eigen::Vector3d in_model(const SharedPlace::Entry& e, const Eigen::Vector3d& position) const {
    const Similarity& s = linked_.similarity[nth(e.model)];
    return s.rotation.conjugate() * (position - s.translation) / s.scale;
  }
  Eigen::Vector3d turn_in_model(const SharedPlace::Entry& e, const Eigen::Quaterniond& rotation) const {
    return rotation_log<double>(e.rotation.conjugate() * rotation * linked_.similarity[nth(e.model)].rotation);
  }

  // The squared misfits of an entry, relative to their expectation if the similarities were known.
  struct Misfit {
    double place = 0, turn = 0;
  };
  Misfit misfit(const SharedPlace::Entry& e, const Mean& m) const {
    // A single entry has no residual and no variance.
    constexpr double kAlone = 1e-12;
    const double free = std::max(kAlone, 1 - weight(e) / m.weight);
    Misfit result{(in_model(e, m.position) - e.position).squaredNorm() / (e.sigma * e.sigma * free)};
    if (e.rotation_sigma > 0) {
      const double turn_free = std::max(kAlone, 1 - rotation_weight(e) / m.rotation_weight);
      result.turn = turn_in_model(e, m.rotation).squaredNorm() * rotation_weight(e) / turn_free;
    }
    return result;
  }
  // The limits for good places and attitudes.
  Misfit limits() const {
    std::vector<double> all_places, turns;
    for (const SharedPlace& place : linked_.places) {
      if (!any_kept(place)) continue;
      const Mean m = mean(place);
      for (const auto& e : place.entries) {
        if (!e.kept) continue;
        const Misfit misfit = this->misfit(e, m);
        all_places.push_back(misfit.place);
        if (place.image) turns.push_back(misfit.turn);
      }
    }
    const double good = chi_square_quantile(options_.rejection_probability, 3);
    return {good * inflation(all_places, 3), good * inflation(turns, 3)};
  }

  // Tests every entry anew and returns how many changed.
  std::int64_t screen() {
    const Misfit limit = limits();
    std::int64_t changed = 0;
    for (SharedPlace& place : linked_.places) {
      const std::vector<SharedPlace::Entry> before = place.entries;
      for (auto& e : place.entries) e.kept = true;
      // One outlier pulls the mean, so that good entries may fail as well. Only the worst one is left out at a time.
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
        // An entry alone says nothing of two models.
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

  // Factorises the equations. Where they leave similarities undetermined, models are taken apart until they no longer
  // do.
  void factorise(SimilarityEquations& equations) {
    linearise(equations);
    for (std::int32_t open; (open = equations.factorise()) >= 0;) {
      take_apart(open);
      equations.hold(linked_.held());
      linearise(equations);
    }
  }

  // Breaks the links between models that fewer than seven common equations per pair connect. If there are none, the
  // open model loses all its links.
  void take_apart(std::int32_t open) {
    std::map<std::pair<std::int32_t, std::int32_t>, int> common;
    for (const SharedPlace& place : linked_.places)
      for (std::size_t i = 0; i < place.entries.size(); ++i)
        for (std::size_t j = i + 1; j < place.entries.size(); ++j)
          if (place.entries[i].kept && place.entries[j].kept)
            common[{place.entries[i].model, place.entries[j].model}] += place.image ? 6 : 3;
    DisjointSets joined(static_cast<std::int32_t>(linked_.models.size()));
    for (const auto& [pair, equations] : common)
      // A similarity has seven unknowns.
      if (equations >= 7) joined.unite(pair.first, pair.second);
    bool split = false;
    for (ModelLink& link : linked_.links) {
      if (!link.kept || joined.find(link.a) == joined.find(link.b)) continue;
      link.kept = false;
      split = true;
    }
    for (ModelLink& link : linked_.links)
      if (!split && (link.a == open || link.b == open)) link.kept = false;
    linked_.find_parts();
  }

  // The largest piece of a part represents the part; the models of the other pieces are lost.
  void find_lost(const std::vector<std::int32_t>& as_linked) {
    std::map<std::int32_t, std::map<std::int32_t, int>> pieces;
    for (std::size_t m = 0; m < as_linked.size(); ++m) ++pieces[as_linked[m]][linked_.reference[m]];
    for (std::size_t m = 0; m < as_linked.size(); ++m) {
      const auto& of_part = pieces[as_linked[m]];
      const auto largest = std::max_element(of_part.begin(), of_part.end(),
                                            [](const auto& a, const auto& b) { return a.second < b.second; });
      if (linked_.reference[m] != largest->first) result_.lost.push_back(linked_.models[m].number);
    }
  }

  // Adds the reduced equations of every place with kept entries, at the present similarities, and counts squares and
  // redundancy: a place of n entries has 3 (n - 1) equations, or 6 (n - 1) with attitudes; a model that is not held has
  // seven unknowns.
  void linearise(SimilarityEquations& equations) {
    equations.clear();
    result_.weighted_squares = 0;
    result_.redundancy = 0;
    for (std::int32_t m = 0; m < std::ssize(linked_.models); ++m)
      result_.redundancy -= linked_.reference[nth(m)] == m ? 0 : 7;
    struct WeightedRows {
      std::int32_t model;
      Eigen::Matrix<double, 7, 3> by_place, by_attitude;  // J' W B
    };
    std::vector<WeightedRows> rows;
    for (const SharedPlace& place : linked_.places) {
      if (!any_kept(place)) continue;
      const Mean m = mean(place);
      rows.clear();
      for (const auto& e : place.entries) {
        if (!e.kept) continue;
        const Similarity& s = linked_.similarity[nth(e.model)];
        const Eigen::Matrix3d back = s.rotation.conjugate().toRotationMatrix();
        const Eigen::Vector3d z = in_model(e, m.position), r = z - e.position;
        const Eigen::Matrix<double, 3, 7> by_step = by_model_step(z);
        const double w = 1 / (e.sigma * e.sigma);
        Block7 own = w * by_step.transpose() * by_step;
        SimilarityStep right = -w * by_step.transpose() * r;
        WeightedRows row{e.model, w / s.scale * by_step.transpose() * back, Eigen::Matrix<double, 7, 3>::Zero()};
        result_.weighted_squares += w * r.squaredNorm();
        if (place.image) {
          // Attitudes are free of position and scale: they add to the rotation of the model alone.
          const double v = rotation_weight(e);
          const Eigen::Vector3d turn = turn_in_model(e, m.rotation);
          own.topLeftCorner<3, 3>().diagonal().array() += v;
          right.head<3>() -= v * turn;
          row.by_attitude.topRows<3>() = v * back;
          result_.weighted_squares += v * turn.squaredNorm();
        }
        equations.add(e.model, e.model, own);
        equations.add(e.model, right);
        rows.push_back(row);
      }
      result_.redundancy += (place.image ? 6 : 3) * (std::ssize(rows) - 1);
      for (const WeightedRows& i : rows)
        for (const WeightedRows& j : rows) {
          Block7 block = -i.by_place * j.by_place.transpose() / m.weight;
          if (place.image) block -= i.by_attitude * j.by_attitude.transpose() / m.rotation_weight;
          equations.add(i.model, j.model, block);
        }
    }
  }

  LinkedModels& linked_;
  const PlaceAdjustmentOptions& options_;
  PlaceAdjustment result_;
};

}  // namespace

PlaceAdjustment adjust_places(LinkedModels& linked, const PlaceAdjustmentOptions& options) {
  return PlaceEquations(linked, options).run();
}

}  // namespace megablock
