// Positions and attitudes of files in a project: from the text to the priors of the frames.
#include <gmock/gmock.h>

#include <cmath>

#include "geometry/numbers/angles.h"
#include "geometry/transform/rotation.h"
#include "io/base/error.h"
#include "io/block/crs.h"
#include "io/project/input_search.h"
#include "io/project/pose_sources.h"
#include "io/project/project.h"
#include "io/project/project_init.h"
#include "tests/support/io/image_files.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

using fixture::gps_tags;
using fixture::joined;
using fixture::message_of;
using fixture::Tags;
using fixture::write_file;
using fixture::write_image_file;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

// Four images in a row to the east near 46.84 N 91.99 W, 2 s apart, with header positions of 250 m height.
class ProjectPositions : public ::testing::Test {
 protected:
  ProjectPositions() {
    for (int i = 0; i < 4; ++i) write(i, gps_tags(46.84, -91.99 + 0.0002 * i, 250));
  }
  void write(int i, const Tags& tags) {
    const std::string second = std::to_string(30 + 2 * i);
    write_image_file(folder_.path("images/100_0001_000" + std::to_string(i + 1) + ".JPG"), 64, 48, i,
                     joined(tags, {{"Exif.Photo.DateTimeOriginal", "2021:06:01 05:20:" + second}}));
  }
  Project read(const std::string& name, const std::string& text, const std::string& more = "") {
    write_file(folder_.path(name), text);
    write_file(folder_.path("block.yaml"),
               "images: images\n" + (more.starts_with("positions") ? more : "positions: " + name + "\n" + more));
    return read_project(folder_.path("block.yaml"));
  }
  std::string refusal(const std::string& name, const std::string& text, const std::string& more = "") {
    std::string message = message_of<InputError>([&] { read(name, text, more); });
    for (std::size_t at; (at = message.find(folder_.path() + "/")) != std::string::npos;)
      message.erase(at, folder_.path().size() + 1);
    return message;
  }
  static const PositionPrior& prior(const Project& project, std::int64_t i) {
    return *project.block.frames[FrameIndex(i)].position_prior;
  }
  static Eigen::Vector3d local(const Project& project, const Geodetic& place) {
    return Georeference(project.block.ground).to_local(place);
  }
  ScratchDirectory folder_;
};

TEST_F(ProjectPositions, TakeThePlaceOfThoseInTheHeaders) {
  const Project project = read("geo.txt",
                               "EPSG:4326\n100_0001_0001.JPG -91.99001 46.84001 203 0 0 0 0.02 0.05\n"
                               "images/100_0001_0002.jpg -91.98981 46.84001 203\n100_0001_0003 -91.98961 46.84001\n"
                               "100_0001_0009.JPG -91.9 46.8 200\n");
  EXPECT_LT((prior(project, 0).position - local(project, {46.84001, -91.99001, 203})).norm(), 1e-6);
  EXPECT_EQ(prior(project, 0).sigma, Eigen::Vector3d(0.02, 0.02, 0.05));
  EXPECT_EQ(prior(project, 1).sigma, Eigen::Vector3d(3, 3, 6));
  EXPECT_EQ(prior(project, 2).sigma, Eigen::Vector3d(3, 3, 1000)) << "no height";
  EXPECT_FALSE(project.block.frames[FrameIndex(3)].position_prior) << "positions of headers may have another datum";
  EXPECT_THAT(
      project.warnings,
      ElementsAre(HasSubstr("geo.txt:5: 1 of 4 lines are not used, because the block has no such image"),
                  HasSubstr("block.yaml:2: 1 of 4 images have no position in the files of 'positions'"),
                  HasSubstr("1 of 3 images with a position have no height there (the first is '100_0001_0003.JPG'")));
  EXPECT_THAT(project.found,
              ElementsAre("positions: 3 of 4 images from geo.txt, sigma 0.02 to 3 m, vertical 0.05 to 1e+03 m",
                          "attitudes: none"));
}

