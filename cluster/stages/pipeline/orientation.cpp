#include "cluster/stages/pipeline/orientation.h"

// Orients the block initially, in one unit for each generation of the block. Images that are added later are oriented
// with respect to the existing ones, which keep their orientation.

#include <fmt/core.h>

#include <algorithm>
#include <cstdio>
#include <map>
#include <set>

#include "adjust/orientation/control_alignment.h"
#include "adjust/orientation/given_trajectories.h"
#include "adjust/orientation/mirrored_lists.h"
#include "adjust/orientation/orientation.h"
#include "adjust/orientation/position_offset.h"
#include "adjust/orientation/position_shifts.h"
#include "adjust/orientation/vertical_check.h"
#include "cluster/job/messages.h"
#include "cluster/job/work_queue.h"
#include "cluster/mpi/collective.h"
#include "cluster/stages/common/block_hash.h"
#include "cluster/stages/common/growth.h"
#include "cluster/stages/common/units.h"
#include "cluster/stages/pipeline/false_pairs.h"
#include "cluster/stages/pipeline/features.h"
#include "io/base/disjoint_sets.h"
#include "io/base/error.h"
#include "io/base/hash.h"
#include "io/block/held_priors.h"
#include "io/store/units/features_file.h"
#include "io/store/units/graph_files.h"
#include "io/store/units/state_file.h"
#include "io/text/counted.h"
#include "match/tracks/tracks.h"

