// Builds the problem of a tile in three steps. The tables come first: the images of the tracks and control points that
// the tile owns, then every frame, camera and mount that any observation touches. The tables ascend by the index in the
// block, so that a row is found by bisection and the unknowns have the same order in every run. The observations then
// name rows of these tables.
//
// Every observation of the block belongs to exactly one tile, because the tiles' normal equations are added up
// (merge/). An observation that concerns one frame belongs to the tile of that frame. One of several frames belongs to
// owner_tile(). Priors of cameras and mounts, which all tiles share, belong to the tile of the first oriented image
// that uses them.
#include "adjust/terms/build_problem.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "adjust/problem/half.h"
#include "adjust/terms/line_terms.h"
#include "adjust/terms/vertical_terms.h"
#include "io/base/error.h"

namespace megablock {

namespace {

// A mount prior has a sigma for its rotation and one for its position. Where one of them is zero, that half is held by
// these sigmas, because a mount is held or free as a whole (mount_free).
constexpr double kHeldRotationRad = 1e-7;
constexpr double kHeldPositionM = 1e-6;

template <typename Value>
void make_distinct(std::vector<Value>& values) {
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
  values.shrink_to_fit();  // tables of frames, cameras and mounts begin with one entry for each image
}

// The row of `value` in an ascending table; -1 when it is not there.
template <typename Value>
std::int32_t row_of(const std::vector<Value>& table, const Value& value) {
  const auto it = std::lower_bound(table.begin(), table.end(), value);
  return it == table.end() || *it != value ? -1 : static_cast<std::int32_t>(it - table.begin());
}

MountId receiver_id(const Block& block, RigIndex rig) {
  return {rig, static_cast<std::int32_t>(block.rigs[rig].mounts.size()) - 1};
}

class TileBuilder {
 public:
  TileBuilder(const Block& block, const BlockState& state, const Tiles& tiles, TileIndex tile, const TrackSet& owned,
              const ObservationOptions& options, const RowsOfTile& rows)
      : block_(block),
        state_(state),
        tiles_(tiles),
        tile_(tile),
        owned_(owned),
        options_(options),
        rows_(rows),
        in_half_(frames_of_half(block, options.half.half)) {}

  TileProblem build() {
    problem_.image_sigma_px = options_.image_sigma_px;
    problem_.image_loss = options_.image_loss;
    problem_.position_loss = options_.position_loss;
    problem_.control_loss = options_.control_loss;
    problem_.attitude_loss = options_.attitude_loss;
    problem_.relative_loss = options_.relative_loss;
    problem_.line_loss = options_.line_loss;
    problem_.vertical_loss = options_.vertical_loss;
    lines_ = line_terms(block_, state_, tiles_, tile_);
    select_control_points();
    make_tables();
    for (std::int64_t t = 0; t < owned_.track_count(); ++t) add_track(t);
    for (std::int64_t row : control_points_) add_control_point(row);
    add_frame_priors();
    add_relative_poses();
    add_measured();
    add_lines();
    add_verticals();
    add_camera_priors();
    add_mount_priors();
    divide_priors(options_.half, problem_);
    return std::move(problem_);
  }

 private:
  bool oriented(FrameIndex frame) const { return state_.oriented[frame] != 0; }
  bool oriented(ImageIndex image) const { return oriented(block_.images[image].frame); }
  bool has_prior(const Frame& frame) const {
    return (options_.use_position_priors && frame.position_prior) ||
           (options_.use_attitude_priors && frame.attitude_prior);
  }
  MountId mount_of(ImageIndex image) const {
    return {block_.frames[block_.images[image].frame].rig, block_.images[image].mount};
  }
  // The receiver of the rig of a frame with a prior in this tile; mount -1: none.
  MountId receiver_of(FrameIndex frame) const {
    const RigIndex rig = block_.frames[frame].rig;
    const bool any =
        block_.rigs[rig].has_receiver() && has_prior(block_.frames[frame]) && tiles_.tile_of_frame[frame] == tile_;
    return any ? receiver_id(block_, rig) : MountId{rig, -1};
  }
  // The group of the position of a frame in this tile; mount -1: none.
  MountId group_of(FrameIndex frame) const {
    const auto& prior = block_.frames[frame].position_prior;
    const bool any =
        options_.use_position_priors && prior && prior->group.valid() && tiles_.tile_of_frame[frame] == tile_;
    return any ? receiver_id(block_, prior->group) : MountId{{}, -1};
  }
  const FrameMeasurement& measured(const std::string& key, std::size_t row) const {
    return block_.frame_measurements.at(key)[row];
  }
  const Mount& mount(const MountId& id) const { return block_.rigs[id.rig].mounts[static_cast<std::size_t>(id.mount)]; }

