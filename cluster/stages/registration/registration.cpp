#include "cluster/stages/registration/registration.h"

#include <fmt/core.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <memory>
#include <set>

#include "adjust/registration/frame_resection.h"
#include "cluster/job/work_queue.h"
#include "cluster/mpi/collective.h"
#include "cluster/stages/common/block_hash.h"
#include "cluster/stages/common/units.h"
#include "cluster/stages/registration/frame_tracks.h"
#include "cluster/stages/registration/registration_output.h"
#include "io/base/error.h"
#include "io/base/hash.h"
#include "io/store/units/adjustment_file.h"
#include "io/store/units/registration_file.h"

namespace megablock {

namespace {

constexpr int kAlgorithm = 5;  // algorithm number of the registration's stages, part of their fingerprints
constexpr const char* kRig = "register/rig.h5";
constexpr const char* kPlaces = "register/places.h5";
constexpr const char* kTrajectory = "register/trajectory.h5";

void add(Hasher& h, const PlaceOptions& o) {
  h.add(o.alpha_m).add(o.z_stretch).add(o.registration_spacing).add(o.revisit_frames).add(o.hops).add(o.max_distance_m);
}

void add(Hasher& h, const PairRegistrationOptions& o) {
  h.add(o.iterations).add(o.first_threshold_px).add(o.last_threshold_px).add(o.robust_start).add(o.robust_threshold_px);
  h.add(o.samples).add(o.image_sigma_px).add(o.pair_position_sigma_m).add(o.pair_rotation_sigma_deg).add(o.min_frames);
  h.add(o.min_tracks).add(o.min_measurements).add(o.min_kept_share).add(o.max_position_sigma_m);
  h.add(o.max_rotation_sigma_deg).add(o.max_shift_m).add(o.max_turn_deg);
}

// Adds the options from which the chain is made. The other options only select control points.
void add_chain(Hasher& h, const TrajectoryOptions& o) {
  h.add(o.chain_position_sigma_m).add(o.chain_rotation_sigma_deg).add(o.difference_position_sigma_m);
  h.add(o.difference_rotation_sigma_deg).add(o.max_gap_m).add(o.max_gap_s);
}

void add(Hasher& h, const TrajectoryOptions& o) {
  add_chain(h, o);
  h.add(o.check_points).add(o.use_control).add(o.check_prefix);
}

void add(Hasher& h, const RigEstimateOptions& o) {
  h.add(o.window_frames).add(o.windows).add(o.min_track).add(o.max_turn_deg);
  add_to_hash(h, o.adjustment);
}

void add(Hasher& h, const JointOptions& o) {
  h.add(o.registration_scale).add(o.first_registration_scale).add(o.robust_registrations).add(o.use_positions);
  h.add(o.first_position_sigma_m).add(o.position_sigma_m).add(o.position_scale).add(o.position_neighbours);
  h.add(o.use_attitudes).add(o.attitude_sigma_deg).add(o.first_image_scale).add(o.image_scale);
  h.add(o.rounds).add(o.iterations).add(o.last_iterations);
}

// The tracks of the block; only ranks that compute a unit read them.
class LazyTracks {
 public:
  LazyTracks(const Block& block, const TrackSource& source) : block_(block), source_(source) {}
  const FrameTracks& operator()() {
    if (!tracks_) tracks_ = std::make_unique<FrameTracks>(block_, source_.read());
    return *tracks_;
  }
  std::uint64_t fingerprint() const { return source_.fingerprint; }

