// Places that several passes see (CN-26, CN-27).
//
// The graph of panoramas is the 3-D alpha shape (Edelsbrunner and Muecke 1994) of the frames' positions: edges of their
// Delaunay triangulation whose alpha ball is empty. Heights are stretched, by 5 as published, so that a frame 4 m
// higher counts as one 20 m away: a bridge is not joined with the street under it. An edge of the shape is
//
//   border    no triangle of the shape on it: plain succession along one pass
//   normal    on the surface of the shape, with triangles        } places seen by several passes
//   interior  inside of it                                        } (or a bend of one)
#pragma once

#include <Eigen/Core>
#include <vector>

#include "io/block/registration.h"

namespace megablock {

enum class EdgeClass : std::uint8_t { kExterior, kInterior, kBorder, kNormal };

struct PanoramaEdge {
  std::int64_t a, b;  // rows of the positions, a < b
  EdgeClass kind;
  friend auto operator<=>(const PanoramaEdge&, const PanoramaEdge&) = default;
};

struct PlaceOptions {
  double alpha_m = 10;            // radius of the ball: frames up to twice as far from one another are joined
  double z_stretch = 5;           // of heights
  int registration_spacing = 15;  // d_cons: frames of a pass between two registrations with another
  int revisit_frames = 25;        // frames of one pass farther apart than this are two visits of a place
  int hops = 3;                   // edges between the frames of two visits, at most
  double max_distance_m = 20;     // between the frames to be registered, in plan; in height by z_stretch
  void check() const;             // throws InputError
};

// Edges of the shape, ascending; exterior ones are left out. Positions in metres, finite; those that repeat an earlier
// one have no edges. Deterministic. Empty with fewer than four positions.
std::vector<PanoramaEdge> panorama_graph(const std::vector<Eigen::Vector3d>& positions, const PlaceOptions& options);

// Where to register: along each visit of a place, for every other visit joined with it by interior and normal edges,
// the two nearest frames of each `registration_spacing` frames. `pass`: of each position, frames of a pass in the order
// they were taken. Ascending by (a, c); a and c are the nearest frames, b and d their successors, or predecessors at an
// end.
std::vector<Place> choose_places(const std::vector<Eigen::Vector3d>& positions, const std::vector<std::int64_t>& pass,
                                 const std::vector<PanoramaEdge>& edges, const PlaceOptions& options);

}  // namespace megablock