namespace megablock {

namespace {

using Frames = std::set<FrameIndex>;
using Links = std::map<FrameIndex, Frames>;  // frames that a verified pair links to each frame

// Algorithm number of the check of verticals. Orientations without verticals stay valid when it is raised.
constexpr int kVerticalCheck = 2;

void add_vertical_values(Hasher& hasher, const Block& block) {
  if (!block.verticals.empty()) hasher.add(kVerticalCheck);
  for (const SeenVertical& vertical : block.verticals) {
    add_to_hash(hasher.add(vertical.image.value), vertical.down);
    for (const double value : vertical.covariance.reshaped()) hasher.add(value);
    for (const double value : vertical.camera) hasher.add(value);
    for (const double value : vertical.by_camera.reshaped()) hasher.add(value);
  }
}

void add_block_values(Hasher& hasher, const Block& block) {
  for (ImageIndex i(0); block.images.contains(i); ++i.value)
    hasher.add(block.image_names[i]).add(block.images[i].frame.value).add(block.images[i].mount);
  for (const Frame& frame : block.frames) {
    hasher.add(frame.name).add(frame.rig.value);
    add_priors_to_hash(hasher, frame);
    if (frame.given_pose) add_to_hash(hasher.add('g'), *frame.given_pose);
  }
  for (const Rig& rig : block.rigs) {
    for (const Mount& mount : rig.mounts) add_to_hash(hasher.add(mount.camera.value), mount.pose);
    // Priors are loosened by these.
    if (rig.has_receiver()) hasher.add(rig.mounts.back().rotation_sigma_rad).add(rig.mounts.back().position_sigma_m);
  }
  for (const Camera& camera : block.cameras) {
    hasher.add(camera.width).add(camera.height).add(camera.focal_known);
    add_to_hash(hasher, camera.intrinsics);
    for (const double value : camera.prior_sigma) hasher.add(value);
  }
  add_vertical_values(hasher, block);
}

Links links_of(const Block& block, const std::vector<VerifiedPair>& pairs) {
  Links links;
  for (const VerifiedPair& pair : pairs) {
    const FrameIndex a = block.images[pair.a].frame, b = block.images[pair.b].frame;
    if (a == b) continue;
    links[a].insert(b);
    links[b].insert(a);
  }
  return links;
}

// Sets of frames without a pose that pairs connect and that contain a new frame, ordered by their first frame.
std::vector<Frames> sets_to_orient(const BlockState& state, const Frames& new_frames, const Links& links) {
  std::vector<Frames> sets;
  Frames seen;
  for (const FrameIndex start : new_frames) {
    if (state.oriented[start] || !links.contains(start) || !seen.insert(start).second) continue;
    Frames set;
    std::vector<FrameIndex> open{start};
    while (!open.empty()) {
      const FrameIndex frame = open.back();
      open.pop_back();
      set.insert(frame);
      for (const FrameIndex next : links.at(frame))
        if (!state.oriented[next] && seen.insert(next).second) open.push_back(next);
    }
    sets.push_back(std::move(set));
  }
  return sets;
}

// The set with the frames that are linked to it and those that are linked to these: enough to intersect the points that
// the set sees.
Frames with_surroundings(const Frames& set, const Links& links) {
  Frames all = set;
  for (int ring = 0; ring < 2; ++ring) {
    const Frames inner = all;
    for (const FrameIndex frame : inner) all.insert(links.at(frame).begin(), links.at(frame).end());
  }
  return all;
}

// Orients one set. Frames that had a pose keep it, and so do their cameras.
void orient_set(const Job& job, const Block& block, const std::vector<VerifiedPair>& pairs, const Frames& set,
                const Links& links, InitialOrientation& orientation) {
  BlockState& state = orientation.state;
  const Frames frames = with_surroundings(set, links);
  std::vector<VerifiedPair> own;
  for (const VerifiedPair& pair : pairs)
    if (frames.contains(block.images[pair.a].frame) && frames.contains(block.images[pair.b].frame)) own.push_back(pair);
  OrientationResult oriented;
  try {
    const TrackSet tracks = build_tracks(read_keypoints(job), own, job.settings.tracks);
    oriented = orient_component(block, state, {frames.begin(), frames.end()}, own, tracks, job.settings.orientation);
  } catch (const ComputeError& error) {  // the frames stay without poses; the result lists their images
    for (const FrameIndex frame : set) orientation.failed.emplace_back(frame, error.what());
    return;
  }
  for (const FrameIndex frame : set) {
    state.frames[frame] = oriented.state.frames[frame];
    state.oriented[frame] = oriented.state.oriented[frame];
  }
  for (const auto& failed : oriented.failed)
    if (set.contains(failed.first)) orientation.failed.push_back(failed);
  for (const SetAsideVertical& vertical : oriented.verticals_aside)
    if (set.contains(block.images[vertical.image].frame)) orientation.verticals_aside.push_back(vertical);
  if (frames.size() == set.size()) state.cameras = oriented.state.cameras;
}

Frames frames_from(const Block& block, std::int64_t first_image) {
  Frames frames;
  for (ImageIndex i(first_image); block.images.contains(i); ++i.value) frames.insert(block.images[i].frame);
  return frames;
}

// The state of a block that has grown: the state before, and start values for the new frames.
BlockState grow(const BlockState& state, const Block& block) {
  BlockState grown = initial_state(block);
  std::copy(state.frames.begin(), state.frames.end(), grown.frames.begin());
  std::copy(state.oriented.begin(), state.oriented.end(), grown.oriented.begin());
  std::copy(state.cameras.begin(), state.cameras.end(), grown.cameras.begin());
  // A rig may have got a receiver meanwhile, and a group may have gone.
  for (RigIndex rig(0); state.mounts.contains(rig) && grown.mounts.contains(rig); ++rig.value)
    if (state.mounts[rig].size() == grown.mounts[rig].size()) grown.mounts[rig] = state.mounts[rig];
  return grown;
}

// The pairs of the cells that belong to this generation or an earlier one; a cell belongs to the generation of its
// latest image. Cells without a verified pair do not count.
std::vector<VerifiedPair> pairs_of_generation(const Job& job, const std::vector<std::string>& matches,
                                              std::int64_t images, Hasher& hasher) {
  std::vector<VerifiedPair> pairs;
  for (const std::string& name : matches) {
    std::vector<VerifiedPair> cell = read_matches(job.store.verified_path(name));
    const auto later = [&](const VerifiedPair& pair) { return pair.b.value >= images; };
    if (cell.empty() || std::any_of(cell.begin(), cell.end(), later)) continue;
    hasher.add(job.store.seal(name)->content_hash);
    std::move(cell.begin(), cell.end(), std::back_inserter(pairs));
  }
  return pairs;
}

// Puts held poses back in their place, because the orientation only comes near them.
BlockState held_in_place(const Job& job, BlockState state) {
  BlockState placed = state;
  place_held_frames(job.block, placed);
  const ObservationOptions& use = job.settings.adjustment.observations;
  for (FrameIndex f(0); job.block.frames.contains(f); ++f.value) {
    if (use.use_attitude_priors) state.frames[f].rotation = placed.frames[f].rotation;
    if (use.use_position_priors) state.frames[f].centre = placed.frames[f].centre;
  }
  return state;
}

// Removes these verticals from the block, and adds them to `all`.
void set_aside(const std::vector<SetAsideVertical>& aside, std::vector<SeenVertical>& verticals,
               std::vector<SetAsideVertical>& all) {
  std::set<ImageIndex> images;
  for (const SetAsideVertical& vertical : aside) images.insert(vertical.image);
  std::erase_if(verticals, [&](const SeenVertical& vertical) { return images.contains(vertical.image); });
  all.insert(all.end(), aside.begin(), aside.end());
}

void tell_of_verticals(const Stage& stage, const Job& job, JobRecord& record,
                       const std::vector<SetAsideVertical>& aside, std::size_t all) {
  const std::string text = set_aside_text(job.block, aside, all);
  if (text.empty()) return;
  record.notes.push_back(text);
  say(job, stage.name, text);
}

// With all poses given nothing is oriented. Given poses may still be poor, and are then adjusted to the observations of
// their frames.
BlockState given_orientation(const Stage& stage, const Job& job, BlockState given) {
  const GivenTrajectoryChange change = adjust_trajectories(job.block, job.settings.adjustment.observations, given);
  if (change.frames > 0)
    say(job, stage.name,
        fmt::format("given poses drift away from the observations of their frames and are adjusted to them as a start: "
                    "{} frames in {}, moved by {:.3g} m rms, {:.3g} m at most",
                    change.frames, counted(change.trajectories, "drive"), change.rms_m, change.largest_m));
  return held_in_place(job, std::move(given));
}

// Frames that verified pairs connect, as sets that grow with the pairs.
void unite_frames(const Block& block, const std::vector<VerifiedPair>& pairs, DisjointSets& sets) {
  for (const VerifiedPair& pair : pairs) sets.unite(block.images[pair.a].frame.value, block.images[pair.b].frame.value);
}

bool nearly_all(const std::vector<VerifiedPair>& pairs, auto is) {
  constexpr double kNearlyAll = 0.95;
  const auto count = std::ranges::count_if(pairs, [&](const VerifiedPair& pair) { return is(pair.model); });
  return !pairs.empty() && static_cast<double>(count) >= kNearlyAll * static_cast<double>(pairs.size());
}

// Whether nearly all pairs are those of a camera that turned about its projection centre.
bool show_no_parallax(const std::vector<VerifiedPair>& pairs) {
  return nearly_all(pairs, [](PairModel model) { return model == PairModel::kRotationOnly; });
}

// A plane before a camera of unknown focal length has the same matches as one that only turned.
bool show_one_plane_of_unknown_focal(const Block& block, const std::vector<VerifiedPair>& pairs) {
  return std::ranges::none_of(block.cameras, &Camera::focal_known) && lacks_positions(block) &&
         nearly_all(pairs, [](PairModel model) { return model != PairModel::kEssential; });
}

constexpr const char* kOnlyTurned =
    "the camera only turned about its projection centre: the pairs of images show no parallax, so that nothing tells "
    "distances; 'megablock calibrate --panoramic JOB' estimates rotations and focal length; for points, move the "
    "camera between the images";
constexpr const char* kOnePlane =
    "each pair of images fits a plane, and no header tells the focal length: flat ground, and a camera that only "
    "turned or cut sections of one image, have the same matches; if it turned, the positions and points of this result "
    "mean nothing, and 'megablock calibrate --panoramic JOB' estimates its rotations; give 'focal_px' or positions";

// Moves a part of the block that has neither positions nor given poses onto the control points.
void align_part(const Stage& stage, const Job& job, JobRecord& record, const std::vector<FrameIndex>& frames,
                BlockState& state) {
  const auto aligned = align_with_control(job.block, state, frames);
  if (!aligned) return;
  move_frames(aligned->similarity, frames, state);
  say(job, stage.name,
      fmt::format("{} moved onto the control: {} of {} fit within {:.1f} px (median){}",
                  counted(std::ssize(frames), "frame"), aligned->agreeing, counted(aligned->points, "control point"),
                  aligned->median_residual_px,
                  aligned->on_a_line ? "; they lie on one line, so that the viewing directions level the block" : ""));
  if (aligned->on_a_line)
    record.notes.push_back(
        "the control points lie on one line: the tilt of the block about it follows from the viewing directions of "
        "the images alone; add a control point off the line, positions or attitudes");
}

// Gives groups of positions that contradict the others a shift of their own.
void shift_groups(const Stage& stage, const Job& job, JobRecord& record, const std::vector<FrameIndex>& frames,
                  Block& own, BlockState& state) {
  const PositionShifts found = find_position_shifts(own, state, frames);
  if (found.groups.empty()) return;
  move_frames(found.to_others, frames, state);
  for (const PositionShift& shift : found.groups) {
    add_position_group(shift.frames, shift.offset, shift.shifted, own, state);
    add_note(job, record, stage.name, shift_text(own, shift));
  }
}

// Leaves out positions whose east and north are exchanged, and returns whether they are.
bool leave_out_mirrored_positions(const Stage& stage, const Job& job, JobRecord& record,
                                  const std::vector<FrameIndex>& frames, Block& own, const BlockState& state) {
  const auto mirrored = find_mirrored_positions(own, state, frames);
  if (!mirrored) return false;
  leave_out_positions(frames, own);
  add_note(job, record, stage.name, mirrored_positions_text(*mirrored));
  return true;
}

// The same of control points. `in_place`: the part has its place from positions.
bool leave_out_mirrored_control(const Stage& stage, const Job& job, JobRecord& record,
                                const std::vector<FrameIndex>& frames, bool in_place, Block& own,
                                const BlockState& state) {
  const auto mirrored = find_mirrored_control(own, state, frames, in_place);
  if (!mirrored) return false;
  leave_out_control(own);
  add_note(job, record, stage.name, mirrored_control_text(*mirrored, in_place));
  return true;
}

struct DatumPart {
  std::vector<FrameIndex> frames;
  bool positions = false, given_poses = false;
};

// The oriented frames that hang together, by the name of their set.
std::map<std::int64_t, DatumPart> datum_parts(const Job& job, DisjointSets& sets, const BlockState& state) {
  const bool use_positions = job.settings.adjustment.observations.use_position_priors;
  std::map<std::int64_t, DatumPart> parts;
  for (FrameIndex f(0); job.block.frames.contains(f); ++f.value) {
    if (!state.oriented[f]) continue;
    DatumPart& part = parts[sets.find(f.value)];
    const Frame& frame = job.block.frames[f];
    part.frames.push_back(f);
    part.given_poses |= frame.given_pose.has_value();
    part.positions |= use_positions && frame.position_prior.has_value();
  }
  return parts;
}

// Finds what contradicts the datum of each part of the block. Lists with east and north exchanged are left out. Groups
// of positions that contradict the others get a shift. Parts without positions are moved onto the control by a
// similarity, and those whose positions contradict the control by one offset get it as a shift.
void settle_datum(const Stage& stage, const Job& job, JobRecord& record, DisjointSets& sets, Block& own,
                  BlockState& state) {
  const Block& block = job.block;
  bool any_control =
      std::ranges::any_of(block.control_points, [](const auto& p) { return p.role == PointRole::kControl; });
  for (const auto& [name, part] : datum_parts(job, sets, state)) {
    const std::vector<FrameIndex>& frames = part.frames;
    if (part.given_poses) continue;
    const bool placed = part.positions && !leave_out_mirrored_positions(stage, job, record, frames, own, state);
    if (any_control && leave_out_mirrored_control(stage, job, record, frames, placed, own, state)) any_control = false;
    if (!placed) {
      if (any_control) align_part(stage, job, record, frames, state);
      continue;
    }
    if (!job.settings.orientation.shift_positions) continue;
    shift_groups(stage, job, record, frames, own, state);
    const auto offset = any_control ? find_position_offset(block, state, frames) : std::nullopt;
    if (!offset) continue;
    shift_positions(*offset, frames, own, state);
    add_note(job, record, stage.name, offset_text(*offset));
  }
}

}  // namespace

OrientationStage run_orientation(const Stage& stage, const Job& job, JobRecord& record,
                                 const std::vector<std::string>& matches, Block& own) {
  std::vector<SeenVertical>& verticals = own.verticals;
  BlockState start = initial_state(job.block);
  const std::size_t all = verticals.size();
  std::vector<SetAsideVertical> aside;
  set_aside(against_given_poses(job.block), verticals, aside);
  if (std::all_of(start.oriented.begin(), start.oriented.end(), [](std::uint8_t o) { return o != 0; })) {
    if (job.is_first_rank()) remove_record(job.store, stage.name);  // an earlier run may have needed the stage
    tell_of_verticals(stage, job, record, aside, all);
    return {given_orientation(stage, job, std::move(start)), {}, {}};
  }
  if (matches.empty())
    throw AgreedError<InputError>(
        "images without pose cannot be oriented from given tie points alone; give poses in the project file");
  OrientationStage made;
  BlockState& state = made.state;
  std::uint64_t previous = 0;
  std::int64_t images_before = 0;
  DisjointSets connected(std::ssize(job.block.frames));
  bool one_plane = false;
  for (std::size_t g = 0; g < job.generations.size(); ++g) {
    const Block block = first_images(job.block, job.generations[g]);
    Hasher hasher;
    hasher.add(stage.algorithm).add(previous).add(images_before).add(job.settings.tracks.min_length);
    add_to_hash(hasher, job.settings.orientation);
    add_block_values(hasher, block);
    const std::vector<VerifiedPair> pairs = pairs_of_generation(job, matches, job.generations[g], hasher);
    unite_frames(block, pairs, connected);
    made.only_turned = show_no_parallax(pairs);
    one_plane = !made.only_turned && show_one_plane_of_unknown_focal(block, pairs);
    Unit unit;
    unit.name = unit_name(stage.folder(), static_cast<std::int64_t>(g));
    unit.fingerprint = hasher.value();
    unit.write = [&](const std::string& path) {
      InitialOrientation grown{grow(state, block), {}, {}};
      const Links links = links_of(block, pairs);
      for (const Frames& set : sets_to_orient(grown.state, frames_from(block, images_before), links))
        orient_set(job, block, pairs, set, links, grown);
      write_orientation(path, grown);
    };
    const StageOutcome outcome = run_stage(job, record, stage, {unit});
    if (!outcome.failures.empty())
      throw AgreedError<ComputeError>("orientation failed: " + outcome.failures.front().reason);
    const InitialOrientation done = read_orientation(job.store.verified_path(unit.name));
    state = done.state;
    for (const auto& [frame, reason] : done.failed) made.not_oriented[frame] = reason;
    set_aside(done.verticals_aside, verticals, aside);
    previous = job.store.seal(unit.name)->content_hash;
    images_before = job.generations[g];
  }
  tell_of_verticals(stage, job, record, aside, all);
  if (std::ranges::any_of(state.oriented, [](std::uint8_t o) { return o != 0; })) {
    if (made.only_turned)
      add_note(job, record, stage.name,
               std::string(kOnlyTurned) + "; positions and points of this result mean nothing");
    if (one_plane) add_note(job, record, stage.name, kOnePlane);
  }
  state = held_in_place(job, grow(state, job.block));
  settle_datum(stage, job, record, connected, own, state);
  return made;
}

// Positions that are all the same come from a receiver that had no fix, and contradict every base.
std::string why_nothing_is_oriented(const Block& block, bool only_turned) {
  if (only_turned) return std::string("no image could be oriented: ") + kOnlyTurned;
  constexpr double kSame_m = 1e-3;
  const Frame* first = nullptr;
  std::int64_t same = 0, others = 0;
  for (const Frame& frame : block.frames) {
    if (!frame.position_prior) continue;
    if (first == nullptr) first = &frame;
    const double distance = (frame.position_prior->position - first->position_prior->position).norm();
    ++(distance < kSame_m ? same : others);
  }
  if (same > 1 && others == 0)
    return fmt::format(
        "no image could be oriented: all {} positions are the same; leave them out with "
        "'gps: {{use: false}}', or give positions or approximate poses in a file ('poses')",
        same);
  return "no image could be oriented from the matches; check that images overlap and that focal lengths are right, "
         "leave out wrong GPS positions ('gps: {use: false}'), or give approximate poses ('poses')";
}

}  // namespace megablock
