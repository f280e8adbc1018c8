#include "cluster/commands/masks_command.h"

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "cluster/job/stage.h"
#include "cluster/process/exit_codes.h"
#include "cluster/terminal/option_checks.h"
#include "cluster/terminal/output_check.h"
#include "io/base/error.h"
#include "io/base/file_error.h"
#include "io/images/image_codec.h"
#include "io/project/project.h"
#include "io/report/drawing/html.h"
#include "io/store/job/job_store.h"
#include "match/images/image_file.h"
#include "match/images/static_regions.h"

namespace megablock {

namespace {

namespace fs = std::filesystem;

constexpr const char* kPage = "masks.html";

struct MasksOptions {
  std::string project, output;
  StaticRegionOptions regions;
};

// The mask proposed for a camera.
struct Proposal {
  std::string camera, file;  // file: empty when nothing is masked, or the camera could not be judged
  int images = 0;            // images that were compared
  double masked = 0;         // share of the image
  std::string note;
  std::string preview;  // JPEG of an image with the mask over it
};

// The images of every camera in order of acquisition, without those taken at the same place as the one before.
IndexedVector<CameraIndex, std::vector<ImageIndex>> images_to_look_at(const Block& block,
                                                                      const StaticRegionOptions& options) {
  IndexedVector<CameraIndex, std::vector<ImageIndex>> chosen(block.cameras.size());
  std::vector<ImageIndex> order;
  for (ImageIndex i(0); block.images.contains(i); ++i.value) order.push_back(i);
  const auto frame_of = [&](ImageIndex i) -> const Frame& { return block.frames[block.images[i].frame]; };
  std::stable_sort(order.begin(), order.end(), [&](ImageIndex a, ImageIndex b) {
    const Frame &fa = frame_of(a), &fb = frame_of(b);
    if (fa.pass != fb.pass) return fa.pass < fb.pass;
    return (std::isfinite(fa.time_s) ? fa.time_s : 0) < (std::isfinite(fb.time_s) ? fb.time_s : 0);
  });
  const auto place = [&](ImageIndex i) -> std::optional<Eigen::Vector3d> {
    const Frame& frame = frame_of(i);
    if (frame.given_pose) return frame.given_pose->centre;
    if (frame.position_prior) return frame.position_prior->position;
    return std::nullopt;
  };
  for (const ImageIndex image : order) {
    std::vector<ImageIndex>& own = chosen[block.camera_of(image)];
    if (!own.empty()) {
      const auto last = place(own.back()), here = place(image);
      if (last && here && (*here - *last).norm() < options.min_distance_m) continue;
    }
    own.push_back(image);
  }
  for (std::vector<ImageIndex>& own : chosen) {
    const auto wanted = static_cast<std::size_t>(options.max_images);
    if (own.size() <= wanted) continue;
    std::vector<ImageIndex> spread;
    for (std::size_t k = 0; k < wanted; ++k) spread.push_back(own[k * own.size() / wanted]);
    own = std::move(spread);
  }
  return chosen;
}

struct Judged {
  cv::Mat mask;    // empty: the camera was not judged
  cv::Mat sample;  // an image in the middle of the drive
  int images = 0;
  std::string failure;
};

Judged judge(const Block& block, const std::vector<ImageIndex>& images, const StaticRegionOptions& options) {
  StaticRegionFinder finder(options);
  const auto count = static_cast<std::int64_t>(images.size());
  std::vector<cv::Mat> gradients(images.size());
  std::vector<cv::Size> sizes(images.size());
  cv::setNumThreads(1);
  load_image_codecs();
#pragma omp parallel for schedule(dynamic, 1)
  for (std::int64_t k = 0; k < count; ++k) {
    const auto at = static_cast<std::size_t>(k);
    const GreyImage image = read_grey_image(block.path_of(images[at]));
    if (!image.failure.empty()) continue;
    gradients[at] = finder.gradients(image.pixels);
    sizes[at] = image.pixels.size();
  }
  Judged judged;
  for (std::size_t k = 0; k < gradients.size(); ++k)
    if (!gradients[k].empty()) finder.add(std::move(gradients[k]), sizes[k]);
  judged.images = finder.images();
  if (judged.images < options.min_images) {
    judged.failure = fmt::format("{} images {} m apart are needed", options.min_images, options.min_distance_m);
    return judged;
  }
  judged.mask = finder.mask();
  judged.sample =
      read_image_file(block.path_of(images[images.size() / 2]), cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
  return judged;
}

// The image with the masked regions in red, at most 800 pixels wide.
std::string preview(const Judged& judged) {
  cv::Mat overlay = judged.sample.empty() ? cv::Mat(judged.mask.size(), CV_8UC3, cv::Scalar::all(128)) : judged.sample;
  if (overlay.size() != judged.mask.size()) cv::resize(overlay, overlay, judged.mask.size());
  cv::Mat red(overlay.size(), CV_8UC3, cv::Scalar(40, 40, 230)), mixed;
  cv::addWeighted(overlay, 0.45, red, 0.55, 0, mixed);
  mixed.copyTo(overlay, judged.mask == 0);
  const double factor = 800.0 / std::max(overlay.cols, overlay.rows);
  if (factor < 1) cv::resize(overlay, overlay, {}, factor, factor, cv::INTER_AREA);
  const auto bytes = encode_image(".jpg", overlay, {cv::IMWRITE_JPEG_QUALITY, 85});
  return {bytes.begin(), bytes.end()};
}

bool holds(const fs::path& file, const std::string& bytes) {
  std::ifstream stream(file, std::ios::binary);
  return std::string(std::istreambuf_iterator<char>(stream), {}) == bytes;
}

Proposal propose(const Block& block, const Camera& camera, const std::vector<ImageIndex>& images,
                 const MasksOptions& options) {
  Proposal proposal;
  proposal.camera = camera.name;
  const Judged judged = judge(block, images, options.regions);
  proposal.images = judged.images;
  if (judged.mask.empty()) {
    proposal.note = judged.failure;
    return proposal;
  }
  proposal.masked = 1 - static_cast<double>(cv::countNonZero(judged.mask)) / static_cast<double>(judged.mask.total());
  proposal.preview = preview(judged);
  if (proposal.masked == 0) {
    proposal.note = "nothing stays the same: no mask";
    return proposal;
  }
  const fs::path file = fs::path(options.output) / mask_file_name(camera.name);
  const auto bytes = encode_image(".png", judged.mask);
  const std::string png(bytes.begin(), bytes.end());
  if (!fs::exists(file)) {
    JobStore(options.output).write_text(file.filename().string(), png);
  } else if (!holds(file, png)) {  // else the file is this proposal, from an earlier run
    proposal.note = file.string() + " is there already and stays as it is";
    return proposal;
  }
  proposal.file = file.string();
  if (!camera.mask_path.empty()) proposal.note = "the project has " + camera.mask_path + ", which stays as it is";
  return proposal;
}

std::string base64(const std::string& bytes) {
  constexpr const char* kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t three = 0;
    for (std::size_t k = 0; k < 3; ++k)
      three = three << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k) text += i + k <= bytes.size() ? kDigits[three >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

// The line about a camera: "16 images, 3.5 % masked; ...".
std::string finding(const Proposal& p) {
  std::string text = fmt::format("{} images", p.images);
  if (p.masked > 0) text += fmt::format(", {:.1f} % masked", 100 * p.masked);
  return p.note.empty() ? text : text + "; " + p.note;
}

std::string page(const std::vector<Proposal>& proposals) {
  std::string html =
      "<!DOCTYPE html>\n<html lang=en><meta charset=utf-8><title>Proposed masks</title>\n"
      "<style>body{font:15px/1.5 system-ui,sans-serif;margin:20px auto;padding:0 16px;max-width:1240px;color:#1c2733}"
      "main{display:grid;grid-template-columns:repeat(auto-fill,minmax(360px,1fr));gap:20px 16px}figure{margin:0}"
      "img{width:100%;display:block}figcaption{font-size:13px;margin-top:4px;overflow-wrap:anywhere}</style>\n"
      "<h1>Proposed masks</h1>\n<p>Red: what never changes over the images of a camera, masked in its PNG "
      "(black = ignored). Correct a proposal in any paint program, or delete it.</p>\n<main>\n";
  for (const Proposal& p : proposals) {
    html += "<figure>";
    if (!p.preview.empty()) html += "<img alt=\"\" src=\"data:image/jpeg;base64," + base64(p.preview) + "\">";
    html += fmt::format("<figcaption><b>{}</b>: {}</figcaption></figure>\n", report::escape(p.camera),
                        report::escape(finding(p)));
  }
  return html + "</main>\n</html>\n";
}

int propose_masks(MasksOptions options) {
  options.regions.check();
  const Project project = read_project(options.project, settings_sections());
  const Block& block = project.block;
  if (!has_image_files(block))
    throw InputError(options.project +
                     ": the project has no image files, from which masks are found; give 'images' in it");
  if (options.output.empty()) options.output = (fs::path(project.file).parent_path() / "mask_proposals").string();
  check_output((fs::path(options.output) / kPage).string(), inputs_of(options.project));
  make_folder(options.output);
  const auto images = images_to_look_at(block, options.regions);
  std::vector<Proposal> proposals;
  int written = 0;
  for (CameraIndex c(0); block.cameras.contains(c); ++c.value) {
    proposals.push_back(propose(block, block.cameras[c], images[c], options));
    const Proposal& p = proposals.back();
    std::printf("%s: %s\n", p.camera.c_str(), finding(p).c_str());
    written += !p.file.empty();
  }
  JobStore(options.output).write_text(kPage, page(proposals));
  const bool any = std::any_of(proposals.begin(), proposals.end(), [](const Proposal& p) { return p.masked > 0; });
  std::printf("%d masks in %s; look at masks.html there%s\n", written, options.output.c_str(),
              any ? (", then add 'masks: " + options.output + "' to the project file").c_str() : "");
  return kExitDone;
}

}  // namespace

void add_masks(CLI::App& app, std::function<int()>& action) {
  auto options = std::make_shared<MasksOptions>();
  StaticRegionOptions& r = options->regions;
  CLI::App* command = app.add_subcommand("masks", "Propose masks: what never changes over the images of a camera");
  command->footer("Example: megablock masks block.yaml -o masks");
  command->add_option("project", options->project, "Project file")->required();
  command
      ->add_option("-o,--output", options->output,
                   "Folder for the masks and masks.html; files that are there stay [mask_proposals beside the project]")
      ->check(named());
  command->add_option("--min-images", r.min_images, "Images that a camera must have")->capture_default_str();
  command->add_option("--max-images", r.max_images, "Images looked at, of each camera")->capture_default_str();
  command->add_option("--min-distance", r.min_distance_m, "Least distance between two of them, m")
      ->capture_default_str();
  command
      ->add_option("--variation", r.variation_share,
                   "A pixel is masked where it changes by less than this share of the usual change")
      ->capture_default_str();
  command->add_option("--min-area", r.min_area, "Smallest region, share of the image")->capture_default_str();
  command->add_option("--margin", r.margin_px, "By which regions are widened, px of images reduced to 480")
      ->capture_default_str();
  command->callback([=, &action] { action = [options] { return propose_masks(*options); }; });
}

}  // namespace megablock
