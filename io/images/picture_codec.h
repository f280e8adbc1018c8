// Pictures from and to the bytes of their files (JPEG, PNG, TIFF and what else OpenCV's imgcodecs knows).
//
// imgcodecs brings GDAL and with it some eighty libraries, 30 MiB and a tenth of a second to every process that is
// linked with it. So it is not: libmegablock_pictures.so is, which is loaded from beside the program (or, installed,
// from ../lib/megablock) when the first picture is read or written. Ranks that only adjust never load it.
//
// All throw InputError when the library is not there, and cv::Exception where OpenCV does. Before pictures are read by
// threads, from which nothing may be thrown, load_picture_codecs() makes sure of the library.
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace megablock {

void load_picture_codecs();

// As cv::imdecode, `flags` of cv::ImreadModes: empty when it is no picture that imgcodecs knows.
cv::Mat decode_picture(const std::vector<unsigned char>& file, int flags);

// As cv::imread: the same of a file, empty also when it cannot be read.
cv::Mat read_picture(const std::string& path, int flags);

// As cv::imencode. `extension`: ".jpg", ".png"; `parameters`: pairs of cv::ImwriteFlags and values. ComputeError where
// imgcodecs cannot.
std::vector<unsigned char> encode_picture(const std::string& extension, const cv::Mat& picture,
                                          const std::vector<int>& parameters = {});

// The format by the extension of `path`. InputError when the file cannot be written.
void write_picture(const std::string& path, const cv::Mat& picture, const std::vector<int>& parameters = {});

// What libmegablock_pictures.so offers, by its one symbol.
struct PictureCodecs {
  cv::Mat (*decode)(const std::vector<unsigned char>& file, int flags);
  std::vector<unsigned char> (*encode)(const std::string& extension, const cv::Mat& picture,
                                       const std::vector<int>& parameters);
};
extern "C" PictureCodecs megablock_picture_codecs();

}  // namespace megablock
