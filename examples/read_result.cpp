// Reads the result of a job: the poses of its frames and how well they are known.
//
//   read_result JOB            poses of all oriented frames with their standard deviations
//   read_result JOB --points   the tie points with their covariances instead
//
// Conventions. The ground frame is right-handed and in metres: east, north, up about the origin of the block. A pose
// holds the rotation ground -> camera (the camera looks along +z, x to the right, y down) and the projection centre in
// the ground frame. The covariance of a frame is that of six numbers: a small rotation about the axes of the ground
// frame in radians (R_adjusted = R Exp(w)), and the centre in metres.
#include <megablock/io/base/error.h>
#include <megablock/io/result/result.h>

#include <cmath>
#include <cstdio>
#include <cstring>
#include <string>

namespace {

using namespace megablock;

constexpr double kDegrees = 180 / 3.14159265358979323846;

// A frame is one pose of a rig; the frame of a single camera is the pose of its image.
void print_frames(const BlockResult& result) {
  std::printf("frame,x_m,y_m,z_m,sigma_x_m,sigma_y_m,sigma_z_m,sigma_rotation_deg\n");
  for (FrameIndex frame(0); result.block.frames.contains(frame); ++frame.value) {
    if (!result.state.oriented[frame]) continue;
    const Pose& pose = result.state.frames[frame];
    std::printf("%s,%.4f,%.4f,%.4f", result.block.frames[frame].name.c_str(), pose.centre.x(), pose.centre.y(),
                pose.centre.z());
    if (result.frame_covariance.empty()) {
      std::printf(",,,,\n");  // the job was run without covariances
      continue;
    }
    const BlockResult::Matrix6& covariance = result.frame_covariance[frame];
    const Eigen::Matrix<double, 6, 1> sigma = covariance.diagonal().cwiseSqrt();
    std::printf(",%.4f,%.4f,%.4f,%.5f\n", sigma[3], sigma[4], sigma[5],
                kDegrees * std::sqrt(covariance.topLeftCorner<3, 3>().trace() / 3));
  }
}

void print_points(const BlockResult& result) {
  std::printf("x_m,y_m,z_m,images,c_xx_m2,c_xy_m2,c_xz_m2,c_yy_m2,c_yz_m2,c_zz_m2\n");
  for (std::size_t track = 0; track < result.points.size(); ++track) {
    const Eigen::Vector3d& point = result.points[track];
    if (!point.allFinite() || result.point_covariance.empty()) continue;  // not intersected
    const Eigen::Matrix3d& c = result.point_covariance[track];
    std::printf("%.4f,%.4f,%.4f,%lld,%.3g,%.3g,%.3g,%.3g,%.3g,%.3g\n", point.x(), point.y(), point.z(),
                static_cast<long long>(result.tracks.begin[track + 1] - result.tracks.begin[track]), c(0, 0), c(0, 1),
                c(0, 2), c(1, 1), c(1, 2), c(2, 2));
  }
}

}  // namespace

int main(int argc, char** argv) {
  const bool points = argc == 3 && std::strcmp(argv[2], "--points") == 0;
  if (argc != 2 && !points) {
    std::fprintf(stderr, "usage: read_result JOB [--points]\n");
    return 2;
  }
  try {
    const BlockResult result = read_result(std::string(argv[1]) + "/result/block.h5");
    points ? print_points(result) : print_frames(result);
  } catch (const Error& error) {
    std::fprintf(stderr, "read_result: %s\n", error.what());
    return 1;
  }
}