  // A control point belongs to the tile that would own a track of the same images.
  void select_control_points() {
    std::vector<ImageIndex> measured;
    for (std::size_t row = 0; row < block_.control_points.size(); ++row) {
      measured.clear();
      for (const ImageMeasurement& m : block_.control_points[row].measurements) measured.push_back(m.image);
      if (owner_tile(block_, tiles_, measured.data(), measured.data() + measured.size()) == tile_)
        control_points_.push_back(static_cast<std::int64_t>(row));
    }
  }

  void make_tables() {
    std::vector<ImageIndex> images(owned_.image);
    for (const std::size_t row : rows_.verticals) images.push_back(block_.verticals[row].image);
    for (std::int64_t row : control_points_)
      for (const ImageMeasurement& m : block_.control_points[static_cast<std::size_t>(row)].measurements)
        images.push_back(m.image);
    make_distinct(images);
    // Images without a pose have no row. Their observations get the row -1 and are never kept.
    std::erase_if(images, [&](ImageIndex image) { return !oriented(image); });

    std::vector<FrameIndex>& frames = problem_.frames;
    problem_.cameras = rows_.cameras;
    problem_.mounts = rows_.mounts;
    for (ImageIndex image : images) {
      frames.push_back(block_.images[image].frame);
      problem_.mounts.push_back(mount_of(image));
      problem_.cameras.push_back(block_.camera_of(image));
    }
    // A frame without observations of the tile's tracks still has a row where a prior or another frame refers to it.
    // Its observations count once, here.
    for (const FrameIndex frame : rows_.frames)
      if (has_prior(block_.frames[frame])) frames.push_back(frame);
    for (std::size_t row : rows_.relative_poses) {
      frames.push_back(block_.relative_poses[row].from);
      frames.push_back(block_.relative_poses[row].to);
    }
    for (const auto& [key, rows] : rows_.measured) {
      for (const std::size_t row : rows) {
        frames.push_back(measured(key, row).from);
        frames.push_back(measured(key, row).to);
      }
    }
    for (const BlockLineTerm& line : lines_) {
      frames.push_back(line.frame);
      if (line.other.valid()) frames.push_back(line.other);
    }
    make_distinct(frames);
    for (const FrameIndex frame : frames)
      for (const MountId id : {receiver_of(frame), group_of(frame)})
        if (id.mount >= 0) problem_.mounts.push_back(id);
    make_distinct(problem_.cameras);
    make_distinct(problem_.mounts);

    problem_.images.reserve(images.size());
    for (ImageIndex image : images) {
      problem_.images.push_back({image, LocalFrame(row_of(frames, block_.images[image].frame)),
                                 LocalCamera(row_of(problem_.cameras, block_.camera_of(image))),
                                 row_of(problem_.mounts, mount_of(image))});
    }
    image_table_ = std::move(images);
    for (CameraIndex camera : problem_.cameras) problem_.camera_free.push_back(free_mask(block_.cameras[camera]));
    for (const MountId& id : problem_.mounts) {
      problem_.mount_free.push_back(mount(id).held() ? 0 : 1);
      // The merge takes the place of a frame at the held first mount of its rig, and the scale of a mount about it
      // (merge/datum/gauge.cpp).
      problem_.reference_of_mount.push_back(state_.mounts[id.rig].front().centre);
    }
    for (FrameIndex frame : frames)
      problem_.reference_of_frame.push_back(state_.mounts[block_.frames[frame].rig].front().centre);
    problem_.begin.push_back(0);
  }

  static ParameterMask free_mask(const Camera& camera) {
    ParameterMask mask = 0;
    // A sigma of zero holds a parameter; a finite one is a prior; an infinite one leaves it free.
    for (int k = 0; k < camera.intrinsics.size(); ++k)
      if (camera.prior_sigma[static_cast<std::size_t>(k)] != 0) mask |= mask_of(k);
    return mask;
  }

