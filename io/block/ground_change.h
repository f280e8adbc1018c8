// Transforms positions and rotations from one local ground frame into another with its own origin. Internal to io/.
#pragma once

#include "io/block/crs.h"

namespace megablock {

class GroundChange {
 public:
  GroundChange(const GroundFrame& from, const GroundFrame& to)
      : from_(from), to_(to), turn_(to_.own_from_block({from.latitude_deg, from.longitude_deg, from.height_m})) {}

  Eigen::Vector3d position(const Eigen::Vector3d& p) const { return to_.to_local(from_.to_geodetic(p)); }
  // A rotation R_cw that refers to the old frame. turn_ turns directions of the new frame into the old one.
  Eigen::Quaterniond rotation(const Eigen::Quaterniond& r) const { return (r * turn_).normalized(); }
  Pose pose(const Pose& p) const { return {rotation(p.rotation), position(p.centre)}; }

 private:
  Georeference from_, to_;
  Eigen::Quaterniond turn_;
};

}  // namespace megablock
