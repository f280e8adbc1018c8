#include "io/project/inputs/verticals.h"

#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <sstream>
#include <utility>

#include "geometry/numbers/angles.h"
#include "geometry/vanishing/vertical.h"
#include "io/base/error.h"
#include "io/project/inputs/camera_priors.h"
#include "io/text/csv_row.h"
#include "io/text/csv_table.h"
#include "io/text/plausible.h"

namespace megablock {

namespace {

std::vector<double> numbers_of(const CsvTable& csv, std::size_t row, const char* column) {
  std::vector<double> numbers;
  std::istringstream words(csv.text(row, column));
  for (std::string word; words >> word;) {
    double value = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(value))
      throw InputError(csv.where(row) + ": " + column + ": '" + word + "' is not a number");
    numbers.push_back(value);
  }
  return numbers;
}

std::string text_of(const Eigen::Ref<const Eigen::VectorXd>& numbers) {
  std::string text;
  for (const double number : numbers) text += (text.empty() ? "" : " ") + fmt::format("{:.12g}", number);
  return text;
}

double needed_sigma(const CsvTable& csv, std::size_t row, const char* column) {
  const double sigma = csv.needed_number(row, column);
  check_within(sigma, kSigmaDegrees, column, csv.where(row));
  return sigma * kDegree;
}

// The covariance of the direction, from sigma_deg or from the sigmas of roll and pitch (geometry/vanishing/vertical.h).
Eigen::Matrix3d covariance_of(const CsvTable& csv, std::size_t row, const Eigen::Vector3d& down) {
  if (csv.number(row, "sigma_deg")) {
    const double sigma = needed_sigma(csv, row, "sigma_deg");
    // A unit vector has no error along itself: the covariance has rank two.
    return sigma * sigma * (Eigen::Matrix3d::Identity() - down * down.transpose());
  }
  const double roll = needed_sigma(csv, row, "sigma_roll_deg"), pitch = needed_sigma(csv, row, "sigma_pitch_deg");
  const double correlation = csv.number(row, "correlation").value_or(0);
  if (!(std::abs(correlation) < 1)) throw InputError(csv.where(row) + ": correlation must lie between -1 and 1");
  const double level = std::hypot(down.x(), down.y());
  if (!(level > 1e-6))
    throw InputError(csv.where(row) +
                     ": an image that looks straight up or down has no roll; give sigma_deg instead of sigma_roll_deg "
                     "and sigma_pitch_deg");
  Eigen::Matrix2d covariance;
  covariance << roll * roll, correlation * roll * pitch, correlation * roll * pitch, pitch * pitch;
  // The derivatives of down = (sin r cos p, cos r cos p, -sin p) by roll r and pitch p, with level = cos p. C_down = J
  // C J'.
  Eigen::Matrix<double, 3, 2> by_angles;
  by_angles << down.y(), down.x() * down.z() / level, -down.x(), down.y() * down.z() / level, 0, -level;
  return by_angles * covariance * by_angles.transpose();
}

// Throws InputError if the vertical was found with another camera. A camera that was calibrated since then is accepted,
// because the direction can be corrected for it. A camera that differs more has taken other images of the same names.
void check_camera(const std::vector<double>& values, const Camera& camera, const std::string& where) {
  constexpr double kFarthest = 3;  // times the prior sigma of a camera that is not calibrated
  const IntrinsicSigmas sigma = default_intrinsic_sigmas(camera, free_parameters(camera.intrinsics.model()));
  for (std::size_t p = 0; p < values.size(); ++p) {
    const double now = camera.intrinsics[p];
    if (!(std::abs(values[p] - now) > kFarthest * sigma[p]) || is_fixed(camera.intrinsics.model(), static_cast<int>(p)))
      continue;
    throw InputError(fmt::format(
        "{}: the vertical was found with another camera than '{}': {} is {:.6g} in the file, but {:.6g} in the block; "
        "name the file that belongs to these images, or run 'megablock verticals' again",
        where, camera.name, parameter_name(camera.intrinsics.model(), static_cast<int>(p)), values[p], now));
  }
}

void read_dependence(const CsvTable& csv, std::size_t row, const Camera& camera, SeenVertical& vertical) {
  std::vector<double> values = numbers_of(csv, row, "camera"), derivatives = numbers_of(csv, row, "down_by_camera");
  if (derivatives.size() != 3 * values.size())
    throw InputError(csv.where(row) + ": 'down_by_camera' must have three numbers for each number of 'camera'");
  // A file from before the model had its rare parameters says nothing of them.
  if (std::ssize(values) == count_without_rare(camera.intrinsics.model())) {
    values.resize(static_cast<std::size_t>(camera.intrinsics.size()), 0);
    derivatives.resize(3 * values.size(), 0);
  }
  if (!values.empty() && std::ssize(values) != camera.intrinsics.size())
    throw InputError(csv.where(row) + ": the vertical was found with another camera model of '" + camera.name +
                     "'; run 'megablock verticals' again");
  check_camera(values, camera, csv.where(row));
  vertical.camera = Eigen::Map<const Eigen::VectorXd>(values.data(), std::ssize(values));
  vertical.by_camera = Eigen::Map<const Eigen::Matrix3Xd>(derivatives.data(), 3, std::ssize(values));
}

}  // namespace