 private:
  const Block& block_;
  const TrackSource& source_;
  std::unique_ptr<FrameTracks> tracks_;
};

// Reads the trajectory. Its errors are found on every rank.
Trajectory agreed_trajectory(const Job& job, const TrajectoryOptions& options) {
  try {
    return trajectory_of(job.block, options);
  } catch (const InputError& error) {
    throw AgreedError<InputError>(job.options.project + ": " + error.what());
  }
}

TileAdjustment rig_file_of(const RigEstimate& estimate) {
  TileAdjustment file;
  for (std::size_t c = 0; c < estimate.cameras.size(); ++c) {
    file.cameras.emplace_back(static_cast<std::int64_t>(c));
    file.intrinsics.push_back(estimate.cameras[file.cameras.back()]);
  }
  for (std::size_t r = 0; r < estimate.mounts.size(); ++r) {
    const RigIndex rig(static_cast<std::int64_t>(r));
    for (std::size_t m = 0; m < estimate.mounts[rig].size(); ++m) {
      file.mount_rigs.push_back(rig);
      file.mount_numbers.push_back(static_cast<std::int32_t>(m));
      file.mounts.push_back(estimate.mounts[rig][m]);
    }
  }
  file.camera_observations.assign(file.cameras.size(), 0);
  file.mount_observations.assign(file.mounts.size(), 0);
  file.summary = estimate.kept_as_given.empty()
                     ? fmt::format(
                           "estimated from {} observations in {} frames, median residual {:.2f} px before, {:.2f} "
                           "px after",
                           estimate.observations, estimate.frames, estimate.median_before_px, estimate.median_after_px)
                     : "as given: " + estimate.kept_as_given;
  return file;
}

// Estimates cameras and mounts. The block's cameras and mounts start from the estimated ones afterwards. Returns the
// outcome in words.
std::string run_rig(const Job& job, JobRecord& record, LazyTracks& tracks, const RegistrationSettings& settings,
                    Block& block) {
  if (!settings.estimate_rig || !has_free_rig(job.block)) return "as given";
  const Trajectory trajectory = agreed_trajectory(job, settings.trajectory);
  Hasher hasher;
  hasher.add(kAlgorithm).add(tracks.fingerprint()).add(job.store.seal("block.h5")->content_hash);
  add_chain(hasher, settings.trajectory);
  RigEstimateOptions options = settings.rig;
  options.adjustment = job.settings.adjustment;
  add(hasher, options);
  Unit unit;
  unit.name = kRig;
  unit.fingerprint = hasher.value();
  unit.write = [&](const std::string& path) {
    write_adjustment(path, rig_file_of(estimate_rig(job.block, trajectory.input, tracks().tracks(), options)));
  };
  run_stage(job, record, {.name = "rig"}, {unit});
  if (!job.store.seal(kRig)) return "as given: " + record.failures.back().reason;
  const TileAdjustment file = read_adjustment(job.store.verified_path(kRig));
  for (std::size_t c = 0; c < file.cameras.size(); ++c) block.cameras[file.cameras[c]].intrinsics = file.intrinsics[c];
  for (std::size_t m = 0; m < file.mounts.size(); ++m)
    block.rigs[file.mount_rigs[m]].mounts[static_cast<std::size_t>(file.mount_numbers[m])].pose = file.mounts[m];
  return file.summary;
}

// The fingerprint of the block and its rig.
std::uint64_t block_fingerprint(const Job& job) {
  Hasher hasher;
  hasher.add(job.store.seal("block.h5")->content_hash);
  for (const Camera& camera : job.block.cameras) add_to_hash(hasher, camera.intrinsics);
  for (const Rig& rig : job.block.rigs)
    for (const Mount& mount : rig.mounts) add_to_hash(hasher, mount.pose);
  return hasher.value();
}

std::vector<Eigen::Vector3d> positions_of(const JointInput& input) {
  std::vector<Eigen::Vector3d> positions;
  for (const Pose& pose : input.start) positions.push_back(pose.centre);
  return positions;
}

// The poses of the four frames of a place. The relative poses within each pair are those of the chain, where it has
// them.
std::array<Pose, 4> poses_of(const Place& place, const JointInput& input,
                             const std::map<std::pair<FrameIndex, FrameIndex>, const ChainLink*>& chain) {
  const auto start = [&](FrameIndex f) { return input.start[static_cast<std::size_t>(f.value)]; };
  const auto next = [&](FrameIndex from, FrameIndex to) {
    const auto link = chain.find({std::min(from, to), std::max(from, to)});
    if (link == chain.end() || link->second->in_ground) return start(to);
    const Pose relative = from < to ? link->second->pose : relative_to(link->second->pose, Pose{});
    const Pose& base = start(from);
    return Pose{(relative.rotation * base.rotation).normalized(),
                base.centre + base.rotation.conjugate() * relative.centre};
  };
  return {start(place.a), next(place.a, place.b), start(place.c), next(place.c, place.d)};
}

std::vector<Place> run_places(const Job& job, JobRecord& record, const Trajectory& trajectory,
                              const RegistrationSettings& settings) {
  Hasher hasher;
  hasher.add(kAlgorithm);
  add(hasher, settings.places);
  const std::vector<Eigen::Vector3d> positions = positions_of(trajectory.input);
  for (const Eigen::Vector3d& p : positions) hasher.add(p.x()).add(p.y()).add(p.z());
  hasher.add(trajectory.input.pass);
  Unit unit;
  unit.name = kPlaces;
  unit.fingerprint = hasher.value();
  unit.write = [&](const std::string& path) {
    write_places(path, choose_places(positions, trajectory.input.pass, panorama_graph(positions, settings.places),
                                     settings.places));
  };
  run_stage(job, record, {.name = "places"}, {unit});
  return read_places(job.store.verified_path(kPlaces));
}

std::vector<RegisteredPlace> register_places(const Job& job, const FrameTracks& tracks, const JointInput& input,
                                             const std::vector<Place>& places, const PairRegistrationOptions& options) {
  std::map<std::pair<FrameIndex, FrameIndex>, const ChainLink*> chain;
  for (const ChainLink& link : input.chain) chain[{link.from, link.to}] = &link;
  std::vector<RegisteredPlace> rows(places.size());
#pragma omp parallel for schedule(dynamic, 1) num_threads(job.options.threads)
  for (std::size_t i = 0; i < places.size(); ++i) {
    const Place place = tracks.richest(places[i], options.min_frames);
    const auto seed = static_cast<std::uint64_t>(place.a.value) << 32 ^ static_cast<std::uint64_t>(place.c.value);
    rows[i] = {place,
               register_pair(poses_of(place, input, chain), tracks.common(place, options.min_frames), options, seed)};
  }
  return rows;
}

struct Registrations {
  std::vector<RegisteredPlace> rows;
  std::uint64_t hash = 0;  // hash of the units' contents
};

Registrations run_registrations(const Job& job, JobRecord& record, LazyTracks& tracks, const Trajectory& trajectory,
                                const std::vector<Place>& places, const RegistrationSettings& settings) {
  const auto size = static_cast<std::size_t>(settings.units_places);
  std::vector<Unit> units;
  for (std::size_t begin = 0; begin < places.size(); begin += size) {
    const std::vector<Place> part(places.begin() + static_cast<std::ptrdiff_t>(begin),
                                  places.begin() + static_cast<std::ptrdiff_t>(std::min(places.size(), begin + size)));
    Hasher hasher;
    hasher.add(kAlgorithm).add(tracks.fingerprint()).add(block_fingerprint(job));
    hasher.add(job.store.seal(kPlaces)->content_hash).add(begin).add(part.size());
    add(hasher, settings.pairs);
    add_chain(hasher, settings.trajectory);
    Unit unit;
    unit.name = unit_name("register/pairs", static_cast<std::int64_t>(units.size()));
    unit.fingerprint = hasher.value();
    unit.cost = static_cast<double>(part.size());
    unit.write = [&, part](const std::string& path) {
      write_registrations(path, register_places(job, tracks(), trajectory.input, part, settings.pairs));
    };
    units.push_back(std::move(unit));
  }
  run_stage(job, record, {.name = "registrations"}, units);
  Registrations all;
  Hasher hasher;
  for (const Unit& unit : units) {
    const auto seal = job.store.seal(unit.name);
    if (!seal) continue;  // the unit failed, which is recorded
    hasher.add(seal->content_hash);
    const std::vector<RegisteredPlace> part = read_registrations(job.store.verified_path(unit.name));
    all.rows.insert(all.rows.end(), part.begin(), part.end());
  }
  all.hash = hasher.value();
  return all;
}

RegisteredTrajectory adjust_trajectory(const Job& job, Trajectory trajectory, const std::vector<RegisteredPlace>& rows,
                                       const RegistrationSettings& settings) {
  JointInput& input = trajectory.input;
  // Neighbouring places may have been moved to the same frames; their registrations count once.
  std::map<std::pair<FrameIndex, FrameIndex>, std::size_t> link_of;
  for (std::size_t i = 0; settings.use_registrations && i < rows.size(); ++i) {
    const auto& [place, registration] = rows[i];
    if (!registration.accepted || !link_of.try_emplace({place.a, place.c}, input.registrations.size()).second) continue;
    input.registrations.push_back({place.a, place.c, registration.relative, registration.covariance});
  }
  RegisteredTrajectory registered;
  if (settings.use_resections) {
    for (const FrameResection& r : resect_frames(job.block, input.start, settings.trajectory, {})) {
      if (r.refused.empty())
        input.resections.push_back({r.frame, r.resection.pose, r.resection.covariance});
      else
        registered.not_resected.push_back(r.refused);
    }
  }
  const JointResult result = adjust_jointly(input, settings.joint);
  registered.frames = result.frames;
  registered.position_weight = result.position_weight;
  registered.weight.assign(rows.size(), 0);
  registered.residual.assign(rows.size(), 0);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto link = link_of.find({rows[i].place.a, rows[i].place.c});
    if (!rows[i].registration.accepted || link == link_of.end()) continue;
    registered.weight[i] = result.registration_weight[link->second];
    registered.residual[i] = result.registration_residual[link->second];
  }
  registered.control_points = trajectory.point_row;
  registered.points = result.points;
  registered.resections = static_cast<std::int64_t>(input.resections.size());
  return registered;
}

RegisteredTrajectory run_trajectory(const Job& job, JobRecord& record, const Trajectory& trajectory,
                                    const Registrations& registrations, const RegistrationSettings& settings) {
  Hasher hasher;
  hasher.add(kAlgorithm).add(block_fingerprint(job));
  hasher.add(settings.use_registrations).add(settings.use_resections);
  add(hasher, settings.trajectory);
  add(hasher, settings.joint);
  hasher.add(registrations.hash);
  Unit unit;
  unit.name = kTrajectory;
  unit.fingerprint = hasher.value();
  unit.write = [&](const std::string& path) {
    write_trajectory(path, adjust_trajectory(job, trajectory, registrations.rows, settings));
  };
  run_stage(job, record, {.name = "trajectory"}, {unit});
  if (!job.store.seal(kTrajectory))
    throw AgreedError<ComputeError>("the trajectory could not be adjusted: " + record.failures.back().reason);
  return read_trajectory(job.store.verified_path(kTrajectory));
}

// Counts reasons that differ in their numbers alone together. The first one stands for all.
class ReasonCounts {
 public:
  void add(const std::string& reason) {
    std::string kind = reason;
    std::erase_if(kind, [](unsigned char c) { return std::isdigit(c) || c == '.'; });
    const auto [place, is_new] = counts_.try_emplace(kind, reason, 0);
    ++place->second.second;
  }
  RegistrationSummary::Reasons take() const {
    RegistrationSummary::Reasons all;
    for (const auto& [kind, count] : counts_) all.push_back(count);
    return all;
  }