  // `kept` begins with 1 where the image has a row, that is, a pose. An observation of the other half of a split test
  // has none.
  void add_observation(ImageIndex image, double x, double y, double sigma, bool taken = true) {
    taken = taken && (in_half_.empty() || in_half_[static_cast<std::size_t>(block_.images[image].frame.value)]);
    const std::int32_t row = taken ? row_of(image_table_, image) : -1;
    problem_.image.push_back(LocalImage(row));
    problem_.x.push_back(x);
    problem_.y.push_back(y);
    problem_.inverse_sigma.push_back(1 / sigma);
    problem_.kept.push_back(row >= 0);
  }

  // Whether a track is in the half of a split test. Parts of a track that was split (track_parts.h) have its index and
  // follow each other. They are in one half, that of the middle one of all their images.
  bool takes(std::int64_t t) {
    if (options_.half.half == Half::kNone || (t > 0 && owned_.id[t] == owned_.id[t - 1])) return taken_;
    std::vector<ImageIndex> images;
    for (std::int64_t part = t; part < owned_.track_count() && owned_.id[part] == owned_.id[t]; ++part)
      for (std::int64_t row = owned_.begin[part]; row < owned_.begin[part + 1]; ++row)
        images.push_back(owned_.image[row]);
    const auto middle = images.begin() + std::ssize(images) / 2;
    std::nth_element(images.begin(), middle, images.end());
    taken_ = takes_track(options_.half, *middle);
    return taken_;
  }

  void add_track(std::int64_t t) {
    problem_.points.push_back({PointRole::kTie, owned_.id[t].value});
    const bool taken = takes(t);
    for (std::int64_t row = owned_.begin[t]; row < owned_.begin[t + 1]; ++row)
      add_observation(owned_.image[row], from_fixed_pixel(owned_.x[row]), from_fixed_pixel(owned_.y[row]),
                      options_.image_sigma_px, taken);
    problem_.begin.push_back(problem_.observation_count());
  }

  void add_control_point(std::int64_t row) {
    const ControlPoint& control = block_.control_points[static_cast<std::size_t>(row)];
    const LocalPoint point(static_cast<std::int32_t>(problem_.points.size()));
    problem_.points.push_back({control.role, row});
    for (const ImageMeasurement& m : control.measurements)
      add_observation(m.image, m.pixel.x(), m.pixel.y(), m.sigma_px);
    problem_.begin.push_back(problem_.observation_count());
    // A check point is intersected like a tie point. Its known position is compared in the end, and must not act
    // before.
    if (control.role != PointRole::kControl) return;
    TileProblem::PointTerm term{point, control.position, control.sigma};
    for (int axis = 0; axis < 3; ++axis) {
      // A position of 0 with an infinite sigma gives the residual 0, where NaN would spoil the sums.
      if (!std::isnan(control.position[axis])) continue;  // unknown height
      term.position[axis] = 0;
      term.sigma[axis] = std::numeric_limits<double>::infinity();
    }
    problem_.point_priors.push_back(term);
  }

  // Frames of other tiles have rows here too, but their priors belong to their own tile.
  void add_frame_priors() {
    for (std::size_t f = 0; f < problem_.frames.size(); ++f) {
      if (tiles_.tile_of_frame[problem_.frames[f]] != tile_) continue;
      const Frame& frame = block_.frames[problem_.frames[f]];
      const LocalFrame local(static_cast<std::int32_t>(f));
      const auto mount_row = [&](const MountId& id) { return id.mount < 0 ? -1 : row_of(problem_.mounts, id); };
      const std::int32_t receiver = mount_row(receiver_of(problem_.frames[f]));
      if (options_.use_position_priors && frame.position_prior)
        problem_.positions.push_back({local, *frame.position_prior, receiver, mount_row(group_of(problem_.frames[f]))});
      if (options_.use_attitude_priors && frame.attitude_prior)
        problem_.attitudes.push_back({local, *frame.attitude_prior, receiver});
    }
  }

  void add_relative_poses() {
    for (std::size_t row : rows_.relative_poses) {
      const RelativePose& relative = block_.relative_poses[row];
      problem_.relatives.push_back({LocalFrame(row_of(problem_.frames, relative.from)),
                                    LocalFrame(row_of(problem_.frames, relative.to)), relative.pose,
                                    relative.rotation_sigma_rad, relative.position_sigma_m});
    }
  }

