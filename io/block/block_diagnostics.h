// Holds the weaknesses of a block: gaps, missing overlap, weak links, unfavourable bases, and places where exposures
// should be added (after Kalantari 2009, chapter 10). partition/diagnostics/block_diagnostics.h finds them in any state
// of a job. The report draws them and writes them as JSON beside it.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <limits>
#include <string>
#include <vector>

#include "io/block/block.h"

namespace megablock {

// The requirements that a block is compared with.
struct DiagnosticsOptions {
  double min_base_to_height = 0.1, max_base_to_height = 1.2;  // of successive exposures of a flight line
  double min_overlap = 0.5;                                   // of their footprints, as a share of the smaller one
  int min_images = 2;        // number of images that must see every place on the ground
  int min_link_points = 15;  // common tie points; a link with fewer is weak
  double gap_factor = 1.5;   // distances above so many usual ones are gaps; twice as many along streets
  void check() const;        // throws InputError
};

struct BlockDiagnostics {
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

  DiagnosticsOptions requested;
  // In an aerial block most images look down. Only such blocks have footprints, bases, flight lines, ground and
  // proposals. In others, above all facades along streets, only interruptions of passes and links have a meaning.
  bool aerial = false;
  std::int64_t frames = 0;            // with a pose; others are not examined
  bool links_known = false;           // there are tie points or matches
  double usual_step_m = kUnknown;     // between successive exposures, median
  double line_distance_m = kUnknown;  // between neighbouring flight lines, median
  double height_m = kUnknown;         // above ground, median
  std::int64_t lines = 0;             // number of flight lines of at least three exposures

  // The corners of an image on a horizontal plane at the height of the ground that it sees, in order around it.
  struct Footprint {
    ImageIndex image;
    std::array<Eigen::Vector2d, 4> corners;
  };
  std::vector<Footprint> footprints;  // ascending by image

  // A place where exposures are missing between others: within a pass, or a flight line between its neighbours.
  struct Gap {
    bool line = false;
    FrameIndex before, after;  // on both sides; of a line: where the gap begins
    Eigen::Vector2d from, to;  // within a pass: these two; of a line: its ends
    std::int64_t missing = 0;  // number of exposures, or of flight lines
    double distance_m = 0;     // from one side to the other, metres
  };
  std::vector<Gap> gaps;

  // A connected piece of ground that fewer than min_images images see, between sufficiently covered ground.
  struct ThinGround {
    Eigen::Vector2d centre;  // mean of its cells
    double area_m2 = 0;
    std::vector<Eigen::Vector2d> cells;  // centres
  };
  std::vector<ThinGround> thin_ground;
  double cell_m = 0;  // side of a cell, metres

  // Two successive exposures of a flight line; without flight lines, any two with a good link.
  struct StereoPair {
    FrameIndex a, b;
    double base_m = 0, base_to_height = kUnknown;
    double overlap = kUnknown;  // of the footprints, as a share of the smaller one
  };
  std::vector<StereoPair> pairs;
  bool base_is_outside(const StereoPair& pair) const {
    return pair.base_to_height < requested.min_base_to_height || pair.base_to_height > requested.max_base_to_height;
  }
  bool overlap_is_missing(const StereoPair& pair) const { return pair.overlap < requested.min_overlap; }

  // Parts that are connected by links of at least min_link_points tie points and by relative poses, the largest first.
  IndexedVector<FrameIndex, std::int32_t> part_of_frame;  // -1: without a pose
  std::vector<std::int64_t> part_frames;
  struct Link {
    FrameIndex a, b;
    std::int64_t points = 0;
    std::int64_t frames = 0;  // for a single link: number of frames on its smaller side
  };
  std::vector<Link> weak_links;    // all links between two parts
  std::vector<Link> single_links;  // good links that alone connect at least two frames with the rest

  // A part whose size the rest of the block does not determine (partition/links/loose_parts.h), the largest first.
  struct LoosePart {
    std::vector<FrameIndex> frames;  // without those of the main part and of larger loose parts, ascending
    std::vector<FrameIndex> joints;  // frames that it shares with other parts; none: no good link leads to it
    std::int64_t points = 0;         // most tie points of a link that passes the joints
  };
  std::vector<LoosePart> loose_parts;

  // A position where an exposure is missing, with the attitude of its neighbours.
  struct Proposal {
    Eigen::Vector3d centre;
    Eigen::Quaterniond rotation;  // ground -> rig
  };
  std::vector<Proposal> proposals;
};

// One JSON object, as described in docs/reference/file-formats.md. Positions are in the block's frame, and in
// georeferenced blocks also as latitude and longitude.
std::string to_json(const BlockDiagnostics& diagnostics, const Block& block);
// The same in a few lines of text. Lines at the end name what could not be examined; without a pose that is everything.
std::string to_text(const BlockDiagnostics& diagnostics, const Block& block);
// "6 frames ('a', 'b', 'c' and 3 more) share only 'd' with the rest of the block, ...". Without a full stop.
std::string loose_part_text(const BlockDiagnostics::LoosePart& part, const BlockDiagnostics& diagnostics,
                            const Block& block);
// What a reader of the result must not overlook: the loose parts of two frames and more, one line each.
std::vector<std::string> loose_part_remarks(const BlockDiagnostics& diagnostics, const Block& block);

}  // namespace megablock
