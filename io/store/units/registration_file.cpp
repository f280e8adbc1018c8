// Reads and writes places and registrations (docs/reference/file-formats.md, "Registration").
#include "io/store/units/registration_file.h"

#include "io/store/hdf5/hdf5_tables.h"

namespace megablock {

namespace {

void put_places(Hdf5Writer& file, const std::vector<Place>& places) {
  const auto frames = [&](const std::string& name, FrameIndex Place::*frame) {
    file.integers("places/" + name, column(places, [&](const Place& p) { return (p.*frame).value; }), {"", "frame"});
  };
  file.group("places", "two successive frames, a and b, of one pass, c and d of another");
  frames("a", &Place::a);
  frames("b", &Place::b);
  frames("c", &Place::c);
  frames("d", &Place::d);
  file.vector("places/component", column(places, [](const Place& p) { return p.component; }),
              {"", "connected component of the places that several passes see"});
}

std::vector<Place> get_places(const Hdf5Reader& file) {
  const auto a = file.vector<std::int64_t>("places/a");
  const auto rows = static_cast<std::int64_t>(a.size());
  const auto b = file.vector<std::int64_t>("places/b", rows), c = file.vector<std::int64_t>("places/c", rows),
             d = file.vector<std::int64_t>("places/d", rows);
  const auto component = file.vector<std::int32_t>("places/component", rows);
  std::vector<Place> places;
  for (std::size_t i = 0; i < a.size(); ++i)
    places.push_back({FrameIndex(a[i]), FrameIndex(b[i]), FrameIndex(c[i]), FrameIndex(d[i]), component[i]});
  return places;
}

}  // namespace

void write_places(const std::string& path, const std::vector<Place>& places) {
  Hdf5Writer file(path, "places");
  put_places(file, places);
  file.close();
}

std::vector<Place> read_places(const std::string& path) { return get_places(Hdf5Reader(path, "places")); }

void write_registrations(const std::string& path, const std::vector<RegisteredPlace>& rows) {
  Hdf5Writer file(path, "registrations");
  put_places(file, column(rows, [](const RegisteredPlace& r) { return r.place; }));
  const auto value = [&](auto get) {
    return column(rows, [&](const RegisteredPlace& r) { return get(r.registration); });
  };
  using Row = PairRegistration;
  file.group("registrations", "one row per place");
  file.vector("registrations/accepted", value([](const Row& r) -> std::uint8_t { return r.accepted; }));
  file.texts("registrations/reason", value([](const Row& r) { return r.reason; }), {"", "why not accepted"});
  write_poses(file, "registrations", value([](const Row& r) { return r.relative; }), "frame c", "frame a");
  std::vector<double> covariances;
  for (const RegisteredPlace& r : rows)
    // Symmetric, so the order of rows and columns does not matter.
    covariances.insert(covariances.end(), r.registration.covariance.data(), r.registration.covariance.data() + 36);
  file.array("registrations/covariance", covariances, {static_cast<std::int64_t>(rows.size()), 6, 6},
             {"rad, m", "of Log(R R_estimated') and of the centre"});
  file.vector("registrations/tracks", value([](const Row& r) { return r.tracks; }), {"", "in enough of the frames"});
  file.vector("registrations/measurements", value([](const Row& r) { return r.measurements; }),
              {"", "of these tracks"});
  file.vector("registrations/kept", value([](const Row& r) { return r.kept; }), {"", "measurements that stay"});
  file.vector("registrations/median_before", value([](const Row& r) { return r.median_before_px; }), {"px", ""});
  file.vector("registrations/median_after", value([](const Row& r) { return r.median_after_px; }), {"px", ""});
  file.vector("registrations/position_sigma", value([](const Row& r) { return r.position_sigma_m; }), {"m", "length"});
  file.vector("registrations/rotation_sigma", value([](const Row& r) { return r.rotation_sigma_deg; }),
              {"deg", "length"});
  file.vector("registrations/shift", value([](const Row& r) { return r.shift_m; }), {"m", "from the trajectory"});
  file.close();
}

std::vector<RegisteredPlace> read_registrations(const std::string& path) {
  const Hdf5Reader file(path, "registrations");
  const std::vector<Place> places = get_places(file);
  const auto count = static_cast<std::int64_t>(places.size());
  const auto accepted = file.vector<std::uint8_t>("registrations/accepted", count);
  const auto reasons = file.texts("registrations/reason", count);
  const auto poses = read_poses(file, "registrations", count);
  const auto covariance = file.array<double>("registrations/covariance", {count, 6, 6});
  const auto tracks = file.vector<std::int32_t>("registrations/tracks", count);
  const auto measurements = file.vector<std::int32_t>("registrations/measurements", count);
  const auto kept = file.vector<std::int32_t>("registrations/kept", count);
  const auto before = file.vector<double>("registrations/median_before", count);
  const auto after = file.vector<double>("registrations/median_after", count);
  const auto position = file.vector<double>("registrations/position_sigma", count);
  const auto rotation = file.vector<double>("registrations/rotation_sigma", count);
  const auto shift = file.vector<double>("registrations/shift", count);
  std::vector<RegisteredPlace> rows;
  for (std::size_t i = 0; i < places.size(); ++i) {
    PairRegistration r;
    r.accepted = accepted[i] != 0;
    r.reason = reasons[i];
    r.relative = poses[i];
    std::copy_n(&covariance[36 * i], 36, r.covariance.data());
    r.tracks = tracks[i], r.measurements = measurements[i], r.kept = kept[i];
    r.median_before_px = before[i], r.median_after_px = after[i];
    r.position_sigma_m = position[i], r.rotation_sigma_deg = rotation[i], r.shift_m = shift[i];
    rows.push_back({places[i], r});
  }
  return rows;
}

void write_trajectory(const std::string& path, const RegisteredTrajectory& trajectory) {
  Hdf5Writer file(path, "trajectory");
  file.group("frames");
  write_poses(file, "frames", trajectory.frames, "rig", "ground frame");
  file.vector("frames/position_weight", trajectory.position_weight,
              {"", "of the trajectory's position, 0: wrong or none, 1: right"});
  file.group("registrations", "one row per place, in the order of the files of pairs");
  file.vector("registrations/weight", trajectory.weight, {"", "0: wrong or refused, 1: right"});
  file.vector("registrations/residual", trajectory.residual, {"sigmas", "length of six numbers"});
  file.group("points", "control and check points measured along the path");
  file.integers("points/control_point", trajectory.control_points, {"", "row in the block's control points"});
  file.matrix("points/position", vectors3(trajectory.points, [](const Eigen::Vector3d& p) { return p; }), 3,
              {"m", "adjusted, ground frame"});
  file.attribute("frames", "resections", trajectory.resections);
  file.texts("not_resected", trajectory.not_resected, {"", "why, of each other frame that sees control"});
  file.close();
}

RegisteredTrajectory read_trajectory(const std::string& path) {
  const Hdf5Reader file(path, "trajectory");
  RegisteredTrajectory trajectory;
  trajectory.frames = read_poses(file, "frames");
  trajectory.position_weight =
      file.vector<double>("frames/position_weight", static_cast<std::int64_t>(trajectory.frames.size()));
  trajectory.weight = file.vector<double>("registrations/weight");
  trajectory.residual =
      file.vector<double>("registrations/residual", static_cast<std::int64_t>(trajectory.weight.size()));
  trajectory.control_points = file.vector<std::int64_t>("points/control_point");
  const auto count = static_cast<std::int64_t>(trajectory.control_points.size());
  const auto positions = file.matrix<double>("points/position", 3, count);
  for (std::size_t i = 0; i < trajectory.control_points.size(); ++i) trajectory.points.push_back(vector3(positions, i));
  trajectory.resections = file.attribute<std::int64_t>("frames", "resections");
  trajectory.not_resected = file.texts("not_resected");
  return trajectory;
}

}  // namespace megablock
