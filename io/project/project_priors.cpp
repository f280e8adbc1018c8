// Sets the position and attitude priors of frames from the image headers (EXIF, XMP) and from the sections `gps`,
// `attitude` and `origin` of the project file, and chooses the ground frame.
//
// Positions: EXIF gives latitude, longitude, height of the antenna. In the ground frame the adjustment uses
//
//     P = C + R' a,    C, R: pose of the frame, a: lever arm in axes of the rig (x right, y down, z ahead).
//
// Attitudes: a gimbal gives R_own, from the axes east, north, up at the image to those of the camera. With the rotation
// own_from_block between the verticals of the two places and the mount R_m of the camera in its rig follows
//
//     R = R_m' R_own own_from_block,    in the axes of the ground frame.
//
// A lever arm or boresight with a sigma, or a boresight that is not zero, gives the rig a receiver
// (io/block/observed_poses.h).
//
// Positions of a group (`gps: {groups: [...]}`) have a shift in common, an unknown of the adjustment.
//
// A kilometre from the origin the verticals differ by half a minute of arc, so this matters for large blocks.
#include <fmt/core.h>
#include <fnmatch.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "geometry/numbers/angles.h"
#include "geometry/transform/rotation.h"
#include "io/base/error.h"
#include "io/block/crs.h"
#include "io/block/held_priors.h"
#include "io/block/observed_poses.h"
#include "io/project/pose_sources.h"
#include "io/project/project_sections.h"
#include "io/text/plausible.h"

