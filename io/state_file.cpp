// Current values of poses, intrinsics and mounts: docs/job-format.md, "State".
#include <algorithm>

#include "io/hdf5_state.h"
#include "io/hdf5_tables.h"
#include "io/unit_files.h"

namespace megablock {

void put_state(Hdf5Writer& file, const BlockState& state) {
  std::vector<double> intrinsics;
  for (const Intrinsics& values : state.cameras) intrinsics.insert(intrinsics.end(), values.begin(), values.end());
  std::vector<Pose> mounts;
  for (const std::vector<Pose>& rig : state.mounts) mounts.insert(mounts.end(), rig.begin(), rig.end());
  write_poses(file, "frames", state.frames, "rig", "ground frame");
  file.vector("frames/oriented", state.oriented, {"", "1: the frame has a pose"});
  file.matrix("cameras/intrinsics", intrinsics, kIntrinsicCount,
              {"px, px, px, 1, 1, 1, 1, 1", "f, cx, cy, k1, k2, k3, p1, p2"});
  write_poses(file, "mounts", mounts, "camera", "rig");
}

BlockState get_state(const Hdf5Reader& file) {
  BlockState state;
  state.frames = IndexedVector<FrameIndex, Pose>(read_poses(file, "frames"));
  state.oriented = IndexedVector<FrameIndex, std::uint8_t>(
      file.vector<std::uint8_t>("frames/oriented", static_cast<std::int64_t>(state.frames.size())));
  const auto intrinsics = file.matrix<double>("cameras/intrinsics", kIntrinsicCount);
  state.cameras.resize(intrinsics.size() / kIntrinsicCount);
  for (std::size_t c = 0; c < state.cameras.size(); ++c)
    std::copy_n(&intrinsics[kIntrinsicCount * c], kIntrinsicCount,
                state.cameras[CameraIndex(static_cast<std::int64_t>(c))].begin());
  const std::vector<Pose> mounts = read_poses(file, "mounts");
  const auto begin =
      begin_of(file, "rigs/mounts", file.vector<std::int64_t>("rigs/mounts"), static_cast<std::int64_t>(mounts.size()));
  for (std::size_t r = 0; r + 1 < begin.size(); ++r)
    state.mounts.push_back({mounts.begin() + begin[r], mounts.begin() + begin[r + 1]});
  return state;
}

namespace {

void put_whole_state(Hdf5Writer& file, const BlockState& state) {
  for (const char* group : {"frames", "cameras", "rigs", "mounts"}) file.group(group);
  file.vector("rigs/mounts",
              column(state.mounts, [](const std::vector<Pose>& rig) { return static_cast<std::int32_t>(rig.size()); }),
              {"", "number of mounts: rows of the group 'mounts', in the order of the rigs"});
  put_state(file, state);
}

}  // namespace

void write_state(const std::string& path, const BlockState& state) {
  Hdf5Writer file(path, "state");
  put_whole_state(file, state);
  file.close();
}

BlockState read_state(const std::string& path) { return get_state(Hdf5Reader(path, "state")); }

void write_orientation(const std::string& path, const InitialOrientation& orientation) {
  Hdf5Writer file(path, "orientation");
  put_whole_state(file, orientation.state);
  file.group("failed");
  file.vector("failed/frame", column(orientation.failed, [](const auto& failed) { return failed.first.value; }),
              {"", "frames without a pose"});
  file.texts("failed/reason", column(orientation.failed, [](const auto& failed) { return failed.second; }), {"", "why"});
  file.close();
}

InitialOrientation read_orientation(const std::string& path) {
  const Hdf5Reader file(path, "orientation");
  InitialOrientation orientation{get_state(file), {}};
  const auto frames = file.vector<std::int64_t>("failed/frame");
  const auto reasons = file.texts("failed/reason", static_cast<std::int64_t>(frames.size()));
  for (std::size_t f = 0; f < frames.size(); ++f) orientation.failed.emplace_back(FrameIndex(frames[f]), reasons[f]);
  return orientation;
}

}  // namespace megablock