 private:
  std::map<std::string, std::pair<std::string, std::int64_t>> counts_;
};

// Notes a datum that nothing fixes: the trajectory then stays about where it was.
void note_free_position(const JointInput& input, const RegisteredTrajectory& registered,
                        const RegistrationSettings& settings, std::vector<std::string>& notes) {
  const bool control =
      std::any_of(input.points.begin(), input.points.end(), [](const PathPoint& p) { return p.known; });
  const bool positions =
      settings.joint.use_positions && std::find(input.located.begin(), input.located.end(), 1) != input.located.end();
  if (!control && !positions && registered.resections == 0)
    notes.push_back(
        "neither positions nor control points take part: the place of the whole block is that of the trajectory; give "
        "either");
}

RegistrationSummary summarise(const Job& job, const JobRecord& record, const Trajectory& trajectory,
                              const std::vector<RegisteredPlace>& rows, const RegisteredTrajectory& registered,
                              const RegistrationSettings& settings) {
  RegistrationSummary s;
  s.frames = std::ssize(registered.frames);
  s.chain = std::ssize(trajectory.input.chain);
  s.places = std::ssize(rows);
  s.resections = registered.resections;
  s.points = std::ssize(registered.points);
  ReasonCounts refusals, not_resected;
  for (const std::string& reason : registered.not_resected) not_resected.add(reason);
  s.not_resected = not_resected.take();
  std::set<std::pair<FrameIndex, FrameIndex>> different;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    s.accepted += rows[i].registration.accepted;
    if (rows[i].registration.accepted) different.emplace(rows[i].place.a, rows[i].place.c);
    s.used += registered.weight[i] >= kHolds;
    if (!rows[i].registration.accepted) refusals.add(rows[i].registration.reason);
  }
  s.different = std::ssize(different);
  s.refusals = refusals.take();
  std::vector<double> moves;
  for (std::size_t f = 0; f < registered.frames.size(); ++f)
    moves.push_back((registered.frames[f].centre - trajectory.input.start[f].centre).norm());
  std::sort(moves.begin(), moves.end());
  if (!moves.empty()) s.median_move_m = moves[moves.size() / 2], s.largest_move_m = moves.back();
  double squares = 0;
  for (std::size_t i = 0; i < registered.points.size(); ++i) {
    if (trajectory.input.points[i].known) continue;
    const ControlPoint& control = job.block.control_points[static_cast<std::size_t>(registered.control_points[i])];
    const Eigen::Vector3d off = registered.points[i] - control.position;
    squares += off.squaredNorm();
    s.check_points.push_back(fmt::format("{} {:.4f} {:.4f} {:.4f} m", control.name, off.x(), off.y(), off.z()));
  }
  if (!s.check_points.empty()) s.check_rms_m = std::sqrt(squares / static_cast<double>(s.check_points.size()));
  s.notes = record.notes;
  s.notes.insert(s.notes.end(), trajectory.notes.begin(), trajectory.notes.end());
  note_free_position(trajectory.input, registered, settings, s.notes);
  s.digest = job.store.seal(kTrajectory)->content_hash;
  return s;
}

}  // namespace

