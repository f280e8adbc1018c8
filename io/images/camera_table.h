// Reads tables that tell a figure for each of many cameras by maker and model.
//
// A line is "make,model,figure" or "make,model,figure,fewest_megapixels" with plain names (letters and digits in lower
// case); an empty make stands for any. The fourth field may also be a word, such as the source of the line, which then
// holds for images of any size. Programs write the same camera with other spaces, hyphens and capitals, so only letters
// and digits are compared. The model is looked up first, then with the name of its maker taken off. Lines that begin
// with '#' are comments.
#pragma once

#include <limits>
#include <map>
#include <optional>
#include <string>
#include <string_view>

namespace megablock {

class CameraTable {
 public:
  // The text outlives the table.
  explicit CameraTable(std::string_view text);
  // `make` and `model` are those of EXIF ("NIKON CORPORATION", "NIKON D800"). Of several lines the one for the most
  // megapixels that the image has counts. Empty if the table does not have the camera.
  std::optional<double> find(const std::string& make, const std::string& model,
                             double megapixels = std::numeric_limits<double>::infinity()) const;

 private:
  struct Line {
    std::string_view make;  // empty: any make
    double figure = 0, fewest_megapixels = 0;
  };
  std::optional<double> find_plain(const std::string& make, const std::string& model, double megapixels) const;
  std::multimap<std::string_view, Line, std::less<>> lines_;  // by model
};

}  // namespace megablock
