#include "io/images/image_header.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exiv2/exiv2.hpp>
#include <filesystem>
#include <mutex>

#include "io/base/error.h"
#include "io/images/header_fields.h"
#include "io/images/header_pose.h"
#include "io/images/sensor_table.h"

namespace megablock {

namespace {

// Exiv2 and its XMP parser have global tables, so only one thread may read at a time.
std::mutex& exiv2_mutex() {
  static std::mutex mutex;
  return mutex;
}

// Seconds since 1970 of a date and a time of day. NaN for a date that does not exist, or before 1900.
double seconds_of(int year, int month, int day, double seconds_of_day) {
  const std::chrono::year_month_day date{std::chrono::year(year), std::chrono::month(static_cast<unsigned>(month)),
                                         std::chrono::day(static_cast<unsigned>(day))};
  if (!date.ok() || year < 1900) return ImageHeader::kUnknown;
  return static_cast<double>(std::chrono::sys_days(date).time_since_epoch().count()) * 86400 + seconds_of_day;
}

double read_time(const ExifFields& exif) {
  const std::string text = exif.text("Exif.Photo.DateTimeOriginal");
  int year, month, day, hour, minute, second;
  if (std::sscanf(text.c_str(), "%d:%d:%d %d:%d:%d", &year, &month, &day, &hour, &minute, &second) != 6)
    return ImageHeader::kUnknown;
  double time = seconds_of(year, month, day, hour * 3600 + minute * 60 + second);
  const std::string fraction = exif.text("Exif.Photo.SubSecTimeOriginal");
  double value = 0;
  // The tag has the digits behind the decimal point: "05" are 50 ms.
  if (!fraction.empty() && std::sscanf(("0." + fraction).c_str(), "%lf", &value) == 1) time += value;
  return time;
}

double read_gps_time(const ExifFields& exif) {
  const std::string date = exif.text("Exif.GPSInfo.GPSDateStamp");
  int year, month, day;
  if (std::sscanf(date.c_str(), "%d%*[:-]%d%*[:-]%d", &year, &month, &day) != 3) return ImageHeader::kUnknown;
  const double hour = exif.number("Exif.GPSInfo.GPSTimeStamp", 0), minute = exif.number("Exif.GPSInfo.GPSTimeStamp", 1);
  return seconds_of(year, month, day, hour * 3600 + minute * 60 + exif.number("Exif.GPSInfo.GPSTimeStamp", 2));
}

// OffsetTimeOriginal (0x9011): "+02:00".
double read_zone(const ExifFields& exif) {
  const std::string text = exif.text("Exif.Photo.0x9011");
  char sign;
  int hours, minutes;
  if (std::sscanf(text.c_str(), "%c%2d:%2d", &sign, &hours, &minutes) != 3) return ImageHeader::kUnknown;
  return (sign == '-' ? -1 : 1) * (hours * 3600.0 + minutes * 60.0);
}

void read_lens(const ExifFields& exif, ImageHeader& header) {
  header.focal_mm = exif.number("Exif.Photo.FocalLength");
  header.focal_35mm = exif.number("Exif.Photo.FocalLengthIn35mmFilm");
  // The resolution refers to the original image. A reduced copy keeps the original size in PixelXDimension.
  const double resolution = exif.number("Exif.Photo.FocalPlaneXResolution");  // pixels per unit
  const double unit = exif.number("Exif.Photo.FocalPlaneResolutionUnit");
  // EXIF codes: 2 inch (the default), 3 centimetre, 4 millimetre.
  const double unit_mm = unit == 3 ? 10 : unit == 4 ? 1 : 25.4;
  double pixels = exif.number("Exif.Photo.PixelXDimension");
  const double other = exif.number("Exif.Photo.PixelYDimension");
  if (std::isnan(pixels)) pixels = std::max(header.width, header.height);
  if (other > pixels) pixels = other;
  const double sensor = pixels / resolution * unit_mm;
  // Another value comes from a copy whose tags no longer fit together.
  if (sensor > 3 && sensor < 70) header.sensor_width_mm = sensor;
}

std::string exiv2_reason(const Exiv2::AnyError& error) {
  if (error.code() == Exiv2::kerFileContainsUnknownImageType || error.code() == Exiv2::kerNotAnImage ||
      error.code() == Exiv2::kerNotAJpeg)
    return "not an image file of a known kind";
  return "its header cannot be read: " + std::string(error.what());
}

}  // namespace

bool is_image_name(const std::string& path) {
  std::string extension = std::filesystem::path(path).extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension == ".jpg" || extension == ".jpeg" || extension == ".png" || extension == ".tif" ||
         extension == ".tiff";
}

ImageHeader read_image_header(const std::string& path) {
  std::error_code error_code;
  const auto size = std::filesystem::file_size(path, error_code);
  if (error_code)
    throw InputError("cannot be read: " + error_code.message() + "; check the path, or copy the image again");
  if (size == 0) throw InputError("the file is empty; copy the image again");

  const std::lock_guard lock(exiv2_mutex());
  // Exiv2 would print warnings about harmless errors in the metadata of many cameras.
  Exiv2::LogMsg::setLevel(Exiv2::LogMsg::mute);
  ImageHeader header;
  try {
    const auto image = Exiv2::ImageFactory::open(path);
    image->readMetadata();
    header.width = image->pixelWidth();
    header.height = image->pixelHeight();
    const ExifFields exif(image->exifData());
    if (header.width <= 0 || header.height <= 0)
      throw InputError("the header gives no image size; the file may be truncated; copy the image again");
    header.make = exif.text("Exif.Image.Make");
    header.model = exif.text("Exif.Image.Model");
    const double orientation = exif.number("Exif.Image.Orientation");
    if (orientation >= 1 && orientation <= 8) header.orientation = static_cast<int>(orientation);
    header.time_s = read_time(exif);
    header.gps_time_s = read_gps_time(exif);
    header.zone_s = read_zone(exif);
    read_lens(exif, header);
    read_header_pose(exif, XmpFields(image->xmpData()), header);
  } catch (const Exiv2::AnyError& error) {
    throw InputError(exiv2_reason(error));
  }
  return header;
}

std::optional<double> focal_px(const ImageHeader& header) {
  const double side = std::max(header.width, header.height);
  if (header.focal_mm > 0) {
    if (header.sensor_width_mm > 0) return header.focal_mm / header.sensor_width_mm * side;
    if (const auto width = sensor_width_mm(header.make, header.model)) return header.focal_mm / *width * side;
  }
  if (header.focal_35mm > 0) return header.focal_35mm / 36 * side;
  return std::nullopt;
}

}  // namespace megablock