TEST_F(ProjectPositions, HaveSigmasFromTheSectionAndFromGps) {
  const std::string geo = "EPSG:4326\n100_0001_0001.JPG -91.99 46.84 250 0 0 0 0.02 0.05\n";
  const auto sigma = [&](const std::string& more) { return prior(read("geo.txt", geo, more), 0).sigma; };
  EXPECT_EQ(sigma("positions: {file: geo.txt, sigma_horizontal_m: 0.1, sigma_vertical_m: 0.2}\n"),
            Eigen::Vector3d(0.1, 0.1, 0.2));
  EXPECT_EQ(sigma("gps: {use: false, sigma_vertical_m: 0.3}\n"), Eigen::Vector3d(0.02, 0.02, 0.3))
      << "gps.use is about the headers";
}

TEST_F(ProjectPositions, WithASigmaOfZeroAreToldOf) {
  const std::string file =
      "name,lat,lon,height,accuracy\n100_0001_0001,46.84,-91.99,250,0.02\n100_0001_0002,46.84,-91.9898,250,0\n"
      "100_0001_0003,46.84,-91.9896,250,0.0\n100_0001_0004,46.84,-91.9894,250,\n";
  const Project project = read("zero.csv", file);
  EXPECT_EQ(prior(project, 1).sigma, Eigen::Vector3d(3, 3, 6));
  EXPECT_THAT(project.warnings,
              ElementsAre(HasSubstr("zero.csv:3: 2 of 4 lines state a sigma of 0, which counts as not stated (default "
                                    "3 m, vertical 6 m); write the sigmas that are true, or hold the positions with "
                                    "'gps: {sigma_horizontal_m: 0, sigma_vertical_m: 0}'")));
  EXPECT_THAT(read("zero.csv", file, "gps: {sigma_horizontal_m: 0, sigma_vertical_m: 0}\n").warnings, IsEmpty());
  EXPECT_THAT(read("geo.txt", "EPSG:4326\n100_0001_0001 -91.99 46.84 250 0 0 0 0 0.05\n").warnings,
              Contains(HasSubstr("geo.txt:2: 1 of 1 lines state a sigma of 0")));
}

TEST_F(ProjectPositions, InAnySystemWithHeightsAboveTheGeoid) {
  std::optional<CrsToWgs84> crs;
  try {
    crs.emplace("EPSG:32615+5773");
  } catch (const InputError&) {
    GTEST_SKIP() << "the grid of EGM96 is not installed";
  }
  const Geodetic place{46.84, -91.99, 250};
  const Eigen::Vector3d grid = crs->from_wgs84(place);
  EXPECT_GT(std::abs(grid.z() - 250), 20) << "the geoid is some 30 m below the ellipsoid here";
  char line[128];
  std::snprintf(line, sizeof line, "100_0001_0001.JPG,%.4f,%.4f,%.4f\n", grid.x(), grid.y(), grid.z());
  const Project project = read("p4d.csv", line, "positions: {file: p4d.csv, crs: EPSG:32615+5773}\n");
  EXPECT_LT((prior(project, 0).position - local(project, place)).norm(), 1e-3);
}

// RTKLIB writes earth-centred coordinates if told so.
TEST_F(ProjectPositions, InTheEarthCentredFrame) {
  const Eigen::Vector3d place = CrsToWgs84("EPSG:4978").from_wgs84({46.84, -91.99, 250});
  std::string text = "% (x/y/z-ecef=WGS84,Q=1:fix)\n%  GPST  x-ecef(m) y-ecef(m) z-ecef(m) Q ns sdx(m) sdy(m) sdz(m)\n";
  for (int e = 0; e < 4; ++e) {
    char line[160];
    std::snprintf(line, sizeof line, "2021/06/01 10:20:%02d.000 %.4f %.4f %.4f 1 9 0.01 0.02 0.03\n", 48 + 2 * e,
                  place.x() + e, place.y(), place.z());
    text += line;
  }
  const Project project = read("a_events.pos", text);
  EXPECT_LT((prior(project, 0).position - local(project, {46.84, -91.99, 250})).norm(), 1e-3);
  EXPECT_NEAR((prior(project, 3).position - prior(project, 0).position).norm(), 3, 1e-3);
  EXPECT_EQ(prior(project, 0).sigma, Eigen::Vector3d(0.03, 0.03, 0.03));
}

