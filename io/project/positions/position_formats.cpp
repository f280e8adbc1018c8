#include "io/project/positions/position_formats.h"

#include <fstream>

#include "io/base/error.h"

namespace megablock {

namespace {

// Whether a file is no text: it has zero bytes, and does not begin with a mark of UTF-16.
bool is_binary(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string begin(4096, ' ');
  file.read(begin.data(), static_cast<std::streamsize>(begin.size()));
  begin.resize(static_cast<std::size_t>(file.gcount()));
  return !begin.starts_with("\xff\xfe") && !begin.starts_with("\xfe\xff") && begin.find('\0') != std::string::npos;
}

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
    const std::string names = names_of_header(text);
    throw InputError(text.path + ": is in no format of positions that is known (" + format_names() + ")" +
                     (names.empty()
                          ? "; name the columns of a table with 'columns', or the format with 'format'"
                          : "; its columns are " + names +
                                ", of which none, or too few, are known as image and position; say which they are with "
                                "'columns: {image: ..., x: ..., y: ..., z: ...}'"));
  }
  for (const PositionFormat* format : position_formats())
    if (format->name == options.format) {
      if (text.binary != (format == &kSbet))
        throw InputError(text.path + ": is " + (text.binary ? "no text" : "a text") + "; a file of format '" +
                         options.format + "' is " + (text.binary ? "one" : "binary") + "; correct 'format'");
      return *format;
    }
  throw InputError("positions: format '" + options.format + "' is not one of: " + format_names());
}

}  // namespace

const std::vector<const PositionFormat*>& position_formats() {
  static const std::vector<const PositionFormat*> formats = {&kDjiMrk, &kRtklibPos, &kMetashape,    &kOdmGeo,   &kPix4d,
                                                             &kTum,    &kKitti,     &kNamedColumns, &kInertial, &kSbet};
  return formats;
}

const PositionFormat* recognise_positions(const PositionText& text) {
  if (text.binary) return kSbet.recognise(text) ? &kSbet : nullptr;
  for (const PositionFormat* format : position_formats())
    if (!text.lines.empty() && format->recognise(text)) return format;
  return nullptr;
}

PositionText read_position_text(const std::string& path) {
  if (is_binary(path)) return {path, {}, true};
  return {path, read_text_lines(path)};
}

PositionTable read_position_table(const std::string& path, const PositionOptions& options) {
  const PositionText text = read_position_text(path);
  if (text.lines.empty() && !text.binary)
    throw InputError(path + ": the file is empty; give the file of positions, or take it out");
  PositionTable table = chosen_format(text, options).read(text, options);
  if (table.rows.empty()) throw InputError(path + ": the file has no positions; give another file, or take it out");
  if (!options.crs.empty()) table.crs = options.crs;
  return table;
}

}  // namespace megablock
