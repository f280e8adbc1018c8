#include "cluster/commands/verticals_command.h"

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>

#include "cluster/commands/found_verticals.h"
#include "cluster/job/stage.h"
#include "cluster/process/exit_codes.h"
#include "cluster/stages/common/block_hash.h"
#include "cluster/terminal/option_checks.h"
#include "cluster/terminal/output_check.h"
#include "geometry/numbers/median.h"
#include "io/base/error.h"
#include "io/images/image_codec.h"
#include "io/images/image_header.h"
#include "io/project/inputs/verticals.h"
#include "io/project/project.h"
#include "io/store/job/job_store.h"
#include "io/text/csv_row.h"
#include "match/images/image_vertical.h"

namespace megablock {

namespace {

struct VerticalsOptions {
  std::string project, output;
  SegmentOptions segments;
};

// Part of the key of an image's row; raised when results change.
constexpr int kVerticalsAlgorithm = 1;

// An attitude belongs to the sensor. Its mounting, and the edges of buildings, are off by this much.
constexpr double kLeastSensorSigma = 2 * kDegree;

constexpr double kGivenPoseSigma = 5 * kDegree;  // approximate poses

std::uint64_t seed_of(std::string_view image) { return Hasher().add(image).value(); }

}  // namespace

VerticalPrior expected_vertical(const Block& block, ImageIndex i) {
  VerticalPrior prior;
  const Image& image = block.images[i];
  const Frame& frame = block.frames[image.frame];
  if (frame.attitude_prior) {
    prior.down = block.mount_of(i).pose.rotation * (frame.attitude_prior->rotation_cw * -Eigen::Vector3d::UnitZ());
    prior.roll_sigma = prior.pitch_sigma = std::max(kLeastSensorSigma, frame.attitude_prior->sigma_rad.maxCoeff());
    return prior;
  }
  if (frame.given_pose) {
    prior.down = block.mount_of(i).pose.rotation * (frame.given_pose->rotation * -Eigen::Vector3d::UnitZ());
    prior.roll_sigma = prior.pitch_sigma = kGivenPoseSigma;
    return prior;
  }
  try {
    prior.down = down_of_exif_orientation(read_image_header(block.path_of(i)).orientation);
  } catch (const InputError&) {
  }  // the error is reported when the image is read
  return prior;
}

// Cameras are held within a sigma of the level two times out of three. In images taken from above, the edges that look
// upright (rows of fields or trees) lie in any direction.
std::string remark_on(const std::vector<FoundVertical>& verticals) {
  constexpr std::size_t kFewest = 5;
  std::vector<double> rolls;
  for (const FoundVertical& v : verticals)
    if (v.found) rolls.push_back(std::abs(v.roll));
  if (rolls.size() < kFewest || median(rolls) < 1) return "";
  return "Most of them are turned farther than cameras are held: images from above show no vertical, but rows of "
         "fields look like one. Check some of them before you use them.\n";
}

namespace {

// One line that names the first images in which no straight edge was found; empty where there are none.
std::string edgeless_text(const Block& block, const std::vector<FoundVertical>& verticals) {
  constexpr std::size_t kNamed = 5;
  std::size_t count = 0;
  std::string names;
  for (std::size_t k = 0; k < verticals.size(); ++k) {
    if (verticals[k].segments > 0 || !verticals[k].failure.empty() || ++count > kNamed) continue;
    names += (count > 1 ? ", " : "") + block.name_of(ImageIndex(static_cast<std::int64_t>(k)));
  }
  if (count == 0) return "";
  if (count > kNamed) names += fmt::format(" and {} more", count - kNamed);
  return fmt::format("{} {} without straight edges: {}\n", count, count == 1 ? "image" : "images", names);
}

SeenVertical seen_vertical(ImageIndex image, const ImageVertical& found, const Intrinsics& camera) {
  return {image, found.down.direction, found.down.covariance,
          Eigen::Map<const Eigen::VectorXd>(camera.data(), camera.size()), found.by_camera};
}

// The row of an image. Its sigmas are also given with the errors of the camera, for the reader of the table.
std::string row_of(const Block& block, ImageIndex i, const ImageVertical& v) {
  const std::string& name = block.name_of(i);
  const std::string found_in = fmt::format("{},{},{}", v.segments, v.vanishing_points, v.lines);
  if (!v.found) return csv_field(name) + ",,,,,,,,,,," + found_in + ",,,\n";
  const Camera& camera = block.cameras[block.camera_of(i)];
  const SeenVertical seen = seen_vertical(i, v, camera.intrinsics);
  const Eigen::Matrix2d whole = roll_pitch_of(whole_error(seen, camera, camera.intrinsics)).covariance;
  return verticals_row(seen, name) + fmt::format(",{},{:.3f},{:.3g},{:.3g}\n", found_in, v.variance_factor,
                                                 std::sqrt(whole(0, 0)) * kDegreesPerRadian,
                                                 std::sqrt(whole(1, 1)) * kDegreesPerRadian);
}

// A hash of everything that determines the result of an image.
std::uint64_t key_of(const Block& block, ImageIndex i, const VerticalPrior& prior, std::uint64_t mask,
                     const SegmentOptions& segments) {
  const Camera& camera = block.cameras[block.camera_of(i)];
  Hasher hasher;
  hasher.add(kVerticalsAlgorithm).add(block.name_of(i)).add(block.images[i].file_hash).add(mask);
  hasher.add(camera.width).add(camera.height);
  add_to_hash(hasher, camera.intrinsics);
  for (const double sigma : camera.prior_sigma) hasher.add(sigma);
  add_to_hash(hasher, prior.down);
  hasher.add(prior.roll_sigma).add(prior.pitch_sigma);
  hasher.add(segments.min_length_px).add(segments.max_megapixels).add(segments.straightness_px);
  return hasher.value();
}

// Finds the verticals of all images. Images in `file` are not read again.
std::vector<FoundVertical> look_at_images(const Block& block, const SegmentOptions& segments, const JobStore& store,
                                          const std::string& file) {
  IndexedVector<CameraIndex, std::uint64_t> masks;
  for (const Camera& camera : block.cameras)
    masks.push_back(camera.mask_path.empty() ? 0 : hash_file(camera.mask_path));
  const auto count = static_cast<std::int64_t>(block.images.size());
  std::vector<VerticalPrior> priors(block.images.size());
  std::vector<std::uint64_t> keys(block.images.size());
#pragma omp parallel for schedule(dynamic, 64)
  for (std::int64_t k = 0; k < count; ++k) {
    const auto at = static_cast<std::size_t>(k);
    priors[at] = expected_vertical(block, ImageIndex(k));
    keys[at] = key_of(block, ImageIndex(k), priors[at], masks[block.camera_of(ImageIndex(k))], segments);
  }
  FoundVerticals found(store, file, std::move(keys));
  if (found.count() > 0) std::printf("%zu of %zu images were looked at before\n", found.count(), priors.size());
  cv::setNumThreads(1);
  load_image_codecs();
#pragma omp parallel for schedule(dynamic, 1)
  for (std::int64_t k = 0; k < count; ++k) {
    const auto at = static_cast<std::size_t>(k);
    if (found.has(at)) continue;
    const ImageIndex i(k);
    const ImageVertical v = find_image_vertical(block.path_of(i), block.cameras[block.camera_of(i)], priors[at],
                                                seed_of(block.image_names[i]), segments);
    FoundVertical vertical{row_of(block, i, v), v.failure, v.found, v.roll, v.segments};
#pragma omp critical(found_verticals)
    {
      found.add(at, std::move(vertical));
      found.save_now_and_then();
    }
  }
  found.save();
  return found.all();
}

int write_verticals(VerticalsOptions options) {
  options.segments.check();
  const Project project = read_project(options.project, settings_sections());
  const Block& block = project.block;
  namespace fs = std::filesystem;
  if (!has_image_files(block))
    throw InputError(options.project +
                     ": the project has no image files, from which verticals are found; give 'images' in it");
  if (options.output.empty()) options.output = (fs::path(project.file).parent_path() / "verticals.csv").string();
  check_output(options.output, inputs_of(options.project, "verticals"));
  const fs::path output = fs::absolute(options.output);

  const JobStore store(output.parent_path().string());
  const std::vector<FoundVertical> verticals =
      look_at_images(block, options.segments, store, output.filename().string() + ".found");

  std::string table = verticals_header() +
                      ",segments,vanishing_points,lines,variance_factor,whole_sigma_roll_deg,whole_sigma_pitch_deg\n";
  int found = 0, failed = 0;
  for (std::size_t k = 0; k < verticals.size(); ++k) {
    const FoundVertical& vertical = verticals[k];
    table += vertical.row;
    found += vertical.found;
    if (vertical.failure.empty()) continue;
    ++failed;
    std::fprintf(stderr, "megablock: %s: %s\n", block.name_of(ImageIndex(static_cast<std::int64_t>(k))).c_str(),
                 vertical.failure.c_str());
  }
  store.write_text(output.filename().string(), table);
  std::printf("%d of %zu images show the vertical: %s\n", found, verticals.size(), options.output.c_str());
  std::printf("%s%s", edgeless_text(block, verticals).c_str(), remark_on(verticals).c_str());
  std::printf("To use them, give 'verticals: %s' in the project file.\n",
              output.lexically_proximate(fs::path(project.file).parent_path()).c_str());
  return failed > 0 ? kExitFailedUnits : kExitDone;
}

}  // namespace

void add_verticals(CLI::App& app, std::function<int()>& action) {
  auto options = std::make_shared<VerticalsOptions>();
  SegmentOptions& s = options->segments;
  CLI::App* command =
      app.add_subcommand("verticals", "Find the direction of down in every image, from its straight edges");
  command->footer("Example: megablock verticals block.yaml -o verticals.csv");
  command->add_option("project", options->project, "Project file")->required();
  command
      ->add_option("-o,--output", options->output,
                   "CSV file [verticals.csv beside the project]; found verticals are kept in FILE.found, so that the "
                   "command, when it is started again, only reads the other images")
      ->check(named());
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