// DJI's own positions are those of the camera; a better solution is that of the antenna, and gets the offsets.
TEST_F(ProjectPositions, OfExposuresOfDjiWithAndWithoutPpk) {
  std::string mrk;
  for (int e = 0; e < 4; ++e) {
    char line[200];
    std::snprintf(line, sizeof line,
                  "%d\t%.6f\t[2160]\t  100,N\t  -50,E\t  200,V\t46.84000000,Lat\t%.8f,Lon\t250.000,Ellh\t0.010, 0.012, "
                  "0.020\t50,Q\n",
                  e + 1, 210048.5 + 2 * e, -91.99 + 0.0002 * e);
    mrk += line;
  }
  const Project rtk = read("images/100_0001_Timestamp.MRK", mrk);
  EXPECT_LT((prior(rtk, 2).position - local(rtk, {46.84, -91.9896, 250})).norm(), 1e-6)
      << "offsets are applied already";
  EXPECT_EQ(prior(rtk, 2).sigma, Eigen::Vector3d(0.012, 0.012, 0.02));
  std::string pos = "%  GPST latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)\n";
  for (int e = 0; e < 60; ++e) {
    char line[200];
    std::snprintf(line, sizeof line, "2160 %.3f 46.840000000 %.9f 203.0000 1 9 0.005 0.006 0.01\n", 210045 + 0.2 * e,
                  -91.99 + 0.0001 * (0.2 * e - 3.5));  // 0.0001 degrees a second, as the images
    pos += line;
  }
  write_file(folder_.path("flight.pos"), pos);
  const Project ppk = read("images/100_0001_Timestamp.MRK", mrk,
                           "positions: {file: flight.pos, exposures: images/100_0001_Timestamp.MRK}\n");
  const Eigen::Vector3d camera = local(ppk, {46.84, -91.9896, 203}) + Eigen::Vector3d(-0.05, 0.1, -0.2);
  EXPECT_LT((prior(ppk, 2).position - camera).norm(), 1e-3);
  EXPECT_EQ(prior(ppk, 2).sigma, Eigen::Vector3d(0.006, 0.006, 0.01));
  EXPECT_THAT(ppk.warnings, IsEmpty());
  // Without the exposures the times of the headers count: 05:20:30 is 10:20:48 of GPS at UTC-5.
  const Project by_time = read("flight.pos", pos);
  EXPECT_LT((prior(by_time, 0).position - local(by_time, {46.84, -91.99 - 0.00005, 203})).norm(), 0.02);
  EXPECT_NEAR(prior(by_time, 0).sigma.x(), 0.3 * 7.62, 0.03) << "0.3 s of flight, because times are whole seconds";
  EXPECT_THAT(by_time.warnings, Contains(HasSubstr("flight.pos: the clock of the camera is taken as UTC-05:00")));
}

TEST_F(ProjectPositions, OfSeveralFilesAreSeveralFlights) {
  write_image_file(folder_.path("images/b/1.JPG"), 64, 48, 9, gps_tags(46.84, -91.99, 250));
  write_file(folder_.path("a.txt"), "EPSG:4326\n100_0001_0001.JPG -91.99 46.84 250\n");
  write_file(folder_.path("b.txt"), "EPSG:4326\nb/1.JPG -91.989 46.84 251\n");
  const Project project = read("c.txt", "x", "positions: [a.txt, {file: b.txt, sigma_vertical_m: 0.1}]\n");
  EXPECT_EQ(prior(project, 0).sigma.z(), 6);
  EXPECT_EQ(prior(project, 4).sigma.z(), 0.1);
  EXPECT_THAT(refusal("c.txt", "EPSG:4326\n100_0001_0001.JPG -91.99 46.84 250\n", "positions: [a.txt, c.txt]\n"),
              HasSubstr("block.yaml:2: image '100_0001_0001.JPG' has a position in 'a.txt' and in 'c.txt'"));
}

