#include "io/project/table_source.h"

#include <cmath>

#include "io/project/positions/position_columns.h"
#include "io/project/positions/position_fields.h"

namespace megablock {

void read_table_source(YamlReader& reader, const std::string& section, TableSource& source) {
  source.where = reader.where();
  const auto file = reader.existing_file("file");
  if (!file)
    throw InputError(reader.where() + ": key 'file' is missing in '" + section + "'; write '" + section +
                     ": {file: ...}'");
  source.path = *file;
  source.folder = reader.text("images").value_or("");
  source.options.format = reader.text("format").value_or("");
  source.options.crs = reader.text("crs").value_or("");
  source.options.accuracy = reader.existing_file("accuracy").value_or("");
  if (auto columns = reader.mapping("columns"))
    for (const std::string& field : columns->keys()) {
      if (!PositionColumns::is_field(field))
        throw InputError(columns->where(field) + ": columns: '" + field +
                         "' is not one of: " + PositionColumns::fields());
      source.options.columns[field] = *columns->text(field);
    }
  source.sigma_horizontal = reader.number("sigma_horizontal_m", kSigmaMetres);
  source.sigma_vertical = reader.number("sigma_vertical_m", kSigmaMetres);
  source.time_offset_s = reader.number("time_offset_s").value_or(kNoNumber);
}

ImageTime time_of_image(const ScannedImage& image) {
  const ImageHeader& header = image.header;
  ImageTime time{image.name, kNoNumber, header.time_s};
  double utc = header.gps_time_s;
  if (std::isnan(utc)) utc = header.time_s - header.zone_s;
  time.gps_s = utc + leap_seconds(utc);
  return time;
}

}  // namespace megablock
