// Reads image files as grey values, with a clear message for each way in which a file can be bad.
#pragma once

#include <opencv2/core.hpp>
#include <span>
#include <string>

namespace megablock {

struct GreyImage {
  cv::Mat pixels;       // CV_8UC1, as stored in the file (an EXIF orientation is not applied); empty on failure
  std::string failure;  // one line; empty on success
  // The grey values of the file between which all but a thousandth of its pixels lie on either side. Pixels of more
  // than 8 bits are stretched from these two to 0 and 255, so that a hot pixel changes nothing but itself.
  double dark = 0, bright = 0;
};

// Does not throw for a bad file.
GreyImage read_grey_image(const std::string& path);
// A mask: 0 where the file has 0, 255 elsewhere, whatever its bits.
GreyImage read_mask(const std::string& path);

// Whether a JPEG stream reaches its end-of-image marker. Decoders fill the missing part of a truncated file with grey,
// without an error.
bool is_complete_jpeg(std::span<const unsigned char> file);

}  // namespace megablock
