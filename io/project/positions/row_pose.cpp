#include "io/project/positions/row_pose.h"

#include <cmath>

#include "geometry/numbers/angles.h"
#include "geometry/transform/body_attitude.h"
#include "geometry/transform/rotation.h"
#include "io/base/error.h"
#include "io/project/inputs/geographic_fault.h"

namespace megablock {

namespace {

bool refers_to_grid(const PositionTable::Row& row) {
  return row.angles == AngleKind::kOmegaPhiKappa || row.angles == AngleKind::kRotation;
}

// Turns the axes east, north, up at a place into those of the grid.
Eigen::Quaterniond grid_from_true(const CrsToWgs84& crs, const Geodetic& place) {
  constexpr double kStepDeg = 1e-4;  // 11 m to the north
  Geodetic north = place;
  north.latitude_deg += kStepDeg;
  const Eigen::Vector3d step = crs.from_wgs84(north) - crs.from_wgs84(place);
  const double bearing = std::atan2(step.x(), step.y());
  return Eigen::Quaterniond(Eigen::AngleAxisd(-bearing, Eigen::Vector3d::UnitZ()));
}

}  // namespace

bool states_attitude(const PositionTable::Row& row) { return row.rotation || row.angles_deg.allFinite(); }

Eigen::Quaterniond rotation_of(const PositionTable::Row& row) {
  if (row.rotation) return *row.rotation;
  const Eigen::Vector3d a = row.angles_deg * kDegree;
  switch (row.angles) {
    case AngleKind::kGimbal:
      return rotation_from(YawPitchRoll{a[0], a[1], a[2]});
    case AngleKind::kOmegaPhiKappa:
      return rotation_from(OmegaPhiKappa{a[0], a[1], a[2]});
    case AngleKind::kBody:
    case AngleKind::kRotation:
      break;
  }
  return rotation_from(BodyAttitude{a[0], a[1], a[2]});
}

SystemOfTable::SystemOfTable(const std::string& crs, const std::string& path) {
  if (crs == "local") return;
  try {
    crs_.emplace(crs);
  } catch (const InputError& error) {
    throw InputError(path + ": " + error.what());
  }
}

Geodetic SystemOfTable::position(const PositionTable::Row& row) const {
  Eigen::Vector3d place = row.place;
  const bool flat = std::isnan(place.z());
  if (flat) place.z() = 0;
  try {
    Geodetic result = crs_->to_wgs84(place);
    if (!row.offset_m.isZero(0)) {
      const GroundFrame here{true, result.latitude_deg, result.longitude_deg, result.height_m, ""};
      result = Georeference(here).to_geodetic(row.offset_m);
    }
    if (flat) result.height_m = kNoNumber;
    return result;
  } catch (const InputError& error) {
    const std::string fault = geographic_fault(*crs_, place);
    throw InputError(row.where + ": " + (fault.empty() ? error.what() : fault));
  }
}

Eigen::Vector2d SystemOfTable::metres_per_unit(const Eigen::Vector3d& place) const {
  constexpr double kStepDeg = 1e-4, kMetresPerDegree = 111132;  // to the north
  if (local()) return {1, 1};
  Eigen::Vector3d low = place;
  if (std::isnan(low.z())) low.z() = 0;
  try {
    const Geodetic at = crs_->to_wgs84(low);
    Geodetic north = at;
    north.latitude_deg += kStepDeg;
    const Eigen::Vector3d step = crs_->from_wgs84(north) - crs_->from_wgs84(at);
    const double higher_m = crs_->to_wgs84(low + Eigen::Vector3d::UnitZ()).height_m;
    return {kStepDeg * kMetresPerDegree / step.head<2>().norm(), higher_m - at.height_m};
  } catch (const InputError&) {
    return {kNoNumber, kNoNumber};
  }
}

Eigen::Quaterniond SystemOfTable::rotation(const PositionTable::Row& row, const Geodetic& position) const {
  const Eigen::Quaterniond rotation = rotation_of(row);
  return refers_to_grid(row) ? (rotation * grid_from_true(*crs_, position)).normalized() : rotation;
}

}  // namespace megablock
