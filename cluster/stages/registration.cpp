#include "cluster/stages/registration.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <memory>
#include <set>

#include "adjust/registration/four_frames.h"
#include "adjust/registration/frame_resection.h"
#include "cluster/collective.h"
#include "cluster/stages/frame_tracks.h"
#include "cluster/stages/stages.h"
#include "io/error.h"
#include "io/hash.h"
#include "io/pose_csv.h"
#include "io/unit_files.h"

namespace megablock {

namespace {

constexpr int kAlgorithm = 2;  // of the registration's stages, part of their fingerprints
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

void add(Hasher& h, const TrajectoryOptions& o) {
  h.add(o.chain_position_sigma_m).add(o.chain_rotation_sigma_deg).add(o.difference_position_sigma_m);
  h.add(o.difference_rotation_sigma_deg).add(o.max_gap_m).add(o.check_points).add(o.use_control).add(o.check_prefix);
}

void add(Hasher& h, const JointOptions& o) {
  h.add(o.registration_scale).add(o.first_registration_scale).add(o.robust_registrations).add(o.use_positions);
  h.add(o.first_position_sigma_m).add(o.position_sigma_m).add(o.position_scale).add(o.position_neighbours);
  h.add(o.use_attitudes).add(o.attitude_sigma_deg).add(o.first_image_scale).add(o.image_scale);
  h.add(o.rounds).add(o.iterations).add(o.last_iterations);
}

std::vector<Eigen::Vector3d> positions_of(const JointInput& input) {
  std::vector<Eigen::Vector3d> positions;
  for (const Pose& pose : input.start) positions.push_back(pose.centre);
  return positions;
}

// The poses of a place with the pairs' relative poses from the chain, where it has them.
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

std::vector<Place> run_places(Job& job, const Trajectory& trajectory, const RegistrationSettings& settings) {
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
  run_stage(job, "places", {unit});
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
  std::uint64_t hash = 0;  // of the units' contents
};

Registrations run_registrations(Job& job, const TrackSource& source, const Trajectory& trajectory,
                                const std::vector<Place>& places, const RegistrationSettings& settings) {
  std::unique_ptr<FrameTracks> tracks;  // read by ranks that compute
  const auto loaded = [&]() -> const FrameTracks& {
    if (!tracks) tracks = std::make_unique<FrameTracks>(job.block, source.read());
    return *tracks;
  };
  const auto size = static_cast<std::size_t>(settings.units_places);
  std::vector<Unit> units;
  for (std::size_t begin = 0; begin < places.size(); begin += size) {
    const std::vector<Place> part(places.begin() + static_cast<std::ptrdiff_t>(begin),
                                  places.begin() + static_cast<std::ptrdiff_t>(std::min(places.size(), begin + size)));
    Hasher hasher;
    hasher.add(kAlgorithm).add(source.fingerprint).add(job.store.seal("block.h5")->content_hash);
    hasher.add(job.store.seal(kPlaces)->content_hash).add(begin).add(part.size());
    add(hasher, settings.pairs);
    add(hasher, settings.trajectory);
    Unit unit;
    unit.name = unit_name("register/pairs", static_cast<std::int64_t>(units.size()));
    unit.fingerprint = hasher.value();
    unit.cost = static_cast<double>(part.size());
    unit.write = [&, part](const std::string& path) {
      write_registrations(path, register_places(job, loaded(), trajectory.input, part, settings.pairs));
    };
    units.push_back(std::move(unit));
  }
  run_stage(job, "registrations", units);
  Registrations all;
  Hasher hasher;
  for (const Unit& unit : units) {
    const auto seal = job.store.seal(unit.name);
    if (!seal) continue;  // failed, and recorded so
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
  std::vector<std::size_t> row_of;
  std::set<std::pair<FrameIndex, FrameIndex>> seen;
  for (std::size_t i = 0; settings.use_registrations && i < rows.size(); ++i) {
    // Neighbouring places may have been moved to the same frames: each counts once.
    if (!rows[i].registration.accepted || !seen.emplace(rows[i].place.a, rows[i].place.c).second) continue;
    row_of.push_back(i);
    input.registrations.push_back(
        {rows[i].place.a, rows[i].place.c, rows[i].registration.relative, rows[i].registration.covariance});
  }
  if (settings.use_resections)
    for (const FrameResection& r : resect_frames(job.block, input.start, settings.trajectory, {}))
      if (r.refused.empty()) input.resections.push_back({r.frame, r.resection.pose, r.resection.covariance});
  const JointResult result = adjust_jointly(input, settings.joint);
  RegisteredTrajectory registered;
  registered.frames = result.frames;
  registered.weight.assign(rows.size(), 0);
  registered.residual.assign(rows.size(), 0);
  for (std::size_t i = 0; i < row_of.size(); ++i) {
    registered.weight[row_of[i]] = result.registration_weight[i];
    registered.residual[row_of[i]] = result.registration_residual[i];
  }
  registered.control_points = trajectory.point_row;
  registered.points = result.points;
  registered.resections = static_cast<std::int64_t>(input.resections.size());
  return registered;
}

RegisteredTrajectory run_trajectory(Job& job, const Trajectory& trajectory, const Registrations& registrations,
                                    const RegistrationSettings& settings) {
  Hasher hasher;
  hasher.add(kAlgorithm).add(job.store.seal("block.h5")->content_hash);
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
  run_stage(job, "trajectory", {unit});
  if (!job.store.seal(kTrajectory))
    throw AgreedError<ComputeError>("the trajectory could not be adjusted: " + job.failures.back().reason);
  return read_trajectory(job.store.verified_path(kTrajectory));
}

constexpr double kHolds = 0.25;  // weight from which a registration counts as right

std::string registrations_csv(const Block& block, const std::vector<RegisteredPlace>& rows,
                              const RegisteredTrajectory& registered) {
  std::string text =
      "a,b,c,d,accepted,holds,weight,residual_sigmas,tracks,measurements,kept,median_before_px,median_after_px,"
      "position_sigma_m,rotation_sigma_deg,shift_m,reason\n";
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Place& p = rows[i].place;
    const PairRegistration& r = rows[i].registration;
    text += fmt::format("{},{},{},{},{:d},{:d},{:.4f},{:.3f},{},{},{},{:.3f},{:.3f},{:.5f},{:.5f},{:.3f},\"{}\"\n",
                        block.frames[p.a].name, block.frames[p.b].name, block.frames[p.c].name, block.frames[p.d].name,
                        r.accepted, registered.weight[i] >= kHolds, registered.weight[i], registered.residual[i],
                        r.tracks, r.measurements, r.kept, r.median_before_px, r.median_after_px, r.position_sigma_m,
                        r.rotation_sigma_deg, r.shift_m, r.reason);
  }
  return text;
}

// The block with registered poses; registrations that hold are relative poses of it, with isotropic sigmas.
Block registered_block(const Block& block, const std::vector<RegisteredPlace>& rows,
                       const RegisteredTrajectory& registered) {
  Block result = block;
  for (std::size_t f = 0; f < registered.frames.size(); ++f)
    result.frames[FrameIndex(static_cast<std::int64_t>(f))].given_pose = registered.frames[f];
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (registered.weight[i] < kHolds) continue;
    const PairRegistration& r = rows[i].registration;
    result.relative_poses.push_back({rows[i].place.a, rows[i].place.c, r.relative,
                                     std::sqrt(r.covariance.topLeftCorner<3, 3>().trace() / 3),
                                     std::sqrt(r.covariance.bottomRightCorner<3, 3>().trace() / 3)});
  }
  return result;
}

void write_outputs(const Job& job, const std::vector<RegisteredPlace>& rows, const RegisteredTrajectory& registered,
                   const std::string& tie_points) {
  PoseTable table;
  table.ground = job.block.ground;
  for (std::size_t f = 0; f < registered.frames.size(); ++f) {
    const Frame& frame = job.block.frames[FrameIndex(static_cast<std::int64_t>(f))];
    table.names.push_back(frame.name);
    table.poses.push_back(registered.frames[f]);
    table.passes.push_back(frame.pass);
  }
  write_pose_csv(job.store.path("register/poses.csv"), table);
  job.store.write_text("register/registrations.csv", registrations_csv(job.block, rows, registered));
  const Block block = registered_block(job.block, rows, registered);
  job.store.write("register/block.h5", job.store.seal(kTrajectory)->content_hash,
                  [&](const std::string& path) { write_block(path, block); });
  std::string yaml =
      "# The block with its registered trajectory and registrations as relative poses.\nblock: block.h5\n";
  if (!tie_points.empty()) yaml += "tie_points: " + tie_points + "\n";
  job.store.write_text("register/block.yaml", yaml);
}

// A reason without its numbers.
std::string kind_of(const std::string& reason) {
  std::string kind;
  for (const char c : reason)
    if (!std::isdigit(static_cast<unsigned char>(c)) && c != '.')
      kind += c;
    else if (kind.empty() || kind.back() != '#')
      kind += '#';
  return kind;
}

RegistrationSummary summarise(const Job& job, const Trajectory& trajectory, const std::vector<RegisteredPlace>& rows,
                              const RegisteredTrajectory& registered) {
  RegistrationSummary s;
  s.frames = std::ssize(registered.frames);
  s.chain = std::ssize(trajectory.input.chain);
  s.places = std::ssize(rows);
  s.resections = registered.resections;
  s.points = std::ssize(registered.points);
  std::map<std::string, std::int64_t> reasons;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    s.accepted += rows[i].registration.accepted;
    s.used += registered.weight[i] >= kHolds;
    if (!rows[i].registration.accepted) ++reasons[kind_of(rows[i].registration.reason)];
  }
  s.refusals.assign(reasons.begin(), reasons.end());
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
  s.digest = job.store.seal(kTrajectory)->content_hash;
  return s;
}

}  // namespace

