// Holds the rows of a file of positions of images, as every reader of such files fills it. Internal to io/.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace megablock {

inline constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();

// The meaning of three angles, in degrees. Yaw counts clockwise from north.
enum class AngleKind : std::uint8_t {
  kBody,           // yaw, pitch, roll; pitch 0 = nadir (geometry/transform/body_attitude.h)
  kGimbal,         // yaw, pitch, roll; pitch -90 = nadir (YawPitchRoll of geometry/transform/rotation.h)
  kOmegaPhiKappa,  // relative to the axes of the grid (OmegaPhiKappa of geometry/transform/rotation.h)
  kRotation,       // no angles but a quaternion or matrix, relative to the axes of the grid or of the block
};

struct PositionTable {
  struct Row {
    std::string where;          // file:line
    std::string image;          // as the file writes it; empty: found by number or time
    std::int64_t number = -1;   // of the exposure, as the camera counts; -1: none
    double time_s = kNoNumber;  // GPS time (without leap seconds), seconds since 1970-01-01, or of the week
    // In the system `crs` (x = easting or longitude, y = northing or latitude); z NaN: unknown. Of the antenna or of
    // the camera, as the file has it.
    Eigen::Vector3d place = Eigen::Vector3d::Constant(kNoNumber);
    double sigma_horizontal_m = kNoNumber, sigma_vertical_m = kNoNumber;
    bool zero_sigma = false;  // the file states a sigma of 0 for the position, which counts as not stated
    // Camera minus antenna at this exposure: east, north, up, metres. It is not yet in `place`.
    Eigen::Vector3d offset_m = Eigen::Vector3d::Zero();
    Eigen::Vector3d angles_deg = Eigen::Vector3d::Constant(kNoNumber);  // in the order of their kind; NaN: none
    AngleKind angles = AngleKind::kBody;
    // In place of the angles, relative to the axes that their kind states: R_cw, to those of the camera or rig.
    std::optional<Eigen::Quaterniond> rotation;
    double sigma_tilt_deg = kNoNumber, sigma_heading_deg = kNoNumber;
    std::optional<std::int64_t> pass;  // number of the drive or flight line
  };
  // How the rows belong to images: each names its image, each is one exposure, they are epochs of a path between
  // which images are interpolated, or they stand in the order of the images.
  enum class Kind : std::uint8_t { kImages, kExposures, kPath, kOrdered } kind = Kind::kImages;
  std::string crs = "WGS84";
  std::vector<Row> rows;
  std::vector<std::string> notes;  // for the user, one line each
  // A row without sigmas in a file that states others is no observation but a start value (trajectories.h).
  bool states_sigmas = false, states_angle_sigmas = false;
};

// What the project file says of a file.
struct PositionOptions {
  std::string format = {};  // its name in the table of formats; empty: recognised
  std::string crs = {};     // overrides that of the file
  std::map<std::string, std::string> columns =
      {};                                // field (position_columns.h) -> name or number (from 1) of the column
  std::optional<AngleKind> angles = {};  // where the file does not say what its angles are
  std::string accuracy = {};             // file with the sigmas of an SBET (sbet.cpp)
};

// One file with all that the project says of it.
struct TableSource {
  std::string path, where;  // where: of its section in the project file
  std::string folder;       // of the images that the file belongs to; empty: not stated
  PositionOptions options;
  std::optional<double> sigma_horizontal, sigma_vertical;  // metres, in place of those of the file
  double time_offset_s = kNoNumber;                        // GPS time minus time of the headers
};

}  // namespace megablock
