// Decodes and encodes image files (JPEG, PNG, TIFF and the other formats of OpenCV's imgcodecs).
//
// imgcodecs depends on GDAL and so on about eighty libraries; they cost every linked process 30 MiB and a tenth of a
// second. The program is therefore not linked with it. libmegablock_image_codecs.so is, and it is loaded from beside
// the program (or, once installed, from ../lib/megablock) when the first image is read or written. Ranks that only
// adjust never load it.
//
// All functions throw InputError if the library is missing, and cv::Exception where OpenCV does. Call
// load_image_codecs() before threads read images, because nothing may be thrown from a thread.
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace megablock {

void load_image_codecs();

// Decodes the bytes of an image file as cv::imdecode does, with the `flags` of cv::ImreadModes. Empty for anything that
// imgcodecs cannot decode.
cv::Mat decode_image(const std::vector<unsigned char>& file, int flags);

// The same for a file, as cv::imread does. Empty also if the file cannot be read.
cv::Mat read_image_file(const std::string& path, int flags);

// Encodes an image as cv::imencode does. `extension` is ".jpg" or ".png", for example; `parameters` are pairs of
// cv::ImwriteFlags and values. Throws ComputeError where imgcodecs fails.
std::vector<unsigned char> encode_image(const std::string& extension, const cv::Mat& image,
                                        const std::vector<int>& parameters = {});

// Writes a file in the format of its extension. Throws InputError if the file cannot be written.
void write_image_file(const std::string& path, const cv::Mat& image, const std::vector<int>& parameters = {});

// The functions of libmegablock_image_codecs.so, which its only symbol returns.
struct ImageCodecs {
  cv::Mat (*decode)(const std::vector<unsigned char>& file, int flags);
  std::vector<unsigned char> (*encode)(const std::string& extension, const cv::Mat& image,
                                       const std::vector<int>& parameters);
};
extern "C" ImageCodecs megablock_image_codecs();

}  // namespace megablock
