#include "io/simulate/images/jpeg_writer.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exiv2/exiv2.hpp>
#include <opencv2/imgcodecs.hpp>

#include "io/base/error.h"
#include "io/images/image_codec.h"

namespace megablock {

namespace {

// The sensor is an invention: EXIF states the focal length in millimetres, and the reader turns it back into pixels by
// the resolution of the focal plane, f_px = f_mm * pixels per mm. Any size gives the same f_px.
constexpr double kSensor = 10;  // length of the larger side, mm

std::string rational(double value, int denominator) {
  return std::to_string(std::llround(value * denominator)) + "/" + std::to_string(denominator);
}

// Degrees, minutes, seconds; seconds to 1e-7, which is 3 micrometres.
std::string degrees_minutes_seconds(double degrees) {
  degrees = std::abs(degrees);
  const double whole = std::floor(degrees), minutes = std::floor((degrees - whole) * 60);
  const double seconds = std::max(0.0, ((degrees - whole) * 60 - minutes) * 60);
  return rational(whole, 1) + " " + rational(minutes, 1) + " " + rational(seconds, 10000000);
}

std::string date_text(double time_s) {
  using namespace std::chrono;
  const sys_seconds time{seconds(std::llround(std::floor(time_s)))};
  const auto day = floor<days>(time);
  const year_month_day date(day);
  const hh_mm_ss clock(time - day);
  char text[32];
  std::snprintf(text, sizeof text, "%04d:%02u:%02u %02d:%02d:%02d", static_cast<int>(date.year()),
                static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()),
                static_cast<int>(clock.hours().count()), static_cast<int>(clock.minutes().count()),
                static_cast<int>(clock.seconds().count()));
  return text;
}

void set_position(Exiv2::ExifData& data, const SimulatedExif& exif) {
  const Geodetic& p = *exif.position;
  data["Exif.GPSInfo.GPSVersionID"] = "2 3 0 0";
  data["Exif.GPSInfo.GPSLatitudeRef"] = p.latitude_deg < 0 ? "S" : "N";
  data["Exif.GPSInfo.GPSLongitudeRef"] = p.longitude_deg < 0 ? "W" : "E";
  Exiv2::URationalValue latitude, longitude, error;
  latitude.read(degrees_minutes_seconds(p.latitude_deg));
  longitude.read(degrees_minutes_seconds(p.longitude_deg));
  data.add(Exiv2::ExifKey("Exif.GPSInfo.GPSLatitude"), &latitude);
  data.add(Exiv2::ExifKey("Exif.GPSInfo.GPSLongitude"), &longitude);
  data["Exif.GPSInfo.GPSAltitudeRef"] = p.height_m < 0 ? "1" : "0";
  data["Exif.GPSInfo.GPSAltitude"] = rational(std::abs(p.height_m), 10000);
  if (exif.position_sigma_m <= 0) return;
  error.read(rational(exif.position_sigma_m, 10000));
  data.add(Exiv2::ExifKey(0x001f, "GPSInfo"), &error);  // GPSHPositioningError
}

}  // namespace

void write_jpeg(const std::string& path, const cv::Mat& image, const SimulatedExif& exif) {
  write_image_file(path, image, {cv::IMWRITE_JPEG_QUALITY, 95});
  try {
    const auto file = Exiv2::ImageFactory::open(path);
    file->readMetadata();
    Exiv2::ExifData& data = file->exifData();
    const int side = std::max(image.cols, image.rows);
    data["Exif.Image.Make"] = "Megablock";
    data["Exif.Image.Model"] = exif.model;
    data["Exif.Image.Orientation"] = std::uint16_t{1};
    data["Exif.Photo.FocalLength"] = rational(exif.focal_px * kSensor / side, 1000000);
    data["Exif.Photo.FocalPlaneXResolution"] = rational(side / kSensor, 1000);
    data["Exif.Photo.FocalPlaneYResolution"] = rational(side / kSensor, 1000);
    data["Exif.Photo.FocalPlaneResolutionUnit"] = std::uint16_t{4};  // pixels per millimetre
    data["Exif.Photo.PixelXDimension"] = static_cast<std::uint32_t>(image.cols);
    data["Exif.Photo.PixelYDimension"] = static_cast<std::uint32_t>(image.rows);
    data["Exif.Photo.DateTimeOriginal"] = date_text(exif.time_s);
    // EXIF keeps fractions of a second in a tag of their own. 1000 would be the next second, and is left out.
    const auto milliseconds = std::llround(1000 * (exif.time_s - std::floor(exif.time_s)));
    if (milliseconds > 0 && milliseconds < 1000) {
      char fraction[4];
      std::snprintf(fraction, sizeof fraction, "%03d", static_cast<int>(milliseconds));
      data["Exif.Photo.SubSecTimeOriginal"] = fraction;
    }
    if (exif.position) set_position(data, exif);
    file->writeMetadata();
  } catch (const Exiv2::AnyError& error) {
    throw InputError(path + ": its header cannot be written: " + error.what());
  }
}

}  // namespace megablock
