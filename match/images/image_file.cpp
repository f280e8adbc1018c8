#include "match/images/image_file.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <system_error>
#include <tuple>
#include <utility>
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

// Counts how often each value occurs, and finds the two quantiles. `cut` pixels lie outside on either side at most.
template <typename T>
std::pair<double, double> range_of_integers(const cv::Mat& pixels, std::int64_t cut) {
  std::vector<std::int64_t> counts(std::size_t{std::numeric_limits<T>::max()} + 1, 0);
  for (int row = 0; row < pixels.rows; ++row) {
    const T* values = pixels.ptr<T>(row);
    for (int column = 0; column < pixels.cols; ++column) ++counts[values[column]];
  }
  const auto quantile = [cut](auto first, auto last) {
    std::int64_t passed = 0;
    auto value = first;
    while (std::next(value) != last && (passed += *value) <= cut) ++value;
    return value;
  };
  const auto dark = quantile(counts.begin(), counts.end()) - counts.begin();
  const auto bright = counts.rend() - quantile(counts.rbegin(), counts.rend()) - 1;
  return {static_cast<double>(dark), static_cast<double>(bright)};
}

std::pair<double, double> range_of_numbers(const cv::Mat& pixels, std::int64_t cut) {
  cv::Mat all;
  pixels.convertTo(all, CV_64F);
  std::vector<double> values(all.begin<double>(), all.end<double>());
  std::erase_if(values, [](double value) { return !std::isfinite(value); });
  if (values.empty()) return {0, 0};
  cut = std::min(cut, static_cast<std::int64_t>(values.size() - 1) / 2);
  std::nth_element(values.begin(), values.begin() + cut, values.end());
  const double dark = values[static_cast<std::size_t>(cut)];
  std::nth_element(values.begin(), values.end() - 1 - cut, values.end());
  return {dark, *(values.end() - 1 - cut)};
}

// The values that all but a thousandth of the pixels keep to on either side.
std::pair<double, double> grey_range(const cv::Mat& pixels) {
  const auto cut = static_cast<std::int64_t>(pixels.total() / 1000);
  if (pixels.depth() == CV_8U) return range_of_integers<std::uint8_t>(pixels, cut);
  if (pixels.depth() == CV_16U) return range_of_integers<std::uint16_t>(pixels, cut);
  return range_of_numbers(pixels, cut);
}

GreyImage in_eight_bits(const cv::Mat& pixels) {
  GreyImage image;
  std::tie(image.dark, image.bright) = grey_range(pixels);
  if (pixels.depth() == CV_8U) {
    image.pixels = pixels;
    return image;
  }
  const double scale = image.bright > image.dark ? 255 / (image.bright - image.dark) : 0;
  pixels.convertTo(image.pixels, CV_8U, scale, -image.dark * scale);
  return image;
}

GreyImage failed(std::string reason) {
  GreyImage image;
  image.failure = std::move(reason);
  return image;
}

// The pixels of a file with all their bits, or the failure.
GreyImage decode(const std::string& path) {
  std::vector<unsigned char> bytes;
  if (!read_bytes(path, bytes)) return failed("file missing or not readable");
  if (bytes.empty()) return failed("empty file (0 bytes)");
  // Decoders fill the missing part of a truncated file with grey, without an error.
  if (is_jpeg(bytes) && !is_complete_jpeg(bytes)) return failed("truncated JPEG: the file ends before the image does");
  try {
    const cv::Mat decoded =
        decode_image(bytes, cv::IMREAD_GRAYSCALE | cv::IMREAD_ANYDEPTH | cv::IMREAD_IGNORE_ORIENTATION);
    if (decoded.empty()) return failed("not an image, damaged, or of an unsupported format");
    GreyImage image;
    image.pixels = decoded;
    return image;
  } catch (const cv::Exception& e) {
    return failed("cannot be decoded: " + e.err);
  }
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
  GreyImage image = decode(path);
  return image.failure.empty() ? in_eight_bits(image.pixels) : image;
}

GreyImage read_mask(const std::string& path) {
  GreyImage mask = decode(path);
  if (mask.failure.empty()) mask.pixels = mask.pixels != 0;
  return mask;
}

}  // namespace megablock
