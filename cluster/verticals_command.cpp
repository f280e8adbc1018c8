#include "cluster/verticals_command.h"

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>

#include "cluster/exit_codes.h"
#include "io/error.h"
#include "io/hash.h"
#include "io/image_header.h"
#include "io/job_store.h"
#include "io/project.h"
#include "match/image_vertical.h"

namespace megablock {

namespace {

struct VerticalsOptions {
  std::string project, output;
  SegmentOptions segments;
};

// Attitudes of sensors are those of the sensor: mountings, and edges of buildings, are off by this much.
constexpr double kLeastSensorSigma = 2 * kDegree;

// Where down should be: by the attitude of the frame, else by how the camera was held (EXIF).
VerticalPrior expected_vertical(const Block& block, ImageIndex i) {
  VerticalPrior prior;
  const Image& image = block.images[i];
  const Frame& frame = block.frames[image.frame];
  if (frame.attitude_prior) {
    prior.down = block.mount_of(i).pose.rotation * (frame.attitude_prior->rotation_cw * -Eigen::Vector3d::UnitZ());
    prior.roll_sigma = prior.pitch_sigma = std::max(kLeastSensorSigma, frame.attitude_prior->sigma_rad.maxCoeff());
    return prior;
  }
  try {
    prior.down = down_of_exif_orientation(read_image_header(image.path).orientation);
  } catch (const InputError&) {
  }  // reading the picture says what is wrong with it
  return prior;
}

std::uint64_t seed_of(const Image& image) {
  Hasher hasher;
  hasher.add(std::string_view(image.name));
  return hasher.value();
}

std::string row_of(const std::string& name, const ImageVertical& v) {
  std::string row = fmt::format("{},{},{}", name, v.segments, v.vanishing_points);
  if (!v.found) return row + ",,,,,,,,,,\n";
  const RollPitch angles = roll_pitch_of(v.down);
  const double roll = std::sqrt(angles.covariance(0, 0)), pitch = std::sqrt(angles.covariance(1, 1));
  const Eigen::Vector3d& d = v.down.direction;
  return row + fmt::format(",{},{:.9f},{:.9f},{:.9f},{:.5f},{:.5f},{:.3g},{:.3g},{:.3f},{:.3f}\n", v.lines, d.x(),
                           d.y(), d.z(), angles.roll * kDegreesPerRadian, angles.pitch * kDegreesPerRadian,
                           roll * kDegreesPerRadian, pitch * kDegreesPerRadian,
                           angles.covariance(0, 1) / (roll * pitch), v.variance_factor);
}

int write_verticals(VerticalsOptions options) {
  options.segments.check();
  const Project project = read_project(options.project);
  const Block& block = project.block;
  namespace fs = std::filesystem;
  if (std::none_of(block.images.begin(), block.images.end(), [](const Image& i) { return fs::exists(i.path); }))
    throw InputError(options.project + ": the project has no pictures; verticals are found from what they show");
  if (options.output.empty()) options.output = (fs::path(project.file).parent_path() / "verticals.csv").string();
  const fs::path output = fs::absolute(options.output);

  std::vector<ImageVertical> verticals(block.images.size());
  const auto count = static_cast<std::int64_t>(block.images.size());
  cv::setNumThreads(1);
#pragma omp parallel for schedule(dynamic, 1)
  for (std::int64_t k = 0; k < count; ++k) {
    const ImageIndex i(k);
    verticals[static_cast<std::size_t>(k)] =
        find_image_vertical(block.images[i].path, block.cameras[block.camera_of(i)], expected_vertical(block, i),
                            seed_of(block.images[i]), options.segments);
  }

  std::string table =
      "image,segments,vanishing_points,lines,down_x,down_y,down_z,roll_deg,pitch_deg,sigma_roll_deg,sigma_pitch_deg,"
      "correlation,variance_factor\n";
  int found = 0, failed = 0;
  for (std::int64_t k = 0; k < count; ++k) {
    const ImageVertical& v = verticals[static_cast<std::size_t>(k)];
    const Image& image = block.images[ImageIndex(k)];
    table += row_of(image.name, v);
    found += v.found;
    failed += !v.failure.empty();
    if (!v.failure.empty()) std::fprintf(stderr, "megablock: %s: %s\n", image.name.c_str(), v.failure.c_str());
  }
  JobStore(output.parent_path().string()).write_text(output.filename().string(), table);
  std::printf("%d of %zu images show the vertical: %s\n", found, verticals.size(), options.output.c_str());
  return failed > 0 ? kExitFailedUnits : kExitDone;
}

}  // namespace

void add_verticals(CLI::App& app, std::function<int()>& action) {
  auto options = std::make_shared<VerticalsOptions>();
  SegmentOptions& s = options->segments;
  CLI::App* command = app.add_subcommand("verticals", "Write where down is in every picture, from its straight edges");
  command->footer("Example: megablock verticals block.yaml -o verticals.csv");
  command->add_option("project", options->project, "Project file")->required();
  command->add_option("-o,--output", options->output, "CSV file [verticals.csv beside the project]");
  command->add_option("--min-length", s.min_length_px, "Shortest segment, px of images reduced to --max-megapixels")
      ->capture_default_str();
  command->add_option("--max-megapixels", s.max_megapixels, "Larger images are reduced")->capture_default_str();
  command
      ->add_option("--straightness", s.straightness_px,
                   "Added to the error of a segment's ends, px: how bent edges are")
      ->capture_default_str();
  command->callback([=, &action] { action = [options] { return write_verticals(*options); }; });
}

}  // namespace megablock
