// Writes small image files with EXIF and XMP for the tests of the project reader.
#pragma once

#include <exiv2/exiv2.hpp>
#include <filesystem>
#include <fstream>
#include <map>
#include <opencv2/core.hpp>
#include <string>

#include "io/images/image_codec.h"

namespace megablock::fixture {

inline void write_file(const std::string& path, const std::string& text) {
  std::filesystem::create_directories(std::filesystem::path(path).parent_path());
  std::ofstream(path, std::ios::binary) << text;
}

inline std::string read_file(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

using Tags = std::map<std::string, std::string>;  // EXIF or XMP keys of Exiv2 and their values

// Writes a grey image. Different values of `shade` give different bytes.
inline void write_image_file(const std::string& path, int width, int height, int shade, const Tags& tags = {}) {
  std::filesystem::create_directories(std::filesystem::path(path).parent_path());
  megablock::write_image_file(path, cv::Mat(height, width, CV_8UC3, cv::Scalar(shade % 256, shade / 256, 90)));
  auto image = Exiv2::ImageFactory::open(path);
  image->readMetadata();
  static const int registered = [] {
    Exiv2::XmpProperties::registerNs("http://www.dji.com/drone-dji/1.0/", "drone-dji");
    return 1;
  }();
  (void)registered;
  for (const auto& [key, value] : tags) {
    if (key.starts_with("Xmp."))
      image->xmpData()[key] = value;
    else
      image->exifData()[key] = value;
  }
  if (!tags.empty()) image->writeMetadata();
}

// Rationals degrees, minutes, seconds / 10^6 of a latitude or longitude.
inline std::string dms(double degrees) {
  const double a = std::abs(degrees);
  const int d = static_cast<int>(a), m = static_cast<int>((a - d) * 60);
  const long s = std::lround(((a - d) * 60 - m) * 60 * 1e6);
  return std::to_string(d) + "/1 " + std::to_string(m) + "/1 " + std::to_string(s) + "/1000000";
}

inline Tags gps_tags(double latitude, double longitude, double height) {
  return {{"Exif.GPSInfo.GPSLatitude", dms(latitude)},
          {"Exif.GPSInfo.GPSLatitudeRef", latitude < 0 ? "S" : "N"},
          {"Exif.GPSInfo.GPSLongitude", dms(longitude)},
          {"Exif.GPSInfo.GPSLongitudeRef", longitude < 0 ? "W" : "E"},
          {"Exif.GPSInfo.GPSAltitude", std::to_string(std::lround(std::abs(height) * 1000)) + "/1000"},
          {"Exif.GPSInfo.GPSAltitudeRef", height < 0 ? "1" : "0"}};
}

inline Tags joined(Tags a, const Tags& b) {
  a.insert(b.begin(), b.end());
  return a;
}

// Message of the exception `action` throws; empty when it throws none.
template <typename Exception, typename Action>
std::string message_of(const Action& action) {
  try {
    action();
  } catch (const Exception& error) {
    return error.what();
  }
  return "";
}

}  // namespace megablock::fixture
