#include "io/project/inputs/approximate_poses.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include "geometry/numbers/angles.h"
#include "geometry/transform/body_attitude.h"
#include "io/base/error.h"
#include "io/block/ground_change.h"
#include "io/project/inputs/image_lookup.h"
#include "io/project/inputs/pose_csv.h"
#include "io/text/csv_table.h"

namespace megablock {

namespace {

constexpr double kGimbalDoubt = 20 * kDegree;  // a pitch so near to -90 is no aircraft's, which would dive vertically

// The three ways in which a file gives attitudes.
enum class Angles { kPhotogrammetric, kGimbal, kBody };

Angles angles_of(const CsvTable& csv) {
  // The names of the columns tell the convention; the numbers alone could not.
  if (csv.has("omega_deg")) return Angles::kPhotogrammetric;
  return csv.has("gimbal_pitch_deg") ? Angles::kGimbal : Angles::kBody;
}

void require_angles(const CsvTable& csv, Angles angles) {
  switch (angles) {
    case Angles::kPhotogrammetric:
      return csv.require({"omega_deg", "phi_deg", "kappa_deg"});
    case Angles::kGimbal:
      return csv.require({"gimbal_yaw_deg", "gimbal_pitch_deg", "gimbal_roll_deg"});
    case Angles::kBody:
      return csv.require({"yaw_deg", "pitch_deg", "roll_deg"});
  }
}

Eigen::Quaterniond rotation_of(const CsvTable& csv, std::size_t row, Angles angles) {
  const auto angle = [&](const char* column) { return csv.needed_number(row, column) * kDegree; };
  if (angles == Angles::kPhotogrammetric)
    return rotation_from(OmegaPhiKappa{angle("omega_deg"), angle("phi_deg"), angle("kappa_deg")});
  if (angles == Angles::kGimbal)
    return rotation_from(YawPitchRoll{angle("gimbal_yaw_deg"), angle("gimbal_pitch_deg"), angle("gimbal_roll_deg")});
  if (std::abs(angle("pitch_deg") + std::numbers::pi / 2) < kGimbalDoubt)
    throw InputError(csv.where(row) +
                     ": pitch_deg is near -90, as in the angles of a gimbal that points down; pitch_deg of an aircraft "
                     "is 0 then. For gimbal angles, name the columns gimbal_yaw_deg, gimbal_pitch_deg, "
                     "gimbal_roll_deg");
  return rotation_from(BodyAttitude{angle("yaw_deg"), angle("pitch_deg"), angle("roll_deg")});
}

std::optional<std::int64_t> pass_of(const CsvTable& csv, std::size_t row) {
  if (!csv.has("pass")) return std::nullopt;
  const double pass = csv.needed_number(row, "pass");
  if (pass != std::floor(pass)) throw InputError(csv.where(row) + ": pass must be a whole number");
  return static_cast<std::int64_t>(pass);
}

ApproximatePoses read_angles(const CsvTable& csv, const std::string& name_column) {
  const bool geodetic = csv.has("latitude_deg");
  const Angles angles = angles_of(csv);
  if (geodetic)
    csv.require({"latitude_deg", "longitude_deg", "height_m"});
  else
    csv.require({"x_m", "y_m", "z_m"});
  require_angles(csv, angles);
  ApproximatePoses poses;
  std::set<std::string> seen;
  for (std::size_t row = 0; row < csv.row_count(); ++row) {
    ApproximatePoses::Row entry;
    entry.name = csv.text(row, name_column);
    entry.where = csv.where(row);
    if (!seen.insert(entry.name).second)
      throw InputError(entry.where + ": '" + entry.name + "' appears twice; delete one of its lines");
    entry.geodetic = geodetic;
    if (geodetic)
      entry.position = {csv.needed_number(row, "latitude_deg"), csv.needed_number(row, "longitude_deg"),
                        csv.needed_metres(row, "height_m")};
    else
      entry.pose.centre = {csv.needed_metres(row, "x_m"), csv.needed_metres(row, "y_m"), csv.needed_metres(row, "z_m")};
    entry.pose.rotation = rotation_of(csv, row, angles);
    entry.pass = pass_of(csv, row);
    poses.rows.push_back(std::move(entry));
  }
  return poses;
}

ApproximatePoses read_quaternions(const std::string& path) {
  const PoseTable table = read_pose_csv(path);
  ApproximatePoses poses;
  poses.ground = table.ground;
  for (std::size_t i = 0; i < table.names.size(); ++i)
    poses.rows.push_back({table.names[i],
                          path,
                          false,
                          {},
                          table.poses[i],
                          table.passes.empty() ? std::nullopt : std::optional(table.passes[i])});
  return poses;
}

// Transforms poses of the file into the ground frame of the block.
class ToBlock {
 public:
  ToBlock(const ApproximatePoses& poses, const GroundFrame& ground) : ground_(ground) {
    if (ground.georeferenced) reference_.emplace(ground);
    if (ground.georeferenced && poses.ground && !same_origin(*poses.ground, ground))
      change_.emplace(*poses.ground, ground);
  }

