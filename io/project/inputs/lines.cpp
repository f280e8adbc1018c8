#include "io/project/inputs/lines.h"

#include <map>
#include <set>

#include "io/base/error.h"
#include "io/project/inputs/image_lookup.h"
#include "io/text/csv_table.h"
#include "io/text/plausible.h"

namespace megablock {

namespace {

// Ends of sigma s across a line of L pixels give its direction a sigma of sqrt(2) s / L: 8 degrees for 1 px and 10 px.
constexpr double kShortestPx = 10;

KnownLine::Direction direction_of(const std::string& text, const std::string& where) {
  if (text == "vertical") return KnownLine::Direction::kVertical;
  if (text == "horizontal") return KnownLine::Direction::kHorizontal;
  throw InputError(where + ": direction: '" + text + "' is not one of: vertical, horizontal");
}

Eigen::Vector2d end_of(const CsvTable& csv, std::size_t row, const char* number, const Camera& camera) {
  const Eigen::Vector2d pixel(csv.needed_number(row, std::string("column") + number + "_px"),
                              csv.needed_number(row, std::string("row") + number + "_px"));
  if (!(pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() <= camera.width && pixel.y() <= camera.height))
    throw InputError(csv.where(row) + ": end " + number + " lies outside the image of " + std::to_string(camera.width) +
                     " x " + std::to_string(camera.height) + " px; correct its coordinates");
  return pixel;
}

KnownLine::Measurement measurement(const CsvTable& csv, std::size_t row, ImageIndex image, const Camera& camera) {
  KnownLine::Measurement m{image, end_of(csv, row, "1", camera), end_of(csv, row, "2", camera),
                           csv.number(row, "sigma_px", kSigmaPx).value_or(1)};
  if ((m.second - m.first).norm() < kShortestPx)
    throw InputError(csv.where(row) +
                     ": the ends are less than 10 px apart; measure them farther apart, because so short a line does "
                     "not determine a direction");
  return m;
}

}  // namespace

void read_lines(const std::string& path, const std::vector<std::string>& left_out, Block& block,
                std::vector<std::string>& warnings) {
  const CsvTable csv(path);
  const std::vector<std::string> columns{"name",    "direction",  "image",  "column1_px",
                                         "row1_px", "column2_px", "row2_px"};
  csv.require(columns);
  std::vector<std::string> known = columns;
  known.push_back("sigma_px");
  csv.refuse_others(known);
  const ImageLookup images(block, left_out);
  std::map<std::string, std::size_t> line_of_name;
  std::map<std::string, std::string> first_place;
  std::set<std::pair<std::string, ImageIndex>> seen;
  for (std::size_t row = 0; row < csv.row_count(); ++row) {
    const std::string name = csv.text(row, "name"), where = csv.where(row), image = csv.text(row, "image");
    if (name.empty()) throw InputError(where + ": name is empty; give every line a name");
    const KnownLine::Direction direction = direction_of(csv.text(row, "direction"), where);
    const auto [entry, inserted] = line_of_name.emplace(name, block.lines.size());
    if (inserted) block.lines.push_back({name, direction, {}});
    KnownLine& line = block.lines[entry->second];
    if (line.direction != direction)
      throw InputError(where + ": line '" + name + "' has another direction than in " + first_place[name] +
                       "; correct one of the two, or give the lines different names");
    first_place.emplace(name, where);
    const ImageLookup::Found found = images.find(image);
    if (found.kind == ImageLookup::Kind::kLeftOut) {
      warnings.push_back(where + ": the measurement of line '" + name + "' is not used, because image '" + image +
                         "' was left out of the block");
      continue;
    }
    if (found.kind == ImageLookup::Kind::kAmbiguous)
      throw InputError(where + ": line '" + name + "' is measured in image '" + image +
                       "', and several images of the block have this name; write it with its folder");
    if (found.kind == ImageLookup::Kind::kAbsent)
      throw InputError(where + ": line '" + name + "' is measured in image '" + image +
                       "', which the block does not have; correct the name or delete the measurement");
    if (!seen.emplace(name, found.image).second)
      throw InputError(where + ": line '" + name + "' is measured twice in image '" + image +
                       "'; delete one of the measurements");
    line.measurements.push_back(measurement(csv, row, found.image, block.cameras[block.camera_of(found.image)]));
  }
  for (const KnownLine& line : block.lines)
    if (line.direction == KnownLine::Direction::kHorizontal && line.measurements.size() < 2)
      warnings.push_back(path + ": the horizontal line '" + line.name +
                         "' is measured in fewer than two images and has no effect; measure it in a second image");
}

}  // namespace megablock
