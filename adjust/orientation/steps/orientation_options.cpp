#include "adjust/orientation/steps/orientation_options.h"

#include "io/base/error.h"

namespace megablock {

void OrientationOptions::check() const {
  observations.check();
  if (!(max_rotation_error_deg > 0 && max_rotation_error_deg < 180))
    throw InputError("max_rotation_error_deg must lie between 0 and 180");
  if (min_points_per_image < 4) throw InputError("min_points_per_image must be at least 4");
  if (tracks_per_pair < 20) throw InputError("tracks_per_pair must be at least 20");
  if (part_frames != 0 && part_frames < 50) throw InputError("part_frames must be 0 or at least 50");
}

}  // namespace megablock