  void add_measured() {
    for (const auto& [key, rows] : rows_.measured) {
      for (const std::size_t row : rows) {
        const FrameMeasurement& m = measured(key, row);
        problem_.measured[key].push_back(
            {LocalFrame(row_of(problem_.frames, m.from)), LocalFrame(row_of(problem_.frames, m.to)), m.value, m.sigma});
      }
    }
  }

  void add_lines() {
    for (const BlockLineTerm& line : lines_) {
      problem_.lines.push_back(line.term);
      problem_.lines.back().frame = LocalFrame(row_of(problem_.frames, line.frame));
      if (line.other.valid()) problem_.lines.back().other = LocalFrame(row_of(problem_.frames, line.other));
    }
  }

  void add_verticals() {
    if (rows_.verticals.empty()) return;
    const GroundVertical ground(block_.ground);
    for (const std::size_t row : rows_.verticals) {
      const SeenVertical& vertical = block_.verticals[row];
      const Pose& frame = state_.frames[block_.images[vertical.image].frame];
      // The direction of down is that at the frame's start position; it changes by an arc second over thirty metres.
      problem_.verticals.push_back(vertical_term(vertical, ground, frame.centre));
      problem_.verticals.back().image = LocalImage(row_of(image_table_, vertical.image));
    }
  }

  void add_camera_priors() {
    for (CameraIndex index : rows_.cameras) {
      const Camera& camera = block_.cameras[index];
      const bool any = std::any_of(camera.prior_sigma.begin(), camera.prior_sigma.end(),
                                   [](double sigma) { return sigma > 0 && std::isfinite(sigma); });
      if (any)
        problem_.intrinsic_priors.push_back(
            {LocalCamera(row_of(problem_.cameras, index)), camera.intrinsics, camera.prior_sigma});
    }
  }

  void add_mount_priors() {
    for (const MountId& id : rows_.mounts) {
      const Mount& m = mount(id);
      // A held mount is no unknown, and a free one has no prior.
      if (m.held() || (std::isinf(m.rotation_sigma_rad) && std::isinf(m.position_sigma_m))) continue;
      problem_.mount_priors.push_back({row_of(problem_.mounts, id), m.pose,
                                       m.rotation_sigma_rad > 0 ? m.rotation_sigma_rad : kHeldRotationRad,
                                       m.position_sigma_m > 0 ? m.position_sigma_m : kHeldPositionM});
    }
  }

