// What is too far away to be meant: exchanged coordinates, another zone, another country.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "geometry/median.h"
#include "io/project_sections.h"

namespace megablock {

namespace {

constexpr double kFar_m = 50e3;

std::string kilometres(double metres) { return std::to_string(std::lround(metres / 1000)) + " km"; }

}  // namespace

void warn_of_distant_places(Project& project) {
  std::vector<double> x, y, z;
  for (const Frame& frame : project.block.frames) {
    if (!frame.position_prior) continue;
    x.push_back(frame.position_prior->position.x());
    y.push_back(frame.position_prior->position.y());
    z.push_back(frame.position_prior->position.z());
  }
  if (x.empty()) return;
  const Eigen::Vector3d images(median(x), median(y), median(z));
  double extent = kFar_m;
  for (std::size_t i = 0; i < x.size(); ++i)
    extent = std::max(extent, 0.1 * (Eigen::Vector3d(x[i], y[i], z[i]) - images).norm());
  const std::string remedy = "; are latitude and longitude exchanged, or is it another coordinate system?";
  if (images.norm() > extent)
    project.warnings.push_back("the origin lies " + kilometres(images.norm()) + " from the images" + remedy);
  for (const ControlPoint& point : project.block.control_points) {
    const double distance = (point.position - images).head<2>().norm();
    if (distance > extent)
      project.warnings.push_back("control point '" + point.name + "' lies " + kilometres(distance) +
                                 " from the images" + remedy);
  }
}

}  // namespace megablock
