// Reads binary COLMAP models. They are little-endian and have no padding. Counts have 64 bits, ids of cameras and
// images 32 bits, and ids of points 64 bits.
//
//     cameras.bin   u64 count; each: u32 id, i32 model, u64 width, u64 height, f64 per parameter of the model
//     images.bin    u64 count; each: u32 id, f64 qw qx qy qz tx ty tz, u32 camera, name with a zero byte,
//                   u64 count; each: f64 x y, u64 point (all bits set: none)
//     points3D.bin  u64 count; each: u64 id, f64 x y z, u8 r g b, f64 error,
//                   u64 count; each: u32 image, u32 index in the list of this image
#include <fmt/core.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>

#include "io/base/error.h"
#include "io/base/file_error.h"
#include "io/exchange/colmap/import_colmap.h"
#include "io/text/number_reader.h"

namespace megablock {

namespace {

static_assert(std::endian::native == std::endian::little);

// Reads a file in memory from its beginning to its end.
class Bytes {
 public:
  explicit Bytes(const std::string& path) : path_(path) {
    std::ifstream in = open_input(path);
    content_.assign(std::istreambuf_iterator<char>(in), {});
  }

  [[noreturn]] void fail(const std::string& message) const {
    throw InputError(path_ + ", byte " + std::to_string(at_) + ": " + message);
  }

  template <typename Value>
  Value value(const char* what) {
    Value value;
    if (content_.size() - at_ < sizeof value) fail(std::string("ends before ") + what);
    std::memcpy(&value, content_.data() + at_, sizeof value);
    at_ += sizeof value;
    return value;
  }
  double number(const char* what, double largest = kLargestNumber) {
    const double number = value<double>(what);
    if (!std::isfinite(number)) fail(std::string(what) + " is not a number");
    if (std::abs(number) > largest) fail(fmt::format("{}: {:g} is too large to be right", what, number));
    return number;
  }
  std::string text(const char* what) {
    const auto end = content_.find('\0', at_);
    if (end == std::string::npos) fail(std::string("ends before ") + what);
    std::string text = content_.substr(at_, end - at_);
    at_ = end + 1;
    return text;
  }
  void skip(std::uint64_t count, std::size_t size, const char* what) {
    if (count > (content_.size() - at_) / size) fail(std::string("ends before ") + what);
    at_ += static_cast<std::size_t>(count) * size;
  }
  void finish() const {
    if (at_ != content_.size()) fail("more bytes than the counts announce");
  }

 private:
  std::string path_, content_;
  std::size_t at_ = 0;
};

class BinaryReader {
 public:
  explicit BinaryReader(const std::string& folder) : folder_(folder) {}

  ImportedBlock read() {
    read_file("points3D.bin", [this](Bytes& bytes) { read_point(bytes); });
    read_file("cameras.bin", [this](Bytes& bytes) { read_camera(bytes); });
    read_file("images.bin", [this](Bytes& bytes) { read_image(bytes); });
    return builder_.finish();
  }

 private:
  template <typename ReadOne>
  void read_file(const char* name, ReadOne read_one) {
    Bytes bytes((std::filesystem::path(folder_) / name).string());
    builder_.fail = [&](const std::string& message) { bytes.fail(message); };
    const auto count = bytes.value<std::uint64_t>("the count");
    for (std::uint64_t i = 0; i < count; ++i) read_one(bytes);
    bytes.finish();
  }

  void read_point(Bytes& bytes) {
    const auto id = static_cast<std::int64_t>(bytes.value<std::uint64_t>("a point's id"));
    Eigen::Vector3d point;
    for (double& value : point) value = bytes.number("a point's coordinates");
    bytes.skip(3 + 8, 1, "a point's colour and error");
    const auto length = bytes.value<std::uint64_t>("a point's track");
    bytes.skip(length, 8, "a point's track");  // the tracks are made from the images
    builder_.add_point(id, point);
  }

  void read_camera(Bytes& bytes) {
    const auto id = bytes.value<std::uint32_t>("a camera's id");
    const auto number = bytes.value<std::int32_t>("a camera's model");
    const auto& all = colmap_camera_forms();
    const auto found =
        std::find_if(all.begin(), all.end(), [&](const ColmapCameraForm& f) { return f.number == number; });
    const std::string name = found == all.end() ? "number " + std::to_string(number) : found->name;
    const ColmapCameraForm& form = colmap_camera_form(name, builder_.fail);
    const auto width = bytes.value<std::uint64_t>("a camera's width");
    const auto height = bytes.value<std::uint64_t>("a camera's height");
    std::vector<double> parameters;
    for (std::size_t i = 0; i < form.parameters.size(); ++i)
      parameters.push_back(bytes.number("a camera's parameters"));
    builder_.add_camera(id, form, static_cast<std::int64_t>(width), static_cast<std::int64_t>(height), parameters);
  }

  void read_image(Bytes& bytes) {
    const auto id = bytes.value<std::uint32_t>("an image's id");
    std::array<double, 4> q;
    Eigen::Vector3d translation;
    for (double& value : q) value = bytes.number("an image's rotation");
    for (double& value : translation) value = bytes.number("an image's translation");
    const auto camera = bytes.value<std::uint32_t>("an image's camera");
    builder_.add_image(id, q, translation, camera, bytes.text("an image's name"));
    const auto observations = bytes.value<std::uint64_t>("an image's observations");
    for (std::uint64_t i = 0; i < observations; ++i) {
      const double x = bytes.number("x of an observation", kFarthestPixel),
                   y = bytes.number("y of an observation", kFarthestPixel);
      builder_.add_observation(x, y, static_cast<std::int64_t>(bytes.value<std::uint64_t>("point of an observation")));
    }
  }

  std::string folder_;
  ColmapBuilder builder_;
};

}  // namespace

ImportedBlock import_colmap_binary(const std::string& folder) { return BinaryReader(folder).read(); }

}  // namespace megablock