namespace megablock {

namespace {

constexpr double kDefaultHorizontalSigma = 3, kDefaultVerticalSigma = 6;  // metres
constexpr double kTiltSigmaDeg = 3, kYawSigmaDeg = 10;                    // of the angles of a gimbal

struct GpsOptions {
  bool given = false, use = true;  // given: the project file has this section
  std::optional<double> sigma_horizontal, sigma_vertical;
  Eigen::Vector3d lever_arm = Eigen::Vector3d::Zero();
  double lever_arm_sigma = 0;       // metres; 0: the lever arm is held
  std::vector<std::string> groups;  // patterns of image names
  double group_sigma = 100;         // of the shift of a group, metres
};

struct AttitudeOptions {
  bool given = false, use = true;
  std::optional<double> sigma_deg;
  Eigen::Vector3d boresight = Eigen::Vector3d::Zero();  // rotation vector, radians
  double boresight_sigma = 0;                           // radians; 0: held
};

// Reads a sigma. The value 0 means that the observed value is held; it is replaced by `held`.
std::optional<double> read_sigma(YamlReader& reader, const std::string& key, const Limits& limits, double held) {
  const auto sigma = reader.number(key);
  if (!sigma) return std::nullopt;
  if (*sigma == 0) return held;
  check_within(*sigma, limits, key, reader.where(key), ", or be 0 to hold the observed value");
  return sigma;
}

// Reads the sigma of a lever arm or boresight; 0 holds it.
double read_receiver_sigma(YamlReader& reader, const std::string& key, const Limits& limits) {
  const auto sigma = reader.number(key);
  if (!sigma || *sigma == 0) return 0;
  check_within(*sigma, limits, key, reader.where(key), ", or be 0 to hold the given value");
  return *sigma;
}

// `given_arms`: the positions have lever arms of their own.
GpsOptions read_gps_options(YamlReader& top, bool given_arms) {
  GpsOptions options;
  auto reader = top.mapping("gps");
  if (!reader) return options;
  options.given = true;
  options.use = reader->flag("use").value_or(true);
  options.sigma_horizontal = read_sigma(*reader, "sigma_horizontal_m", kSigmaMetres, kHeldPositionSigma);
  options.sigma_vertical = read_sigma(*reader, "sigma_vertical_m", kSigmaMetres, kHeldPositionSigma);
  if (given_arms && reader->node("lever_arm_m"))
    refuse_unused(*reader, "lever_arm_m", "with 'block', whose positions have their own lever arms");
  if (const auto arm = reader->numbers("lever_arm_m", 3)) {
    options.lever_arm = {(*arm)[0], (*arm)[1], (*arm)[2]};
    check_on_vehicle(options.lever_arm, "gps.lever_arm_m", reader->where("lever_arm_m"));
  }
  options.lever_arm_sigma = read_receiver_sigma(*reader, "lever_arm_sigma_m", kSigmaMetres);
  options.groups = reader->texts("groups").value_or(std::vector<std::string>());
  if (const auto sigma = reader->number("group_sigma_m")) {
    if (options.groups.empty()) refuse_unused(*reader, "group_sigma_m", "without 'groups', whose shifts it is for");
    check_within(*sigma, kSigmaMetres, "group_sigma_m", reader->where("group_sigma_m"));
    options.group_sigma = *sigma;
  }
  reader->finish();
  return options;
}

AttitudeOptions read_attitude_options(YamlReader& top) {
  AttitudeOptions options;
  auto reader = top.mapping("attitude");
  if (!reader) return options;
  options.given = true;
  options.use = reader->flag("use").value_or(true);
  options.sigma_deg = read_sigma(*reader, "sigma_deg", kSigmaDegrees, kHeldAttitudeSigma * kDegreesPerRadian);
  if (const auto turn = reader->numbers("boresight_deg", 3)) {
    options.boresight = kDegree * Eigen::Vector3d((*turn)[0], (*turn)[1], (*turn)[2]);
    check_rotation_vector(options.boresight, "attitude.boresight_deg", reader->where("boresight_deg"));
  }
  options.boresight_sigma = kDegree * read_receiver_sigma(*reader, "boresight_sigma_deg", kSigmaDegrees);
  reader->finish();
  return options;
}

// Calls set(receiver) for each rig of which a frame has a prior, and gives it a receiver first where it has none.
void set_receivers(Block& block, const auto& has_prior, const auto& set) {
  for (const Frame& frame : block.frames) {
    Rig& rig = block.rigs[frame.rig];
    if (!has_prior(frame)) continue;
    if (!rig.has_receiver()) rig.mounts.push_back({});
    set(rig.mounts.back());
  }
}

// Gives the positions of the images that match a pattern a shift in common. An image belongs to the first such pattern.
void set_groups(const GpsOptions& options, const std::string& where, Project& project) {
  Block& block = project.block;
  for (Frame& frame : block.frames)
    if (auto& prior = frame.position_prior) {
      prior->group = {};
      if (held(*prior))
        throw InputError(where +
                         ": gps.groups: positions with a sigma of 0 are held, and cannot have a shift; give them a "
                         "sigma, or remove 'groups'");
    }
  for (const std::string& pattern : options.groups) {
    const RigIndex group = block.rigs.next_index();
    bool any = false;
    for (ImageIndex i(0); block.images.contains(i); ++i.value) {
      auto& prior = block.frames[block.images[i].frame].position_prior;
      if (!prior || prior->group.valid() || fnmatch(pattern.c_str(), block.name_of(i).c_str(), 0) != 0) continue;
      prior->group = group;
      prior->shifted.setOnes();
      any = true;
    }
    if (!any)
      throw InputError(fmt::format(
          "{}: gps.groups: no image with a position matches '{}', or those that do belong to a group before it; "
          "patterns are as 'flight2/*.jpg', with the folders below 'images'",
          where, pattern));
    block.rigs.push_back(position_group("positions of " + pattern, Eigen::Vector3d::Zero(), options.group_sigma));
  }
  if (std::ranges::none_of(block.frames, [](const Frame& frame) {
        return frame.position_prior && !frame.position_prior->group.valid();
      }))
    project.warnings.push_back(fmt::format(
        "{}: all positions belong to 'groups', which have a shift: without control points the place of the "
        "block is known to 'group_sigma_m' ({:g} m) only; name the groups that may be wrong, and leave out the "
        "one that gives the place",
        where, options.group_sigma));
}

// The sigmas of a position: those of the project file, else the accuracy in the image header, else the defaults. A DOP
// can only enlarge the default; it is taken as metres, because phones write their accuracy there.
Eigen::Vector3d position_sigma(const ImageHeader& header, bool has_height, const GpsOptions& options) {
  const double own = header.position_sigma_horizontal_m;
  double horizontal = own > 0 ? own : kDefaultHorizontalSigma;
  if (!(own > 0) && header.dop > horizontal) horizontal = header.dop;
  double vertical = header.position_sigma_vertical_m;
  if (!(vertical > 0)) vertical = horizontal * (kDefaultVerticalSigma / kDefaultHorizontalSigma);
  horizontal = options.sigma_horizontal.value_or(horizontal);
  vertical = options.sigma_vertical.value_or(vertical);
  if (!has_height) vertical = kUnknownHeightSigma;
  return {horizontal, horizontal, vertical};
}

// Sets the priors of the frames, and returns the sigmas used for each image: horizontal, vertical.
std::vector<Eigen::Vector2d> set_position_priors(const std::vector<ScannedImage>& scanned,
                                                 const std::vector<std::optional<Geodetic>>& positions,
                                                 const GpsOptions& options, Block& block) {
  std::vector<Eigen::Vector2d> sigmas(scanned.size(), Eigen::Vector2d::Constant(ImageHeader::kUnknown));
  std::optional<Georeference> georeference;
  if (block.ground.georeferenced) georeference.emplace(block.ground);
  for (std::size_t i = 0; i < scanned.size(); ++i) {
    const auto& local = scanned[i].local_position;
    if (!local && (!positions[i] || !georeference)) continue;
    PositionPrior prior;
    bool has_height = true;
    if (local) {
      prior.position = *local;
    } else {
      Geodetic position = *positions[i];
      // An unknown height gets that of the origin, and a sigma that leaves it free (position_sigma).
      has_height = std::isfinite(position.height_m);
      if (!has_height) position.height_m = block.ground.height_m;
      prior.position = georeference->to_local(position);
    }
    prior.sigma = position_sigma(scanned[i].header, has_height, options);
    prior.lever_arm = options.lever_arm;
    sigmas[i] = {prior.sigma.x(), prior.sigma.z()};
    Frame& frame = block.frames[block.images[ImageIndex(static_cast<std::int64_t>(i))].frame];
    if (!frame.position_prior) frame.position_prior = prior;  // in a rig, the first image with a position counts
  }
  return sigmas;
}

// Warns of positions without a height, unless a trajectory takes their place. Heights that are far off, which
// `positions` leaves out as well, were warned of before.
void warn_of_missing_heights(const std::vector<ScannedImage>& scanned,
                             const std::vector<std::optional<Geodetic>>& positions, const Trajectories& trajectories,
                             Project& project) {
  std::set<FrameIndex> replaced;
  for (const auto& pose : trajectories.poses) replaced.insert(pose.frame);
  std::size_t missing = 0, known = 0;
  const ScannedImage* first = nullptr;
  for (std::size_t i = 0; i < scanned.size(); ++i) {
    const ImageIndex image(static_cast<std::int64_t>(i));
    if (!positions[i] || replaced.contains(project.block.images[image].frame)) continue;
    ++known;
    if (std::isfinite(scanned[i].header.position->height_m)) continue;
    if (missing++ == 0) first = &scanned[i];
  }
  if (missing == 0) return;
  project.warnings.push_back(fmt::format(
      "{} of {} images with a position have no height there (the first is '{}', from {}): each gets that of "
      "the origin with a sigma of {:g} m; give heights in a file ('positions'), or control points, which "
      "determine the height of the block",
      missing, known, first->name, first->header.position_source, kUnknownHeightSigma));
}

// Whether several images have one and the same position: a receiver without updates, or a tripod. It is then one
// observation of the whole block, which places the block and tells nothing of its scale and direction.
bool share_one_position(const std::vector<Geodetic>& known) {
  return known.size() > 1 && std::ranges::all_of(known, [&](const Geodetic& p) {
           return p.latitude_deg == known[0].latitude_deg && p.longitude_deg == known[0].longitude_deg;
         });
}

std::string text_of_one_position(const std::vector<Geodetic>& known, std::size_t images) {
  return fmt::format(
      "{} of {} images share one position ({:.6f}, {:.6f}), as from a receiver without updates; it is used as one, as "
      "the "
      "origin of the block. Positions of the images ('positions') or control points give scale and direction",
      known.size(), images, known[0].latitude_deg, known[0].longitude_deg);
}

// Complains of a section that has no effect. With a given block, which never changes, it is an error. With images, it
// is a warning, because other images may be added later.
void check_effect(const YamlReader& top, const std::string& section, const std::string& what, bool from_images,
                  bool has_effect, std::vector<std::string>& warnings) {
  if (has_effect) return;
  if (!from_images) refuse_unused(top, section, "with a 'block' without " + what);
  warnings.push_back(top.where(section) + ": '" + section + "' has no effect: the images have no " + what);
}

bool has_position(const Frame& frame) { return frame.position_prior.has_value(); }
bool has_attitude(const Frame& frame) { return frame.attitude_prior.has_value(); }

GroundFrame ground_at(const Geodetic& origin) {
  return {true, origin.latitude_deg, origin.longitude_deg, origin.height_m, "EPSG:4979"};
}

Geodetic known_height(Geodetic position) {
  if (!std::isfinite(position.height_m)) position.height_m = 0;
  return position;
}

std::optional<GroundFrame> read_origin(YamlReader& top) {
  const auto origin = top.numbers("origin", 3);
  if (!origin) return std::nullopt;
  const Geodetic position{(*origin)[0], (*origin)[1], (*origin)[2]};
  if (std::abs(position.latitude_deg) > 90 || std::abs(position.longitude_deg) > 180)
    throw InputError(fmt::format("{}: origin must be [latitude_deg, longitude_deg, height_m] (WGS84), not {:g}, {:g}",
                                 top.where("origin"), position.latitude_deg, position.longitude_deg));
  check_on_earth(position.height_m, "origin", top.where("origin"));
  return ground_at(position);
}

}  // namespace

Eigen::Vector3d read_positions(YamlReader& top, const std::vector<ScannedImage>& scanned, bool from_files,
                               const Trajectories& trajectories, const std::vector<Geodetic>& others,
                               const std::optional<GroundFrame>& ground, Project& project) {
  Block& block = project.block;
  const bool from_images = !scanned.empty();  // otherwise a given block, which has its own ground frame
  const GpsOptions options = read_gps_options(top, !from_images && trajectories.empty());
  const auto origin = read_origin(top);
  if (!options.use)
    for (Frame& frame : block.frames) frame.position_prior.reset();
  const bool local =
      std::ranges::any_of(scanned, [](const ScannedImage& image) { return image.local_position.has_value(); });
  std::vector<std::optional<Geodetic>> positions(scanned.size());
  if (options.use || from_files) positions = screen_positions(scanned, project.warnings);
  std::vector<Geodetic> known;
  for (const auto& position : positions)
    if (position) known.push_back(*position);
  if (local && !known.empty())
    throw InputError(
        top.where("positions") +
        ": positions: some files are in the block's own frame and some in a system on earth; give all of them "
        "in one kind");
  if (options.given && options.use && trajectories.empty()) {
    const bool has_effect = from_images ? !known.empty() || local : std::ranges::any_of(block.frames, has_position);
    check_effect(top, "gps", "positions", from_images, has_effect, project.warnings);
  }
  for (Frame& frame : block.frames) {
    if (!frame.position_prior) continue;
    if (options.sigma_horizontal) frame.position_prior->sigma.head<2>().setConstant(*options.sigma_horizontal);
    if (options.sigma_vertical) frame.position_prior->sigma.z() = *options.sigma_vertical;
  }
  if (origin && !from_images)
    throw InputError(top.where("origin") +
                     ": 'origin' cannot be given with 'block', which has its own ground frame; remove it");
  const bool one = share_one_position(known);
  // The order of project_sections.h: the running job, `origin`, the images, other positions.
  if (ground && from_images)
    block.ground = *ground;
  else if (origin)
    block.ground = *origin;
  else if (!known.empty())
    block.ground = ground_at(one ? known_height(known[0]) : rounded_median(known));
  else if (!others.empty() && !block.ground.georeferenced)
    block.ground = ground_at(rounded_median(others));
  const auto set_unknowns = [&] {
    if (options.lever_arm_sigma > 0)
      set_receivers(block, has_position, [&](Mount& receiver) { receiver.position_sigma_m = options.lever_arm_sigma; });
    if (options.use && !options.groups.empty()) set_groups(options, top.where("gps"), project);
  };
  const auto set_trajectories = [&] {
    trajectories.set_positions(options.sigma_horizontal, options.sigma_vertical, options.lever_arm, block);
    set_unknowns();
    return options.lever_arm;
  };
  if (!from_images) return set_trajectories();
  if (!known.empty() && !block.ground.georeferenced)
    project.warnings.push_back(
        "GPS positions are not used, because the block of this job is not georeferenced; start a new job to use them");
  if (one) {
    positions.assign(scanned.size(), std::nullopt);
    project.warnings.push_back(text_of_one_position(known, scanned.size()));
  }
  if (block.ground.georeferenced) warn_of_missing_heights(scanned, positions, trajectories, project);
  const auto sigmas = set_position_priors(scanned, positions, options, block);
  const std::vector<std::string> lines = lines_of_positions(scanned, sigmas);
  project.found.insert(project.found.end(), lines.begin(), lines.end());
  return set_trajectories();
}

void read_attitudes(YamlReader& top, const std::vector<ScannedImage>& scanned, const Trajectories& trajectories,
                    Project& project) {
  const bool from_images = !scanned.empty();
  const AttitudeOptions options = read_attitude_options(top);
  Block& block = project.block;
  if (options.given && options.use && trajectories.empty()) {
    const auto tells = [](const ScannedImage& image) { return image.header.attitude || image.local_attitude; };
    const bool has_effect =
        from_images ? std::ranges::any_of(scanned, tells) : std::ranges::any_of(block.frames, has_attitude);
    check_effect(top, "attitude", "attitudes", from_images, has_effect, project.warnings);
  }
  if (!options.use)
    for (Frame& frame : block.frames) frame.attitude_prior.reset();
  for (Frame& frame : block.frames)
    if (frame.attitude_prior && options.sigma_deg)
      frame.attitude_prior->sigma_rad.setConstant(*options.sigma_deg * kDegree);
  const auto set_boresights = [&] {
    if (options.boresight.isZero() && options.boresight_sigma == 0) return;
    set_receivers(block, has_attitude, [&](Mount& receiver) {
      receiver.pose.rotation = rotation_exp<double>(options.boresight);
      receiver.rotation_sigma_rad = options.boresight_sigma;
    });
  };
  if (!from_images) {
    trajectories.set_attitudes(options.sigma_deg, block);
    return set_boresights();
  }
  std::optional<Georeference> georeference;
  if (block.ground.georeferenced) georeference.emplace(block.ground);
  std::vector<bool> used(scanned.size(), false);
  const double tilt = options.sigma_deg.value_or(kTiltSigmaDeg) * kDegree;
  const double yaw = options.sigma_deg.value_or(kYawSigmaDeg) * kDegree;
  for (std::size_t i = 0; i < scanned.size(); ++i) {
    const auto& local = scanned[i].local_attitude;
    if (!options.use || (!local && (!scanned[i].header.attitude || !georeference))) continue;
    used[i] = true;
    const ImageIndex image(static_cast<std::int64_t>(i));
    Frame& frame = block.frames[block.images[image].frame];
    if (frame.attitude_prior) continue;
    AttitudePrior prior;
    prior.rotation_cw = local ? *local : scanned[i].header.attitude->rotation;
    if (frame.position_prior && !local)
      prior.rotation_cw =
          (prior.rotation_cw * georeference->own_from_block(georeference->to_geodetic(frame.position_prior->position)))
              .normalized();
    prior.rotation_cw = (block.mount_of(image).pose.rotation.conjugate() * prior.rotation_cw).normalized();
    prior.sigma_rad = attitude_sigmas(prior.rotation_cw, tilt, yaw);
    frame.attitude_prior = prior;
  }
  trajectories.set_attitudes(options.sigma_deg, block);
  set_boresights();
  const auto lines = lines_of_attitudes(scanned, used, tilt * kDegreesPerRadian, yaw * kDegreesPerRadian);
  project.found.insert(project.found.end(), lines.begin(), lines.end());
}

}  // namespace megablock
