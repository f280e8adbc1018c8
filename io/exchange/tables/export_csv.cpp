// Writes the tables of a result as CSV files.
#include <cmath>
#include <filesystem>

#include "geometry/numbers/angles.h"
#include "geometry/transform/body_attitude.h"
#include "io/block/crs.h"
#include "io/exchange/model/export_view.h"
#include "io/exchange/tables/export_tables.h"
#include "io/project/inputs/pose_csv.h"
#include "io/text/csv_row.h"
#include "io/text/text_writer.h"

namespace megablock {

namespace fs = std::filesystem;

namespace {

void print_angles(TextWriter& writer, const Eigen::Quaterniond& rotation) {
  const OmegaPhiKappa o = omega_phi_kappa(rotation);
  const BodyAttitude y = body_attitude(rotation);
  for (const double angle : {o.omega, o.phi, o.kappa, y.yaw, y.pitch, y.roll})
    writer.print(",{:.12g}", angle * kDegreesPerRadian);
}

// The covariance of an image's rotation (about the ground axes) and projection centre, from that of its frame. The
// projection centre is C + R' c, where c is the place of the camera in the rig. The increment w of the frame makes R
// into R Exp(w), and R' c into Exp(-w) R' c = R' c - w x R' c, so it moves the centre by [R' c]x w. With J = (I 0; [R'
// c]x I) the covariance is J C J'. The covariance of the mount itself is not included.
BlockResult::Matrix6 image_covariance(const ExportView& view, std::int64_t i,
                                      const IndexedVector<FrameIndex, BlockResult::Matrix6>& frames) {
  const FrameIndex frame = view.image(i).frame;
  BlockResult::Matrix6 move = BlockResult::Matrix6::Identity();
  move.bottomLeftCorner<3, 3>() = skew<double>(view.pose(i).centre - view.result.state.frames[frame].centre);
  return move * frames[frame] * move.transpose();
}

constexpr const char* kSigmaColumns = ",{3}sigma_{0}_m,{3}sigma_{1}_m,{3}sigma_{2}_m,{3}sigma_rotation_deg";
constexpr const char* kEmpirical = "empirical_";

// Prints the sigmas along the axes into which `to_axes` turns those of the ground frame.
void print_sigmas(TextWriter& writer, const BlockResult::Matrix6& covariance, const Eigen::Quaterniond& to_axes) {
  const Eigen::Matrix3d r = to_axes.toRotationMatrix();
  const Eigen::Vector3d position = (r * covariance.bottomRightCorner<3, 3>() * r.transpose()).diagonal();
  for (const double variance : position) writer.print(",{:.6g}", std::sqrt(variance));
  // The root mean square of the three axes: one number for all three angles, the same in every system of axes.
  writer.print(",{:.6g}", std::sqrt(covariance.topLeftCorner<3, 3>().diagonal().mean()) * kDegreesPerRadian);
}

void write_local(const ExportView& view, const std::string& path) {
  const bool sigmas = !view.result.frame_covariance.empty(),
             empirical = !view.result.empirical.frame_covariance.empty();
  TextWriter writer(path);
  writer.print("image,frame,camera,x_m,y_m,z_m,omega_deg,phi_deg,kappa_deg,yaw_deg,pitch_deg,roll_deg");
  if (sigmas) writer.print(kSigmaColumns, "x", "y", "z", "");
  if (empirical) writer.print(kSigmaColumns, "x", "y", "z", kEmpirical);
  writer.print("\n");
  for (std::int64_t i = 0; i < view.image_count(); ++i) {
    const Image& image = view.image(i);
    const Pose pose = view.pose(i);
    writer.print("{},{},{},{},{},{}", csv_field(view.image_name(i)),
                 csv_field(view.result.block.frames[image.frame].name),
                 csv_field(view.result.block.cameras[view.camera_index(i)].name), pose.centre.x(), pose.centre.y(),
                 pose.centre.z());
    print_angles(writer, pose.rotation);
    const auto& result = view.result;
    if (sigmas)
      print_sigmas(writer, image_covariance(view, i, result.frame_covariance), Eigen::Quaterniond::Identity());
    if (empirical)
      print_sigmas(writer, image_covariance(view, i, result.empirical.frame_covariance),
                   Eigen::Quaterniond::Identity());
    writer.print("\n");
  }
  writer.close();
}

void write_wgs84(const ExportView& view, const std::string& path) {
  const Georeference georeference(view.result.block.ground);
  TextWriter writer(path);
  const bool sigmas = !view.result.frame_covariance.empty(),
             empirical = !view.result.empirical.frame_covariance.empty();
  writer.print("image,latitude_deg,longitude_deg,height_m,omega_deg,phi_deg,kappa_deg,yaw_deg,pitch_deg,roll_deg");
  if (sigmas) writer.print(kSigmaColumns, "east", "north", "up", "");
  if (empirical) writer.print(kSigmaColumns, "east", "north", "up", kEmpirical);
  writer.print("\n");
  for (std::int64_t i = 0; i < view.image_count(); ++i) {
    const Pose pose = view.pose(i);
    const Geodetic position = georeference.to_geodetic(pose.centre);
    writer.print("{},{:.11f},{:.11f},{:.5f}", csv_field(view.image_name(i)), position.latitude_deg,
                 position.longitude_deg, position.height_m);
    const Eigen::Quaterniond own = georeference.own_from_block(position);
    // R maps axes of the block's frame; R own' maps those of the place of the image.
    print_angles(writer, pose.rotation * own.conjugate());
    if (sigmas) print_sigmas(writer, image_covariance(view, i, view.result.frame_covariance), own);
    if (empirical) print_sigmas(writer, image_covariance(view, i, view.result.empirical.frame_covariance), own);
    writer.print("\n");
  }
  writer.close();
}

// The names of the parameters of all camera models, in the order of their first appearance.
std::vector<std::string> all_parameters(const IndexedVector<CameraIndex, Camera>& cameras) {
  std::vector<std::string> names;
  for (const Camera& camera : cameras)
    for (int p = 0; p < camera.intrinsics.size(); ++p) {
      const std::string name = parameter_name(camera.intrinsics.model(), p);
      if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
    }
  return names;
}

// Writes the table of cameras. Cells of parameters that a camera does not have are empty.
void write_cameras(const BlockResult& result, const std::string& path) {
  const std::vector<std::string> names = all_parameters(result.block.cameras);
  TextWriter writer(path);
  writer.print("name,width,height,model");
  for (const std::string& name : names) writer.print(",{}", name);
  const auto& empirical = result.empirical.camera_covariance;
  if (!result.camera_covariance.empty())
    for (const std::string& name : names) writer.print(",sigma_{}", name);
  if (!empirical.empty())
    for (const std::string& name : names) writer.print(",{}sigma_{}", kEmpirical, name);
  writer.print("\n");
  for (std::size_t c = 0; c < result.block.cameras.size(); ++c) {
    const CameraIndex index(static_cast<std::int64_t>(c));
    const Camera& camera = result.block.cameras[index];
    const Intrinsics& k = result.state.cameras[index];
    writer.print("{},{},{},{}", csv_field(camera.name), camera.width, camera.height, model_name(k.model()));
    for (const std::string& name : names)
      if (const auto p = find_parameter(k.model(), name))
        writer.print(",{}", k[*p]);
      else
        writer.print(",");
    for (const auto* covariances : {&result.camera_covariance, &empirical})
      for (std::size_t i = 0; i < names.size() && !covariances->empty(); ++i)
        if (const auto p = find_parameter(k.model(), names[i]))
          writer.print(",{:.6g}", std::sqrt(std::max(0.0, (*covariances)[index](*p, *p))));
        else
          writer.print(",");
    writer.print("\n");
  }
  writer.close();
}

bool has_rig(const Block& block) {
  return std::any_of(block.rigs.begin(), block.rigs.end(), [](const Rig& rig) { return rig.cameras().size() > 1; });
}

// Writes the mounts of rigs with two or more cameras. The sigmas are along and about the axes of the rig.
void write_mounts(const BlockResult& result, const std::string& path) {
  TextWriter writer(path);
  writer.print("rig,mount,camera,x_m,y_m,z_m,qw,qx,qy,qz");
  if (!result.mount_covariance.empty())
    writer.print(",sigma_x_m,sigma_y_m,sigma_z_m,sigma_rotation_x_deg,sigma_rotation_y_deg,sigma_rotation_z_deg");
  writer.print("\n");
  for (RigIndex r(0); result.block.rigs.contains(r); ++r.value) {
    const Rig& rig = result.block.rigs[r];
    if (rig.cameras().size() < 2) continue;
    for (std::size_t m = 0; m < rig.cameras().size(); ++m) {
      const Pose& pose = result.state.mounts[r][m];
      const Eigen::Quaterniond& q = pose.rotation;
      writer.print("{},{},{}", csv_field(rig.name), m, csv_field(result.block.cameras[rig.mounts[m].camera].name));
      for (const double value : {pose.centre.x(), pose.centre.y(), pose.centre.z(), q.w(), q.x(), q.y(), q.z()})
        writer.print(",{}", value);
      if (!result.mount_covariance.empty()) {
        const PoseIncrement sigma = result.mount_covariance[r][m].diagonal().cwiseSqrt();
        for (const double position : sigma.tail<3>()) writer.print(",{:.6g}", position);
        for (const double rotation : sigma.head<3>()) writer.print(",{:.6g}", rotation * kDegreesPerRadian);
      }
      writer.print("\n");
    }
  }
  writer.close();
}

}  // namespace

void export_csv(const BlockResult& result, const std::string& folder) {
  const ExportView view = make_export_view(result);
  const fs::path root(folder);
  write_pose_csv((root / "frames.csv").string(), pose_table(result.block, result.state));
  write_local(view, (root / "images_local.csv").string());
  if (result.block.ground.georeferenced) write_wgs84(view, (root / "images_wgs84.csv").string());
  write_cameras(result, (root / "cameras.csv").string());
  if (has_rig(result.block)) write_mounts(result, (root / "mounts.csv").string());
}

}  // namespace megablock
