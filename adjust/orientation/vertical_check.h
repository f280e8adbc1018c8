// Decides which verticals of a component are accepted, before any of them is used.
//
// Correct verticals show the same direction of the ground; wrong ones show any direction, such as rows of a field or a
// slanting roof. Rotations that were averaged without verticals bring the directions into common axes. These rotations
// drift, so each vertical is compared with others near it in the graph and with a few farther away. Two verticals agree
// when the rotation vector e from one to the other passes
//
//     e' C^-1 e < chi^2(2, 0.999),   C = S_a + S_b + D D' + (v_ab + 1 deg^2) I
//
// with S the covariances of the observed directions, D the effect of the errors of the camera parameters, v_ab the
// variance of the relative rotation along the best path of edges, and one degree for walls that lean. For two images of
// one camera D is the difference of their effects, because they share the errors.
//
// Verticals that agree form groups. Groups whose mean direction is not down by the positions or attitudes are rejected
// first, where these tell. Of the others that were compared with one another, the largest group is accepted if it holds
// a third of all of them and four fifths of those that agree with any other. The second condition rejects rows of a
// field: they agree with one another, but in strips flown to and fro half of them point the other way. Frames with a
// given pose are not oriented here, so their verticals are tested against the given poses alone.
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

// The vertical that an image shows, in the axes of its node (a frame of the graph).
struct SeenDown {
  std::int32_t node = -1;
  std::int32_t camera = -1;    // images with the same number share a camera
  Eigen::Vector3d direction;   // unit
  Eigen::Matrix3d covariance;  // of the observation alone, rad^2
  Eigen::Matrix3Xd by_camera;  // derivatives of `direction` by the camera parameters, each times its sigma
};

// Returns a verdict for each of `seen`. `rotation` [nodes], world -> node, was averaged without verticals over the
// edges marked in `kept`. `down` is the known direction of down in their world. A vertical that was compared with no
// other is accepted, unless `down` contradicts it. A vertical whose node has no rotation is accepted, unless all others
// are rejected.
std::vector<VerticalVerdict> judge_verticals(const std::vector<std::optional<Eigen::Quaterniond>>& rotation,
                                             const std::vector<RelativeRotation>& edges,
                                             const std::vector<std::uint8_t>& kept, const std::vector<SeenDown>& seen,
                                             const std::optional<AxisDirection>& down);

// Returns, by image, the verticals that contradict the given pose of their frame. A given pose counts as approximate,
// with a sigma of five degrees. If four fifths of the verticals show one direction in the world of the poses that is
// not down, all are set aside (kAgainstPoses): either the poses are not level, as those of an imported model, or images
// taken from above show rows.
std::vector<SetAsideVertical> against_given_poses(const Block& block);

// Whether the verticals of two images agree under their given poses, with the same sigma as above. True where a pose is
// not given. The test needs no direction of down in the world of the poses.
bool given_poses_join(const Block& block, ImageIndex a, const AxisDirection& seen_a, ImageIndex b,
                      const AxisDirection& seen_b);

}  // namespace megablock
