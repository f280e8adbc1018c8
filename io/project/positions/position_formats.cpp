#include "io/project/positions/position_formats.h"

#include "io/base/error.h"

namespace megablock {

namespace {

std::string format_names() {
  std::string list;
  for (const PositionFormat* format : position_formats())
    list += (list.empty() ? "" : ", ") + std::string(format->name);
  return list;
}

const PositionFormat& chosen_format(const PositionText& text, const PositionOptions& options) {
  // Columns that the project format_names are those of a table.
  if (options.format.empty() && !options.columns.empty()) return kNamedColumns;
  if (options.format.empty()) {
    if (const PositionFormat* format = recognise_positions(text)) return *format;
    throw InputError(text.path + ": is in no format of positions that is known (" + format_names() +
                     "); name the columns of a table with 'columns', or the format with 'format'");
  }
  for (const PositionFormat* format : position_formats())
    if (format->name == options.format) return *format;
  throw InputError("positions: format '" + options.format + "' is not one of: " + format_names());
}

}  // namespace

const std::vector<const PositionFormat*>& position_formats() {
  static const std::vector<const PositionFormat*> formats = {&kDjiMrk, &kRtklibPos, &kMetashape,
                                                             &kOdmGeo, &kPix4d,     &kNamedColumns};
  return formats;
}

const PositionFormat* recognise_positions(const PositionText& text) {
  for (const PositionFormat* format : position_formats())
    if (!text.lines.empty() && format->recognise(text)) return format;
  return nullptr;
}

PositionTable read_position_table(const std::string& path, const PositionOptions& options) {
  const PositionText text{path, read_text_lines(path)};
  if (text.lines.empty()) throw InputError(path + ": the file is empty; give the file of positions, or take it out");
  PositionTable table = chosen_format(text, options).read(text, options);
  if (table.rows.empty()) throw InputError(path + ": the file has no positions; give another file, or take it out");
  if (!options.crs.empty()) table.crs = options.crs;
  return table;
}

}  // namespace megablock
