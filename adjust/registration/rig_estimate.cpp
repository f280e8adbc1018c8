// The windows become a block of their own, which adjust/tile adjusts: start poses as given poses, the chain as relative
// poses, the first frame of each window with tight priors of position and attitude. A track lies in one window only; a
// track of two passes would tell of the errors of the trajectory between them, and not of the rig.
#include "adjust/registration/rig_estimate.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "adjust/terms/build_problem.h"
#include "adjust/terms/linearise.h"
#include "geometry/numbers/angles.h"
#include "geometry/numbers/median.h"
#include "io/base/error.h"

namespace megablock {

namespace {

constexpr double kFirstFramePosition = 1e-3,
                 kFirstFrameRotation = 1e-5;  // sigmas of the first frame of a window, m and rad

std::size_t at(FrameIndex f) { return static_cast<std::size_t>(f.value); }

using Links = std::map<FrameIndex, const ChainLink*>;  // by their second frame

// The first frames of windows of successive linked frames, which follow each other along the passes.
// A window ends at a missing link, and the next one begins there. Windows do not overlap.
std::vector<FrameIndex> cut_windows(const JointInput& input, const Links& links, int size) {
  std::vector<FrameIndex> windows;
  for (std::int64_t f = 0; f + size <= static_cast<std::int64_t>(input.start.size());) {
    std::int64_t next = f + 1;
    while (next < f + size) {
      const auto link = links.find(FrameIndex(next));
      if (link == links.end() || link->second->from.value != next - 1) break;
      ++next;
    }
    if (next == f + size) windows.emplace_back(f);
    f = next;
  }
  return windows;
}

// Chooses the windows that turn most, and as many spread evenly over the others; ascending.
std::vector<FrameIndex> choose_windows(const JointInput& input, const Links& links, const RigEstimateOptions& options) {
  const std::vector<FrameIndex> all = cut_windows(input, links, options.window_frames);
  const auto wanted = static_cast<std::size_t>(options.windows);
  if (all.size() <= wanted) return all;
  const auto turn = [&](FrameIndex f) {
    const double angle = rotation_angle(
        input.start[at(f)].rotation, input.start[at(f) + static_cast<std::size_t>(options.window_frames) - 1].rotation);
    // Above the bound all windows are equal, so that places where the trajectory jumps do not win.
    return std::min(angle, options.max_turn_deg * kDegree);
  };
  std::vector<FrameIndex> order = all;
  std::stable_sort(order.begin(), order.end(), [&](FrameIndex a, FrameIndex b) { return turn(a) > turn(b); });
  std::vector<FrameIndex> chosen(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(wanted / 2));
  std::vector<FrameIndex> rest(order.begin() + static_cast<std::ptrdiff_t>(wanted / 2), order.end());
  std::sort(rest.begin(), rest.end());
  const std::size_t more = wanted - chosen.size();
  // The middle ones of equal sections of the rest.
  for (std::size_t i = 0; i < more; ++i) chosen.push_back(rest[(2 * i + 1) * rest.size() / (2 * more)]);
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

// The frames of the windows, as a block of their own.
struct Part {
  Block block;
  TrackSet tracks;
  std::vector<std::int32_t> window;  // [frames of the whole block], -1: none
};

void add_frames(const Block& whole, const JointInput& input, const Links& links, const std::vector<FrameIndex>& windows,
                int size, Part& part) {
  part.window.assign(whole.frames.size(), -1);
  for (std::size_t w = 0; w < windows.size(); ++w)
    for (std::int64_t f = windows[w].value; f < windows[w].value + size; ++f) {
      const FrameIndex from(f), to = part.block.frames.next_index();
      Frame frame = whole.frames[from];
      frame.given_pose = input.start[at(from)];
      frame.position_prior.reset();
      frame.attitude_prior.reset();
      if (from == windows[w]) {
        // The first frame is tied to its start by sigmas far below those of the chain: it is held, and its window has a
        // datum.
        frame.position_prior = PositionPrior{frame.given_pose->centre, Eigen::Vector3d::Constant(kFirstFramePosition)};
        frame.attitude_prior =
            AttitudePrior{frame.given_pose->rotation, Eigen::Vector3d::Constant(kFirstFrameRotation)};
      } else {
        const ChainLink& link = *links.at(from);
        Pose pose = link.pose;
        // The tile adjustment knows relative poses in the axes of the first frame only.
        if (link.in_ground) pose.centre = input.start[at(link.from)].rotation * pose.centre;
        part.block.relative_poses.push_back(
            {FrameIndex(to.value - 1), to, pose, link.rotation_sigma_rad, link.position_sigma_m});
      }
      part.window[at(from)] = static_cast<std::int32_t>(w);
      part.block.frames.push_back(std::move(frame));
    }
}

// Adds the images of the windows. Returns the new row of each image of the whole block; -1: not in a window.
std::vector<std::int64_t> add_images(const Block& whole, Part& part) {
  std::vector<std::int64_t> frame_row(whole.frames.size(), -1);
  std::int64_t next = 0;
  for (std::size_t f = 0; f < frame_row.size(); ++f)
    if (part.window[f] >= 0) frame_row[f] = next++;
  std::vector<std::int64_t> row(whole.images.size(), -1);
  for (std::size_t i = 0; i < row.size(); ++i) {
    const ImageIndex index(static_cast<std::int64_t>(i));
    const std::int64_t frame = frame_row[at(whole.images[index].frame)];
    if (frame < 0) continue;
    row[i] = part.block.images.next_index().value;
    Image image = whole.images[index];
    image.frame = FrameIndex(frame);
    part.block.add_image(whole.image_names[index], image);
  }
  return row;
}

// Adds the observations of each track in the window that has most of them.
void add_tracks(const Block& whole, const TrackSet& tracks, const std::vector<std::int64_t>& image_row, int min_track,
                Part& part) {
  part.tracks.begin = {0};
  std::map<std::int32_t, int> count;
  for (std::int64_t t = 0; t < tracks.track_count(); ++t) {
    const auto begin = static_cast<std::size_t>(tracks.begin[static_cast<std::size_t>(t)]),
               end = static_cast<std::size_t>(tracks.begin[static_cast<std::size_t>(t) + 1]);
    const auto window_of = [&](std::size_t o) { return part.window[at(whole.images[tracks.image[o]].frame)]; };
    count.clear();
    for (std::size_t o = begin; o < end; ++o)
      if (window_of(o) >= 0) ++count[window_of(o)];
    // A track that several windows share counts in one of them. Windows are not connected, so that the errors of the
    // trajectory between them do not matter.
    const auto most =
        std::max_element(count.begin(), count.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
    if (most == count.end() || most->second < min_track) continue;
    for (std::size_t o = begin; o < end; ++o) {
      if (window_of(o) != most->first) continue;
      part.tracks.image.emplace_back(image_row[static_cast<std::size_t>(tracks.image[o].value)]);
      part.tracks.x.push_back(tracks.x[o]);
      part.tracks.y.push_back(tracks.y[o]);
      part.tracks.feature.push_back(-1);
    }
    part.tracks.id.push_back(tracks.id[static_cast<std::size_t>(t)]);
    part.tracks.begin.push_back(part.tracks.observation_count());
  }
}

// The block of the windows: cameras, rigs and ground of the whole one, frames, images and tracks of the windows alone.
// Frames are numbered window by window, so that the relative pose of a frame is to the one before it.
Part make_part(const Block& whole, const JointInput& input, const TrackSet& tracks, const RigEstimateOptions& options) {
  Links links;
  for (const ChainLink& link : input.chain) links.emplace(link.to, &link);
  Part part;
  part.block.ground = whole.ground;
  part.block.cameras = whole.cameras;
  part.block.rigs = whole.rigs;
  add_frames(whole, input, links, choose_windows(input, links, options), options.window_frames, part);
  add_tracks(whole, tracks, add_images(whole, part), options.min_track, part);
  return part;
}

// The median residual of all observations, with points intersected anew at the poses of the state.
double median_residual(TileProblem problem, TileState state, const AdjustOptions& options) {
  // All observations count, those that the adjustment rejected too: the rig that explains more of them is the better
  // one.
  for (std::size_t row = 0; row < problem.kept.size(); ++row) problem.kept[row] = problem.image[row].valid();
  triangulate_points(problem, state, options);
  std::vector<double> lengths;
  for (std::int64_t p = 0; p < problem.point_count(); ++p) {
    if (!problem.active(p)) continue;
    for (std::int64_t row = problem.begin[static_cast<std::size_t>(p)];
         row < problem.begin[static_cast<std::size_t>(p) + 1]; ++row)
      if (problem.kept[static_cast<std::size_t>(row)])
        lengths.push_back(image_difference_px(problem, state, p, row).norm());
  }
  return lengths.empty() ? std::numeric_limits<double>::infinity() : median(std::move(lengths));
}

void adjust(const Part& part, const RigEstimateOptions& options, RigEstimate& estimate) {
  BlockState state = initial_state(part.block);
  Tiles tiles;
  tiles.tile_count = 1;
  tiles.tile_of_frame.assign(part.block.frames.size(), TileIndex(0));
  tiles.component.assign(part.block.frames.size(), 0);
  ObservationOptions observations = options.adjustment.observations;
  observations.use_position_priors = observations.use_attitude_priors = true;  // those of the held frames
  TileProblem problem = make_tile_problem(part.block, state, tiles, TileIndex(0), part.tracks, observations);
  const Eigen::Vector3d unknown = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  TileState tile = make_tile_state(problem, state, std::vector<Eigen::Vector3d>(problem.points.size(), unknown));
  estimate.median_before_px = median_residual(problem, tile, options.adjustment);
  // The tile adjustment screens the tracks and estimates frames, points, cameras and mounts together.
  const AdjustSummary summary = adjust_tile(problem, tile, options.adjustment);
  estimate.median_after_px = median_residual(problem, tile, options.adjustment);
  estimate.observations = summary.observations;
  // Both medians have their points intersected in the same way, so that they differ by the rig and the frames alone.
  if (!(estimate.median_after_px < estimate.median_before_px)) {
    estimate.kept_as_given = fmt::format("residuals do not fall: median {:.2f} px before, {:.2f} px after",
                                         estimate.median_before_px, estimate.median_after_px);
    return;
  }
  store_tile_state(problem, tile, state);
  estimate.cameras = state.cameras;
  estimate.mounts = state.mounts;
}

}  // namespace

void RigEstimateOptions::check() const {
  if (window_frames < 3) throw InputError("window_frames must be at least 3");
  if (windows < 1) throw InputError("windows must be at least 1");
  if (min_track < 2) throw InputError("min_track must be at least 2");
  if (!(max_turn_deg > 0)) throw InputError("max_turn_deg must be positive");
  adjustment.check();
}

bool has_free_rig(const Block& block) {
  for (const Camera& camera : block.cameras)
    for (int p = 0; p < camera.intrinsics.size(); ++p)
      if (camera.prior_sigma[static_cast<std::size_t>(p)] != 0) return true;
  for (const Rig& rig : block.rigs)
    if (!rig.is_group() && std::ranges::any_of(rig.mounts, [](const Mount& m) { return !m.held(); })) return true;
  return false;
}

RigEstimate estimate_rig(const Block& block, const JointInput& input, const TrackSet& tracks,
                         const RigEstimateOptions& options) {
  options.check();
  const BlockState given = initial_state(block);
  RigEstimate estimate;
  // The given rig is the result wherever the estimate fails.
  estimate.cameras = given.cameras;
  estimate.mounts = given.mounts;
  const Part part = make_part(block, input, tracks, options);
  estimate.frames = static_cast<std::int64_t>(part.block.frames.size());
  if (part.tracks.track_count() == 0) {
    estimate.kept_as_given = fmt::format("no {} successive frames of a pass share tracks of {} measurements",
                                         options.window_frames, options.min_track);
    return estimate;
  }
  try {
    adjust(part, options, estimate);
  } catch (const ComputeError& error) {
    estimate.kept_as_given = error.what();
  }
  return estimate;
}

}  // namespace megablock
