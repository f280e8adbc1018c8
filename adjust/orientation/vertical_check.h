// Which verticals of a component are believed, before any of them is used.
//
// Right verticals show the same direction of the ground, wrong ones any: rows of a field, a slanting roof. Rotations
// averaged without them carry the directions into common axes. These rotations drift, so a vertical is compared with
// others near by in the graph, and a few farther ones: two of them agree when the rotation vector e from one to the
// other passes
//
//     e' C^-1 e < chi^2(2, 0.999),   C = S_a + S_b + D D' + (v_ab + 1 deg^2) I
//
// with S the covariances of measuring, D what the parameters of the camera may be wrong by, which for images of one
// camera is the difference of two like errors, v_ab the variance of the relative rotation, no more than that along the
// best path of edges, and a degree for walls that lean. What agrees makes groups. Of all that was compared with one
// another the largest group is believed when it has a third of all and four fifths of those who agree with anybody:
// rows of a field agree with themselves, but in strips flown to and fro half of them the other way round. Last, what a
// group takes for down must be down by the positions or attitudes, where these tell. Frames with a given pose are not
// oriented, so theirs are held against the poses alone.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "adjust/orientation/steps/rotation_averaging.h"
#include "geometry/vanishing/interpretation_plane.h"
#include "io/project/inputs/verticals.h"

namespace megablock {

// What an image sees, in the axes of its node.
struct SeenDown {
  std::int32_t node = -1;
  std::int32_t camera = -1;    // any number; the same: one camera
  Eigen::Vector3d direction;   // unit
  Eigen::Matrix3d covariance;  // of measuring alone, radians^2
  Eigen::Matrix3Xd by_camera;  // of `direction` by each parameter of the camera, times its sigma
};

// A verdict for each of `seen`. `rotation` [nodes], world -> node, averaged without verticals, over the edges that
// `kept` names; `down`: where down is known to be in their world. What cannot be compared with others is believed, but
// where `down` contradicts it, or where nothing that can is believed.
std::vector<VerticalVerdict> judge_verticals(const std::vector<std::optional<Eigen::Quaterniond>>& rotation,
                                             const std::vector<RelativeRotation>& edges,
                                             const std::vector<std::uint8_t>& kept, const std::vector<SeenDown>& seen,
                                             const std::optional<AxisDirection>& down);

// Verticals of frames with a given pose that are wrong by it: farther off than an approximate pose can be, which is
// taken to have a sigma of five degrees. By image. Where four fifths show one direction of the poses' world that is
// not down (kAgainstPoses), the poses are not level, as those of an imported model, or pictures from above show rows:
// then all are set aside.
std::vector<SetAsideVertical> against_given_poses(const Block& block);

// Whether the given poses of two images, as good as above, take what one sees to what the other sees; true where a pose
// is not given. Asks nothing of what is down in their world.
bool given_poses_join(const Block& block, ImageIndex a, const AxisDirection& seen_a, ImageIndex b,
                      const AxisDirection& seen_b);

}  // namespace megablock