void RegistrationSettings::check() const {
  places.check();
  pairs.check();
  rig.check();
  trajectory.check();
  joint.check();
  if (units_places < 1) throw InputError("units_places must be at least 1");
}

RegistrationSummary run_registration(const Job& job, JobRecord& record, Block& block, const TrackSource& source,
                                     const RegistrationSettings& settings) {
  if (std::ranges::any_of(job.block.rigs, &Rig::is_group))
    throw AgreedError<InputError>(
        job.options.project +
        ": gps.groups: the registration of drives takes positions as they are, without shifts; "
        "correct the positions, or remove 'groups'");
  LazyTracks tracks(job.block, source);
  const std::string rig = run_rig(job, record, tracks, settings, block);
  const Trajectory trajectory = agreed_trajectory(job, settings.trajectory);
  Registrations registrations;
  if (settings.use_registrations)
    registrations =
        run_registrations(job, record, tracks, trajectory, run_places(job, record, trajectory, settings), settings);
  const std::vector<RegisteredPlace>& rows = registrations.rows;
  const RegisteredTrajectory registered = run_trajectory(job, record, trajectory, registrations, settings);
  on_first_rank(job.ranks, [&] {
    write_registration_outputs(job, trajectory.input.start, rows, registered, settings.joint, source.file);
    return std::string();
  });
  RegistrationSummary summary = summarise(job, record, trajectory, rows, registered, settings);
  summary.rig = rig;
  return summary;
}

std::string to_text(const RegistrationSummary& s) {
  std::string text = fmt::format(
      "frames                {} in a chain of {} links\n"
      "rig                   {}\n"
      "places                {}, registered {} (on {} different pairs of frames), of these {} hold in the joint "
      "adjustment\n",
      s.frames, s.chain, s.rig, s.places, s.accepted, s.different, s.used);
  const auto say = [&](const char* what, const RegistrationSummary::Reasons& reasons) {
    for (const auto& [reason, count] : reasons)
      text += fmt::format("  {:<20}{}: {}{}\n", what, count, count > 1 ? "for example, " : "", reason);
  };
  say("refused", s.refusals);
  text += fmt::format("resections            {}\n", s.resections);
  say("refused", s.not_resected);
  text += fmt::format("control measured      {} points\n", s.points);
  text += fmt::format("frames moved by       median {:.3f} m, largest {:.3f} m\n", s.median_move_m, s.largest_move_m);
  if (!s.check_points.empty())
    text += fmt::format("check points          {}, rms {:.4f} m\n", s.check_points.size(), s.check_rms_m);
  for (const std::string& note : s.notes) text += "look: " + note + "\n";
  return text + fmt::format("digest                {}\n", hex(s.digest));
}

}  // namespace megablock
