// Reference of cameras as Agisoft Metashape (PhotoScan) exports it:
//
//     # CoordinateSystem: GEOGCS["WGS 84",DATUM[...],...]
//     #Label,X/Longitude,Y/Latitude,Z/Altitude,Accuracy_X/Y_(m),Accuracy_Z_(m),Yaw,Pitch,Roll,Error_(m),X_error,...
//     IMG_0001.JPG,-91.994561,46.842608,198.31,0.02,0.03,45.0,0.1,0.0,...
//     # Total Error
//     ,,,,,,,,,1.23,...
//
// X is easting or longitude, in the system of the second line as WKT; without it WGS84 where the header says Longitude.
// Heights are metres, above the ellipsoid unless the system has a vertical part. Yaw, pitch and roll are degrees, with
// pitch 0 at nadir (kBody); Omega, Phi and Kappa refer to the axes of the grid. The columns of errors and estimates
// (Error_(m), X_est, ...) are Metashape's results, not accuracies, and are not read. The tail has no labels.
//
// Sources: Agisoft Metashape User Manual, "Reference pane" (export, columns n x y z X Y Z a b c); agisoft-llc
// metashape-scripts, save_estimated_reference.
#include "io/base/error.h"
#include "io/project/positions/position_columns.h"
#include "io/project/positions/position_fields.h"
#include "io/project/positions/position_formats.h"

namespace megablock {

namespace {

// The line with the names of the columns; the number of lines if there is none.
std::size_t label_line(const PositionText& text) {
  for (std::size_t l = 0; l < text.lines.size(); ++l)
    if (lower_case(text.lines[l].text).starts_with("#label")) return l;
  return text.lines.size();
}

bool is_metashape(const PositionText& text) { return label_line(text) < text.lines.size(); }

PositionTable read_metashape(const PositionText& text, const PositionOptions& options) {
  const std::size_t at = label_line(text);
  if (at == text.lines.size())
    throw InputError(text.path + ": has no line that begins with #Label; export the reference of Metashape again");
  const std::string header = text.lines[at].text.substr(1);
  const Separator separator = separator_of(header);
  const PositionColumns columns(split_fields(header, separator));
  if (!columns.has_place())
    throw InputError(text.where(text.lines[at]) +
                     ": the header names no columns X and Y; export the reference with its source coordinates");
  PositionTable table;
  table.crs = lower_case(header).find("longitude") != std::string::npos ? "WGS84" : "";
  for (std::size_t l = 0; l < at; ++l) {
    const std::string& line = text.lines[l].text;
    const std::size_t colon = line.find(':');
    if (lower_case(line).find("coordinatesystem") != std::string::npos && colon != std::string::npos)
      table.crs = trimmed(line.substr(colon + 1));
  }
  if (table.crs.starts_with("LOCAL_CS")) table.crs = "local";
  if (table.crs.empty() && options.crs.empty())
    throw InputError(
        text.where(text.lines[at]) +
        ": the file does not name its coordinate reference system; add 'crs: EPSG:...' beside 'file' in the "
        "project file");
  for (std::size_t l = at + 1; l < text.lines.size(); ++l) {
    const TextLine& line = text.lines[l];
    if (line.text.front() == '#') continue;
    if (const auto row = columns.row(split_fields(line.text, separator), separator, text.where(line), options.angles))
      table.rows.push_back(*row);
  }
  return table;
}

}  // namespace

const PositionFormat kMetashape = {"metashape", "reference of Metashape (#Label,...)", is_metashape, read_metashape};

}  // namespace megablock
