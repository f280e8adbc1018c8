// Gives io/images/image_codec.h the codecs of OpenCV, as the only source of libmegablock_image_codecs.so, which is a
// library of its own for the reasons stated there.
#include <opencv2/imgcodecs.hpp>

#include "io/images/image_codec.h"

namespace megablock {

namespace {

cv::Mat decode(const std::vector<unsigned char>& file, int flags) { return cv::imdecode(file, flags); }

std::vector<unsigned char> encode(const std::string& extension, const cv::Mat& image,
                                  const std::vector<int>& parameters) {
  std::vector<unsigned char> bytes;
  cv::imencode(extension, image, bytes, parameters);
  return bytes;
}

}  // namespace

extern "C" ImageCodecs megablock_image_codecs() { return {decode, encode}; }

}  // namespace megablock
