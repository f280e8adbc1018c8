// Gives, for each image, its position, direction and place in the order of acquisition, before anything is oriented.
// Candidates are chosen by it.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "io/block/block.h"

namespace megablock {

struct View {
  bool located = false;   // the frame has a position prior or a given pose
  bool doubtful = false;  // the position is far off its neighbours in the order of acquisition
  bool directed = false;  // the viewing direction is known
  bool placed = false;    // `place` is set
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();      // projection centre in the ground plane, metres (if located)
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  // unit vector, ground frame (if directed)
  // The place by which neighbours are sought: the centre of the footprint (if directed), or the projection centre. For
  // images that are not located or doubtful, the middle between the places of their nearest neighbours in the order of
  // acquisition.
  Eigen::Vector2d place = Eigen::Vector2d::Zero();
  double reach = 0;       // horizontal distance from centre to footprint centre, metres
  double sigma = 0;       // standard deviation of the horizontal position, metres
  std::int64_t rank = 0;  // in the order of names: img_9 before img_10
};

struct Views {
  IndexedVector<ImageIndex, View> of_image;
  std::vector<std::vector<ImageIndex>> passes;  // passes_of()
};

// The images of each pass, rig and mount in the order of acquisition: by time if all have one, else by name.
std::vector<std::vector<ImageIndex>> passes_of(const Block& block);

// Height above ground follows from control points if there are any, else from the spacing of the frames and an assumed
// overlap of three quarters. Views near the horizontal get a depth of three spacings.
Views views_of(const Block& block);

// Half of the larger opening angle of an image, radians.
double half_opening(const Camera& camera);

}  // namespace megablock
