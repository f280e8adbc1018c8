// What is known of where each image stands and looks before anything is oriented, and its order of acquisition.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "io/block/block.h"

namespace megablock {

struct View {
  bool located = false;                                  // the frame has a position prior or a given pose
  bool doubtful = false;                                 // position far off its acquisition neighbours
  bool directed = false;                                 // viewing direction known
  bool placed = false;                                   // `place` is set
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();      // projection centre in the ground plane, metres (located)
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  // unit, ground frame (directed)
  // What neighbours are sought by: the footprint's centre (directed) or the projection centre; for images that are not
  // located or doubtful, midway between those of the nearest acquisition neighbours.
  Eigen::Vector2d place = Eigen::Vector2d::Zero();
  double reach = 0;       // horizontal distance from centre to footprint centre, metres
  double sigma = 0;       // of the position, horizontal, metres
  std::int64_t rank = 0;  // by name: img_9 before img_10
};

struct Views {
  IndexedVector<ImageIndex, View> of_image;
  std::vector<std::vector<ImageIndex>> passes;  // passes_of()
};

// Images of one pass, rig and mount, in order of acquisition: by time where all have one, else by name.
std::vector<std::vector<ImageIndex>> passes_of(const Block& block);

// Height above ground: from control points where there are some, else from the spacing of the frames, taking three
// quarters of overlap. Views near the horizontal are given a depth of three spacings.
Views views_of(const Block& block);

// Half of the larger opening angle of an image, radians.
double half_opening(const Camera& camera);

}  // namespace megablock
