// Sensor widths (larger side, mm) of cameras often met on drones and in hands; makers' data sheets.
#include <algorithm>
#include <cctype>
#include <string_view>

#include "io/images/image_header.h"

namespace megablock {

namespace {

struct Sensor {
  std::string_view model;  // lower case, without the make
  double width_mm;
};

constexpr Sensor kSensors[] = {
    // DJI
    {"fc200", 6.17},
    {"fc220", 6.17},
    {"fc300c", 6.17},
    {"fc300s", 6.17},
    {"fc300se", 6.17},
    {"fc300x", 6.17},
    {"fc300xw", 6.17},
    {"fc330", 6.17},
    {"fc350", 6.17},
    {"fc550", 17.3},
    {"fc6310", 13.2},
    {"fc6310r", 13.2},
    {"fc6310s", 13.2},
    {"fc6360", 4.87},
    {"fc6510", 13.2},
    {"fc6520", 17.3},
    {"fc6540", 23.5},
    {"fc7203", 6.17},
    {"fc7303", 6.17},
    {"fc3170", 6.4},
    {"fc3411", 13.2},
    {"fc3582", 9.6},
    {"l1d-20c", 13.2},
    {"l2d-20c", 17.3},
    {"zenmusep1", 35.9},
    {"m3e", 17.3},
    {"m3m", 17.3},
    {"m3t", 6.4},
    {"phantom vision fc200", 6.17},
    {"hg310", 6.17},
    {"zh20t", 9.6},
    {"test_pro", 13.2},
    // Other drones and action cameras
    {"anafi", 5.9},
    {"bebop 2", 6.2},
    {"evo ii", 6.4},
    {"xt705", 6.17},
    {"hero3+ black edition", 6.17},
    {"hero4 black", 6.17},
    {"hero4 silver", 6.17},
    {"hero5 black", 6.17},
    {"hero6 black", 6.17},
    {"hero7 black", 6.17},
    {"hero8 black", 6.17},
    {"rededge-m", 4.8},
    {"sequoia", 4.8},
    {"s.o.d.a.", 13.2},
    {"duet t", 13.2},
    // Compact and system cameras
    {"powershot elph 300 hs", 6.17},
    {"powershot elph 110 hs", 6.17},
    {"powershot elph 520 hs", 6.17},
    {"powershot s100", 7.44},
    {"powershot s110", 7.44},
    {"powershot sx260 hs", 6.17},
    {"powershot g9 x", 13.2},
    {"ixus 127 hs", 6.17},
    {"ixus 220 hs", 6.17},
    {"dsc-wx220", 6.17},
    {"dsc-rx100", 13.2},
    {"dsc-rx100m2", 13.2},
    {"dsc-rx1rm2", 35.9},
    {"dsc-qx1", 23.2},
    {"ilce-5100", 23.5},
    {"ilce-6000", 23.5},
    {"ilce-6300", 23.5},
    {"ilce-6500", 23.5},
    {"ilce-7", 35.8},
    {"ilce-7r", 35.9},
    {"ilce-7rm2", 35.9},
    {"ilce-7rm3", 35.9},
    {"ilce-7rm4", 35.7},
    {"nex-5n", 23.5},
    {"nex-7", 23.5},
    {"gr", 23.7},
    {"gr ii", 23.7},
    {"gr iii", 23.5},
    {"eos 5d mark ii", 36.0},
    {"eos 5d mark iii", 36.0},
    {"eos 5ds r", 36.0},
    {"eos 6d", 35.8},
    {"eos 700d", 22.3},
    {"eos m", 22.3},
    {"nikon d800", 35.9},
    {"nikon d810", 35.9},
    {"nikon d850", 35.9},
    {"nikon d3x", 35.9},
    {"nikon d90", 23.6},
    {"dmc-gf1", 17.3},
    {"dmc-gh4", 17.3},
    {"ixm-100", 43.9},
    {"ixu 150", 43.8},
    {"ixu-rs 1000", 53.4},
    {"gfx 100", 43.8},
    // Phones (main camera)
    {"iphone 4", 4.54},
    {"iphone 4s", 4.54},
    {"iphone4,1", 4.54},
    {"iphone 5", 4.54},
    {"iphone 5s", 4.89},
    {"iphone 6", 4.89},
    {"iphone 6s", 4.8},
    {"iphone 7", 4.8},
    {"iphone 8", 4.8},
    {"iphone x", 4.8},
};

std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

}  // namespace

std::optional<double> sensor_width_mm(const std::string& make, const std::string& model) {
  std::string name = lower(model);
  const std::string prefix = lower(make) + " ";
  if (name.starts_with(prefix)) name.erase(0, prefix.size());
  const auto found = std::find_if(std::begin(kSensors), std::end(kSensors),
                                  [&](const Sensor& sensor) { return sensor.model == name; });
  if (found == std::end(kSensors)) return std::nullopt;
  return found->width_mm;
}

}  // namespace megablock