TEST_F(ProjectPositions, OfEqualNamesBelongToTheFolderOfTheirFile) {
  write_image_file(folder_.path("images/b/100_0001_0001.JPG"), 64, 48, 9);
  write_image_file(folder_.path("images/c/100_0001_0001.JPG"), 64, 48, 10);
  write_file(folder_.path("images/b/geo.txt"), "EPSG:4326\n100_0001_0001 -91.99 46.84 250 0 0 0 0.1 0.1\n");
  write_file(folder_.path("c.txt"), "EPSG:4326\n100_0001_0001 -91.98 46.84 250 0 0 0 0.2 0.2\n");
  const Project project = read("d.txt", "x", "positions: [images/b/geo.txt, {file: c.txt, images: c}]\n");
  EXPECT_FALSE(project.block.frames[FrameIndex(0)].position_prior);
  EXPECT_EQ(prior(project, 4).sigma.z(), 0.1);
  EXPECT_EQ(prior(project, 5).sigma.z(), 0.2);
  write_image_file(folder_.path("images/b/2.JPG"), 64, 48, 11);
  write_image_file(folder_.path("images/c/2.JPG"), 64, 48, 12);
  EXPECT_THAT(refusal("c.txt", "EPSG:4326\n2 -91.98 46.84 250\n"),
              HasSubstr("c.txt:2: several images of the block have the name '2'; write it with its folder"));
}

TEST_F(ProjectPositions, CarryAttitudes) {
  // Pix4D: 90, 0, 0 is nadir with the top of the image to the east.
  const Project project =
      read("p.csv", "#image,lat,lon,alt,yaw,pitch,roll\n100_0001_0001.JPG,46.84,-91.99,250,90,0,0\n",
           "origin: [46.84, -91.99, 250]\n");
  const Eigen::Matrix3d expected = (Eigen::Matrix3d() << 0, -1, 0, -1, 0, 0, 0, 0, -1).finished();
  ASSERT_TRUE(project.block.frames[FrameIndex(0)].attitude_prior);
  EXPECT_LT((project.block.frames[FrameIndex(0)].attitude_prior->rotation_cw.toRotationMatrix() - expected).norm(),
            1e-9);
  EXPECT_THAT(project.found, Contains("attitudes: 1 of 4 images from p.csv, sigma 3 degrees, heading 10"));
}

// Kappa 0: the top of the image points to grid north, which lies east of true north west of the central meridian in the
// northern hemisphere only by its sign: g = atan(tan(dl) sin(lat)), known in closed form on the sphere.
TEST_F(ProjectPositions, TurnOmegaPhiKappaByTheConvergenceOfTheMeridians) {
  const Geodetic place{46.84, -91.99, 250};
  const Eigen::Vector3d grid = CrsToWgs84("EPSG:32615").from_wgs84(place);  // central meridian 93 W
  char line[160];
  std::snprintf(line, sizeof line, "name,x,y,z,omega,phi,kappa\n100_0001_0001.JPG,%.4f,%.4f,250,0,0,0\n", grid.x(),
                grid.y());
  const Project project =
      read("opk.csv", line, "positions: {file: opk.csv, crs: EPSG:32615}\norigin: [46.84, -91.99, 250]\n");
  const auto& attitude = project.block.frames[FrameIndex(0)].attitude_prior;
  ASSERT_TRUE(attitude);
  const Eigen::Vector3d top = attitude->rotation_cw.conjugate() * -Eigen::Vector3d::UnitY();
  const double convergence = std::atan(std::tan(1.01 * kDegree) * std::sin(46.84 * kDegree));  // clockwise from true
  EXPECT_NEAR(std::atan2(top.x(), top.y()) / kDegree, convergence / kDegree, 1e-3);
  EXPECT_LT((attitude->rotation_cw.conjugate() * Eigen::Vector3d::UnitZ() - Eigen::Vector3d(0, 0, -1)).norm(), 1e-6);
}

TEST_F(ProjectPositions, InTheBlocksOwnFrame) {
  const Project project =
      read("local.csv", "name,x,y,z,accuracy\n100_0001_0001.JPG,1.5,2.5,3.5,0.003\n100_0001_0002.JPG,2,2,3,0.003\n",
           "positions: {file: local.csv, crs: local}\n");
  EXPECT_FALSE(project.block.ground.georeferenced);
  EXPECT_EQ(prior(project, 0).position, Eigen::Vector3d(1.5, 2.5, 3.5));
  EXPECT_EQ(prior(project, 0).sigma, Eigen::Vector3d(0.003, 0.003, 0.003));
  EXPECT_FALSE(project.block.frames[FrameIndex(2)].position_prior);
}

