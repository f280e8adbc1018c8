#include "io/evaluation/remarks/camera_remarks.h"

#include <fmt/core.h>

#include <cmath>

namespace megablock {

namespace {

constexpr double kWeak = 0.05;     // sigma of a focal length over it
constexpr double kAnother = 0.05;  // difference of a focal length from a stated one, over it; focusing explains less
constexpr double kCertain = 4;     // the same in sigmas

std::string camera_text(const Camera& camera, double focal, double sigma) {
  if (sigma > kWeak * focal)
    return fmt::format(
        "The focal length of camera '{}' is hardly determined: {:.0f} +- {:.0f} px; depths are uncertain by its share "
        "of {:.0f} %; give 'focal_px', or add positions, control points or images that look in other directions",
        camera.name, focal, sigma, 100 * sigma / focal);
  const double stated = camera.intrinsics[kFocal];
  if (!camera.focal_known || std::abs(focal - stated) < std::max(kAnother * focal, kCertain * sigma)) return "";
  return fmt::format(
      "The focal length of camera '{}' is {:.0f} +- {:.0f} px in the block, {:.0f} % {} than the stated {:.0f} px: "
      "check the header or 'focal_px', and whether images were cropped or the lens zoomed",
      camera.name, focal, sigma, 100 * std::abs(focal / stated - 1), focal > stated ? "more" : "less", stated);
}

}  // namespace

std::vector<std::string> camera_texts(const BlockResult& result) {
  std::vector<std::string> lines;
  for (CameraIndex c(0); result.block.cameras.contains(c) && result.camera_covariance.contains(c); ++c.value) {
    const Eigen::MatrixXd& covariance = result.camera_covariance[c];
    if (covariance.rows() <= kFocal || !(covariance(kFocal, kFocal) > 0)) continue;  // held
    const std::string text =
        camera_text(result.block.cameras[c], result.state.cameras[c][kFocal], std::sqrt(covariance(kFocal, kFocal)));
    if (!text.empty()) lines.push_back(text);
  }
  return lines;
}

}  // namespace megablock