  const Block& block_;
  const BlockState& state_;
  const Tiles& tiles_;
  const TileIndex tile_;
  const TrackSet& owned_;
  const ObservationOptions& options_;
  const RowsOfTile& rows_;
  const std::vector<std::uint8_t> in_half_;  // [frames] of a half of the images, or empty
  bool taken_ = true;                        // whether the present track is in the half
  TileProblem problem_;
  std::vector<std::int64_t> control_points_;
  std::vector<BlockLineTerm> lines_;
  std::vector<ImageIndex> image_table_;
};

void check_sizes(const Block& block, const BlockState& state, const Tiles& tiles) {
  if (state.oriented.size() != block.frames.size() || tiles.tile_of_frame.size() != block.frames.size())
    throw ComputeError("the block's state or tiles have another number of frames than the block");
}

}  // namespace

TileProblem make_tile_problem(const Block& block, const BlockState& state, const Tiles& tiles, TileIndex tile,
                              const TrackSet& owned, const ObservationOptions& options, const RowsOfTile& rows) {
  check_sizes(block, state, tiles);
  options.check();
  return TileBuilder(block, state, tiles, tile, owned, options, rows).build();
}

TileProblem make_tile_problem(const Block& block, const BlockState& state, const Tiles& tiles, TileIndex tile,
                              const TrackSet& owned, const ObservationOptions& options) {
  const RowsOfTiles rows = rows_of_tiles(block, state, tiles);
  return make_tile_problem(block, state, tiles, tile, owned, options, rows.at(static_cast<std::size_t>(tile.value)));
}

namespace {

// The priors of a camera and of its mount belong to the tile of the first oriented image that uses it, those of a
// receiver to the tile of the first oriented frame with a position or an attitude.
void find_first_users(const Block& block, const BlockState& state, const Tiles& tiles, RowsOfTiles& rows) {
  IndexedVector<CameraIndex, std::uint8_t> camera_seen(block.cameras.size(), 0);
  std::vector<std::vector<std::uint8_t>> mount_seen;
  // The search ends as soon as every camera and mount has its tile. In a large block of few cameras that is soon.
  std::size_t open = block.cameras.size();
  for (const Rig& rig : block.rigs) {
    mount_seen.emplace_back(rig.cameras().size(), 0);
    open += rig.cameras().size();
  }
  for (ImageIndex image(0); block.images.contains(image) && open > 0; ++image.value) {
    const FrameIndex frame = block.images[image].frame;
    const TileIndex home = tiles.tile_of_frame[frame];
    if (!state.oriented[frame] || !home.valid()) continue;
    const MountId id{block.frames[frame].rig, block.images[image].mount};
    auto& mount_flag = mount_seen[static_cast<std::size_t>(id.rig.value)][static_cast<std::size_t>(id.mount)];
    if (mount_flag) continue;  // its camera has been seen as well then
    mount_flag = 1;
    --open;
    RowsOfTile& tile = rows[static_cast<std::size_t>(home.value)];
    tile.mounts.push_back(id);
    const CameraIndex camera = block.camera_of(image);
    if (camera_seen[camera]) continue;
    camera_seen[camera] = 1;
    --open;
    tile.cameras.push_back(camera);
  }
  for (RowsOfTile& tile : rows) {
    make_distinct(tile.cameras);
    make_distinct(tile.mounts);
  }
}

}  // namespace

// One pass over each table of the block, for all tiles at once. Tiles would otherwise each read the whole block.
RowsOfTiles rows_of_tiles(const Block& block, const BlockState& state, const Tiles& tiles) {
  check_sizes(block, state, tiles);
  RowsOfTiles rows(static_cast<std::size_t>(tiles.tile_count));
  IndexedVector<RigIndex, std::uint8_t> receiver_seen(block.rigs.size(), 0);
  for (FrameIndex frame(0); block.frames.contains(frame); ++frame.value) {
    const TileIndex tile = tiles.tile_of_frame[frame];
    const bool prior = block.frames[frame].position_prior || block.frames[frame].attitude_prior;
    if (!tile.valid() || !state.oriented[frame] || !prior) continue;
    rows[static_cast<std::size_t>(tile.value)].frames.push_back(frame);
    const auto see_receiver = [&](RigIndex rig) {
      if (!rig.valid() || !block.rigs[rig].has_receiver() || receiver_seen[rig]) return;
      receiver_seen[rig] = 1;
      rows[static_cast<std::size_t>(tile.value)].mounts.push_back(receiver_id(block, rig));
    };
    see_receiver(block.frames[frame].rig);
    if (block.frames[frame].position_prior) see_receiver(block.frames[frame].position_prior->group);
  }
  for (std::size_t row = 0; row < block.relative_poses.size(); ++row) {
    const RelativePose& relative = block.relative_poses[row];
    if (!state.oriented[relative.from] || !state.oriented[relative.to]) continue;
    const TileIndex tile = owner_tile(tiles, relative.from, relative.to);
    if (tile.valid()) rows[static_cast<std::size_t>(tile.value)].relative_poses.push_back(row);
  }
  for (const auto& [key, measurements] : block.frame_measurements) {
    for (std::size_t row = 0; row < measurements.size(); ++row) {
      const FrameMeasurement& m = measurements[row];
      // A number between two parts of the block that have no common datum says nothing about either.
      if (!state.oriented[m.from] || !state.oriented[m.to] || tiles.component[m.from] != tiles.component[m.to])
        continue;
      const TileIndex tile = owner_tile(tiles, m.from, m.to);
      if (tile.valid()) rows[static_cast<std::size_t>(tile.value)].measured[key].push_back(row);
    }
  }
  for (std::size_t row = 0; row < block.verticals.size(); ++row) {
    const FrameIndex frame = block.images[block.verticals[row].image].frame;
    const TileIndex tile = tiles.tile_of_frame[frame];
    if (tile.valid() && state.oriented[frame]) rows[static_cast<std::size_t>(tile.value)].verticals.push_back(row);
  }
  find_first_users(block, state, tiles, rows);
  return rows;
}

}  // namespace megablock
