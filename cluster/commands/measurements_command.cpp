#include "cluster/commands/measurements_command.h"

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "cluster/process/exit_codes.h"
#include "cluster/status/status.h"
#include "cluster/terminal/option_checks.h"
#include "cluster/terminal/output_check.h"
#include "io/base/error.h"
#include "io/base/file_error.h"
#include "io/result/measurements.h"
#include "io/text/csv_row.h"

namespace megablock {

namespace {

namespace fs = std::filesystem;

struct MeasurementsOptions {
  std::string job, output;
  std::vector<std::string> images, frames;
  std::vector<double> near;  // east, north and, perhaps, up
  double radius_m = 0;
  bool json = false;
};

void check(const MeasurementsOptions& options) {
  const bool by_image = !options.images.empty() || !options.frames.empty(), by_place = !options.near.empty();
  if (by_image == by_place)
    throw InputError("measurements: either --image or --frame, or --near; see 'megablock measurements --help'");
  if (by_place && options.near.size() != 2 && options.near.size() != 3)
    throw InputError("measurements: --near takes EAST,NORTH or EAST,NORTH,UP in metres");
  if (by_place && !(options.radius_m > 0)) throw InputError("measurements: --near needs --radius METRES");
  if (!by_place && options.radius_m > 0) throw InputError("measurements: --radius is for --near EAST,NORTH[,UP]");
  for (const double coordinate : options.near)
    if (!std::isfinite(coordinate)) throw InputError("measurements: --near takes finite numbers, in metres");
}

// Warns that no point lies near the asked position, and says where points lie.
void tell_of_nothing(const MeasurementStore& store, const MeasurementsOptions& options) {
  const Eigen::AlignedBox3d extent = store.extent();
  std::string where = "no point has a position";
  if (!extent.isEmpty())
    where = fmt::format("points lie from {:.1f} to {:.1f} m east, {:.1f} to {:.1f} m north, {:.1f} to {:.1f} m up",
                        extent.min().x(), extent.max().x(), extent.min().y(), extent.max().y(), extent.min().z(),
                        extent.max().z());
  std::fprintf(stderr, "megablock: warning: %s: no point lies within %g m of the place; %s\n", options.job.c_str(),
               options.radius_m, where.c_str());
}

Measurements ask(const MeasurementStore& store, const MeasurementsOptions& options) {
  if (!options.near.empty()) {
    const double up = options.near.size() == 3 ? options.near[2] : std::nan("");
    Measurements found = store.near({{options.near[0], options.near[1], up}, options.radius_m});
    if (const std::vector<std::string> stale = unfinished_stages(JobStore(options.job)); !stale.empty())
      std::fprintf(stderr, "megablock: warning: %s: places are those of an older result; %s\n", options.job.c_str(),
                   stale.front().c_str());
    if (found.size() == 0) tell_of_nothing(store, options);
    return found;
  }
  std::vector<ImageIndex> images = store.find_images(options.images);
  const std::vector<ImageIndex> of_frames = store.images_of_frames(options.frames);
  images.insert(images.end(), of_frames.begin(), of_frames.end());
  return store.of_images(std::move(images));
}

std::string quoted(const std::string& name, bool json) {
  if (json) return nlohmann::json(name).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  return csv_field(name);
}

// A number; NaN becomes an empty cell, or null.
std::string number(float value, bool json) {
  return std::isfinite(value) ? fmt::format("{:.4f}", value) : json ? "null" : "";
}

// `adjusted`: with the columns from the result.
std::string table(const MeasurementStore& store, const Measurements& rows, bool adjusted, bool json) {
  std::vector<ImageIndex> images = rows.image;
  std::sort(images.begin(), images.end());
  images.erase(std::unique(images.begin(), images.end()), images.end());
  std::vector<std::string> names = store.names_of(images);
  for (std::string& name : names) name = quoted(name, json);
  std::string text = json ? "[" : "image,track,x_px,y_px,feature,tile";
  if (!json) text += adjusted ? ",kept,residual_x_px,residual_y_px\n" : "\n";
  for (std::size_t r = 0; r < rows.image.size(); ++r) {
    const auto image = std::lower_bound(images.begin(), images.end(), rows.image[r]) - images.begin();
    const char* row =
        json ? "{}\n {{\"image\": {}, \"track\": {}, \"x_px\": {}, \"y_px\": {}, \"feature\": {}, \"tile\": {}"
             : "{}{},{},{},{},{},{}";
    text += fmt::format(fmt::runtime(row), json && r > 0 ? "," : "", names[static_cast<std::size_t>(image)],
                        rows.track[r].value, from_fixed_pixel(rows.x[r]), from_fixed_pixel(rows.y[r]), rows.feature[r],
                        rows.tile[r].value);
    if (adjusted)
      text += fmt::format(
          fmt::runtime(json ? ", \"kept\": {}, \"residual_x_px\": {}, \"residual_y_px\": {}" : ",{},{},{}"),
          static_cast<int>(rows.kept[r]), number(rows.residual_x[r], json), number(rows.residual_y[r], json));
    text += json ? "}" : "\n";
  }
  return json ? text + "\n]\n" : text;
}

int measurements(const MeasurementsOptions& options) {
  check(options);
  if (!options.output.empty()) {
    check_parent(options.output);
    check_output(options.output, inputs_of(options.job));
  }
  const MeasurementStore store(options.job);
  const std::string text = table(store, ask(store, options), !options.near.empty(), options.json);
  if (options.output.empty()) {
    std::fwrite(text.data(), 1, text.size(), stdout);
  } else {
    const fs::path path = fs::absolute(options.output);
    JobStore(path.parent_path().string()).write_text(path.filename().string(), text);
  }
  return kExitDone;
}

}  // namespace

void add_measurements(CLI::App& app, std::function<int()>& action) {
  auto options = std::make_shared<MeasurementsOptions>();
  CLI::App* command = app.add_subcommand("measurements", "List tie point observations in some images, or near a place");
  command->footer(
      "Example: megablock measurements job --image 0001.jpg --image 0002.jpg -o rows.csv\n"
      "         megablock measurements job --near 120,85 --radius 10");
  command->add_option("job", options->job, "Job directory")->required();
  command->add_option("--image", options->images, "Name of an image; may be repeated")->allow_extra_args(false);
  command->add_option("--frame", options->frames, "Name of a frame: all its images; may be repeated")
      ->allow_extra_args(false);
  command
      ->add_option("--near", options->near, "Ground position EAST,NORTH[,UP], m; without UP distances are horizontal")
      ->delimiter(',')
      ->type_name("EAST,NORTH[,UP]")
      ->expected(1, 3)
      ->allow_extra_args(false);
  command->add_option("--radius", options->radius_m, "Radius about that position, within which adjusted points lie, m")
      ->check(positive());
  command->add_option("-o,--output", options->output, "File to write instead of standard output")->check(named());
  command->add_flag("--json", options->json, "JSON instead of CSV");
  command->callback([=, &action] { action = [options] { return measurements(*options); }; });
}

}  // namespace megablock
