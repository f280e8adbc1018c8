// Lists the points and images that two or more models hold, and checks the models.
// Internal to adjust/: it is not installed.
#pragma once

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <tuple>
#include <vector>

#include "adjust/independent_models/model_link.h"
#include "adjust/independent_models/similarity_equations.h"
#include "io/base/error.h"

namespace megablock {

// A point or an image, with its position in each of the models that hold it.
struct SharedPlace {
  struct Entry {
    std::int32_t model, row;  // row of the model's points or images
    Eigen::Vector3d position;
    double sigma;
    Eigen::Quaterniond rotation;
    double rotation_sigma;  // 0 for a point
    bool kept;
  };
  std::vector<Entry> entries;  // ascending by model
  bool image = false;
};

// Throws InputError for numbers that are not finite, sigmas that are not positive, numbers given twice.
inline void check(const Model& model) {
  const auto refuse = [&](const char* what, std::int64_t number, const char* why) {
    throw InputError(fmt::format("assembly: model {}, {} {}: {}", model.number, what, number, why));
  };
  const auto twice = [&](std::vector<std::int64_t> numbers, const char* what) {
    std::sort(numbers.begin(), numbers.end());
    const auto found = std::adjacent_find(numbers.begin(), numbers.end());
    if (found != numbers.end()) refuse(what, *found, "given twice");
  };
  std::vector<std::int64_t> points, images;
  for (const ModelPoint& p : model.points) {
    points.push_back(p.number);
    if (!p.position.allFinite()) refuse("point", p.number, "its position is not finite");
    if (!(p.sigma > 0) || !std::isfinite(p.sigma)) refuse("point", p.number, "its sigma must be positive");
  }
  for (const ModelImage& i : model.images) {
    images.push_back(i.number);
    if (!i.pose.centre.allFinite() || !i.pose.rotation.coeffs().allFinite())
      refuse("image", i.number, "its pose is not finite");
    if (!(i.centre_sigma > 0 && i.rotation_sigma > 0) || !std::isfinite(i.centre_sigma + i.rotation_sigma))
      refuse("image", i.number, "its sigmas must be positive");
  }
  twice(points, "point");
  twice(images, "image");
}

// Lists points, then images, ascending by number. The models that hold one are in their order.
inline std::vector<SharedPlace> shared_places(const std::vector<Model>& models) {
  std::vector<SharedPlace> places;
  struct Key {
    std::int64_t number;
    std::int32_t model, row;
    bool image;
    bool operator<(const Key& k) const { return std::tie(image, number, model) < std::tie(k.image, k.number, k.model); }
  };
  std::vector<Key> keys;
  for (std::int32_t m = 0; m < std::ssize(models); ++m) {
    for (std::int32_t i = 0; i < std::ssize(models[nth(m)].points); ++i)
      keys.push_back({models[nth(m)].points[nth(i)].number, m, i, false});
    for (std::int32_t i = 0; i < std::ssize(models[nth(m)].images); ++i)
      keys.push_back({models[nth(m)].images[nth(i)].number, m, i, true});
  }
  // Points before images, then by number and model: entries of one place are then neighbours.
  std::sort(keys.begin(), keys.end());
  for (std::size_t begin = 0, end = 0; begin < keys.size(); begin = end) {
    SharedPlace place;
    place.image = keys[begin].image;
    for (; end < keys.size() && keys[end].number == keys[begin].number && keys[end].image == place.image; ++end) {
      const Model& model = models[nth(keys[end].model)];
      if (place.image) {
        const ModelImage& i = model.images[nth(keys[end].row)];
        place.entries.push_back(
            {keys[end].model, keys[end].row, i.pose.centre, i.centre_sigma, i.pose.rotation, i.rotation_sigma, true});
      } else {
        const ModelPoint& p = model.points[nth(keys[end].row)];
        place.entries.push_back(
            {keys[end].model, keys[end].row, p.position, p.sigma, Eigen::Quaterniond::Identity(), 0, true});
      }
    }
    if (place.entries.size() > 1) places.push_back(std::move(place));
  }
  return places;
}

}  // namespace megablock
