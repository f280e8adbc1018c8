// Reads and writes the features of the images of one shard (docs/reference/file-formats.md, "Features").
#include "io/store/units/features_file.h"

#include <algorithm>

#include "io/base/error.h"
#include "io/store/hdf5/hdf5_tables.h"

namespace megablock {

namespace {

// Of SIFT: 4 x 4 cells with 8 directions each. Global descriptors have as many numbers.
constexpr std::int64_t kDescriptorSize = 128;

void put_images(Hdf5Writer& file, const std::vector<ImageFeatures>& images) {
  std::vector<std::int32_t> size, counts;
  std::vector<float> global, range;
  for (const ImageFeatures& features : images) {
    size.insert(size.end(), {features.width, features.height});
    counts.push_back(static_cast<std::int32_t>(features.keypoints.size()));
    range.insert(range.end(), features.grey_range.begin(), features.grey_range.end());
    global.insert(global.end(), features.global_descriptor.begin(), features.global_descriptor.end());
  }
  file.group("images", "one row per image of the shard");
  file.vector("images/index", column(images, [](const ImageFeatures& f) { return f.image.value; }),
              {"", "image index in the block"});
  file.matrix("images/size", size, 2, {"px", "width, height of the decoded image; 0: it failed"});
  file.vector("images/keypoints", counts, {"", "number of rows of the group 'keypoints', in the order of the images"});
  file.matrix("images/grey_range", range, 2,
              {"", "grey values of the file that all but a thousandth of its pixels keep to on either side"});
  file.matrix("images/global_descriptor", global, kDescriptorSize, {"", "unit norm"});
  file.texts("images/failure", column(images, [](const ImageFeatures& f) { return f.failure; }),
             {"", "why the image has no features; empty when it has"});
}

void put_keypoints(Hdf5Writer& file, const std::vector<ImageFeatures>& images) {
  std::vector<std::int32_t> position;
  std::vector<float> scale, angle;
  std::vector<std::uint8_t> descriptors;
  for (const ImageFeatures& features : images) {
    if (features.keypoints.size() != features.descriptors.size())
      throw ComputeError("image " + std::to_string(features.image.value) + " has " +
                         std::to_string(features.keypoints.size()) + " keypoints but " +
                         std::to_string(features.descriptors.size()) + " descriptors");
    for (const Keypoint& keypoint : features.keypoints) {
      position.insert(position.end(), {keypoint.x, keypoint.y});
      scale.push_back(keypoint.scale_px);
      angle.push_back(keypoint.angle_deg);
    }
    for (const SiftDescriptor& d : features.descriptors) descriptors.insert(descriptors.end(), d.begin(), d.end());
  }
  file.group("keypoints", "one row per keypoint, image after image");
  file.matrix("keypoints/position", position, 2, {"2^-10 px", "x, y; pixel centres at +0.5"});
  file.vector("keypoints/scale", scale, {"px", "diameter of the region"});
  file.vector("keypoints/angle", angle, {"deg", "orientation of the region"});
  file.matrix("keypoints/descriptor", descriptors, kDescriptorSize);
}

}  // namespace

void write_features(const std::string& path, const std::vector<ImageFeatures>& images) {
  Hdf5Writer file(path, "features");
  put_images(file, images);
  put_keypoints(file, images);
  file.close();
}

std::vector<ImageFeatures> read_keypoints(const std::string& path) {
  const Hdf5Reader file(path, "features");
  const auto index = file.vector<std::int64_t>("images/index");
  const auto count = static_cast<std::int64_t>(index.size());
  const auto size = file.matrix<std::int32_t>("images/size", 2, count);
  const auto global = file.matrix<float>("images/global_descriptor", kDescriptorSize, count);
  const auto range = file.matrix<float>("images/grey_range", 2, count);
  const std::vector<std::string> failures = file.texts("images/failure", count);
  const auto scale = file.vector<float>("keypoints/scale");
  const auto rows = static_cast<std::int64_t>(scale.size());
  const auto angle = file.vector<float>("keypoints/angle", rows);
  const auto position = file.matrix<std::int32_t>("keypoints/position", 2, rows);
  const auto begin = begin_of(file, "images/keypoints", file.vector<std::int64_t>("images/keypoints", count), rows);
  std::vector<ImageFeatures> images(index.size());
  for (std::size_t i = 0; i < images.size(); ++i) {
    images[i].image = ImageIndex(index[i]);
    images[i].width = size[2 * i];
    images[i].height = size[2 * i + 1];
    std::copy_n(&global[kDescriptorSize * i], kDescriptorSize, images[i].global_descriptor.begin());
    images[i].grey_range = {range[2 * i], range[2 * i + 1]};
    images[i].failure = failures[i];
    for (auto k = static_cast<std::size_t>(begin[i]); k < static_cast<std::size_t>(begin[i + 1]); ++k)
      images[i].keypoints.push_back({position[2 * k], position[2 * k + 1], scale[k], angle[k]});
  }
  return images;
}

std::vector<ImageFeatures> read_features(const std::string& path) {
  std::vector<ImageFeatures> images = read_keypoints(path);
  const Hdf5Reader file(path, "features");
  std::int64_t rows = 0;
  // Descriptors are most of the file; the readers that compare no images leave them out (read_keypoints).
  for (const ImageFeatures& features : images) rows += static_cast<std::int64_t>(features.keypoints.size());
  const auto descriptors = file.matrix<std::uint8_t>("keypoints/descriptor", kDescriptorSize, rows);
  const std::uint8_t* next = descriptors.data();
  for (ImageFeatures& features : images) {
    features.descriptors.resize(features.keypoints.size());
    for (SiftDescriptor& descriptor : features.descriptors) {
      std::copy_n(next, kDescriptorSize, descriptor.begin());
      next += kDescriptorSize;
    }
  }
  return images;
}

}  // namespace megablock
