#include "match/images/image_file.h"

#include <cstring>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <system_error>
#include <vector>

#include "io/images/image_codec.h"

namespace megablock {

namespace {

constexpr unsigned char kStartOfImage = 0xD8, kEndOfImage = 0xD9, kStartOfScan = 0xDA;

bool is_jpeg(std::span<const unsigned char> file) {
  return file.size() >= 3 && file[0] == 0xFF && file[1] == kStartOfImage && file[2] == 0xFF;
}

// Whether a marker has no length field: TEM, RST0 to RST7, SOI.
bool stands_alone(unsigned char marker) { return marker == 0x01 || (marker >= 0xD0 && marker <= kStartOfImage); }

// Position of the 0xFF of the next marker after entropy-coded data. Stuffed zeros and restart markers belong to the
// data.
std::size_t end_of_scan(std::span<const unsigned char> file, std::size_t at) {
  while (at < file.size()) {
    const void* found = std::memchr(file.data() + at, 0xFF, file.size() - at);
    if (!found) return file.size();
    at = static_cast<std::size_t>(static_cast<const unsigned char*>(found) - file.data());
    if (at + 1 >= file.size()) return file.size();
    const unsigned char next = file[at + 1];
    if (next == 0xFF) {
      ++at;
    } else if (next == 0 || (next >= 0xD0 && next <= 0xD7)) {
      at += 2;
    } else {
      return at;
    }
  }
  return file.size();
}

// Reads a whole file. False for anything but a regular file, such as a folder.
bool read_bytes(const std::string& path, std::vector<unsigned char>& bytes) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return false;
  std::ifstream stream(path, std::ios::binary | std::ios::ate);
  const std::streamoff size = stream.tellg();
  if (size < 0) return false;
  bytes.resize(static_cast<std::size_t>(size));
  stream.seekg(0);
  stream.read(reinterpret_cast<char*>(bytes.data()), size);
  return static_cast<bool>(stream);
}

// Stretches the range of grey values to 8 bits.
cv::Mat to_eight_bits(const cv::Mat& pixels) {
  if (pixels.depth() == CV_8U) return pixels;
  double darkest = 0, brightest = 0;
  cv::minMaxLoc(pixels, &darkest, &brightest);
  const double scale = brightest > darkest ? 255 / (brightest - darkest) : 0;
  cv::Mat stretched;
  pixels.convertTo(stretched, CV_8U, scale, -darkest * scale);
  return stretched;
}

}  // namespace

bool is_complete_jpeg(std::span<const unsigned char> file) {
  std::size_t at = 2;
  while (at + 1 < file.size()) {
    if (file[at] != 0xFF) return false;  // no marker where there must be one
    const unsigned char marker = file[at + 1];
    if (marker == kEndOfImage) return true;
    if (marker == 0xFF) {
      ++at;  // fill byte
    } else if (stands_alone(marker)) {
      at += 2;
    } else {
      if (at + 3 >= file.size()) return false;
      at += 2 + (std::size_t{file[at + 2]} << 8 | file[at + 3]);
      if (marker == kStartOfScan) at = end_of_scan(file, at);
    }
  }
  return false;
}

GreyImage read_grey_image(const std::string& path) {
  std::vector<unsigned char> bytes;
  if (!read_bytes(path, bytes)) return {{}, "file missing or not readable"};
  if (bytes.empty()) return {{}, "empty file (0 bytes)"};
  // Decoders fill the missing part of a truncated file with grey, without an error.
  if (is_jpeg(bytes) && !is_complete_jpeg(bytes)) return {{}, "truncated JPEG: the file ends before the image does"};
  try {
    const cv::Mat decoded =
        decode_image(bytes, cv::IMREAD_GRAYSCALE | cv::IMREAD_ANYDEPTH | cv::IMREAD_IGNORE_ORIENTATION);
    if (decoded.empty()) return {{}, "not an image, damaged, or of an unsupported format"};
    return {to_eight_bits(decoded), {}};
  } catch (const cv::Exception& e) {
    return {{}, "cannot be decoded: " + e.err};
  }
}

}  // namespace megablock
