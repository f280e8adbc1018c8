#include "io/simulate/streets/drive.h"

#include <algorithm>

namespace megablock {

std::vector<Eigen::Vector2d> drive_corners(std::int64_t streets, double spacing) {
  const double far = static_cast<double>(streets - 1) * spacing;
  std::vector<Eigen::Vector2d> corners;
  for (std::int64_t j = 0; j < streets; ++j) {
    const double y = static_cast<double>(j) * spacing;
    corners.emplace_back(j % 2 == 0 ? 0 : far, y);
    corners.emplace_back(j % 2 == 0 ? far : 0, y);
  }
  // The serpentine along y continues from the last corner: at the x of this corner and at the far y.
  // The last street along x was driven forwards if the number of streets is odd.
  const bool from_far = streets % 2 == 1;
  for (std::int64_t i = 0; i < streets; ++i) {
    const double column = static_cast<double>(i) * spacing, x = from_far ? far - column : column;
    corners.emplace_back(x, i % 2 == 0 ? far : 0);
    corners.emplace_back(x, i % 2 == 0 ? 0 : far);
  }
  return corners;
}

Drive::Drive(std::vector<Eigen::Vector2d> corners) : corners_(std::move(corners)), length_{0} {
  for (std::size_t i = 1; i < corners_.size(); ++i)
    length_.push_back(length_.back() + (corners_[i] - corners_[i - 1]).norm());
}

Eigen::Vector2d Drive::at(double s) const {
  s = std::clamp(s, 0.0, length());
  const auto next = std::upper_bound(length_.begin() + 1, length_.end() - 1, s);
  const auto i = static_cast<std::size_t>(next - length_.begin());
  const double part = length_[i] - length_[i - 1];
  return part > 0 ? Eigen::Vector2d(corners_[i - 1] + (corners_[i] - corners_[i - 1]) * ((s - length_[i - 1]) / part))
                  : corners_[i];
}

Eigen::Vector2d Drive::rounded_at(double s) const {
  constexpr int kSteps = 20;
  Eigen::Vector2d sum = 0.5 * (at(s - 5) + at(s + 5));
  for (int i = 1; i < kSteps; ++i) sum += at(s - 5 + 10.0 * i / kSteps);
  return sum / kSteps;
}

// The rows are the axes of the rig in the ground: right = (forward turned by -90 degrees), down = -z, forward.
Eigen::Quaterniond level_rotation(const Eigen::Vector2d& forward) {
  Eigen::Matrix3d r;
  r.row(0) << forward.y(), -forward.x(), 0;
  r.row(1) << 0, 0, -1;
  r.row(2) << forward.x(), forward.y(), 0;
  return Eigen::Quaterniond(r).normalized();
}

}  // namespace megablock
