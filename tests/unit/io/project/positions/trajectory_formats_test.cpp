// A file of each format of trajectories of docs/reference/positions.md, as its program writes it, with what its values
// mean.
#include <gmock/gmock.h>

#include <cmath>
#include <fstream>
#include <numbers>

#include "geometry/numbers/angles.h"
#include "geometry/transform/rotation.h"
#include "io/base/error.h"
#include "io/project/positions/position_formats.h"
#include "io/project/positions/row_pose.h"
#include "tests/support/io/position_texts.h"

namespace megablock {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using TableKind = PositionTable::Kind;

const Eigen::Vector3d kNorth(0, 1, 0), kEast(1, 0, 0), kUp(0, 0, 1);
// The axes of a camera or rig in those that its rotation refers to.
Eigen::Vector3d ahead(const PositionTable::Row& row) { return rotation_of(row).conjugate() * Eigen::Vector3d::UnitZ(); }
Eigen::Vector3d right(const PositionTable::Row& row) { return rotation_of(row).conjugate() * Eigen::Vector3d::UnitX(); }

class TrajectoryFormats : public fixture::PositionTexts {};

std::string bytes_of(const std::vector<std::vector<double>>& records) {
  std::string bytes;
  for (const std::vector<double>& record : records)
    bytes.append(reinterpret_cast<const char*>(record.data()), record.size() * sizeof(double));
  return bytes;
}

// Time, latitude, longitude, height, velocities, roll, pitch, heading, wander angle, accelerations, rates.
std::vector<double> sbet_record(double time, double heading_deg, double wander_deg = 0) {
  return {time,
          48.1 * kDegree,
          11.5 * kDegree,
          545 + time / 1000,
          10,
          0,
          0,
          2 * kDegree,
          3 * kDegree,
          heading_deg * kDegree,
          wander_deg * kDegree,
          0,
          0,
          9.8,
          0,
          0,
          0};
}

TEST_F(TrajectoryFormats, SbetOfPospac) {
  const std::string sbet =
      bytes_of({sbet_record(126000, 90), sbet_record(126000.005, 90.1), sbet_record(126000.01, 90)});
  EXPECT_EQ(format_of("sbet_drive.out", sbet), "sbet");
  PositionOptions options;
  options.angles = AngleKind::kGimbal;
  const PositionTable table = read("sbet_drive.out", sbet, options);
  EXPECT_EQ(table.kind, TableKind::kPath);
  EXPECT_EQ(table.crs, "WGS84");
  ASSERT_THAT(table.rows, SizeIs(3));
  EXPECT_THAT(table.notes, IsEmpty());
  EXPECT_EQ(table.rows[1].time_s, 126000.005);
  EXPECT_LT((table.rows[0].place - Eigen::Vector3d(11.5, 48.1, 671)).norm(), 1e-9);
  // Heading east, nose 3 degrees up, right wing 2 degrees down.
  const Eigen::Vector3d nose(std::cos(3 * kDegree), 0, std::sin(3 * kDegree));
  EXPECT_LT((ahead(table.rows[0]) - nose).norm(), 1e-9);
  EXPECT_LT(right(table.rows[0]).z(), 0);
  EXPECT_NEAR(right(table.rows[0]).z(), -std::sin(2 * kDegree) * std::cos(3 * kDegree), 1e-9);
  EXPECT_FALSE(table.states_sigmas);
}

TEST_F(TrajectoryFormats, SbetWithAccuraciesAndWanderAngle) {
  PositionOptions options;
  options.accuracy = folder_.path("smrmsg_drive.out");
  fixture::write_file(options.accuracy, bytes_of({{126000, 0.02, 0.03, 0.05, 0, 0, 0, 0.6, 0.9, 3},
                                                  {126001, 0.04, 0.01, 0.06, 0, 0, 0, 1.2, 0.3, 6}}));
  const PositionTable table =
      read("sbet.out", bytes_of({sbet_record(126000.1, 120, 30), sbet_record(126000.9, 120, 30)}), options);
  EXPECT_TRUE(table.states_sigmas);
  EXPECT_EQ(table.rows[0].sigma_horizontal_m, 0.03);
  EXPECT_EQ(table.rows[0].sigma_vertical_m, 0.05);
  EXPECT_NEAR(table.rows[0].sigma_tilt_deg, 0.015, 1e-12);
  EXPECT_NEAR(table.rows[0].sigma_heading_deg, 0.05, 1e-12);
  EXPECT_EQ(table.rows[1].sigma_horizontal_m, 0.04);
  EXPECT_NEAR(table.rows[0].angles_deg[0], 90, 1e-9);
  EXPECT_THAT(table.notes, ElementsAre(HasSubstr("wander angles of up to 30")));
  fixture::write_file(options.accuracy, bytes_of({{86000, 0.02, 0.03, 0.05, 0, 0, 0, 0.6, 0.9, 3}}));
  EXPECT_THAT(refusal("sbet.out", bytes_of({sbet_record(126000.1, 120)}), options),
              HasSubstr("smrmsg_drive.out: has no record within a second"));
}

TEST_F(TrajectoryFormats, SbetThatIsCutOrNone) {
  const std::string sbet = bytes_of({sbet_record(126000, 90), sbet_record(126001, 90)});
  PositionOptions options;
  options.format = "sbet";
  EXPECT_THAT(refusal("sbet.out", sbet.substr(0, 200), options), HasSubstr("its 200 bytes are no multiple of 136"));
  EXPECT_THAT(refusal("sbet.out", bytes_of({sbet_record(126001, 90), sbet_record(126000, 90)})),
              HasSubstr("sbet.out: record 2: is no record of an SBET"));
  EXPECT_THAT(refusal("sbet.out", "a text\n", options),
              HasSubstr("sbet.out: is a text; a file of format 'sbet' is binary"));
  EXPECT_EQ(format_of("noise.bin", std::string(136, '\0').replace(8, 8, "\xff\xff\xff\xff\xff\xff\xef\x7f")), "none");
}

// As the export wizard of Inertial Explorer writes it, with its usual lines before the columns.
const std::string kInertialText =
    "Project:     drive\n"
    "Program:     Inertial Explorer Version 8.90\n"
    "Profile:     Street\n"
    "Datum:       WGS84,  (processing datum)\n"
    "\n"
    "      GPSTime       Latitude      Longitude      H-Ell    Heading     Pitch      Roll  SDNorth  SDEast SDHeight  "
    "RollSD PitchSD HdngSD\n"
    "        (sec)          (deg)          (deg)        (m)      (deg)     (deg)     (deg)      (m)     (m)      (m)   "
    "(deg)   (deg)  (deg)\n"
    "   126000.000  48.1000000000  11.5000000000    545.123   91.00000   0.50000  -0.25000    0.008   0.007    0.012  "
    "0.0050  0.0060 0.0200\n"
    "   126000.100  48.1000000000  11.5000010000    545.125   91.10000   0.50000  -0.25000    0.009   0.007    0.012  "
    "0.0050  0.0060 0.0200\n";

TEST_F(TrajectoryFormats, TextOfInertialExplorer) {
  EXPECT_EQ(format_of("drive.txt", kInertialText), "inertial");
  const PositionTable table = read("drive.txt", kInertialText);
  EXPECT_EQ(table.kind, TableKind::kPath);
  ASSERT_THAT(table.rows, SizeIs(2));
  const PositionTable::Row& row = table.rows[1];
  EXPECT_EQ(row.time_s, 126000.1);
  EXPECT_EQ(row.place, Eigen::Vector3d(11.500001, 48.1, 545.125));
  EXPECT_EQ(row.angles_deg, Eigen::Vector3d(91.1, 0.5, -0.25));
  EXPECT_EQ(row.sigma_horizontal_m, 0.009);
  EXPECT_EQ(row.sigma_vertical_m, 0.012);
  EXPECT_EQ(row.sigma_tilt_deg, 0.006);
  EXPECT_EQ(row.sigma_heading_deg, 0.02);
  EXPECT_TRUE(table.states_sigmas && table.states_angle_sigmas);
  EXPECT_THAT(
      refusal("drive.txt", "Project: drive\n GPSTime Latitude Longitude H-Ell\n 126000 48 06 0.0 11 30 0.0 545\n"),
      HasSubstr("drive.txt:3: 8 fields under 4 names of columns; export angles in decimal degrees"));
}

TEST_F(TrajectoryFormats, TextWithUnitsInTheLineUnderTheNames) {
  const PositionTable table = read("drive.txt",
                                   "GPSTime Latitude Longitude H-Ell SDHeight\n(sec) (deg) (deg) (ft) (ft)\n"
                                   "126000 48.1 11.5 1000 0.1\n");
  EXPECT_DOUBLE_EQ(table.rows.at(0).place.z(), 304.8);
  EXPECT_DOUBLE_EQ(table.rows[0].sigma_vertical_m, 0.03048);
}

TEST_F(TrajectoryFormats, TextWithEastingAndNorthingNeedsASystem) {
  const std::string text =
      "POSPac export\nTIME EASTING NORTHING HEIGHT OMEGA PHI KAPPA\n126000.0 690000.5 5330000.25 545.1 0.5 -0.25 90\n";
  EXPECT_THAT(refusal("eo.txt", text), HasSubstr("eo.txt:2: easting and northing need a coordinate reference system"));
  PositionOptions options;
  options.crs = "EPSG:32632";
  const PositionTable table = read("eo.txt", text, options);
  EXPECT_EQ(table.crs, "EPSG:32632");
  ASSERT_THAT(table.rows, SizeIs(1));
  EXPECT_EQ(table.rows[0].place, Eigen::Vector3d(690000.5, 5330000.25, 545.1));
  EXPECT_EQ(table.rows[0].angles, AngleKind::kOmegaPhiKappa);
}

// The camera looks to the north, its right to the east: axes right, down, ahead are east, -up, north.
TEST_F(TrajectoryFormats, TrajectoryOfTum) {
  const double half = std::sqrt(0.5);
  const std::string text = "# timestamp tx ty tz qx qy qz qw\n1305031102.1758 1.3405 0.6266 1.6575 " +
                           std::to_string(-half) + " 0 0 " + std::to_string(half) + "\n";
  EXPECT_EQ(format_of("groundtruth.txt", text), "tum");
  const PositionTable table = read("groundtruth.txt", text);
  EXPECT_EQ(table.kind, TableKind::kPath);
  EXPECT_EQ(table.crs, "local");
  ASSERT_THAT(table.rows, SizeIs(1));
  EXPECT_EQ(table.rows[0].time_s, 1305031102.1758);
  EXPECT_EQ(table.rows[0].place, Eigen::Vector3d(1.3405, 0.6266, 1.6575));
  EXPECT_LT((ahead(table.rows[0]) - kNorth).norm(), 1e-5);
  EXPECT_LT((right(table.rows[0]) - kEast).norm(), 1e-5);
  EXPECT_THAT(refusal("groundtruth.txt", text + "1305031102.2 1 2 3 0 0 0\n"),
              HasSubstr("groundtruth.txt:3: 7 fields in this line; expected time tx ty tz qx qy qz qw"));
  EXPECT_THAT(refusal("groundtruth.txt", text + "1305031102.2 1 2 3 0 0 0 2\n"), HasSubstr("is not a unit quaternion"));
}

TEST_F(TrajectoryFormats, PosesOfKitti) {
  // The second frame stands 2 m ahead, 1 m to the right and 0.5 m higher, and looks to the right.
  const std::string text = "1 0 0 0 0 1 0 0 0 0 1 0\n0 0 1 1 0 1 0 -0.5 -1 0 0 2\n";
  EXPECT_EQ(format_of("00.txt", text), "kitti");
  const PositionTable table = read("00.txt", text);
  EXPECT_EQ(table.kind, TableKind::kOrdered);
  EXPECT_EQ(table.crs, "local");
  ASSERT_THAT(table.rows, SizeIs(2));
  EXPECT_LT((ahead(table.rows[0]) - kNorth).norm(), 1e-12);
  EXPECT_LT((right(table.rows[0]) - kEast).norm(), 1e-12);
  EXPECT_LT((table.rows[1].place - Eigen::Vector3d(1, 2, 0.5)).norm(), 1e-12);
  EXPECT_LT((ahead(table.rows[1]) - kEast).norm(), 1e-12);
  EXPECT_THAT(refusal("00.txt", text + "1 0 0 0 0 2 0 0 0 0 1 0\n"), HasSubstr("00.txt:3: the first three columns"));
}

TEST_F(TrajectoryFormats, TableWithTimesAndQuaternions) {
  const std::string text =
      "# crs: local\ntime_s;pass;qw;qx;qy;qz;x;y;z;sigma_horizontal_m;sigma_vertical_m;sigma_rotation_deg\n"
      "10,5;3;1;0;0;0;1,25;2;3;0,02;0,05;0,03\n11,5;3;1;0;0;0;2;2;3;;;\n";
  EXPECT_EQ(format_of("drive.csv", text), "columns");
  const PositionTable table = read("drive.csv", text);
  EXPECT_EQ(table.kind, TableKind::kPath);
  ASSERT_THAT(table.rows, SizeIs(2));
  EXPECT_EQ(table.rows[0].time_s, 10.5);
  EXPECT_EQ(table.rows[0].pass, 3);
  EXPECT_EQ(table.rows[0].place.x(), 1.25);
  EXPECT_EQ(table.rows[0].sigma_tilt_deg, 0.03);
  EXPECT_EQ(table.rows[0].sigma_heading_deg, 0.03);
  EXPECT_TRUE(table.states_sigmas);
  EXPECT_TRUE(std::isnan(table.rows[1].sigma_horizontal_m));
  const PositionTable weeks = read("week.csv", "week,gps_seconds,lat,lon,height\n2160,100.5,48,11,500\n");
  EXPECT_EQ(weeks.rows.at(0).time_s, 315964800 + 2160 * 604800.0 + 100.5);
}

}  // namespace
}  // namespace megablock
