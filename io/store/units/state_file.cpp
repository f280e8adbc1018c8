// Reads and writes the current values of poses, intrinsics and mounts (docs/reference/file-formats.md, "State").
#include "io/store/units/state_file.h"

#include "io/base/error.h"
#include "io/store/hdf5/hdf5_cameras.h"
#include "io/store/units/hdf5_state.h"

namespace megablock {

void put_state(Hdf5Writer& file, const BlockState& state) {
  std::vector<Pose> mounts;
  for (const std::vector<Pose>& rig : state.mounts) mounts.insert(mounts.end(), rig.begin(), rig.end());
  write_poses(file, "frames", state.frames, "rig", "ground frame");
  file.vector("frames/oriented", state.oriented, {"", "1: the frame has a pose"});
  put_intrinsics(file, state.cameras, "current values of the parameters");
  write_poses(file, "mounts", mounts, "camera", "rig");
}

BlockState get_state(const Hdf5Reader& file) {
  BlockState state;
  state.frames = IndexedVector<FrameIndex, Pose>(read_poses(file, "frames"));
  state.oriented = IndexedVector<FrameIndex, std::uint8_t>(
      file.vector<std::uint8_t>("frames/oriented", static_cast<std::int64_t>(state.frames.size())));
  state.cameras = IndexedVector<CameraIndex, Intrinsics>(get_intrinsics(file));
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
  put_models(file, models_of(state.cameras));
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
  file.texts("failed/reason", column(orientation.failed, [](const auto& failed) { return failed.second; }),
             {"", "why"});
  if (!orientation.verticals_aside.empty()) {
    file.group("verticals_aside", "verticals that are not believed");
    file.vector("verticals_aside/image",
                column(orientation.verticals_aside, [](const SetAsideVertical& v) { return v.image.value; }), {"", ""});
    file.vector("verticals_aside/verdict",
                column(orientation.verticals_aside,
                       [](const SetAsideVertical& v) { return static_cast<std::uint8_t>(v.verdict); }),
                {"",
                 "1 contradicted by most others, 2 without consensus, 3 against positions or attitudes, 4 against "
                 "given poses"});
  }
  file.close();
}

InitialOrientation read_orientation(const std::string& path) {
  const Hdf5Reader file(path, "orientation");
  InitialOrientation orientation{get_state(file), {}, {}};
  const auto frames = file.vector<std::int64_t>("failed/frame");
  const auto reasons = file.texts("failed/reason", static_cast<std::int64_t>(frames.size()));
  for (std::size_t f = 0; f < frames.size(); ++f) orientation.failed.emplace_back(FrameIndex(frames[f]), reasons[f]);
  if (!file.has("verticals_aside")) return orientation;
  const auto images = file.vector<std::int64_t>("verticals_aside/image");
  const auto verdicts = file.vector<std::uint8_t>("verticals_aside/verdict", static_cast<std::int64_t>(images.size()));
  for (std::size_t v = 0; v < images.size(); ++v) {
    if (verdicts[v] < 1 || verdicts[v] > static_cast<std::uint8_t>(VerticalVerdict::kAgainstPoses))
      throw StoreError(path + ": verticals_aside/verdict must be 1 to 4");
    orientation.verticals_aside.push_back({ImageIndex(images[v]), static_cast<VerticalVerdict>(verdicts[v])});
  }
  return orientation;
}

}  // namespace megablock
