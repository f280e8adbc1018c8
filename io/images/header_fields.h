// Finds EXIF and XMP fields by name and turns their values into numbers. Internal to io/.
#pragma once

#include <exiv2/exiv2.hpp>
#include <string>

namespace megablock {

class ExifFields {
 public:
  explicit ExifFields(const Exiv2::ExifData& data) : data_(data) {}

  std::string text(const char* key) const;  // trimmed; empty if absent
  // Component n of a field; NaN if it is absent or its denominator is zero.
  double number(const char* key, long n = 0) const;

 private:
  const Exiv2::Exifdatum* find(const char* key) const;
  const Exiv2::ExifData& data_;
};

class XmpFields {
 public:
  explicit XmpFields(const Exiv2::XmpData& data) : data_(data) {}

  // The property `name` of the namespace whose usual prefix is `prefix`. Fields of structures are named as by Exiv2:
  // "CameraOrientationNED/drone-skydio:Yaw". Empty if absent.
  std::string text(const std::string& prefix, const std::string& name) const;
  // Its number, also a fraction or a number with text behind it; NaN if it does not begin with one.
  double number(const std::string& prefix, const std::string& name) const;

 private:
  const Exiv2::XmpData& data_;
};

}  // namespace megablock
