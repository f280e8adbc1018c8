// Reads approximate poses from a CSV file with a header line and one line per image or frame. The columns are:
//
//     name (or image)                                        name of an image or a frame
//     latitude_deg,longitude_deg,height_m                    WGS84, ellipsoidal height; or
//     x_m,y_m,z_m                                            in the block's ground frame
//     omega_deg,phi_deg,kappa_deg                            geometry/transform/rotation.h; or
//     yaw_deg,pitch_deg,roll_deg                             of the vehicle (geometry/transform/body_attitude.h); or
//     gimbal_yaw_deg,gimbal_pitch_deg,gimbal_roll_deg        of the camera; pitch -90 = nadir
//     pass                                                   optional: number of the drive or flight line
//
// Other columns are not read. With WGS84 positions, the angles refer to the vertical at the image's own place; with
// local positions, they refer to the block's ground frame. The file may also have the form of
// io/project/inputs/pose_csv.h, with quaternions; its "# origin:" then names the ground frame. A line with the name of
// an image gives the pose of the image's camera; a line with the name of a frame gives the pose of the rig.
#pragma once

#include <string>
#include <vector>

#include "io/block/block.h"
#include "io/block/crs.h"

namespace megablock {

struct ApproximatePoses {
  struct Row {
    std::string name, where;
    bool geodetic = false;  // true: position in WGS84; false: in a local ground frame
    Geodetic position;      // geodetic rows only
    Pose pose;              // geodetic rows: only its rotation counts, relative to the vertical at the position
    std::optional<std::int64_t> pass;
  };
  std::vector<Row> rows;
  std::optional<GroundFrame> ground;  // the frame of local rows; empty: that of the block

  std::vector<Geodetic> positions() const;  // those of the geodetic rows, else the origin of the file's own frame
};

// Reads the file. Throws InputError with file:line for missing columns, malformed numbers, and repeated names.
ApproximatePoses read_approximate_poses(const std::string& path);

// Sets Frame::given_pose, also where the block has one already, and Frame::pass if the file has that column. If several
// images of a frame have a row, the first row counts, unless the frame itself has a row. Throws InputError with
// file:line for a name that the block does not have; a name in `left_out` only gives a warning.
void set_given_poses(const ApproximatePoses& poses, const std::vector<std::string>& left_out, Block& block,
                     std::vector<std::string>& warnings);

}  // namespace megablock
