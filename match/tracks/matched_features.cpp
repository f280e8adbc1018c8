#include "match/tracks/matched_features.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <string>

#include "io/base/error.h"

namespace megablock {

namespace {

constexpr std::size_t kWordBits = 64, kGroupWords = 8, kHintStep = 64;

}  // namespace

void MatchedFeatures::mark(ImageIndex image, const std::vector<std::int32_t>& rows) {
  if (rows.empty()) return;
  const auto [lowest, highest] = std::minmax_element(rows.begin(), rows.end());
  if (!images_.contains(image) || *lowest < 0)
    throw ComputeError("matches of image " + std::to_string(image.value) + ": the image or the feature does not exist");
  // One bit per feature; the vector grows to the largest marked row only.
  std::vector<std::uint64_t>& words = images_[image].words;
  const std::size_t needed = static_cast<std::size_t>(*highest) / kWordBits + 1;
  if (words.size() < needed) words.resize(needed);
  for (const std::int32_t row : rows)
    words[static_cast<std::size_t>(row) / kWordBits] |= std::uint64_t{1} << (static_cast<std::size_t>(row) % kWordBits);
}

void MatchedFeatures::number() {
  // Counts of bits before each group of words make rank a table look-up plus at most eight population counts.
  begin_.assign(1, 0);
  for (Image& image : images_) {
    std::uint32_t in_image = 0;
    for (std::size_t w = 0; w < image.words.size(); ++w) {
      if (w % kGroupWords == 0) image.before.push_back(in_image);
      in_image += static_cast<std::uint32_t>(std::popcount(image.words[w]));
    }
    begin_.push_back(begin_.back() + in_image);
  }
  if (count() > std::numeric_limits<FeatureNumber>::max())
    throw InputError("the block has " + std::to_string(count()) +
                     " matched features, more than 2^32; divide it into blocks that overlap");
  std::size_t image = 0;
  for (std::int64_t number = 0; number < count(); number += kHintStep) {
    while (begin_[image + 1] <= number) ++image;
    image_hint_.push_back(static_cast<std::uint32_t>(image));
  }
}

FeatureNumber MatchedFeatures::number_of(ImageIndex image, std::int32_t row) const {
  const Image& own = images_[image];
  const std::size_t word = static_cast<std::size_t>(row) / kWordBits, group = word / kGroupWords;
  std::uint32_t rank = own.before[group];
  for (std::size_t w = group * kGroupWords; w < word; ++w)
    rank += static_cast<std::uint32_t>(std::popcount(own.words[w]));
  const std::uint64_t below = (std::uint64_t{1} << (static_cast<std::size_t>(row) % kWordBits)) - 1;
  rank += static_cast<std::uint32_t>(std::popcount(own.words[word] & below));
  return static_cast<FeatureNumber>(begin_[static_cast<std::size_t>(image.value)] + rank);
}

ImageIndex MatchedFeatures::image_of(FeatureNumber number) const {
  std::size_t image = image_hint_[number / kHintStep];
  while (begin_[image + 1] <= number) ++image;
  return ImageIndex(static_cast<std::int64_t>(image));
}

std::int32_t MatchedFeatures::row_of(FeatureNumber number) const {
  const ImageIndex image = image_of(number);
  const Image& own = images_[image];
  // Select, the inverse of rank: first the group, then the word, then the bit.
  auto rank = static_cast<std::uint32_t>(number - begin_[static_cast<std::size_t>(image.value)]);
  const auto group = std::upper_bound(own.before.begin(), own.before.end(), rank) - own.before.begin() - 1;
  rank -= own.before[static_cast<std::size_t>(group)];
  std::size_t word = static_cast<std::size_t>(group) * kGroupWords;
  for (std::uint32_t in_word; rank >= (in_word = static_cast<std::uint32_t>(std::popcount(own.words[word]))); ++word)
    rank -= in_word;
  std::uint64_t bits = own.words[word];
  for (; rank > 0; --rank) bits &= bits - 1;  // clears the lowest bit
  return static_cast<std::int32_t>(word * kWordBits) + std::countr_zero(bits);
}

}  // namespace megablock
