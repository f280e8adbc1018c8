#include "cluster/stages/pipeline/cameras.h"

// A unit is a rig whose cameras ask for a choice of their parameters or for their readout time. Its file has a line for
// each of them: the number of the camera in the block, the chosen parameters as a mask, 1 where the focal length is
// contradicted, a better one and its sigma in pixels, the readout time in microseconds, and the reason.

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "adjust/calibration/camera_sample.h"
#include "cluster/job/messages.h"
#include "cluster/job/work_queue.h"
#include "cluster/mpi/collective.h"
#include "cluster/stages/common/block_hash.h"
#include "cluster/stages/pipeline/focal_lengths.h"
#include "io/base/error.h"
#include "io/base/hash.h"
#include "io/project/inputs/camera_priors.h"
#include "merge/camera/determined_parameters.h"
#include "merge/camera/readout_time.h"

namespace megablock {

namespace {

bool asks_its_images(const Camera& camera) { return camera.choose || camera.estimate_readout; }

// Cameras that ask for something and belong to this rig: a camera of several rigs belongs to the first of them.
std::vector<CameraIndex> cameras_of(const Block& block, RigIndex rig) {
  std::vector<CameraIndex> cameras;
  const auto carries = [&](RigIndex r, CameraIndex camera) {
    const auto& mounts = block.rigs[r].mounts;
    return std::any_of(mounts.begin(), mounts.end(), [&](const Mount& m) { return m.camera == camera; });
  };
  for (const Mount& mount : block.rigs[rig].cameras()) {
    if (!asks_its_images(block.cameras[mount.camera])) continue;
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
    if (camera.readout_s != 0 || camera.estimate_readout) hasher.add(camera.readout_s).add(camera.estimate_readout);
  }
  if (std::any_of(job.block.cameras.begin(), job.block.cameras.end(),
                  [](const Camera& c) { return c.readout_s != 0 || c.estimate_readout; }))
    for (const Frame& frame : job.block.frames) hasher.add(frame.time_s).add(frame.pass);
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

// Of images of the wrong focal length pairs are lost, and others are verified with a wrong orientation. A tenth does
// little harm. A stated focal length must be contradicted more clearly than a guess.
bool is_wrong(const Camera& camera, const CameraChoice& choice) {
  constexpr double kHarmless = 0.1, kMostSigma = 0.1;
  const bool may_change = choice.focal_contradicted || !camera.focal_known;
  const double sigma = choice.focal_sigma_px / choice.focal_px, sigmas = camera.focal_known ? 5 : 3;
  return may_change && contains(choice.estimated, kFocal) && sigma <= kMostSigma &&
         std::abs(std::log(choice.focal_px / camera.intrinsics[kFocal])) > std::max(kHarmless, sigmas * sigma);
}

// What a unit finds for one of its cameras.
struct Found {
  CameraChoice choice;
  std::int64_t readout_us = 0;
};

// The frames of a sample, and what they share.
struct Sample {
  BlockState state;  // the other frames are not oriented
  TrackSet tracks;
};

Sample take_sample(const Job& job, const Tiles& tiles, const BlockState& state, RigIndex rig) {
  const CameraSampleOptions options;
  const std::vector<FrameIndex> frames = frames_of_sample(job, tiles, state, rig, options);
  Sample sample{state, {}};
  std::fill(sample.state.oriented.begin(), sample.state.oriented.end(), std::uint8_t{0});
  for (const FrameIndex f : frames) sample.state.oriented[f] = 1;
  std::vector<ImageIndex> images;
  for (ImageIndex i(0); job.block.images.contains(i); ++i.value)
    if (sample.state.oriented[job.block.images[i].frame]) images.push_back(i);
  if (images.empty()) throw ComputeError("no image of it is oriented");
  const MeasurementStore store(job.store.directory());
  sample.tracks = tracks_in_frames(job.block, store.of_images(images), options.max_observations);
  return sample;
}

// The readout times [cameras of the block] that the sample confirms, and the reasons [cameras]. Several cameras of a
// rig share their poses, so that each is estimated again with what was found of the others.
std::vector<std::string> find_readouts(const Job& job, const Sample& sample, const std::vector<CameraIndex>& cameras,
                                       IndexedVector<CameraIndex, double>& readout_s) {
  const Block& block = job.block;
  const auto estimated =
      std::count_if(cameras.begin(), cameras.end(), [&](CameraIndex c) { return block.cameras[c].estimate_readout; });
  std::vector<std::string> reasons(cameras.size());
  for (int pass = 0; pass < (estimated > 1 ? 2 : 1); ++pass)
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      const CameraIndex c = cameras[i];
      if (!block.cameras[c].estimate_readout) continue;
      const ReadoutChoice choice =
          choose_readout(estimate_readout(block, sample.state, sample.tracks, readout_s, c, job.settings.adjustment),
                         block.cameras[c].readout_s);
      readout_s[c] = choice.time_s;
      reasons[i] = choice.reason;
    }
  return reasons;
}

// Images that say nothing of each other, such as one alone, leave every camera with what is usual. The rest of the
// block may still say something.
std::vector<Found> nothing_found(const Block& block, const std::vector<CameraIndex>& cameras, const std::string& why) {
  std::vector<Found> found(cameras.size());
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const Camera& camera = block.cameras[cameras[i]];
    if (camera.choose)
      found[i].choice = {usual_parameters(camera.intrinsics.model()),
                         fmt::format("estimated: the usual parameters; no choice: {}", why)};
    else
      found[i].choice.reason = fmt::format("no rolling shutter: {}", why);
  }
  return found;
}

std::vector<Found> find(const Job& job, const Tiles& tiles, const BlockState& state, RigIndex rig,
                        const std::vector<CameraIndex>& cameras) {
  const Block& block = job.block;
  std::vector<CameraIndex> to_choose;
  for (const CameraIndex c : cameras)
    if (block.cameras[c].choose) to_choose.push_back(c);
  IndexedVector<CameraIndex, double> readout_s;
  for (const Camera& camera : block.cameras) readout_s.push_back(camera.readout_s);
  try {
    const Sample sample = take_sample(job, tiles, state, rig);
    const std::vector<std::string> readouts = find_readouts(job, sample, cameras, readout_s);
    std::vector<CameraChoice> choices;
    if (!to_choose.empty())
      choices =
          determined_parameters(block, sample.state, sample.tracks, to_choose, readout_s, job.settings.adjustment, {});
    std::vector<Found> found(cameras.size());
    for (std::size_t i = 0, chosen = 0; i < cameras.size(); ++i) {
      if (block.cameras[cameras[i]].choose) found[i].choice = choices[chosen++];
      found[i].readout_us = std::llround(1e6 * readout_s[cameras[i]]);
      std::string& reason = found[i].choice.reason;
      reason += (reason.empty() || readouts[i].empty() ? "" : "; ") + readouts[i];
    }
    return found;
  } catch (const ComputeError& error) {
    return nothing_found(block, cameras, error.what());
  }
}

void write_found(const std::string& path, const std::vector<CameraIndex>& cameras, const std::vector<Found>& found) {
  std::ofstream out(path);
  for (std::size_t c = 0; c < cameras.size(); ++c)
    out << fmt::format("{} {} {:d} {} {} {} {}\n", cameras[c].value, found[c].choice.estimated,
                       found[c].choice.focal_contradicted, found[c].choice.focal_px, found[c].choice.focal_sigma_px,
                       found[c].readout_us, found[c].choice.reason);
}

void take_choice(CameraChoice choice, Camera& camera, Intrinsics& values) {
  if (choice.focal_contradicted) {
    camera.focal_known = false;
    choice.reason = fmt::format("the images contradict the focal length of {:.0f} px, which becomes a guess; {}",
                                camera.intrinsics[kFocal], choice.reason);
  }
  camera.prior_sigma = default_intrinsic_sigmas(camera, choice.estimated);
  camera.choice = choice.reason;
  for (int p = 0; p < values.size(); ++p)
    if (!contains(choice.estimated, p))
      values[static_cast<std::size_t>(p)] = camera.intrinsics[static_cast<std::size_t>(p)];
}

// Whether the focal length of the images differs by more from a stated one than focusing explains.
bool differs(const Camera& camera, const CameraChoice& choice) {
  constexpr double kFocusing = 0.05;
  return std::abs(std::log(choice.focal_px / camera.intrinsics[kFocal])) > kFocusing;
}

// Of a focal length from a header or the project file. One that is_wrong() gets the words of the stage focal_lengths.
std::string contradiction_text(const Camera& camera, const CameraChoice& choice) {
  return fmt::format(
      "camera '{}': the focal length of {} {}: the oriented block gives {:.0f} +- {:.0f} px; check the header "
      "or 'focal_px', and whether images were cropped or the lens zoomed",
      camera.name, focal_length_text(camera, camera.intrinsics[kFocal]),
      is_wrong(camera, choice) ? "cannot be right" : "does not fit the images", choice.focal_px, choice.focal_sigma_px);
}

void take_found(const std::string& path, Block& block, BlockState& state, CameraFindings& findings) {
  std::ifstream in(path);
  std::int64_t number = 0;
  Found found;
  CameraChoice& choice = found.choice;
  while (in >> number >> choice.estimated >> choice.focal_contradicted >> choice.focal_px >> choice.focal_sigma_px >>
             found.readout_us &&
         std::getline(in >> std::ws, choice.reason)) {
    const CameraIndex c(number);
    Camera& camera = block.cameras[c];
    if (camera.choose && is_wrong(camera, choice))
      findings.better.push_back({c, choice.focal_px, choice.focal_sigma_px});
    if (camera.choose && choice.focal_contradicted && differs(camera, choice))
      findings.contradictions.push_back(contradiction_text(camera, choice));
    if (camera.choose)
      take_choice(choice, camera, state.cameras[c]);
    else
      camera.choice = found.choice.reason;
    if (camera.estimate_readout) camera.readout_s = 1e-6 * static_cast<double>(found.readout_us);
  }
}

}  // namespace

CameraFindings run_cameras(const Stage& stage, const Job& job, JobRecord& record, const Tiles& tiles, BlockState& state,
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
      write_found(path, cameras, find(job, tiles, state, rig, cameras));
    };
    units.push_back(std::move(unit));
  }
  if (units.empty()) {
    if (job.is_first_rank()) remove_record(job.store, stage.name);  // an earlier run may have needed the stage
    return {};
  }
  const StageOutcome outcome = run_stage(job, record, stage, units);
  if (!outcome.failures.empty())
    throw AgreedError<ComputeError>("the parameters of the cameras could not be chosen: " +
                                    outcome.failures.front().reason);
  CameraFindings findings;
  for (const Unit& unit : units) take_found(job.store.verified_path(unit.name), block, state, findings);
  for (const Camera& camera : block.cameras)
    if (asks_its_images(camera)) say(job, stage.name, fmt::format("camera '{}': {}", camera.name, camera.choice));
  return findings;
}

}  // namespace megablock
