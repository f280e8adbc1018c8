// Consecutive numbers of the features that have matches, so that tables of them are as long as there are any: of the
// features of an image one in ten or fewer is matched. Numbers ascend by image, then by row.
//
// Memory: one bit per feature up to an image's last matched row, and 6 % more; about 1 bit per matched feature.
#pragma once

#include <cstdint>
#include <vector>

#include "io/base/index.h"

namespace megablock {

using FeatureNumber = std::uint32_t;  // at most 4.29e9 matched features in a block

class MatchedFeatures {
 public:
  explicit MatchedFeatures(std::size_t images) : images_(images) {}

  // Before number(). Rows in any order, any number of times. InputError for images and rows that cannot be.
  void mark(ImageIndex image, const std::vector<std::int32_t>& rows);
  // Once, after all are marked. InputError where there are too many.
  void number();

  std::int64_t count() const { return begin_.empty() ? 0 : begin_.back(); }
  std::size_t image_count() const { return images_.size(); }
  FeatureNumber number_of(ImageIndex image, std::int32_t row) const;  // of a marked one
  ImageIndex image_of(FeatureNumber number) const;
  std::int32_t row_of(FeatureNumber number) const;

 private:
  // Marked rows as bits, and how many are marked before each group of 8 words.
  struct Image {
    std::vector<std::uint64_t> words;
    std::vector<std::uint32_t> before;
  };
  IndexedVector<ImageIndex, Image> images_;
  std::vector<std::int64_t> begin_;        // [images + 1] numbers of each image
  std::vector<std::uint32_t> image_hint_;  // image of every 64th number
};

}  // namespace megablock