  Pose operator()(const ApproximatePoses::Row& row) const {
    if (!row.geodetic) return change_ ? change_->pose(row.pose) : row.pose;
    if (!reference_)
      throw InputError(row.where + ": poses in WGS84 need a georeferenced block; add 'origin' to the project file");
    try {
      // The angles refer to the vertical at the position: R_own turns the axes there to those of the camera.
      return {(row.pose.rotation * reference_->own_from_block(row.position)).normalized(),
              reference_->to_local(row.position)};
    } catch (const InputError& error) {
      throw InputError(row.where + ": '" + row.name + "': " + error.what());
    }
  }

 private:
  GroundFrame ground_;
  std::optional<Georeference> reference_;
  std::optional<GroundChange> change_;
};

}  // namespace

std::vector<Geodetic> ApproximatePoses::positions() const {
  std::vector<Geodetic> result;
  for (const Row& row : rows)
    if (row.geodetic) result.push_back(row.position);
  if (result.empty() && ground) result.push_back({ground->latitude_deg, ground->longitude_deg, ground->height_m});
  return result;
}

ApproximatePoses read_approximate_poses(const std::string& path) {
  const CsvTable csv(path);
  if (csv.has("qw") || csv.has("qx") || csv.has("qy") || csv.has("qz")) return read_quaternions(path);
  const std::string name_column = csv.has("image") ? "image" : "name";
  csv.require({name_column});
  if (!csv.has("latitude_deg") && !csv.has("x_m"))
    throw InputError(path +
                     ": the header has no columns of poses; expected latitude_deg,longitude_deg,height_m or "
                     "x_m,y_m,z_m with angles, or qw,qx,qy,qz,x,y,z");
  return read_angles(csv, name_column);
}

void set_given_poses(const ApproximatePoses& poses, const std::vector<std::string>& left_out, Block& block,
                     std::vector<std::string>& warnings) {
  const ToBlock to_block(poses, block.ground);
  const ImageLookup images(block, left_out);
  std::map<std::string, FrameIndex> frames;
  for (std::size_t f = 0; f < block.frames.size(); ++f)
    frames.emplace(block.frames[FrameIndex(static_cast<std::int64_t>(f))].name,
                   FrameIndex(static_cast<std::int64_t>(f)));
  std::set<FrameIndex> placed;  // frames with a pose from an earlier row; a pose that the block had is replaced
  for (const ApproximatePoses::Row& row : poses.rows) {
    // A single image and its frame have the same name. Its mount is the identity, so both readings of the row agree.
    const auto frame = frames.find(row.name);
    const bool of_frame = frame != frames.end() && !images.has(row.name);
    const ImageLookup::Found image = of_frame ? ImageLookup::Found() : images.find(row.name);
    if (image.kind == ImageLookup::Kind::kLeftOut) {
      warnings.push_back(row.where + ": the pose of '" + row.name + "' is not used, because '" + row.name +
                         "' was left out of the block");
    } else if (image.kind == ImageLookup::Kind::kImage) {
      // The pose of the frame follows from that of the camera: X_cam = R_m (R_f (X - C_f) - C_m).
      const Pose camera = to_block(row);
      const Pose& mount = block.mount_of(image.image).pose;
      const Eigen::Quaterniond rotation = (mount.rotation.conjugate() * camera.rotation).normalized();
      const FrameIndex index = block.images[image.image].frame;
      Frame& target = block.frames[index];
      if (row.pass) target.pass = *row.pass;
      if (placed.insert(index).second)
        target.given_pose = Pose{rotation, camera.centre - rotation.conjugate() * mount.centre};
    } else if (of_frame) {
      Frame& target = block.frames[frame->second];
      if (row.pass) target.pass = *row.pass;
      target.given_pose = to_block(row);
      placed.insert(frame->second);
    } else {
      throw InputError(row.where + ": the block has no image and no frame '" + row.name +
                       "'; correct the name or delete the line");
    }
  }
}

}  // namespace megablock