TEST_F(ProjectPositions, DoNotTellTheOriginOfLocalControl) {
  const std::string head = "name,role,x,y,z,sigma_horizontal_m,sigma_vertical_m,image,column_px,row_px,sigma_px\n";
  const std::string geo = "EPSG:4326\n100_0001_0001.JPG -91.99 46.84 250\n";
  const auto warned = Contains(HasSubstr("the coordinates of the control are local, and the project names no origin"));
  write_file(folder_.path("control.csv"),
             "# crs: local\n" + head + "a,control,1,2,3,0.01,0.04,100_0001_0001.JPG,9,9,1\n");
  EXPECT_THAT(read("geo.txt", geo, "control: control.csv\n").warnings, warned);
  EXPECT_THAT(read("geo.txt", geo, "control: control.csv\norigin: [46.84, -91.99, 250]\n").warnings, Not(warned));
  write_file(folder_.path("control.csv"),
             "# crs: EPSG:4326\n" + head + "a,control,-91.99,46.84,3,0.01,0.04,100_0001_0001.JPG,9,9,1\n");
  EXPECT_THAT(read("geo.txt", geo, "control: control.csv\n").warnings, Not(warned));
}

TEST_F(ProjectPositions, FarFromTheHeadersAreToldOf) {
  std::string geo = "EPSG:4326\n";
  for (int i = 1; i <= 4; ++i) geo += "100_0001_000" + std::to_string(i) + ".JPG -91.99 46.85 250\n";
  EXPECT_THAT(read("geo.txt", geo).warnings,
              Contains(HasSubstr("geo.txt: its positions lie 1114 m (median) from those of the image headers")));
}

// 250 m are 820 feet.
TEST_F(ProjectPositions, WithHeightsFarFromTheHeadersAreToldOf) {
  const auto geo = [](const std::string& height) {
    std::string text = "EPSG:4326\n";
    for (int i = 0; i < 4; ++i)
      text += "100_0001_000" + std::to_string(i + 1) + " " + std::to_string(-91.99 + 0.0002 * i) + " 46.84 " + height +
              "\n";
    return text;
  };
  EXPECT_THAT(read("geo.txt", geo("820.2")).warnings,
              ElementsAre(HasSubstr("geo.txt: its heights are 570 m (median) above those of the image headers; check "
                                    "whether they are in feet")));
  EXPECT_THAT(read("geo.txt", geo("80")).warnings, ElementsAre(HasSubstr("its heights are 170 m (median) below")));
  EXPECT_THAT(read("geo.txt", geo("203")).warnings, IsEmpty()) << "above the geoid";
}

TEST_F(ProjectPositions, WithoutHeightsAreToldOf) {
  const auto told = [](const std::string& source) {
    return ElementsAre(
        HasSubstr("2 of 4 images with a position have no height there (the first is "
                  "'100_0001_0002.JPG', from " +
                  source + "): each gets that of the origin with a sigma of 1000 m; give heights"));
  };
  const std::string file =
      "name,lat,lon,height\n100_0001_0001,46.84,-91.99,250\n100_0001_0002,46.84,-91.9898\n"
      "100_0001_0003,46.84,-91.9896,nan\n100_0001_0004,46.84,-91.9894,250\n";
  EXPECT_THAT(read("heights.csv", file).warnings, told("heights.csv"));
  for (int i = 1; i < 3; ++i) {
    Tags flat = gps_tags(46.84, -91.99 + 0.0002 * i, 250);
    flat.erase("Exif.GPSInfo.GPSAltitude");
    write(i, flat);
  }
  write_file(folder_.path("block.yaml"), "images: images\n");
  EXPECT_THAT(read_project(folder_.path("block.yaml")).warnings, told("EXIF"));
}

