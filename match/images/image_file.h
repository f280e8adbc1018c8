// Reads image files as grey values, with a clear message for each way in which a file can be bad.
#pragma once

#include <opencv2/core.hpp>
#include <span>
#include <string>

namespace megablock {

struct GreyImage {
  cv::Mat pixels;       // CV_8UC1, as stored in the file (an EXIF orientation is not applied); empty on failure
  std::string failure;  // one line; empty on success
};

// Does not throw for a bad file. Images of more than 8 bits are stretched from their darkest to their brightest pixel.
GreyImage read_grey_image(const std::string& path);

// Whether a JPEG stream reaches its end-of-image marker. Decoders fill the missing part of a truncated file with grey,
// without an error.
bool is_complete_jpeg(std::span<const unsigned char> file);

}  // namespace megablock
