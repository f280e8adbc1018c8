// Names the unknowns of the reduced normal equations: frames, free cameras, free mounts. Points never appear here,
// because they are eliminated one by one inside their tile.
#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace megablock {

// Rows and offsets are signed numbers; the containers of the standard library take unsigned ones.
inline std::size_t at(std::int64_t i) { return static_cast<std::size_t>(i); }

// The order of the kinds is the order of the rows in lists and matrices: frames first, then what many frames share.
enum class UnknownKind : std::int32_t { kFrame = 0, kCamera = 1, kMount = 2 };

// Identifies an unknown in the block: a FrameIndex, a CameraIndex, or (RigIndex, mount).
struct UnknownId {
  UnknownKind kind = UnknownKind::kFrame;
  std::int32_t part = 0;  // mount in its rig, else 0
  std::int64_t index = -1;
  friend auto operator<=>(const UnknownId& a, const UnknownId& b) {
    if (auto order = a.kind <=> b.kind; order != 0) return order;
    if (auto order = a.index <=> b.index; order != 0) return order;
    return a.part <=> b.part;
  }
  friend bool operator==(const UnknownId&, const UnknownId&) = default;
};

// A block of scalar unknowns: a frame or mount has 6 (PoseIncrement: rotation in radians, then position in metres), a
// camera as many as it has free parameters (ascending parameter number, in the units of the camera model).
struct Unknown {
  UnknownId id;
  std::int64_t dimension = 6;
  friend auto operator<=>(const Unknown&, const Unknown&) = default;
};

// Lists of unknowns are ascending by id unless said otherwise.
using UnknownList = std::vector<Unknown>;

std::int64_t total_dimension(const UnknownList& unknowns);
// The first scalar row of every unknown, and the total as the last entry: [unknowns + 1].
std::vector<std::int64_t> row_offsets(const UnknownList& unknowns);
// The position of an id in an ascending list; -1 when it is not there.
std::int64_t find_unknown(const UnknownList& ascending, const UnknownId& id);
// The ascending union of ascending lists. Throws ComputeError when an unknown has two dimensions, as a camera would
// whose free parameters differ between tiles.
UnknownList unite(const std::vector<const UnknownList*>& lists);
// "frame 12", "camera 3", "mount 2 of rig 0".
std::string describe(const UnknownId& id);

}  // namespace megablock