TEST_F(ProjectPositions, RefusalsNameFileAndLine) {
  const std::string good = "EPSG:4326\n100_0001_0001.JPG -91.99 46.84 250\n";
  EXPECT_EQ(refusal("geo.txt", good), "");
  EXPECT_THAT(refusal("geo.txt", good + "100_0001_0001 -91.99 46.84 250\n"),
              HasSubstr("geo.txt:3: image '100_0001_0001' has a position in geo.txt:2 already"));
  EXPECT_THAT(refusal("geo.txt", "EPSG:4326\nX.JPG -91.99 46.84 250\n"),
              HasSubstr("geo.txt:2: the block has none of the images of this file (the first is 'X.JPG')"));
  EXPECT_THAT(refusal("geo.txt", "EPSG:999999\n100_0001_0001.JPG -91.99 46.84 250\n"),
              HasSubstr("geo.txt: coordinate reference system 'EPSG:999999' is not known to PROJ"));
  EXPECT_EQ(refusal("geo.txt", "EPSG:4326\n100_0001_0001.JPG 46.84 -91.99 250\n"),
            "geo.txt:2: latitude -91.99 is out of range [-90, 90]; are latitude and longitude exchanged?");
  EXPECT_EQ(refusal("geo.txt", "EPSG:4258\n100_0001_0001.JPG 46.84 -91.99 250\n"),
            "geo.txt:2: latitude -91.99 is out of range [-90, 90]; are latitude and longitude exchanged?");
  EXPECT_EQ(refusal("geo.txt", "EPSG:4326\n100_0001_0001.JPG -91.99 146.84 250\n"),
            "geo.txt:2: latitude 146.84 is out of range [-90, 90]; correct it");
  EXPECT_THAT(refusal("geo.txt", "EPSG:4326\n100_0001_0001.JPG 576700 5188000 250\n"),
              HasSubstr("geo.txt:2: longitude 576700 is out of range [-180, 180]; correct it, or name the coordinate"));
  EXPECT_THAT(refusal("geo.txt", good, "positions: none.txt\n"),
              HasSubstr("block.yaml:2: positions: file 'none.txt' does not exist"));
  EXPECT_THAT(refusal("geo.txt", good, "positions: {format: odm_geo}\n"),
              HasSubstr("block.yaml:2: key 'file' is missing"));
  EXPECT_THAT(refusal("geo.txt", good, "positions: {file: geo.txt, angles: degrees}\n"),
              HasSubstr("block.yaml:2: angles: 'degrees' is not one of: yaw_pitch_roll, gimbal, omega_phi_kappa"));
  EXPECT_THAT(refusal("geo.txt", good, "positions: {file: geo.txt, columns: {img: a}}\n"),
              HasSubstr("block.yaml:2: columns: 'img' is not one of: image, latitude"));
  EXPECT_THAT(refusal("geo.txt", good, "positions: {file: geo.txt, sigma_m: 1}\n"), HasSubstr("unknown key 'sigma_m'"));
  EXPECT_THAT(refusal("geo.txt", good, "positions: {file: geo.txt, exposures: geo.txt}\n"),
              HasSubstr("block.yaml:2: 'exposures' is for a _Timestamp.MRK of DJI"));
}

TEST_F(ProjectPositions, OfOneReceiverWithoutUpdatesAreOne) {
  for (int i = 0; i < 4; ++i) write(i, gps_tags(46.84, -91.99, 198));
  write_file(folder_.path("block.yaml"), "images: images\n");
  const Project project = read_project(folder_.path("block.yaml"));
  int priors = 0;
  for (const Frame& frame : project.block.frames) priors += frame.position_prior.has_value();
  EXPECT_EQ(priors, 0);
  EXPECT_TRUE(project.block.ground.georeferenced);
  EXPECT_NEAR(project.block.ground.latitude_deg, 46.84, 1e-9);
  EXPECT_NEAR(project.block.ground.height_m, 198, 1e-9);
  EXPECT_THAT(project.warnings,
              ElementsAre(HasSubstr("4 of 4 images share one position (46.840000, -91.990000), as from a "
                                    "receiver without updates; it is used as one")));
}

class InitFinds : public ProjectPositions {
 protected:
  std::string summary() {
    InitOptions options;
    options.images = folder_.path("images");
    options.output = folder_.path("block.yaml");
    std::filesystem::remove(options.output);
    return init_project(options);
  }
  std::string project() { return fixture::read_file(folder_.path("block.yaml")); }
};

