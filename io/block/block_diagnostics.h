// What a block lacks: gaps, missing overlap, weak links, unfavourable bases, and where a view should be added (M57).
// Found by partition/diagnostics/block_diagnostics.h from any state of a job, drawn by the report, written beside it as
// JSON.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <limits>
#include <string>
#include <vector>

#include "io/block/block.h"

namespace megablock {

// What is asked of a block.
struct DiagnosticsOptions {
  double min_base_to_height = 0.1, max_base_to_height = 1.2;  // of successive exposures of a flight line
  double min_overlap = 0.5;                                   // of their footprints, share of the smaller one
  int min_images = 2;                                         // that see every place on the ground
  int min_link_points = 15;                                   // common tie points; a link with fewer is weak
  double gap_factor = 1.5;  // larger distances than so many usual ones are gaps; along streets twice as many
  void check() const;       // throws InputError
};

struct BlockDiagnostics {
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

  DiagnosticsOptions requested;
  // Aerial: most images look down. Only these have footprints, bases, flight lines, ground and proposals; of others,
  // facades along streets above all, only interruptions of passes and links say something.
  bool aerial = false;
  bool links_known = false;           // there are tie points or matches
  double usual_step_m = kUnknown;     // between successive exposures, median
  double line_distance_m = kUnknown;  // between neighbouring flight lines, median
  double height_m = kUnknown;         // above ground, median
  std::int64_t lines = 0;             // of three exposures and more

  // Where an image's corners look on a horizontal plane at the height of its ground; in order around it.
  struct Footprint {
    ImageIndex image;
    std::array<Eigen::Vector2d, 4> corners;
  };
  std::vector<Footprint> footprints;  // by image

  // A place where exposures are missing between others: along a pass, or a flight line between its neighbours.
  struct Gap {
    bool line = false;
    FrameIndex before, after;  // on both sides; of a line: where it begins
    Eigen::Vector2d from, to;  // along a pass: these two; of a line: its ends
    std::int64_t missing = 0;  // exposures, or flight lines
    double distance_m = 0;     // from one side to the other
  };
  std::vector<Gap> gaps;

  // A connected piece of ground between well covered places that fewer than min_images see.
  struct ThinGround {
    Eigen::Vector2d centre;  // of its cells
    double area_m2 = 0;
    std::vector<Eigen::Vector2d> cells;  // centres
  };
  std::vector<ThinGround> thin_ground;
  double cell_m = 0;  // side of the cells

  // Two exposures that follow one another on a flight line; without flight lines, any two with a good link.
  struct StereoPair {
    FrameIndex a, b;
    double base_m = 0, base_to_height = kUnknown;
    double overlap = kUnknown;  // of the footprints, share of the smaller one
  };
  std::vector<StereoPair> pairs;
  bool base_is_outside(const StereoPair& pair) const {
    return pair.base_to_height < requested.min_base_to_height || pair.base_to_height > requested.max_base_to_height;
  }
  bool overlap_is_missing(const StereoPair& pair) const { return pair.overlap < requested.min_overlap; }

  // What hangs together by links of min_link_points tie points and more, and by relative poses; largest first.
  IndexedVector<FrameIndex, std::int32_t> part_of_frame;  // -1: without pose
  std::vector<std::int64_t> part_frames;
  struct Link {
    FrameIndex a, b;
    std::int64_t points = 0;
    std::int64_t frames = 0;  // of a single link: on its smaller side
  };
  std::vector<Link> weak_links;    // all that there is between two parts
  std::vector<Link> single_links;  // good ones that two frames and more hang on

  // Where a view is missing, with the attitude of its neighbours.
  struct Proposal {
    Eigen::Vector3d centre;
    Eigen::Quaterniond rotation;  // ground -> rig
  };
  std::vector<Proposal> proposals;
};

// One JSON object; docs/job-format.md. Places in the block's frame and, when it is georeferenced, as latitude and
// longitude too.
std::string to_json(const BlockDiagnostics& diagnostics, const Block& block);
// A few lines, what could not be looked for at the end.
std::string to_text(const BlockDiagnostics& diagnostics, const Block& block);

}  // namespace megablock
