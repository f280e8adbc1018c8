#include "cluster/stages/pipeline/cameras.h"

// A unit is a rig whose cameras ask for a choice. Its file has a line for each of them: the number of the camera in the
// block, the chosen parameters as a mask, 1 where the focal length is contradicted, and the reason.

#include <fmt/core.h>

#include <algorithm>
#include <fstream>

#include "adjust/calibration/camera_sample.h"
#include "cluster/job/messages.h"
#include "cluster/job/work_queue.h"
#include "cluster/mpi/collective.h"
#include "cluster/stages/common/block_hash.h"
#include "io/base/error.h"
#include "io/base/hash.h"
#include "io/project/inputs/camera_priors.h"
#include "merge/camera/determined_parameters.h"

namespace megablock {

namespace {

// Cameras that ask for a choice and belong to this rig: a camera of several rigs belongs to the first of them.
std::vector<CameraIndex> cameras_of(const Block& block, RigIndex rig) {
  std::vector<CameraIndex> cameras;
  const auto carries = [&](RigIndex r, CameraIndex camera) {
    const auto& mounts = block.rigs[r].mounts;
    return std::any_of(mounts.begin(), mounts.end(), [&](const Mount& m) { return m.camera == camera; });
  };
  for (const Mount& mount : block.rigs[rig].mounts) {
    if (!block.cameras[mount.camera].choose) continue;
    bool earlier = false;
    for (RigIndex r(0); r < rig && !earlier; ++r.value) earlier = carries(r, mount.camera);
    if (!earlier) cameras.push_back(mount.camera);
  }
  std::sort(cameras.begin(), cameras.end());
  cameras.erase(std::unique(cameras.begin(), cameras.end()), cameras.end());
  return cameras;
}

// Everything from which the choices are made. The tracks of the whole block stand for those of the samples.
std::uint64_t inputs_hash(const Stage& stage, const Job& job, const BlockState& state) {
  Hasher hasher;
  hasher.add(stage.algorithm).add(job.store.seal("tracks/index.txt")->content_hash);
  add_to_hash(hasher, job.settings.adjustment);
  for (FrameIndex f(0); state.frames.contains(f); ++f.value) {
    hasher.add(state.oriented[f]);
    if (state.oriented[f]) add_to_hash(hasher, state.frames[f]);
    add_priors_to_hash(hasher, job.block.frames[f]);
  }
  for (CameraIndex c(0); state.cameras.contains(c); ++c.value) {
    add_to_hash(hasher, state.cameras[c]);
    const Camera& camera = job.block.cameras[c];
    add_to_hash(hasher.add(camera.choose).add(camera.focal_known), camera.intrinsics);
    for (const double sigma : camera.prior_sigma) hasher.add(sigma);
  }
  return hasher.value();
}

// The sample comes from the first images of the block, as far as these are enough: images that are added later must not
// change the choice, which would adjust every tile anew.
std::vector<FrameIndex> frames_of_sample(const Job& job, const Tiles& tiles, const BlockState& state, RigIndex rig,
                                         const CameraSampleOptions& options) {
  constexpr std::ptrdiff_t kEnough = 20;
  std::vector<FrameIndex> frames;
  for (const std::int64_t images : job.generations) {
    BlockState early = state;
    for (ImageIndex i(images); job.block.images.contains(i); ++i.value) early.oriented[job.block.images[i].frame] = 0;
    frames = frames_near_the_middle(job.block, early, rig, tiles.component, options.max_frames);
    if (std::ssize(frames) >= kEnough) break;
  }
  return frames;
}

std::vector<CameraChoice> choose(const Job& job, const Tiles& tiles, const BlockState& state, RigIndex rig,
                                 const std::vector<CameraIndex>& cameras) {
  const CameraSampleOptions options;
  const std::vector<FrameIndex> frames = frames_of_sample(job, tiles, state, rig, options);
  BlockState sample = state;
  std::fill(sample.oriented.begin(), sample.oriented.end(), std::uint8_t{0});
  for (const FrameIndex f : frames) sample.oriented[f] = 1;
  std::vector<ImageIndex> images;
  for (ImageIndex i(0); job.block.images.contains(i); ++i.value)
    if (sample.oriented[job.block.images[i].frame]) images.push_back(i);
  try {
    if (images.empty()) throw ComputeError("no image of it is oriented");
    const MeasurementStore store(job.store.directory());
    const TrackSet tracks = tracks_in_frames(job.block, store.of_images(images), options.max_observations);
    return determined_parameters(job.block, sample, tracks, cameras, job.settings.adjustment, {});
  } catch (const ComputeError& error) {
    // Images that say nothing of each other, such as one alone. The rest of the block may still say something.
    std::vector<CameraChoice> usual;
    for (const CameraIndex c : cameras)
      usual.push_back({usual_parameters(job.block.cameras[c].intrinsics.model()),
                       fmt::format("estimated: the usual parameters; no choice: {}", error.what())});
    return usual;
  }
}

void write_choices(const std::string& path, const std::vector<CameraIndex>& cameras,
                   const std::vector<CameraChoice>& choices) {
  std::ofstream out(path);
  for (std::size_t c = 0; c < cameras.size(); ++c)
    out << cameras[c].value << ' ' << choices[c].estimated << ' ' << choices[c].focal_contradicted << ' '
        << choices[c].reason << '\n';
}

void take_choices(const std::string& path, Block& block, BlockState& state) {
  std::ifstream in(path);
  std::int64_t number = 0;
  CameraChoice choice;
  while (in >> number >> choice.estimated >> choice.focal_contradicted && std::getline(in >> std::ws, choice.reason)) {
    Camera& camera = block.cameras[CameraIndex(number)];
    if (choice.focal_contradicted) {
      camera.focal_known = false;
      choice.reason = fmt::format("the images contradict the focal length of {:.0f} px, which becomes a guess; {}",
                                  camera.intrinsics[kFocal], choice.reason);
    }
    camera.prior_sigma = default_intrinsic_sigmas(camera, choice.estimated);
    camera.choice = choice.reason;
    Intrinsics& values = state.cameras[CameraIndex(number)];
    for (int p = 0; p < values.size(); ++p)
      if (!contains(choice.estimated, p))
        values[static_cast<std::size_t>(p)] = camera.intrinsics[static_cast<std::size_t>(p)];
  }
}

}  // namespace

void run_cameras(const Stage& stage, const Job& job, JobRecord& record, const Tiles& tiles, BlockState& state,
                 Block& block) {
  std::vector<Unit> units;
  const std::uint64_t inputs = inputs_hash(stage, job, state);
  for (RigIndex rig(0); job.block.rigs.contains(rig); ++rig.value) {
    const std::vector<CameraIndex> cameras = cameras_of(job.block, rig);
    if (cameras.empty()) continue;
    Unit unit;
    unit.name = fmt::format("{}/{:06}.txt", stage.folder(), rig.value);
    unit.fingerprint = Hasher().add(inputs).add(rig.value).value();
    unit.write = [&job, &tiles, &state, rig, cameras](const std::string& path) {
      write_choices(path, cameras, choose(job, tiles, state, rig, cameras));
    };
    units.push_back(std::move(unit));
  }
  if (units.empty()) {
    if (job.is_first_rank()) remove_record(job.store, stage.name);  // an earlier run may have needed the stage
    return;
  }
  const StageOutcome outcome = run_stage(job, record, stage, units);
  if (!outcome.failures.empty())
    throw AgreedError<ComputeError>("the parameters of the cameras could not be chosen: " +
                                    outcome.failures.front().reason);
  for (const Unit& unit : units) take_choices(job.store.verified_path(unit.name), block, state);
  for (const Camera& camera : block.cameras)
    if (camera.choose) say(job, stage.name, fmt::format("camera '{}': {}", camera.name, camera.choice));
}

}  // namespace megablock
