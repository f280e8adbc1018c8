#include "cluster/stages/merge/merge_checkpoint.h"

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <tuple>

#include "adjust/tile/image_sigma.h"
#include "cluster/job/messages.h"
#include "cluster/job/stage.h"
#include "cluster/job/work_queue.h"
#include "cluster/mpi/collective.h"
#include "cluster/process/process_memory.h"
#include "cluster/stages/common/units.h"
#include "io/base/error.h"
#include "io/base/hash.h"
#include "io/store/units/adjustment_file.h"
#include "io/store/units/state_file.h"

namespace megablock {

namespace {

constexpr const char* kMarker = "/iteration.bin";  // written last

TileAdjustment snapshot(const RankTile& tile) {
  TileAdjustment snapshot;
  snapshot.frames = tile.problem.frames;
  snapshot.poses = tile.state.frames;
  snapshot.observations.assign(snapshot.frames.size(), 0);
  snapshot.cameras = tile.problem.cameras;
  snapshot.intrinsics = tile.state.cameras;
  snapshot.camera_observations.assign(snapshot.cameras.size(), 0);
  snapshot.points = tile.state.points;
  snapshot.kept = tile.problem.kept;
  snapshot.image_sigma_px = tile.problem.image_sigma_px;
  return snapshot;
}

std::string tile_unit(const std::string& folder, std::int64_t tile) { return unit_name(folder, tile); }

// The layout of the marker as docs/reference/file-formats.md describes it.
constexpr std::size_t kScaleBytes = 8 * kObservationKinds + 8 + 24 * SigmaScales::kMostGroups;
static_assert(sizeof(SigmaScales) == kScaleBytes && sizeof(MergePosition) == 144 + kScaleBytes + 24 * 32 &&
              offsetof(MergePosition, tried_steps) == 4 && offsetof(MergePosition, global) == 8 &&
              offsetof(MergePosition, scales) == 112 && offsetof(MergePosition, rounds_afar) == 112 + kScaleBytes &&
              offsetof(MergePosition, first_round) == 120 + kScaleBytes &&
              offsetof(GlobalState, lambda) == 8 && offsetof(GlobalState, decrement_squared) == 48 &&
              offsetof(GlobalState, accepted) == 84 && offsetof(GlobalState, curvature) == 88 &&
              offsetof(GlobalState, held) == 100);

void write_marker(const std::string& path, const MergePosition& position) {
  std::ofstream out(path, std::ios::binary);
  out.write(reinterpret_cast<const char*>(&position), sizeof position);
}

MergePosition read_marker(const std::string& path) {
  static_assert(std::is_trivially_copyable_v<MergePosition>);
  MergePosition position;
  std::ifstream in(path, std::ios::binary);
  in.read(reinterpret_cast<char*>(&position), sizeof position);
  if (!in) throw StoreError(path + ": is truncated; run again to compute it anew");
  return position;
}

}  // namespace

PriorVerdicts StoredVerdicts::get() const {
  PriorVerdicts all;
  for (std::int64_t i = 0; i < count; ++i) {
    const Verdict& verdict = verdicts[static_cast<std::size_t>(i)];
    (verdict.aside ? all.aside : all.cleared).push_back(verdict.prior);
  }
  return all;
}

PriorVerdicts StoredVerdicts::store(const PriorVerdicts& change) {
  PriorVerdicts stored;
  for (const PriorId& prior : change.aside) {
    if (count == std::ssize(verdicts)) break;
    verdicts[static_cast<std::size_t>(count++)] = {prior, 1};
    stored.aside.push_back(prior);
  }
  for (const PriorId& prior : change.cleared) {
    std::ranges::find(verdicts, prior, &Verdict::prior)->aside = 0;
    stored.cleared.push_back(prior);
  }
  return stored;
}

std::string MergeCheckpoint::folder(const MergePosition& position) const {
  char text[64];
  std::snprintf(text, sizeof text, "merge/%02d-%04d", position.round, position.global.accepted);
  return text;
}

std::uint64_t MergeCheckpoint::fingerprint(const std::string& folder) const {
  Hasher hasher;
  // The size of the marker is hashed too, so that a checkpoint of another layout does not count.
  hasher.add(inputs_).add(folder).add(std::int64_t{sizeof(MergePosition)});
  return hasher.value();
}

void MergeCheckpoint::write(const MergePosition& position, TileStore& tiles, const BlockState& state) {
  const std::string here = folder(position);
  const std::string before = current_;
  on_first_rank(job_.ranks, [&] {
    std::filesystem::create_directories(job_.store.path(here));
    return std::string();
  });
  std::string problem;
  try {
    for (std::size_t row = 0; row < tiles.size(); ++row)
      job_.store.write(tile_unit(here, tiles.number(row)), fingerprint(here),
                       [&](const std::string& path) { write_adjustment(path, snapshot(tiles.whole(row))); });
  } catch (const Error& error) {
    problem = error.what();
  }
  share_error(job_.ranks, 'i', problem);
  on_first_rank(job_.ranks, [&] {
    job_.store.write(here + "/state.h5", fingerprint(here), [&](const std::string& path) { write_state(path, state); });
    job_.store.write(here + kMarker, fingerprint(here), [&](const std::string& path) { write_marker(path, position); });
    UnitEvent event;
    event.stage = kMergeStage;
    event.unit = here;
    event.seconds = monotonic_seconds() - last_s_;
    event.peak_rss_mib = peak_rss_mib();
    events_.append(event);
    if (!before.empty() && before != here) std::filesystem::remove_all(job_.store.path(before));
    return std::string();
  });
  current_ = here;
  last_s_ = monotonic_seconds();
}

std::optional<MergePosition> MergeCheckpoint::find() {
  current_ = on_first_rank(job_.ranks, [&] {
    std::string last;
    const std::filesystem::path root(job_.store.path("merge"));
    std::vector<std::string> folders;
    if (std::filesystem::exists(root))
      for (const auto& entry : std::filesystem::directory_iterator(root))
        folders.push_back("merge/" + entry.path().filename().string());
    std::sort(folders.begin(), folders.end());
    for (const std::string& name : folders) {
      const auto seal = job_.store.seal(name + kMarker);
      bool valid = seal && seal->fingerprint == fingerprint(name);
      if (valid)
        for (const auto& file : std::filesystem::directory_iterator(job_.store.path(name))) {
          const std::string unit = name + "/" + file.path().filename().string(), problem = job_.store.problem(unit);
          if (!problem.empty()) warn_of_damage(job_.store, job_.log, kMergeStage, unit, problem);
          valid = valid && problem.empty();
        }
      if (valid)
        last = name;
      else
        std::filesystem::remove_all(job_.store.path(name));
    }
    return last;
  });
  if (current_.empty()) return std::nullopt;
  return read_marker(job_.store.verified_path(current_ + kMarker));
}

BlockState MergeCheckpoint::state() const { return read_state(job_.store.verified_path(current_ + "/state.h5")); }

void MergeCheckpoint::load_tile(RankTile& tile) const {
  const TileAdjustment snapshot = read_adjustment(job_.store.verified_path(tile_unit(current_, tile.tile)));
  tile.problem.kept = snapshot.kept;
  set_image_sigma(tile.problem, snapshot.image_sigma_px);
  tile.state.frames = snapshot.poses;
  tile.state.cameras = snapshot.intrinsics;
  tile.state.points = snapshot.points;
}

SweepRecorder::Position MergeCheckpoint::of_sweep(const MergePosition& position) const {
  Hasher hasher;
  hasher.add(fingerprint(folder(position))).add(job_.ranks.size());
  return {hasher.value(), Bytes(reinterpret_cast<const char*>(&position), sizeof position)};
}

std::optional<MergePosition> MergeCheckpoint::find_sweep(const MergePosition& start, SweepRecorder& recorder) {
  recorder.keep_found(of_sweep(start).state);
  ByteWriter writer;
  writer.bytes(recorder.found() ? recorder.found()->position : Bytes());
  writer.value(recorder.found() ? recorder.found()->tiles : 0);
  std::optional<MergePosition> furthest;
  std::int64_t tiles = 0;
  const auto order = [](const GlobalState& state) {
    return std::tuple(state.iterations, state.sweep_lambda == 0, state.next == GlobalAction::kStop);
  };
  for (const Bytes& bytes : job_.ranks.gather_all(writer.take())) {
    ByteReader reader(bytes);
    const Bytes there = reader.bytes();
    tiles += reader.value<std::int64_t>();
    if (there.size() != sizeof(MergePosition)) continue;
    MergePosition position;
    std::memcpy(&position, there.data(), sizeof position);
    if (!furthest || order(furthest->global) < order(position.global)) furthest = position;
  }
  if (furthest) say(job_, kMergeStage, "resumes within a sweep: " + std::to_string(tiles) + " tiles are done");
  return furthest;
}

void MergeCheckpoint::clear() {
  std::filesystem::remove_all(job_.store.path("merge"));
  std::filesystem::create_directories(job_.store.path("merge"));
  current_.clear();
}

}  // namespace megablock
