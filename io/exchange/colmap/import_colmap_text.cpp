// Reads COLMAP models in text form. Each image has two lines: the pose, then its observations; the second one is empty
// for an image without any. Track lists of points3D.txt repeat what the images say, and are not read.
#include <charconv>
#include <filesystem>

#include "io/exchange/colmap/import_colmap.h"
#include "io/text/number_reader.h"

namespace megablock {

namespace {

class TextReader {
 public:
  explicit TextReader(const std::string& folder) : folder_(folder) {}

  ImportedBlock read() {
    read_file("points3D.txt", [this](NumberReader& reader, const std::string& first) { read_point(reader, first); });
    read_file("cameras.txt", [this](NumberReader& reader, const std::string& first) { read_camera(reader, first); });
    read_file("images.txt", [this](NumberReader& reader, const std::string& first) { read_image(reader, first); });
    return builder_.finish();
  }

 private:
  // Calls the function with the first word of each line that is no comment. The function reads the rest of the line.
  template <typename ReadLine>
  void read_file(const char* name, ReadLine read_line) {
    NumberReader reader((std::filesystem::path(folder_) / name).string());
    builder_.fail = [&](const std::string& message) { reader.fail(message); };
    while (!reader.at_end()) {
      const std::string first(reader.word("a line"));
      if (first.starts_with('#'))
        reader.rest_of_line();
      else
        read_line(reader, first);
    }
  }

  static std::int64_t parse_id(NumberReader& reader, const std::string& word, const char* what) {
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size() || value < 0)
      reader.fail(std::string(what) + ": '" + word + "' is not a whole number");
    return value;
  }

  // The next number of the same line. A line that is too short must not take the numbers of the next one.
  static void need_more(NumberReader& reader, const char* what) {
    if (!reader.line_has_more()) reader.fail(std::string("the line ends before ") + what);
  }
  static double number_here(NumberReader& reader, const char* what) {
    need_more(reader, what);
    return reader.number(what);
  }

  void read_point(NumberReader& reader, const std::string& first) {
    Eigen::Vector3d point;
    for (double& value : point) value = number_here(reader, "a point's coordinates");
    reader.rest_of_line();  // colour, error and track; the tracks are made from the images
    builder_.add_point(parse_id(reader, first, "a point's id"), point);
  }

  void read_camera(NumberReader& reader, const std::string& first) {
    const std::int64_t id = parse_id(reader, first, "a camera's id");
    const ColmapCameraForm& form = colmap_camera_form(std::string(reader.word("a camera's model")), builder_.fail);
    const std::int64_t width = reader.integer("a camera's width", 1, kMany);
    const std::int64_t height = reader.integer("a camera's height", 1, kMany);
    std::vector<double> parameters;
    const std::string all = "all " + std::to_string(form.parameters.size()) + " parameters of " + form.name;
    for (std::size_t i = 0; i < form.parameters.size(); ++i) parameters.push_back(number_here(reader, all.c_str()));
    if (reader.line_has_more()) reader.fail("the line has more than " + all);
    builder_.add_camera(id, form, width, height, parameters);
    reader.rest_of_line();
  }

  void read_image(NumberReader& reader, const std::string& first) {
    const std::int64_t id = parse_id(reader, first, "an image's id");
    std::array<double, 4> q;
    Eigen::Vector3d translation;
    for (double& value : q) value = number_here(reader, "an image's rotation");
    for (double& value : translation) value = number_here(reader, "an image's translation");
    const std::int64_t camera = reader.integer("an image's camera", 0, kMany);
    builder_.add_image(id, q, translation, camera, std::string(reader.rest_of_line()));
    while (reader.line_has_more()) {
      const double x = reader.number("x of an observation", kFarthestPixel);
      need_more(reader, "y of an observation");
      const double y = reader.number("y of an observation", kFarthestPixel);
      need_more(reader, "the point of an observation");
      builder_.add_observation(x, y, reader.integer("point of an observation", -1, kMany));
    }
    reader.rest_of_line();
  }

  std::string folder_;
  ColmapBuilder builder_;
};

}  // namespace

ImportedBlock import_colmap_text(const std::string& folder) { return TextReader(folder).read(); }

}  // namespace megablock
