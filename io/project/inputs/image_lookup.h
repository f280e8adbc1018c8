// Finds the image that a list means by a name: people and programs write names with other folders, in other case,
// without ending, with backslashes or in quotes.
//
// Ways are tried in this order, and the first that finds something counts:
//
//   1. the name as it stands, 2. in other case, 3. without ending or with another one, each of them
//        a. as a whole name, also without the first folders that the list wrote before it ("images/a.jpg" for "a.jpg"),
//        b. as the last part of a name, if the list wrote no folder, or all images of the block lie in one.
//
// So "flight2/a.jpg" is never taken for "flight1/a.jpg". A name that fits several images in the same way is ambiguous.
#pragma once

#include <array>
#include <string>
#include <unordered_map>
#include <vector>

#include "io/block/block.h"

namespace megablock {

class ImageLookup {
 public:
  enum class Kind : std::uint8_t { kImage, kLeftOut, kAbsent, kAmbiguous };
  struct Found {
    Kind kind = Kind::kAbsent;
    ImageIndex image;  // kImage only
  };

  // `left_out`: names of images that are not in the block for a reason that was reported. The block must live as long
  // as the lookup, with the same images.
  ImageLookup(const Block& block, const std::vector<std::string>& left_out);

  Found find(const std::string& written) const;
  bool has(const std::string& name) const;  // exactly, in the block or left out

 private:
  static constexpr int kWays = 3;  // as it stands, in other case, without ending
  struct Names {
    bool made = false;
    std::unordered_map<std::string, Found> whole, last;  // by whole names, and by their last parts
  };

  const Names& names(std::size_t way) const;

  const Block& block_;
  std::vector<std::string> left_out_;
  bool one_folder_ = true;                         // all images of the block lie in one
  mutable std::array<Names, kWays> names_of_way_;  // made when they are first needed: a large block has many names
};

}  // namespace megablock
