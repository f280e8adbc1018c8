// Reads the section `control` of the project file: the file of control points, and settings that override its values.
#include <algorithm>

#include "io/base/error.h"
#include "io/project/project_sections.h"

namespace megablock {

namespace {

void set_check_points(YamlReader& control, ControlTable& table) {
  const auto names = control.texts("check");
  if (!names) return;
  for (const std::string& name : *names) {
    const auto found = std::find_if(table.points.begin(), table.points.end(),
                                    [&](const ControlTable::Point& point) { return point.name == name; });
    if (found == table.points.end())
      throw InputError(control.where("check") + ": control.check: the control file has no point '" + name + "'");
    found->role = PointRole::kCheck;
  }
}

void set_sigmas(YamlReader& control, ControlTable& table) {
  const auto horizontal = control.number("sigma_horizontal_m", kSigmaMetres);
  const auto vertical = control.number("sigma_vertical_m", kSigmaMetres);
  const auto pixels = control.number("sigma_px", kSigmaPx);
  for (ControlTable::Point& point : table.points) {
    if (horizontal) point.sigma.head<2>().setConstant(*horizontal);
    if (vertical) point.sigma.z() = *vertical;
    for (ControlTable::Measurement& measurement : point.measurements)
      if (pixels) measurement.sigma_px = *pixels;
  }
}

}  // namespace

std::optional<ControlTable> read_control(YamlReader& top) {
  const auto node = top.node("control");
  if (!node) return std::nullopt;
  if (!node->IsMap()) return read_control_table(*top.existing_file("control"));
  YamlReader control = *top.mapping("control");
  const auto file = control.existing_file("file");
  if (!file)
    throw InputError(control.where() + ": key 'file' is missing in 'control'; write 'control: {file: points.csv}'");
  ControlTable table = read_control_table(*file);
  set_sigmas(control, table);
  set_check_points(control, table);
  control.finish();
  return table;
}

}  // namespace megablock