void RegistrationSettings::check() const {
  places.check();
  pairs.check();
  trajectory.check();
  joint.check();
  if (units_places < 1) throw InputError("units_places must be at least 1");
}

RegistrationSummary run_registration(Job& job, const TrackSource& tracks, const RegistrationSettings& settings) {
  const Trajectory trajectory = trajectory_of(job.block, settings.trajectory);
  Registrations registrations;
  if (settings.use_registrations)
    registrations = run_registrations(job, tracks, trajectory, run_places(job, trajectory, settings), settings);
  const std::vector<RegisteredPlace>& rows = registrations.rows;
  const RegisteredTrajectory registered = run_trajectory(job, trajectory, registrations, settings);
  on_first_rank(job.ranks, [&] {
    write_outputs(job, rows, registered, tracks.file);
    return std::string();
  });
  return summarise(job, trajectory, rows, registered);
}

std::string to_text(const RegistrationSummary& s) {
  std::string text = fmt::format(
      "frames                {} in a chain of {} links\n"
      "places                {}, registered {}, of these {} hold in the joint adjustment\n",
      s.frames, s.chain, s.places, s.accepted, s.used);
  for (const auto& [reason, count] : s.refusals) text += fmt::format("  refused             {}: {}\n", count, reason);
  text += fmt::format("resections            {}\ncontrol measured      {} points\n", s.resections, s.points);
  text += fmt::format("frames moved by       median {:.3f} m, largest {:.3f} m\n", s.median_move_m, s.largest_move_m);
  if (!s.check_points.empty())
    text += fmt::format("check points          {}, rms {:.4f} m\n", s.check_points.size(), s.check_rms_m);
  return text + fmt::format("digest                {}\n", hex(s.digest));
}

}  // namespace megablock
