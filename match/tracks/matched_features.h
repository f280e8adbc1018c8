// Gives consecutive numbers to the features that have matches. Tables of them are then only as long as needed: at most
// about one in ten features of an image is matched. Numbers ascend by image, then by row.
//
// It is a bit vector with rank and select. Memory: one bit per feature up to the last matched row of an image, plus 6
// %.
#pragma once

#include <cstdint>
#include <vector>

#include "io/base/index.h"

namespace megablock {

using FeatureNumber = std::uint32_t;  // at most 4.29e9 matched features in a block

class MatchedFeatures {
 public:
  explicit MatchedFeatures(std::size_t images) : images_(images) {}

  // Marks the features of an image that have matches, in any order, repeatedly if needed. Call before number(). Throws
  // ComputeError for images and rows that cannot exist.
  void mark(ImageIndex image, const std::vector<std::int32_t>& rows);
  // Assigns the numbers. Call once, after all marks. Throws InputError for more features than a FeatureNumber can
  // count.
  void number();

  std::int64_t count() const { return begin_.empty() ? 0 : begin_.back(); }
  std::size_t image_count() const { return images_.size(); }
  FeatureNumber number_of(ImageIndex image, std::int32_t row) const;  // only for marked features
  ImageIndex image_of(FeatureNumber number) const;
  std::int32_t row_of(FeatureNumber number) const;

 private:
  // The marked rows as bits, and the number of marked rows before each group of 8 words.
  struct Image {
    std::vector<std::uint64_t> words;
    std::vector<std::uint32_t> before;
  };
  IndexedVector<ImageIndex, Image> images_;
  std::vector<std::int64_t> begin_;        // [images + 1] first number of each image
  std::vector<std::uint32_t> image_hint_;  // image of every 64th number, where the search for an image begins
};

}  // namespace megablock
