// Approximate poses from a file: CSV with a header line and one line per image or frame.
//
//     name (or image)                                        of an image or a frame
//     latitude_deg,longitude_deg,height_m                    WGS84, ellipsoidal height; or
//     x_m,y_m,z_m                                            in the block's frame
//     omega_deg,phi_deg,kappa_deg  or  yaw_deg,pitch_deg,roll_deg
//                    (geometry/transform/rotation.h) in the vertical of the image's own place with WGS84, else in the
//                    block's frame
//     pass                                                   if there: number of the drive or line it belongs to
//     further columns are not read
// or the quaternion form of io/project/inputs/pose_csv.h (name,qw,qx,qy,qz,x,y,z[,pass]; its "# origin:" tells the
// frame). A pose given by the name of an image is that of the image's camera, by the name of a frame that of the rig.
#pragma once

#include <string>
#include <vector>

#include "io/block/block.h"
#include "io/block/crs.h"

namespace megablock {

struct ApproximatePoses {
  struct Row {
    std::string name, where;
    bool geodetic = false;  // else local
    Geodetic position;      // geodetic
    Pose pose;              // local: pose; geodetic: rotation in the own vertical
    std::optional<std::int64_t> pass;
  };
  std::vector<Row> rows;
  std::optional<GroundFrame> ground;  // of local rows; none: the block's

  std::vector<Geodetic> positions() const;  // of the geodetic rows, or the origin of the file's own frame
};

// InputError with file:line for missing columns, numbers that are none, names that appear twice.
ApproximatePoses read_approximate_poses(const std::string& path);

// Sets Frame::given_pose, in place of what the block has, and Frame::pass where the file has it. Of several images of a
// frame the first counts, unless the frame itself has a row. InputError with file:line for a name the block does
// not have (a warning for `left_out`).
void set_given_poses(const ApproximatePoses& poses, const std::vector<std::string>& left_out, Block& block,
                     std::vector<std::string>& warnings);

}  // namespace megablock