void read_verticals(const std::string& path, const std::vector<std::string>& left_out, Block& block) {
  const CsvTable csv(path);
  csv.require({"image", "down_x", "down_y", "down_z"});
  if (!csv.has("sigma_deg")) csv.require({"sigma_roll_deg", "sigma_pitch_deg"});
  std::map<std::string, ImageIndex> images;
  for (ImageIndex i(0); block.images.contains(i); ++i.value) images.emplace(block.name_of(i), i);
  std::map<ImageIndex, SeenVertical> verticals;
  for (std::size_t row = 0; row < csv.row_count(); ++row) {
    const std::string name = csv.text(row, "image");
    if (csv.text(row, "down_x").empty() || std::find(left_out.begin(), left_out.end(), name) != left_out.end())
      continue;
    const auto found = images.find(name);
    if (found == images.end())
      throw InputError(csv.where(row) + ": the block has no image '" + name + "'; correct the name or delete the line");
    SeenVertical vertical;
    vertical.image = found->second;
    vertical.down = {csv.needed_number(row, "down_x"), csv.needed_number(row, "down_y"),
                     csv.needed_number(row, "down_z")};
    if (!(std::abs(vertical.down.norm() - 1) < 1e-3))
      throw InputError(csv.where(row) + ": down_x, down_y, down_z are not a unit vector; its length must be 1");
    vertical.down.normalize();
    vertical.covariance = covariance_of(csv, row, vertical.down);
    read_dependence(csv, row, block.cameras[block.camera_of(vertical.image)], vertical);
    if (!verticals.emplace(vertical.image, vertical).second)
      throw InputError(csv.where(row) + ": image '" + name + "' appears twice; delete one of its lines");
  }
  block.verticals.clear();
  for (auto& [image, vertical] : verticals) block.verticals.push_back(std::move(vertical));
}

std::string verticals_header() {
  return "image,down_x,down_y,down_z,roll_deg,pitch_deg,sigma_roll_deg,sigma_pitch_deg,correlation,camera,"
         "down_by_camera";
}

std::string verticals_row(const SeenVertical& vertical, const std::string& image) {
  const RollPitch angles = roll_pitch_of({vertical.down, vertical.covariance});
  const double roll = std::sqrt(angles.covariance(0, 0)), pitch = std::sqrt(angles.covariance(1, 1));
  const Eigen::Vector3d& d = vertical.down;
  return fmt::format("{},{:.12f},{:.12f},{:.12f},{:.6f},{:.6f},{:.9g},{:.9g},{:.9f},{},{}", csv_field(image), d.x(),
                     d.y(), d.z(), angles.roll * kDegreesPerRadian, angles.pitch * kDegreesPerRadian,
                     roll * kDegreesPerRadian, pitch * kDegreesPerRadian, angles.covariance(0, 1) / (roll * pitch),
                     text_of(vertical.camera), text_of(vertical.by_camera.reshaped()));
}

Eigen::Matrix3Xd camera_error(const SeenVertical& vertical, const Camera& camera) {
  const IntrinsicSigmas weak = weak_sigmas(camera.intrinsics, 0.3 * camera.intrinsics[kFocal], camera.width,
                                           free_parameters(camera.intrinsics.model()));
  Eigen::Matrix3Xd error = vertical.by_camera;
  for (Eigen::Index p = 0; p < vertical.camera.size(); ++p) {
    const auto at = static_cast<std::size_t>(p);
    error.col(p) *= std::isfinite(camera.prior_sigma[at]) ? camera.prior_sigma[at] : weak[at];
  }
  return error;
}

AxisDirection whole_error(const SeenVertical& vertical, const Camera& camera, const Intrinsics& values) {
  AxisDirection down{vertical.down, vertical.covariance};
  for (Eigen::Index p = 0; p < vertical.camera.size(); ++p)
    down.direction += (values[static_cast<std::size_t>(p)] - vertical.camera[p]) * vertical.by_camera.col(p);
  // C = C_measured + sum over parameters of d d' with d = sigma_p * derivative by p.
  const Eigen::Matrix3Xd of_camera = camera_error(vertical, camera);
  down.covariance += of_camera * of_camera.transpose();
  down.direction.normalize();
  return down;
}

std::string set_aside_text(const Block& block, std::span<const SetAsideVertical> aside, std::size_t all) {
  constexpr std::size_t kNamed = 5;
  if (aside.empty()) return "";
  std::string reasons;
  for (const auto& [verdict, reason] :
       {std::pair(VerticalVerdict::kContradicted, "contradicted by most others"),
        std::pair(VerticalVerdict::kNoConsensus, "that agree with too few others"),
        std::pair(VerticalVerdict::kAgainstGround, "contradicted by the positions or attitudes"),
        std::pair(VerticalVerdict::kAgainstPoses, "that agree with each other, but not with the given poses")}) {
    std::string names;
    std::size_t count = 0;
    for (const SetAsideVertical& vertical : aside) {
      if (vertical.verdict != verdict || ++count > kNamed) continue;
      names += (names.empty() ? "" : ", ") + block.name_of(vertical.image);
    }
    if (count > kNamed) names += fmt::format(" and {} more", count - kNamed);
    if (count > 0) reasons += fmt::format("{}{} {} ({})", reasons.empty() ? "" : ", ", count, reason, names);
  }
  std::string text =
      fmt::format("{} of {} verticals take{} no part: {}", aside.size(), all, aside.size() == 1 ? "s" : "", reasons);
  if (2 * aside.size() > all)
    text += "; images from above show no vertical edges, remove their lines from the file of 'verticals'";
  if (std::any_of(aside.begin(), aside.end(),
                  [](const auto& a) { return a.verdict == VerticalVerdict::kAgainstPoses; }))
    text +=
        "; the z axis of the given poses may not be vertical: add positions or control points, which define the "
        "vertical";
  return text;
}

}  // namespace megablock
