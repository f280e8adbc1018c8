// Reads files of positions of images that other programs write. To add a format, write one file with its reader and add
// one line to the table in position_formats.cpp. Internal to io/.
//
// A reader's head states units, datum and axes of the format, and where it is defined.
#pragma once

#include <string>
#include <vector>

#include "io/project/positions/position_table.h"
#include "io/text/text_lines.h"

namespace megablock {

// A file as its reader gets it.
struct PositionText {
  std::string path;
  std::vector<TextLine> lines;  // those that are not empty; none of a binary file
  bool binary = false;
  std::string where(const TextLine& line) const { return path + ":" + std::to_string(line.number); }
};

struct PositionFormat {
  const char* name;      // in the key `format` of the project file
  const char* describe;  // for messages and help
  // Whether the file has this format, from its name and its lines.
  bool (*recognise)(const PositionText& text);
  // Throws InputError with file:line for malformed lines.
  PositionTable (*read)(const PositionText& text, const PositionOptions& options);
};

// The readers, one file each.
extern const PositionFormat kDjiMrk;        // dji_mrk.cpp
extern const PositionFormat kRtklibPos;     // rtklib_pos.cpp
extern const PositionFormat kMetashape;     // metashape_reference.cpp
extern const PositionFormat kPix4d;         // pix4d_geolocation.cpp
extern const PositionFormat kOdmGeo;        // odm_geo.cpp
extern const PositionFormat kSbet;          // sbet.cpp
extern const PositionFormat kInertial;      // inertial_text.cpp
extern const PositionFormat kTum;           // tum_trajectory.cpp
extern const PositionFormat kKitti;         // kitti_poses.cpp
extern const PositionFormat kNamedColumns;  // named_columns.cpp

// The names of the columns of a table for messages, "'Bild', 'Ost', 'Nord'"; empty if its first line is no list of
// names.
std::string names_of_header(const PositionText& text);

// The table, in the order in which formats are tried.
const std::vector<const PositionFormat*>& position_formats();

// The format of a file; nullptr if none recognises it.
const PositionFormat* recognise_positions(const PositionText& text);

// The file as readers get it. Throws InputError if it cannot be read.
PositionText read_position_text(const std::string& path);

// Reads a file. Throws InputError if it cannot be read, has no rows, or has none of the formats.
PositionTable read_position_table(const std::string& path, const PositionOptions& options);

}  // namespace megablock
