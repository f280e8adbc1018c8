// Simulates models in a grid, each in its own coordinate system: points and images that neighbours share, with
// noise, wrong points and wrong links. Counts how many of these an assembly finds.
#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <random>
#include <set>

#include "adjust/independent_models/model_assembly.h"
#include "geometry/transform/rotation.h"
#include "tests/spec/reached.h"

namespace megablock::model_grid {

struct Options {
  int rows = 4, columns = 4;
  double side = 2000, overlap = 0.2;
  double images_per_side = 16;  // of a model; 0: none
  double points_per_side = 20;
  double relief = 100;
  double sigma = 0.1, rotation_sigma = 1e-4;  // units, rad
  double wrong_points = 0, wrong_links = 0;   // shares
  unsigned seed = 33;
};

struct Errors {
  double corner = 0, corner_rms = 0, scale = 0, normalised = 0;
  double mean_squares = 0;  // of corners in the metric of their covariance, over three
};

class ModelGrid {
 public:
  explicit ModelGrid(const Options& options) : options_(options), random_(options.seed) {
    const int count = options.rows * options.columns;
    const double step = options.side * (1 - options.overlap);
    for (int m = 0; m < count; ++m) {
      models.push_back({100 + m, {}, {}});
      gauges.push_back(
          {std::exp(uniform(-1, 1)), rotation_exp<double>(uniform(0, 3.1) * direction()), 1e5 * direction()});
      corners_.push_back({step * (m % options.columns), step * (m / options.columns), 0});
    }
    const double width = step * (options.columns - 1) + options.side, height = step * (options.rows - 1) + options.side;
    add_points(width, height);
    add_images(width, height);
    for (const auto& [pair, shared] : shared_) links.insert(pair);
    spoil_points();
    spoil_links();
  }

  std::vector<Model> models;
  std::vector<Similarity> gauges;  // common frame -> model
  std::set<std::pair<int, int>> links, wrong;

  // In the frame of the first model. Models of other parts than that of the first count as infinitely far off.
  Errors errors(const AssembledModels& found) const {
    Errors e;
    int corners = 0;
    for (std::size_t m = 0; m < models.size(); ++m) {
      const Similarity& s = found.similarity[m];
      const Similarity truth = gauges[0] * gauges[m].inverse();
      if (found.part[m] != models[0].number) return {INFINITY, INFINITY, INFINITY, INFINITY, INFINITY};
      keep_largest(e.scale, std::abs(s.scale / truth.scale - 1));
      for (int c = 0; c < 4; ++c, ++corners) {
        const Eigen::Vector3d x =
            gauges[m](corners_[m] + options_.side * Eigen::Vector3d(c % 2, static_cast<double>(c / 2), 0));
        const Eigen::Vector3d error = s(x) - truth(x);
        keep_largest(e.corner, error.norm() / gauges[0].scale);
        e.corner_rms += error.squaredNorm() / std::pow(gauges[0].scale, 2);
        if (m == 0 || found.covariance.empty()) continue;
        const Eigen::Matrix3d turn = s.scale * s.rotation.toRotationMatrix();
        Eigen::Matrix<double, 3, 7> by_step;
        by_step << -turn * skew(x), turn * x, Eigen::Matrix3d::Identity();
        const Eigen::Matrix3d covariance = by_step * found.covariance[m] * by_step.transpose();
        const double squares = error.dot(covariance.ldlt().solve(error));
        keep_largest(e.normalised, std::sqrt(squares));
        e.mean_squares += squares / (12.0 * static_cast<double>(models.size() - 1));
      }
    }
    e.corner_rms = std::sqrt(e.corner_rms / corners);
    return e;
  }

  int wrong_links_kept(const AssembledModels& found) const { return count(found, true, true); }
  int right_links_removed(const AssembledModels& found) const { return count(found, false, false); }
  int right_links_found(const AssembledModels& found) const { return count(found, false, true); }

  double images_per_model() const {
    return mean([](const Model& m) { return m.images.size(); });
  }
  double points_per_model() const {
    return mean([](const Model& m) { return m.points.size(); });
  }

  // Place of each model in shuffled(seed).
  std::vector<std::size_t> place_when_shuffled(unsigned seed) const {
    std::vector<std::size_t> place(models.size());
    std::iota(place.begin(), place.end(), std::size_t{0});
    std::mt19937_64 random(seed);
    std::shuffle(place.begin(), place.end(), random);
    return place;
  }
  std::vector<Model> shuffled(unsigned seed) const {
    std::vector<Model> result(models.size());
    const auto place = place_when_shuffled(seed);
    for (std::size_t m = 0; m < models.size(); ++m) result[place[m]] = models[m];
    std::mt19937_64 random(seed + 1);
    for (Model& model : result) {
      std::shuffle(model.points.begin(), model.points.end(), random);
      std::shuffle(model.images.begin(), model.images.end(), random);
    }
    return result;
  }

 private:
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  Eigen::Vector3d normal() {
    std::normal_distribution<double> gauss;
    const double x = gauss(random_), y = gauss(random_), z = gauss(random_);
    return {x, y, z};
  }
  Eigen::Vector3d direction() { return normal().normalized(); }

  template <typename Size>
  double mean(Size size) const {
    double sum = 0;
    for (const Model& model : models) sum += static_cast<double>(size(model));
    return sum / static_cast<double>(models.size());
  }

