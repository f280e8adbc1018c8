// A file of each format of docs/reference/positions.md, as its program writes it, with what its values mean.
#include "io/project/positions/position_formats.h"

#include <gmock/gmock.h>

#include <functional>

#include "io/base/error.h"
#include "io/project/positions/position_columns.h"
#include "io/project/positions/position_fields.h"
#include "tests/support/io/position_texts.h"

namespace megablock {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using TableKind = PositionTable::Kind;

class PositionFormats : public fixture::PositionTexts {};

// From the documentation of ODM, with a line of each length.
const std::string kGeo =
    "EPSG:4326\n"
    "DJI_0028.JPG\t-91.9942096111111\t46.84252125\t198.609\n"
    "DJI_0032.JPG -91.9938293055556 46.8424584444444\n"
    "# a comment\n"
    "DJI_0033.JPG -91.9938 46.8424 198.609 30 5 -1\n"
    "DJI_0034.JPG -91.9938 46.8424 198.609 0 0 0 0.02 0.05 strip 3\n";

TEST_F(PositionFormats, GeoOfOdm) {
  const PositionTable table = read("geo.txt", kGeo);
  EXPECT_EQ(table.kind, TableKind::kImages);
  EXPECT_EQ(table.crs, "EPSG:4326");
  ASSERT_THAT(table.rows, SizeIs(4));
  EXPECT_EQ(table.rows[0].image, "DJI_0028.JPG");
  EXPECT_EQ(table.rows[0].place, Eigen::Vector3d(-91.9942096111111, 46.84252125, 198.609));
  EXPECT_TRUE(std::isnan(table.rows[1].place.z()));
  EXPECT_FALSE(table.rows[2].angles_deg.allFinite());
  EXPECT_TRUE(std::isnan(table.rows[2].sigma_horizontal_m));
  EXPECT_EQ(table.rows[3].sigma_horizontal_m, 0.02);
  EXPECT_EQ(table.rows[3].sigma_vertical_m, 0.05);
  EXPECT_THAT(table.notes, ElementsAre(HasSubstr("geo.txt: its angles are not used")));
  const PositionTable with = read("geo.txt", kGeo, {.angles = AngleKind::kBody});
  EXPECT_EQ(with.rows[2].angles_deg, Eigen::Vector3d(30, 5, -1));
  EXPECT_THAT(with.notes, IsEmpty());
}

// Appendix B.1 of the manual of RTKLIB; the last line has no sigmas of its own.
const std::string kPosHead =
    "% program   : RTKPOST ver.2.4.2\n"
    "% inp file  : rover.obs\n"
    "% obs start : 2019/06/19 08:00:00.0 GPST (week2058 288000.0s)\n"
    "% ref pos   : 48.1 11.5 500\n%\n"
    "% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp,ns=# of satellites)\n"
    "%  GPST                  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)  sdne(m)  "
    "sdeu(m)  sdun(m) age(s)  ratio\n";
const std::string kPosRows =
    "2019/06/19 08:00:00.000   48.117266300   11.516700000   545.1234   1  12   0.0051   0.0043   0.0098   0.0012  "
    "-0.0010   0.0020   0.00   99.9\n"
    "2019/06/19 08:00:00.200   48.117276300   11.516710000   545.2234   2  12   0.0000   0.0000   0.0000   0.0000   "
    "0.0000   0.0000   0.00    1.9\n";

TEST_F(PositionFormats, PathOfRtklib) {
  const PositionTable table = read("flight.pos", kPosHead + kPosRows);
  EXPECT_EQ(table.kind, TableKind::kPath);
  EXPECT_EQ(table.crs, "WGS84");
  ASSERT_THAT(table.rows, SizeIs(2));
  EXPECT_EQ(table.rows[0].place, Eigen::Vector3d(11.5167, 48.1172663, 545.1234));
  EXPECT_DOUBLE_EQ(table.rows[0].time_s, 1560931200);  // date -u -d '2019-06-19 08:00:00' +%s, without leap seconds
  EXPECT_DOUBLE_EQ(table.rows[0].time_s, gps_week_seconds(2058, 288000)) << "as the file says itself";
  EXPECT_EQ(table.rows[0].sigma_horizontal_m, 0.0051);
  EXPECT_EQ(table.rows[0].sigma_vertical_m, 0.0098);
  EXPECT_EQ(table.rows[1].sigma_horizontal_m, 0.5) << "of a float solution";
  EXPECT_EQ(read("flight_events.pos", kPosHead + kPosRows).kind, TableKind::kExposures);
}

TEST_F(PositionFormats, OtherTimesAndPlacesOfRtklib) {
  const auto one = [&](const std::string& columns, const std::string& row, const std::string& system = "") {
    return read("a.pos", "% (" + system + ",Q=1:fix)\n%  " + columns + "   Q  ns   sdn(m)   sde(m)   sdu(m)\n" + row);
  };
  const std::string degrees = "latitude(deg) longitude(deg)  height(m)", rest = " 48.5 11.25 545 1 12 0.01 0.01 0.02\n";
  // 2019: GPS is 18 s ahead of UTC; JST is 9 h ahead of UTC.
  EXPECT_DOUBLE_EQ(one("UTC " + degrees, "2019/06/19 08:00:00.000" + rest).rows[0].time_s, 1560931218);
  EXPECT_DOUBLE_EQ(one("JST " + degrees, "2019/06/19 17:00:00.000" + rest).rows[0].time_s, 1560931218);
  EXPECT_DOUBLE_EQ(one("GPST " + degrees, "2058 288000.500" + rest).rows[0].time_s, 1560931200.5);
  EXPECT_EQ(one("GPST " + degrees, "2058 288000.500" + rest, "lat/lon/height=WGS84/geodetic").crs, "EPSG:4326+5773");
  const PositionTable dms = one("GPST latitude(d'\") longitude(d'\")  height(m)",
                                "2019/06/19 08:00:00.000 -48 30 36.0 11 15 0.0 545 1 12 0.01 0.01 0.02\n");
  EXPECT_NEAR(dms.rows[0].place.y(), -48.51, 1e-12);
  EXPECT_NEAR(dms.rows[0].place.x(), 11.25, 1e-12);
  const PositionTable ecef =
      one("GPST x-ecef(m) y-ecef(m) z-ecef(m)",
          "2024/05/18 00:00:00.000 3655334.3694 1403901.2189 5018038.3221 2 8 1.158 0.6265 1.2637\n");
  EXPECT_EQ(ecef.crs, "EPSG:4978");
  EXPECT_EQ(ecef.rows[0].place, Eigen::Vector3d(3655334.3694, 1403901.2189, 5018038.3221));
  EXPECT_EQ(ecef.rows[0].sigma_horizontal_m, 1.2637);
  EXPECT_THAT(refusal("b.pos", "%  GPST   e-baseline(m) n-baseline(m) u-baseline(m) Q\n2058 1 1 2 3 1 9\n"),
              HasSubstr("b.pos: the header names no positions"));
  EXPECT_THAT(refusal("b.pos", kPosHead + "2019/06/19 48.1 11.5 545 1\n"), HasSubstr("b.pos:8: 5 fields in this line"));
  EXPECT_THAT(refusal("b.pos", kPosHead + "2019-06-19 08:00:00.0 48.1 11.5 545 1 9 1 1 1\n"),
              HasSubstr("b.pos:8: '2019-06-19 08:00:00.0' is no time"));
  EXPECT_THAT(refusal("b.pos", kPosHead + "2019/06/19 08:00:00.0 48.1 x 545 1 9 1 1 1\n"),
              HasSubstr("b.pos:8: longitude: 'x' is not a number"));
}

// Lines of a Phantom 4 RTK.
const std::string kMrk =
    "1\t373434.034125\t[2047]\t    -8,N\t    -3,E\t   193,V\t45.12345678,Lat\t7.12345678,Lon\t283.394,Ellh\t"
    "0.010123, 0.009123, 0.021234\t50,Q\n"
    "2\t373437.136500\t[2047]\t   -12,N\t     5,E\t   190,V\t45.12355678,Lat\t7.12355678,Lon\t283.404,Ellh\t"
    "1.210123, 1.409123, 2.821234\t16,Q\n";

TEST_F(PositionFormats, ExposuresOfDji) {
  const PositionTable table = read("100_0001_Timestamp.MRK", kMrk);
  EXPECT_EQ(table.kind, TableKind::kExposures);
  ASSERT_THAT(table.rows, SizeIs(2));
  EXPECT_EQ(table.rows[0].number, 1);
  EXPECT_EQ(table.rows[0].place, Eigen::Vector3d(7.12345678, 45.12345678, 283.394));
  EXPECT_EQ(table.rows[0].offset_m, Eigen::Vector3d(-0.003, -0.008, -0.193)) << "east, north, up; the file counts down";
  EXPECT_EQ(table.rows[0].sigma_horizontal_m, 0.010123);
  EXPECT_EQ(table.rows[0].sigma_vertical_m, 0.021234);
  // Week 2047 began on 2019-03-31, a Sunday.
  EXPECT_DOUBLE_EQ(table.rows[0].time_s, calendar_seconds(2019, 3, 31, 373434.034125));
  EXPECT_EQ(table.rows[1].sigma_vertical_m, 2.821234);
  EXPECT_THAT(refusal("a.MRK", kMrk + "3\t373440.1\t[2047]\t 1,N\n"), HasSubstr("a.MRK:3: has no value 'Lon'"));
}

TEST_F(PositionFormats, ReferenceOfMetashape) {
  const std::string text =
      "# CoordinateSystem: PROJCS[\"WGS 84 / UTM zone 15N\",GEOGCS[\"WGS 84\",DATUM[\"World Geodetic System 1984\","
      "SPHEROID[\"WGS 84\",6378137,298.257223563]],PRIMEM[\"Greenwich\",0],UNIT[\"degree\",0.01745329251994328]],"
      "PROJECTION[\"Transverse_Mercator\"],PARAMETER[\"latitude_of_origin\",0],PARAMETER[\"central_meridian\",-93],"
      "PARAMETER[\"scale_factor\",0.9996],PARAMETER[\"false_easting\",500000],PARAMETER[\"false_northing\",0],"
      "UNIT[\"metre\",1]]\n"
      "#Label,X/East,Y/North,Z/Altitude,Accuracy_X/Y_(m),Accuracy_Z_(m),Yaw,Pitch,Roll,Error_(m),X_error,Y_error,"
      "Z_error,X_est,Y_est,Z_est\n"
      "DJI_0018.JPG,576700.1,5188000.5,198.31,0.020000,0.030000,45.0,0.1,0.0,1.5,0.1,0.1,1.4,576700.2,5188000.6,199\n"
      "DJI_0019.JPG,,,,,,,,,,,,,576710.2,5188000.6,199\n"
      "# Total Error\n"
      ",,,,,,,,,1.5,0.1,0.1,1.4\n";
  const PositionTable table = read("reference.txt", text);
  EXPECT_THAT(table.crs, ::testing::StartsWith("PROJCS["));
  ASSERT_THAT(table.rows, SizeIs(1)) << "an image without reference has no row, and the totals have none";
  EXPECT_EQ(table.rows[0].place, Eigen::Vector3d(576700.1, 5188000.5, 198.31)) << "not the estimated ones";
  EXPECT_EQ(table.rows[0].sigma_horizontal_m, 0.02);
  EXPECT_EQ(table.rows[0].sigma_vertical_m, 0.03);
  EXPECT_EQ(table.rows[0].angles_deg, Eigen::Vector3d(45, 0.1, 0));
  EXPECT_EQ(table.rows[0].angles, AngleKind::kBody);
  const PositionTable old =
      read("old.csv", "#Label,X/Longitude,Y/Latitude,Z/Altitude\nDJI_0018.JPG,-91.99,46.84,198.31\n");
  EXPECT_EQ(old.crs, "WGS84");
  EXPECT_EQ(old.rows[0].place, Eigen::Vector3d(-91.99, 46.84, 198.31));
  EXPECT_THAT(refusal("e.csv", "#Label,X/East,Y/North,Z/Altitude\na.jpg,1,2,3\n"),
              HasSubstr("e.csv:1: the file does not name its coordinate reference system"));
}

// The examples of support.pix4d.com.
TEST_F(PositionFormats, GeolocationOfPix4d) {
  const PositionTable plain = read("geo.csv", "IMG_3165.JPG,46.2345612,6.5611445,539.931\n");
  EXPECT_EQ(plain.crs, "WGS84");
  EXPECT_EQ(plain.rows[0].place, Eigen::Vector3d(6.5611445, 46.2345612, 539.931)) << "latitude stands first";
  const PositionTable accurate = read("geo.csv", "IMG_3165.JPG,46.2345612,6.5611445,539.931,0.02,0.04\n");
  EXPECT_EQ(accurate.rows[0].sigma_horizontal_m, 0.02);
  EXPECT_EQ(accurate.rows[0].sigma_vertical_m, 0.04);
  const std::string nine = "IMG_3165.JPG,46.2345612,6.5611445,539.931,38.6,3.5,8.3,0.02,0.04\n";
  const PositionTable unsaid = read("geo.csv", nine);
  EXPECT_FALSE(unsaid.rows[0].angles_deg.allFinite());
  EXPECT_EQ(unsaid.rows[0].sigma_vertical_m, 0.04);
  EXPECT_THAT(unsaid.notes, ElementsAre(HasSubstr("its angles are not used")));
  const PositionTable matic = read("geo.csv", "#imagename,coordinate1,coordinate2,z,yaw,pitch,roll\n" + nine);
  EXPECT_EQ(matic.rows[0].angles, AngleKind::kBody);
  EXPECT_EQ(matic.rows[0].angles_deg, Eigen::Vector3d(38.6, 3.5, 8.3));
  const PositionTable mapper = read("geo.csv", nine, {.angles = AngleKind::kOmegaPhiKappa});
  EXPECT_EQ(mapper.rows[0].angles, AngleKind::kOmegaPhiKappa);
  const PositionTable grid = read("geo.csv", "IMG_3165.JPG,474191.175,5091809.612,539.931\n", {.crs = "EPSG:32632"});
  EXPECT_EQ(grid.crs, "EPSG:32632");
  EXPECT_EQ(grid.rows[0].place, Eigen::Vector3d(474191.175, 5091809.612, 539.931));
  EXPECT_THAT(refusal("g.csv", "IMG_3165.JPG,474191.175,5091809.612,539.931\n"),
              HasSubstr("g.csv:1: 474191.175, 5091809.612 are no latitude and longitude; add 'crs: EPSG:...'"));
  EXPECT_THAT(refusal("g.csv", "IMG_3165.JPG,46,6,539.931\nIMG_3166.JPG,46,6,539.931,1\n"),
              HasSubstr("g.csv:2: 5 fields in this line"));
}

TEST_F(PositionFormats, TablesWithHeaders) {
  struct Case {
    const char *what, *header, *row;
  };
  // What common programs write; all mean 46.84 N, 91.99 W, 198.31 m.
  const std::vector<Case> cases = {
      {"exiftool -csv -n", "SourceFile,GPSAltitude,GPSLatitude,GPSLongitude", "images/1.JPG,198.31,46.84,-91.99"},
      {"exiftool -csv", "SourceFile,GPSAltitude,GPSLatitude,GPSLongitude",
       "images/1.JPG,198.31,\"46 deg 50' 24.00\"\" N\",\"91 deg 59' 24.00\"\" W\""},
      {"our own", "image,latitude_deg,longitude_deg,height_m", "images/1.JPG,46.84,-91.99,198.31"},
      {"semicolons and decimal commas", "Name;Latitude;Longitude;Altitude [m]", "images/1.JPG;46,84;-91,99;198,31"},
      {"tabs", "Label\tLon\tLat\tAlt", "images/1.JPG\t-91.99\t46.84\t198.31"},
      {"in a comment", "# filename,lat,lon,alt", "images/1.JPG,46.84,-91.99,198.31"}};
  for (const Case& c : cases) {
    const PositionTable table = read("t.csv", std::string(c.header) + "\r\n" + c.row + "\r\n");
    EXPECT_EQ(table.crs, "WGS84") << c.what;
    ASSERT_THAT(table.rows, SizeIs(1)) << c.what;
    EXPECT_EQ(table.rows[0].image, "images/1.JPG") << c.what;
    EXPECT_LT((table.rows[0].place - Eigen::Vector3d(-91.99, 46.84, 198.31)).norm(), 1e-9) << c.what;
  }
  const PositionTable all = read("t.csv",
                                 "# crs: EPSG:25832\nName,Easting,Northing,Height,sd_E,sd_N,sd_U,Omega,Phi,Kappa\n"
                                 "1.jpg,500000,5300000,600,0.02,0.03,0.05,1,-2,90\n2.jpg,500000,5300000,nan,0,,,,,\n");
  EXPECT_EQ(all.crs, "EPSG:25832");
  EXPECT_EQ(all.rows[0].sigma_horizontal_m, 0.03);
  EXPECT_EQ(all.rows[0].sigma_vertical_m, 0.05);
  EXPECT_EQ(all.rows[0].angles, AngleKind::kOmegaPhiKappa);
  EXPECT_EQ(all.rows[0].angles_deg, Eigen::Vector3d(1, -2, 90));
  EXPECT_TRUE(std::isnan(all.rows[1].place.z()) && std::isnan(all.rows[1].sigma_horizontal_m));
  EXPECT_EQ(read("t.csv", "name,lat,lon,gimbal_yaw,gimbal_pitch,gimbal_roll\n1.jpg,1,2,3,-90,0\n").rows[0].angles,
            AngleKind::kGimbal);
  EXPECT_THAT(refusal("t.csv", "name,x,y\n1.jpg,1,2\n"), HasSubstr("t.csv:1: the columns x and y need a coordinate"));
  EXPECT_THAT(refusal("t.csv", "name,lat,lon\n1.jpg,46.8,x\n"), HasSubstr("t.csv:2: longitude: 'x' is no angle"));
  EXPECT_THAT(refusal("t.csv", "name,lat,lon,accuracy\n1.jpg,46.8,9,-1\n"),
              HasSubstr("t.csv:2: sigma must lie in [1e-08, 1e+06], not -1; write a standard deviation, or leave the "
                        "field empty if it is not known"));
}

TEST_F(PositionFormats, UnitsInTheNamesOfColumnsAreConverted) {
  const auto row = [&](const std::string& columns, const std::string& values) {
    return read("t.csv", "name,lat,lon," + columns + "\n1.jpg,46.8,-92," + values + "\n").rows.at(0);
  };
  for (const char* feet : {"altitude (ft)", "altitude [ft]", "altitude_ft", "Height (feet)", "altitude(feet)", "z_ft"})
    EXPECT_DOUBLE_EQ(row(feet, "1000").place.z(), 304.8) << feet;
  for (const char* feet : {"Height [us-ft]", "height (US survey feet)", "height_us_ft"})
    EXPECT_DOUBLE_EQ(row(feet, "3937").place.z(), 1200) << feet;
  EXPECT_DOUBLE_EQ(row("height_cm", "30480").place.z(), 304.8);
  for (const char* metres : {"Height", "height_m", "Altitude (m)", "altitude [WGS84]", "Height (ellipsoidal) [m]"})
    EXPECT_EQ(row(metres, "1000").place.z(), 1000) << metres;
  EXPECT_EQ(row("altitude_ft,altitude_m", "1000,304").place.z(), 304) << "metres need no conversion";
  EXPECT_DOUBLE_EQ(row("accuracy (cm)", "5").sigma_horizontal_m, 0.05);
  EXPECT_DOUBLE_EQ(row("sigma_mm", "20").sigma_vertical_m, 0.02);
  EXPECT_DOUBLE_EQ(row("sigma_heading (arcmin)", "30").sigma_heading_deg, 0.5);
  const Eigen::Vector3d angles = row("omega (rad),phi_rad,kappa [mrad]", "0.1,-0.2,1500").angles_deg;
  EXPECT_LT((angles - 57.29577951308232 * Eigen::Vector3d(0.1, -0.2, 1.5)).norm(), 1e-12);
}

TEST_F(PositionFormats, UnitsOfXAndYAreThoseOfTheirSystem) {
  const std::string text = "name,Easting (ft),Northing (ft)\n1.jpg,1640416.75,17388333.5\n";
  EXPECT_THAT(refusal("t.csv", text, {.crs = "EPSG:32632"}),
              HasSubstr("t.csv:1: column 'Easting (ft)' is in ft, and the coordinate reference system 'EPSG:32632' is "
                        "not; name a system in this unit with 'crs', or convert"));
  EXPECT_THAT(refusal("t.csv", text, {.crs = "local"}), HasSubstr("column 'Easting (ft)' is in ft"));
  const PositionTable table = read("t.csv", text, {.crs = "+proj=utm +zone=32 +datum=WGS84 +units=us-ft"});
  EXPECT_EQ(table.rows.at(0).place.head<2>(), Eigen::Vector2d(1640416.75, 17388333.5));
  const PositionOptions named = {.crs = "EPSG:32632", .columns = {{"image", "name"}, {"x", "Ost [ft]"}, {"y", "3"}}};
  EXPECT_THAT(refusal("t.csv", "name,Ost [ft],Nord\n1.jpg,500000,5300000\n", named),
              HasSubstr("column 'Ost [ft]' is in ft"));
}

TEST_F(PositionFormats, RowsWithMoreFieldsThanNamesAreRefused) {
  const PositionOptions local = {.crs = "local"};
  const std::string head = "image,x,y,z\n";
  EXPECT_THAT(
      refusal("t.csv", head + "f.jpg,953,53,1974,31,599,42\n", local),
      HasSubstr("t.csv:2: 7 fields under 4 names of columns; decimal commas need semicolons or tabs between the "
                "fields"));
  EXPECT_THAT(read("t.csv", head + "f.jpg,953.53,1974.31,599.42,,\n", local).rows, SizeIs(1))
      << "empty ones at the end";
  EXPECT_THAT(refusal("t.csv", "image;x;y;z\nf.jpg;953,53;1974,31;599,42;sharp\n", local),
              HasSubstr("t.csv:2: 5 fields under 4 names of columns; name every column"));
  const PositionOptions numbers = {.crs = "local", .columns = {{"image", "1"}, {"x", "2"}, {"y", "3"}, {"z", "5"}}};
  EXPECT_THAT(read("t.csv", "image,x,y\nf.jpg,953.53,1974.31,good,599.42\n", numbers).rows, SizeIs(1))
      << "the project names a column that the header does not";
}

TEST_F(PositionFormats, RowsThatAreCutAreNamed) {
  const std::string head = "image,x,y,z\n", good = "f.jpg,953.53,1974.31,599.42\n";
  const PositionTable table = read("t.csv", head + good + "g.jpg,953.5\nh.jpg\n", {.crs = "local"});
  EXPECT_THAT(table.rows, SizeIs(1));
  EXPECT_THAT(table.notes, ElementsAre(HasSubstr("t.csv:3: the line ends after 2 of 4 fields, before its image or "
                                                 "coordinates, and is not used (2 such lines in all)")));
  EXPECT_THAT(read("t.csv", head + good + "g.jpg,,,\n", {.crs = "local"}).notes, IsEmpty())
      << "programs write images without position so";
}

TEST_F(PositionFormats, HeightsAboveTheTakeOffAreNone) {
  for (const std::string name : {"relative_altitude", "RelativeAltitude", "height_above_takeoff(feet)"}) {
    const PositionTable table = read("t.csv", "name,lat,lon," + name + "\n1.jpg,46.8,-92,80\n");
    EXPECT_TRUE(std::isnan(table.rows.at(0).place.z()));
    EXPECT_THAT(table.notes, ElementsAre(HasSubstr("t.csv:1: column '" + name +
                                                   "' counts from the take-off and is no "
                                                   "height; give heights above the ellipsoid")));
  }
  EXPECT_THAT(read("t.csv", "name,lat,lon,alt,RelativeAltitude\n1.jpg,46.8,-92,280,80\n").notes, IsEmpty());
}

TEST_F(PositionFormats, ColumnsThatTheProjectNames) {
  const PositionOptions names = {.crs = "EPSG:25832",
                                 .columns = {{"image", "Bild"}, {"x", "Rechtswert"}, {"y", "Hochwert"}, {"z", "4"}}};
  const PositionTable table = read("t.csv", "Bild;Rechtswert;Hochwert;Hoehe\n1.jpg;500000,5;5300000;600\n", names);
  ASSERT_THAT(table.rows, SizeIs(1));
  EXPECT_EQ(table.rows[0].place, Eigen::Vector3d(500000.5, 5300000, 600));
  const PositionOptions numbers = {.crs = "EPSG:25832", .columns = {{"image", "2"}, {"x", "3"}, {"y", "4"}}};
  EXPECT_THAT(read("t.csv", "7,1.jpg,500000.5,5300000\n8,2.jpg,500001,5300000\n", numbers).rows, SizeIs(2))
      << "no header";
  EXPECT_THAT(read("t.csv", "id,file,e,n\n7,1.jpg,500000.5,5300000\n", numbers).rows, SizeIs(1));
  EXPECT_THAT(refusal("t.csv", "Bild;x;y\n1.jpg;1;2\n", {.columns = {{"image", "Foto"}}}),
              HasSubstr("t.csv: columns.image: the header has no column 'Foto'"));
}

TEST_F(PositionFormats, RefusalsListTheNamesOfTheHeader) {
  const std::string german = "Bild;Rechtswert;Hochwert;Hoehe\n1.jpg;500000,5;5300000;600\n";
  EXPECT_THAT(refusal("t.csv", german),
              HasSubstr("; its columns are 'Bild', 'Rechtswert', 'Hochwert', 'Hoehe', of which "
                        "none, or too few, are known as image and position; say which they "
                        "are with 'columns: {image: ..., x: ..., y: ..., z: ...}'"));
  EXPECT_THAT(refusal("t.csv", german, {.columns = {{"image", "Bild"}}}),
              HasSubstr("t.csv:1: the header names no columns of image (or time) and position; its names are 'Bild', "
                        "'Rechtswert', 'Hochwert', 'Hoehe'; name them in the project file: "));
  EXPECT_THAT(refusal("t.csv", german, {.format = "columns"}), HasSubstr("its names are 'Bild', 'Rechtswert'"));
}

TEST_F(PositionFormats, AreToldApartByTheirContents) {
  EXPECT_EQ(format_of("a.txt", kGeo), "odm_geo");
  EXPECT_EQ(format_of("a.txt", "WGS84 UTM 15N\nDJI_0028.JPG,576700,5188000,198\n"), "odm_geo");
  EXPECT_EQ(format_of("a.txt", kPosHead + kPosRows), "rtklib");
  EXPECT_EQ(format_of("a.txt", kMrk), "mrk");
  EXPECT_EQ(format_of("a.txt", "#Label,X/Longitude,Y/Latitude,Z/Altitude\nDJI_0018,1,2,3\n"), "metashape");
  EXPECT_EQ(format_of("a.txt", "IMG_3165.JPG,46.2345612,6.5611445,539.931\n"), "pix4d");
  EXPECT_EQ(format_of("a.txt", "name,lat,lon\n1.jpg,1,2\n"), "columns");
  // Lists of control points and other texts are none of these.
  EXPECT_EQ(format_of("a.txt", "WGS84 UTM 11N\n391430.5 5820112.25 45.5 10.5 20 IMG_0022.jpg 1\n"), "none");
  EXPECT_EQ(format_of("a.txt", "name,x,z\n"), "none");
  EXPECT_THAT(refusal("a.txt", "these are words\n"),
              HasSubstr("a.txt: is in no format of positions that is known (mrk, "));
  EXPECT_THAT(refusal("a.txt", ""), HasSubstr("a.txt: the file is empty"));
  EXPECT_THAT(refusal("a.txt", "EPSG:4326\n", {.format = "odm_geo"}), HasSubstr("a.txt: the file has no positions"));
  EXPECT_THAT(refusal("a.txt", kGeo, {.format = "odm"}), HasSubstr("format 'odm' is not one of: mrk, rtklib"));
}

TEST(PositionFields, LeapSecondsAreThoseOfTheIers) {
  EXPECT_EQ(leap_seconds(calendar_seconds(1998, 12, 31, 0)), 12);
  EXPECT_EQ(leap_seconds(calendar_seconds(2006, 6, 1, 0)), 14);
  EXPECT_EQ(leap_seconds(calendar_seconds(2016, 12, 31, 0)), 17);
  EXPECT_EQ(leap_seconds(calendar_seconds(2024, 1, 1, 0)), 18);
}

TEST(PositionFields, DegreesInEveryForm) {
  for (const char* text : {"46.84", "46 50 24", "46 50' 24.00\" N", "46 deg 50' 24.00\" N",
                           "46\xc2\xb0"
                           "50'24\"N",
                           "N 46 50.4"})
    EXPECT_NEAR(position_degrees(text, Separator::kComma, "latitude", "f:1"), 46.84, 1e-9) << text;
  for (const char* text : {"-46.84", "-46 50 24", "46 50 24 S"})
    EXPECT_NEAR(position_degrees(text, Separator::kComma, "latitude", "f:1"), -46.84, 1e-9) << text;
  EXPECT_NEAR(position_degrees("-0 30 0", Separator::kBlanks, "latitude", "f:1"), -0.5, 1e-12);
}

}  // namespace
}  // namespace megablock
