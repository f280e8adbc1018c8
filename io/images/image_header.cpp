#include "io/images/image_header.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exiv2/exiv2.hpp>
#include <filesystem>
#include <mutex>

#include "io/base/error.h"
#include "io/images/sensor_table.h"

namespace megablock {

namespace {

// Exiv2 and its XMP parser have global tables, so only one thread may read at a time.
std::mutex& exiv2_mutex() {
  static std::mutex mutex;
  return mutex;
}

std::string trimmed_exif(std::string text) {
  while (!text.empty() && (text.back() == ' ' || text.back() == '\0' || text.back() == '\n')) text.pop_back();
  text.erase(0, text.find_first_not_of(' ') == std::string::npos ? text.size() : text.find_first_not_of(' '));
  return text;
}

class ExifFields {
 public:
  explicit ExifFields(const Exiv2::ExifData& data) : data_(data) {}

  std::string text(const char* key) const {
    const auto* value = find(key);
    return value ? trimmed_exif(value->toString()) : "";
  }
  // Component n of a field; NaN if it is absent or its denominator is zero.
  double number(const char* key, long n = 0) const {
    const auto* value = find(key);
    if (!value || n >= value->count()) return ImageHeader::kUnknown;
    const Exiv2::TypeId type = value->typeId();
    // Exiv2 returns both kinds as signed numbers, so unsigned values above 2^31 are converted back.
    if (type == Exiv2::unsignedRational || type == Exiv2::signedRational) {
      const Exiv2::Rational r = value->toRational(n);
      const bool is_unsigned = type == Exiv2::unsignedRational;
      const double top = is_unsigned ? static_cast<std::uint32_t>(r.first) : r.first;
      const double bottom = is_unsigned ? static_cast<std::uint32_t>(r.second) : r.second;
      return bottom != 0 ? top / bottom : ImageHeader::kUnknown;
    }
    return static_cast<double>(value->toFloat(n));
  }

 private:
  const Exiv2::Exifdatum* find(const char* key) const {
    const auto found = data_.findKey(Exiv2::ExifKey(key));
    return found != data_.end() ? &*found : nullptr;
  }
  const Exiv2::ExifData& data_;
};

// Finds XMP properties by their local name, whatever prefix the writer chose.
double xmp_number(const Exiv2::XmpData& data, const std::string& group, const std::string& name) {
  for (const auto& property : data) {
    if (property.groupName() != group || property.tagName() != name) continue;
    double value = ImageHeader::kUnknown;
    return std::sscanf(property.toString().c_str(), "%lf", &value) == 1 ? value : ImageHeader::kUnknown;
  }
  return ImageHeader::kUnknown;
}

// Degrees from the three rationals degrees, minutes and seconds; the last two may be absent.
double dms_degrees(const ExifFields& exif, const char* key) {
  const double degrees = exif.number(key, 0), minutes = exif.number(key, 1), seconds = exif.number(key, 2);
  return degrees + (std::isnan(minutes) ? 0 : minutes / 60) + (std::isnan(seconds) ? 0 : seconds / 3600);
}

void read_position(const ExifFields& exif, const Exiv2::XmpData& xmp, ImageHeader& header) {
  double latitude = dms_degrees(exif, "Exif.GPSInfo.GPSLatitude");
  double longitude = dms_degrees(exif, "Exif.GPSInfo.GPSLongitude");
  if (std::isnan(latitude) || std::isnan(longitude)) return;
  if (exif.text("Exif.GPSInfo.GPSLatitudeRef") == "S") latitude = -latitude;
  if (exif.text("Exif.GPSInfo.GPSLongitudeRef") == "W") longitude = -longitude;
  double height = exif.number("Exif.GPSInfo.GPSAltitude");
  if (exif.number("Exif.GPSInfo.GPSAltitudeRef") == 1) height = -height;
  if (std::isnan(height)) height = xmp_number(xmp, "drone-dji", "AbsoluteAltitude");
  header.position = Geodetic{latitude, longitude, height};

  header.dop = exif.number("Exif.GPSInfo.GPSDOP");
  header.position_sigma_horizontal_m = exif.number("Exif.GPSInfo.0x001f");  // GPSHPositioningError
  // RTK values are the standard deviations of this image and replace the general estimate.
  const double east = xmp_number(xmp, "drone-dji", "RtkStdLon"), north = xmp_number(xmp, "drone-dji", "RtkStdLat");
  const double up = xmp_number(xmp, "drone-dji", "RtkStdHgt");
  if (east > 0 && north > 0) header.position_sigma_horizontal_m = std::max(east, north);
  if (up > 0) header.position_sigma_vertical_m = up;
}

// The gimbal angles are those of the camera. Flight angles are those of the body and say nothing about a camera on a
// gimbal. For a fixed camera they would need the assumption that it looks along the body's z axis, so they are not used
// alone.
void read_attitude(const Exiv2::XmpData& xmp, ImageHeader& header) {
  const double yaw = xmp_number(xmp, "drone-dji", "GimbalYawDegree");
  const double pitch = xmp_number(xmp, "drone-dji", "GimbalPitchDegree");
  const double roll = xmp_number(xmp, "drone-dji", "GimbalRollDegree");
  if (std::isnan(yaw) || std::isnan(pitch) || std::isnan(roll)) return;
  header.attitude = ImageHeader::Attitude{yaw, pitch, roll};
}

double read_time(const ExifFields& exif) {
  const std::string text = exif.text("Exif.Photo.DateTimeOriginal");
  int year, month, day, hour, minute, second;
  if (std::sscanf(text.c_str(), "%d:%d:%d %d:%d:%d", &year, &month, &day, &hour, &minute, &second) != 6)
    return ImageHeader::kUnknown;
  const std::chrono::year_month_day date{std::chrono::year(year), std::chrono::month(static_cast<unsigned>(month)),
                                         std::chrono::day(static_cast<unsigned>(day))};
  if (!date.ok() || year < 1900) return ImageHeader::kUnknown;
  const double days = static_cast<double>(std::chrono::sys_days(date).time_since_epoch().count());
  double time = days * 86400 + hour * 3600 + minute * 60 + second;
  const std::string fraction = exif.text("Exif.Photo.SubSecTimeOriginal");
  double value = 0;
  // The tag has the digits behind the decimal point: "05" are 50 ms.
  if (!fraction.empty() && std::sscanf(("0." + fraction).c_str(), "%lf", &value) == 1) time += value;
  return time;
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
    read_lens(exif, header);
    read_position(exif, image->xmpData(), header);
    read_attitude(image->xmpData(), header);
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