  std::vector<int> models_at(const Eigen::Vector3d& x) const {
    std::vector<int> result;
    for (std::size_t m = 0; m < models.size(); ++m) {
      const Eigen::Vector3d inside = x - corners_[m];
      if (inside.x() >= 0 && inside.y() >= 0 && inside.x() <= options_.side && inside.y() <= options_.side)
        result.push_back(static_cast<int>(m));
    }
    return result;
  }
  void share(const std::vector<int>& at, bool image) {
    for (const int a : at)
      for (const int b : at)
        if (a < b) {
          const auto last = [&](int m) {
            return (image ? models[row(m)].images.size() : models[row(m)].points.size()) - 1;
          };
          shared_[{a, b}].push_back({image, last(b), at.size() == 2});
        }
  }
  static std::size_t row(int m) { return static_cast<std::size_t>(m); }

  void add_points(double width, double height) {
    const double area = options_.side * options_.side / (options_.points_per_side * options_.points_per_side);
    const auto count = static_cast<std::int64_t>(width * height / area);
    for (std::int64_t p = 0; p < count; ++p) {
      const Eigen::Vector3d x(uniform(0, width), uniform(0, height), options_.relief * uniform(-1, 1));
      const std::vector<int> at = models_at(x);
      for (const int m : at)
        models[row(m)].points.push_back(
            {p, gauges[row(m)](x + options_.sigma * normal()), options_.sigma * gauges[row(m)].scale});
      share(at, false);
    }
    next_point_ = count;
  }
  void add_images(double width, double height) {
    if (options_.images_per_side == 0) return;
    const double spacing = options_.side / options_.images_per_side;
    std::int64_t number = 0;
    for (double y = 0.5 * spacing; y < height; y += spacing)
      for (double x = 0.5 * spacing; x < width; x += spacing, ++number) {
        const Pose truth{rotation_exp<double>(uniform(0, 3) * direction()), {x, y, 500 + 20 * uniform(-1, 1)}};
        const std::vector<int> at = models_at(truth.centre);
        for (const int m : at) {
          Pose pose = gauges[row(m)](truth);
          pose.centre += options_.sigma * gauges[row(m)].scale * normal();
          pose.rotation = rotation_update(pose.rotation, options_.rotation_sigma * normal());
          models[row(m)].images.push_back(
              {number, pose, options_.sigma * gauges[row(m)].scale, options_.rotation_sigma});
        }
        share(at, true);
      }
  }

  // In one of the models that hold it.
  void spoil_points() {
    std::set<std::int64_t> shared;
    for (const auto& [pair, places] : shared_)
      for (const Shared& place : places)
        if (!place.image) shared.insert(models[row(pair.second)].points[place.row].number);
    std::map<std::int64_t, std::vector<ModelPoint*>> at;
    for (Model& model : models)
      for (ModelPoint& p : model.points)
        if (shared.contains(p.number)) at[p.number].push_back(&p);
    for (auto& [number, entries] : at) {
      if (uniform(0, 1) >= options_.wrong_points) continue;
      ModelPoint& p = *entries[random_() % entries.size()];
      p.position += uniform(0, 0.5) * options_.side / options_.sigma * p.sigma * direction();
    }
  }

  void spoil_links() {
    const auto count = static_cast<std::size_t>(options_.wrong_links * static_cast<double>(links.size()));
    std::vector<std::pair<int, int>> all;  // links of two models alone, for the most part
    for (const auto& [pair, places] : shared_)
      if (2 * std::count_if(places.begin(), places.end(), [](const Shared& s) { return s.only; }) > std::ssize(places))
        all.push_back(pair);
    while (wrong.size() < count / 2) {
      const auto pair = all[random_() % all.size()];
      if (!wrong.insert(pair).second) continue;
      const Similarity other = elsewhere(pair.second);
      for (const Shared& place : shared_[pair]) {
        if (!place.only) continue;
        Model& model = models[row(pair.second)];
        if (place.image)
          model.images[place.row].pose = other(model.images[place.row].pose);
        else
          model.points[place.row].position = other(model.points[place.row].position);
      }
    }
    constexpr int kFalse = 60;  // points
    while (wrong.size() < count) {
      const int a = static_cast<int>(random_() % models.size()), b = static_cast<int>(random_() % models.size());
      if (a >= b || links.contains({a, b}) || !wrong.insert({a, b}).second) continue;
      const Similarity other = elsewhere(b);
      for (int i = 0; i < kFalse; ++i, ++next_point_) {
        const Eigen::Vector3d inside(uniform(0, 1) * options_.side, uniform(0, 0.2) * options_.side,
                                     options_.relief * uniform(-1, 1));
        for (const int m : {a, b}) {
          const Similarity& gauge = gauges[row(m)];
          Eigen::Vector3d x = gauge(corners_[row(m)] + inside + options_.sigma * normal());
          if (m == b) x = other(x);
          models[row(m)].points.push_back({next_point_, x, options_.sigma * gauge.scale});
        }
      }
    }
  }

  // A motion of a model about its middle that no noise makes.
  Similarity elsewhere(int m) {
    const Similarity& gauge = gauges[row(m)];
    const Eigen::Vector3d middle = gauge(corners_[row(m)] + 0.5 * options_.side * Eigen::Vector3d(1, 1, 0));
    Similarity s{std::exp(uniform(-0.2, 0.2)), rotation_exp<double>(0.3 * direction()), {}};
    s.translation = middle - s.scale * (s.rotation * middle) + 0.1 * options_.side * gauge.scale * direction();
    return s;
  }

  int count(const AssembledModels& found, bool is_wrong, bool kept) const {
    int result = 0;
    for (const ModelLink& link : found.links)
      result += wrong.contains(std::minmax(link.a, link.b)) == is_wrong && link.kept == kept;
    return result;
  }

  struct Shared {
    bool image;
    std::size_t row;  // of the second model
    bool only;        // no third model holds it
  };
  Options options_;
  std::mt19937_64 random_;
  std::vector<Eigen::Vector3d> corners_;
  std::map<std::pair<int, int>, std::vector<Shared>> shared_;
  std::int64_t next_point_ = 0;
};

}  // namespace megablock::model_grid
