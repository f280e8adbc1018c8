// The only source of libmegablock_pictures.so, which gives io/images/picture_codec.h the codecs of OpenCV. It is a
// library of its own for the reasons stated there.
#include <opencv2/imgcodecs.hpp>

#include "io/images/picture_codec.h"

namespace megablock {

namespace {

cv::Mat decode(const std::vector<unsigned char>& file, int flags) { return cv::imdecode(file, flags); }

std::vector<unsigned char> encode(const std::string& extension, const cv::Mat& picture,
                                  const std::vector<int>& parameters) {
  std::vector<unsigned char> bytes;
  cv::imencode(extension, picture, bytes, parameters);
  return bytes;
}

}  // namespace

extern "C" PictureCodecs megablock_picture_codecs() { return {decode, encode}; }

}  // namespace megablock
