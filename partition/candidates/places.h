// Finds the places that several passes see, where they are to be registered with each other (Cannelle 2013).
//
// The graph of panoramas is the three-dimensional alpha shape of the frames' positions (H. Edelsbrunner and E. Muecke,
// ACM Transactions on Graphics 13(1), 1994): those edges of their Delaunay triangulation whose alpha ball is empty.
// Heights are stretched, by 5 as in the thesis. A frame 4 m higher then counts as one 20 m away, so a bridge is not
// joined with the street below it. The edges of the shape are
//
//   border    no triangle of the shape on it: plain succession along one pass
//   normal    on the surface of the shape, with triangles        } places seen by several passes,
//   interior  inside the shape                                   } or a bend of one pass
#pragma once

#include <Eigen/Core>
#include <vector>

#include "io/block/registration.h"

namespace megablock {

enum class EdgeClass : std::uint8_t { kExterior, kInterior, kBorder, kNormal };

// An edge of the graph of panoramas.
struct PanoramaEdge {
  std::int64_t a, b;  // rows of the positions, a < b
  EdgeClass kind;
  friend auto operator<=>(const PanoramaEdge&, const PanoramaEdge&) = default;
};

struct PlaceOptions {
  double alpha_m = 10;            // radius of the ball, metres: frames up to twice this distance apart are joined
  double z_stretch = 5;           // factor of heights
  int registration_spacing = 15;  // d_cons in the thesis: frames of a pass between two registrations with another pass
  int revisit_frames = 25;        // frames of one pass farther apart than this are two visits of a place
  int hops = 3;                   // largest number of edges between the frames of two visits
  double max_distance_m = 20;     // between frames to be registered, metres; heights count z_stretch times
  void check() const;             // throws InputError
};

// Returns the edges of the shape except the exterior ones, ascending. Positions are in metres and must be finite; a
// position that repeats an earlier one has no edges. The result is deterministic. Empty for fewer than four positions.
std::vector<PanoramaEdge> panorama_graph(const std::vector<Eigen::Vector3d>& positions, const PlaceOptions& options);

// Chooses where to register. Along each visit of a place, for every other visit that interior and normal edges join
// with it, the two nearest frames of each `registration_spacing` frames are taken. `pass` is the pass of each position;
// the frames of a pass are in the order of acquisition. The result is ascending by (a, c): a and c are the nearest
// frames, b and d their successors (predecessors at the end of a pass).
std::vector<Place> choose_places(const std::vector<Eigen::Vector3d>& positions, const std::vector<std::int64_t>& pass,
                                 const std::vector<PanoramaEdge>& edges, const PlaceOptions& options);

}  // namespace megablock