TEST_F(InitFinds, WhereThePositionsComeFrom) {
  EXPECT_THAT(summary(), HasSubstr("\npositions: 4 of 4 images from EXIF, sigma 3 m, vertical 6 m (not stated there)"
                                   "\nattitudes: none"));
  EXPECT_THAT(project(), HasSubstr("# positions: 4 of 4 images from EXIF"));
  for (int i = 0; i < 4; ++i)
    write(i, joined(gps_tags(46.84, -91.99 + 0.0002 * i, 250), {{"Xmp.drone-dji.RtkFlag", i == 3 ? "34" : "50"},
                                                                {"Xmp.drone-dji.RtkStdLon", i == 3 ? "0.4" : "0.011"},
                                                                {"Xmp.drone-dji.RtkStdLat", "0.01"},
                                                                {"Xmp.drone-dji.RtkStdHgt", "0.02"},
                                                                {"Xmp.drone-dji.GimbalYawDegree", "10"},
                                                                {"Xmp.drone-dji.GimbalPitchDegree", "-90"},
                                                                {"Xmp.drone-dji.GimbalRollDegree", "0"}}));
  EXPECT_THAT(summary(), HasSubstr("\npositions: 3 of 4 images from EXIF, RTK fixed, sigma 0.011 m, vertical 0.02 m"
                                   "\npositions: 1 of 4 images from EXIF, RTK float, sigma 0.4 m, vertical 0.02 m"
                                   "\nattitudes: 4 of 4 images from XMP (drone-dji), sigma 3 degrees, heading 10"));
}

TEST_F(InitFinds, FilesBesideTheImages) {
  write_file(folder_.path("geo.txt"), "EPSG:4326\n100_0001_0001.JPG -91.99 46.84 203 0 0 0 0.02 0.05\n");
  write_file(folder_.path("gcp_list.txt"), "EPSG:4326\n-91.99 46.84 203 5 6 100_0001_0001.JPG a\n");
  EXPECT_THAT(summary(), HasSubstr("1 control point"));
  EXPECT_THAT(project(), HasSubstr("\npositions: \"geo.txt\"  # geo.txt of OpenDroneMap\n"));
  EXPECT_THAT(project(), HasSubstr("\ncontrol: \"gcp_list.txt\"\n"));
  EXPECT_EQ(read_project(folder_.path("block.yaml")).block.control_points.size(), 1U);
}

TEST_F(InitFinds, TablesThatAreNamedGeo) {
  write_file(folder_.path("geo.txt"), "name,lat,lon,height\n100_0001_0001.JPG,46.84,-91.99,203\n");
  EXPECT_THAT(summary(), HasSubstr("\nfound: positions: geo.txt (table with a header)"));
  EXPECT_THAT(project(), HasSubstr("\npositions: \"geo.txt\"  # table with a header\n"));
}

TEST_F(InitFinds, ExposuresWithTheSolutionOfTheirFlight) {
  std::string mrk, pos = "%  GPST latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)\n";
  for (int e = 0; e < 4; ++e)
    mrk += std::to_string(e + 1) + "\t" + std::to_string(210048.5 + 2 * e) +
           "\t[2160]\t1,N\t1,E\t1,V\t46.84,Lat\t-91.99,Lon\t250,Ellh\t0.01, 0.01, 0.02\t50,Q\n";
  for (int e = 0; e < 12; ++e) pos += "2160 " + std::to_string(210046 + e) + " 46.84 -91.99 203 1 9 0.005 0.006 0.01\n";
  write_file(folder_.path("images/100_0001_Timestamp.MRK"), mrk);
  summary();
  EXPECT_THAT(project(), HasSubstr("\npositions: \"images/100_0001_Timestamp.MRK\"  # exposures of DJI"));
  write_file(folder_.path("images/100_0001_Rinex.pos"), pos);
  summary();
  EXPECT_THAT(project(), HasSubstr("\npositions: {file: \"images/100_0001_Rinex.pos\", exposures: "
                                   "\"images/100_0001_Timestamp.MRK\"}"));
}

// A file that does not fit is named, and left to the user.
TEST_F(InitFinds, FilesThatDoNotFitAreNotUsed) {
  write_file(folder_.path("geo.txt"), "EPSG:4326\nOTHER.JPG -91.99 46.84 203\n");
  EXPECT_THAT(summary(), HasSubstr("geo.txt:2: the block has none of the images of this file"));
  EXPECT_THAT(project(), HasSubstr("\n# positions: \"geo.txt\"  # geo.txt of OpenDroneMap; not used: "));
  EXPECT_THAT(read_project(folder_.path("block.yaml")).found, Contains(HasSubstr("from EXIF")));
}

}  // namespace
}  // namespace megablock
