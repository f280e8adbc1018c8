#include "io/project/inputs/control_file.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <functional>

#include "io/base/error.h"
#include "io/project/project.h"
#include "tests/support/io/image_files.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

using fixture::gps_tags;
using fixture::message_of;
using fixture::write_file;
using fixture::write_image_file;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

// Three images of 200 x 100 pixels in zone 33, near 52.52 N 13.40 E, 40 m.
class ControlFile : public ::testing::Test {
 protected:
  ControlFile() {
    for (int i = 0; i < 3; ++i)
      write_image_file(folder_.path("images/sub/" + std::to_string(i) + ".jpg"), 200, 100, i,
                       gps_tags(52.52, 13.40 + 0.0002 * i, 40));
  }

  Project read(const std::string& control_name, const std::string& control) {
    write_file(folder_.path(control_name), control);
    write_file(folder_.path("block.yaml"),
               "images: images\norigin: [52.52, 13.4, 40]\ncontrol: " + control_name + "\n");
    return read_project(folder_.path("block.yaml"));
  }

  std::string refusal(const std::string& name, const std::string& control) {
    std::string message = message_of<InputError>([&] { read(name, control); });
    for (std::size_t at; (at = message.find(folder_.path() + "/")) != std::string::npos;)
      message.erase(at, folder_.path().size() + 1);
    return message;
  }

  ScratchDirectory folder_;
  const Georeference reference_{GroundFrame{true, 52.52, 13.4, 40, ""}};
};

TEST_F(ControlFile, GcpListInWgs84WithTabsAndBlanks) {
  const Project project = read("gcp_list.txt",
                               "WGS84\n"
                               "# lon lat height column row image name\n"
                               "13.4001\t52.5201\t45.5\t99.5\t49.5\tsub/0.jpg\tchurch door\n"
                               "13.4001\t52.5201\t45.5\t10\t20\t1.jpg\tchurch door\n"
                               "13.4002 52.5202 NaN 5 6 sub/2.jpg\n"
                               "13.4002 52.5202 NaN 7 8 sub/1.jpg\r\n");
  const auto& points = project.block.control_points;
  ASSERT_THAT(points, SizeIs(2));
  EXPECT_EQ(points[0].name, "church door");
  EXPECT_EQ(points[0].role, PointRole::kControl);
  EXPECT_LT((points[0].position - reference_.to_local({52.5201, 13.4001, 45.5})).norm(), 1e-6);
  ASSERT_THAT(points[0].measurements, SizeIs(2));
  EXPECT_EQ(points[0].measurements[0].pixel, Eigen::Vector2d(100, 50)) << "pixels count from the first pixel's centre";
  EXPECT_EQ(project.block.name_of(points[0].measurements[1].image), "sub/1.jpg") << "also without its folder";
  EXPECT_EQ(points[1].name, "gcp2");
  EXPECT_THAT(points[1].measurements, SizeIs(2));
  EXPECT_EQ(points[1].sigma.z(), 1000) << "height unknown";
  EXPECT_TRUE(points[1].position.allFinite());
}

TEST_F(ControlFile, GcpListInEveryNameOfUtmMeansTheSamePlace) {
  const Geodetic place{52.5203, 13.4004, 44};
  const Eigen::Vector3d utm = CrsToWgs84("EPSG:32633").from_wgs84(place);
  char row[128];
  std::snprintf(row, sizeof row, "%.6f %.6f %.6f 5 6 sub/2.jpg a\n", utm.x(), utm.y(), utm.z());
  for (const std::string crs : {"EPSG:32633", "WGS84 UTM 33N", "+proj=utm +zone=33 +datum=WGS84 +units=m +no_defs"}) {
    const Block block = read("gcp_list.txt", crs + "\n" + row).block;
    EXPECT_LT((block.control_points.at(0).position - reference_.to_local(place)).norm(), 1e-4) << crs;
  }
}

TEST_F(ControlFile, GcpListRefusals) {
  const std::string good = "13.4 52.52 40 5 6 sub/0.jpg a\n";
  EXPECT_EQ(refusal("gcp_list.txt", "WGS84\n" + good), "");
  EXPECT_EQ(refusal("gcp_list.txt", "WGS84\n13.4 52.52 40 5 6 DSC7.jpg a\n13.4 52.52 40 5 6 DSC8.jpg a\n"),
            "gcp_list.txt:2: the block has none of the images in which the points are measured ('DSC7.jpg', "
            "'DSC8.jpg'); give the list that belongs to these images, or correct the names");
  EXPECT_THAT(refusal("gcp_list.txt", "WGS84\n13.4 52.52 40 5\n"),
              HasSubstr("gcp_list.txt:2: 4 fields in this line; expected"));
  EXPECT_THAT(refusal("gcp_list.txt", "WGS84\nx 52.52 40 5 6 sub/0.jpg\n"), HasSubstr("gcp_list.txt:2: x: 'x' is not"));
  EXPECT_THAT(refusal("gcp_list.txt", "WGS84\n13.4 52.52 40 500 6 sub/0.jpg a\n"),
              HasSubstr("outside image 'sub/0.jpg'"));
  EXPECT_THAT(refusal("gcp_list.txt", "WGS84\n" + good + good),
              HasSubstr("gcp_list.txt:3: point 'a' is measured twice"));
  EXPECT_THAT(refusal("gcp_list.txt", "WGS84\n" + good + "13.5 52.52 40 5 6 sub/1.jpg a\n"),
              HasSubstr("gcp_list.txt:3: point 'a' has other coordinates than in gcp_list.txt:2"));
  EXPECT_THAT(refusal("gcp_list.txt", "# a comment\nEPSG:123456\n" + good),
              HasSubstr("gcp_list.txt:2: coordinate reference system 'EPSG:123456' is not known to PROJ"));
  EXPECT_EQ(
      refusal("gcp_list.txt", "WGS84\n52.52 113.4 40 5 6 sub/0.jpg a\n"),
      "gcp_list.txt:2: point 'a': latitude 113.4 is out of range [-90, 90]; are latitude and longitude exchanged?");
  EXPECT_THAT(refusal("gcp_list.txt", "EPSG:25832\n1e300 5 40 5 6 sub/0.jpg a\n"),
              HasSubstr("gcp_list.txt:2: x: 1e+300 is beyond any place on Earth"));
  EXPECT_THAT(refusal("gcp_list.txt", ""), HasSubstr("gcp_list.txt: the file is empty"));
  EXPECT_THAT(message_of<InputError>([&] { read_control_table(folder_.path("none.txt")); }),
              HasSubstr("none.txt: cannot be read: no such file or directory; check the path"));
  std::filesystem::create_directories(folder_.path("folder.csv"));
  EXPECT_THAT(message_of<InputError>([&] { read_control_table(folder_.path("folder.csv")); }),
              HasSubstr("folder.csv: cannot be read: a directory is where a file is needed"));
}

TEST_F(ControlFile, OpenSfmJson) {
  const Project project = read("ground_control_points.json", R"({"points": [
    {"id": "0", "position": {"latitude": 52.5201, "longitude": 13.4001, "altitude": 45},
     "observations": [{"shot_id": "sub/0.jpg", "projection": [0.25, -0.1]},
                      {"shot_id": "sub/1.jpg", "projection": [0, 0]}]},
    {"id": "1", "observations": [{"shot_id": "sub/0.jpg", "projection": [0, 0]}]},
    {"id": "2", "role": "metrics_only", "position": {"latitude": 52.52, "longitude": 13.4}, "observations": []}]})");
  const auto& points = project.block.control_points;
  ASSERT_THAT(points, SizeIs(2));
  EXPECT_LT((points[0].position - reference_.to_local({52.5201, 13.4001, 45})).norm(), 1e-6);
  EXPECT_EQ(points[0].measurements[0].pixel, Eigen::Vector2d(100 + 0.25 * 200, 50 - 0.1 * 200));
  EXPECT_EQ(points[0].measurements[1].pixel, Eigen::Vector2d(100, 50)) << "the image's centre";
  EXPECT_EQ(points[1].role, PointRole::kCheck);
  EXPECT_THAT(project.warnings, ElementsAre(HasSubstr("json:5: point '1' is left out, because it has no 'position'")));
}

TEST_F(ControlFile, OpenSfmJsonRefusals) {
  const std::string name = "g.json";
  EXPECT_THAT(refusal(name, "{\"points\": [\n{]"), HasSubstr("g.json:2: not valid JSON"));
  EXPECT_THAT(refusal(name, "[]"), HasSubstr("list 'points'"));
  EXPECT_THAT(refusal(name, "{\"points\": [{}]}"), HasSubstr("no 'id'"));
  EXPECT_THAT(refusal(name, "{\"points\": [\n{\"id\": \"a\", \"position\": {\"latitude\": 1}}]}"),
              HasSubstr("g.json:2: 'longitude' is missing"));
  const std::string point = "{\"points\": [{\"id\": \"a\", \"position\": {\"latitude\": 52.52, \"longitude\": 13.4},\n";
  EXPECT_THAT(refusal(name, point + "\"observations\": [{\"shot_id\": \"x.jpg\", \"projection\": [0, 0]}]}]}"),
              HasSubstr("g.json:2: the block has none of the images in which the points are measured ('x.jpg')"));
  EXPECT_THAT(refusal(name, point + "\"observations\": [{\"shot_id\": \"sub/0.jpg\", \"projection\": [0]}]}]}"),
              HasSubstr("needs shot_id and projection"));
}

TEST_F(ControlFile, CsvInTheBlocksFrameAndItsWriterReturn) {
  const std::string text =
      "# crs: local\n"
      "name,role,x,y,z,sigma_horizontal_m,sigma_vertical_m,image,column_px,row_px,sigma_px\n"
      "a,control,1.5,-2.25,3,0.01,0.04,sub/0.jpg,10.25,20.5,0.2\n"
      "a,,,,,,,sub/1.jpg,11,21,\n"
      "b,check,7,8,9,0.05,0.05,\"sub/2.jpg\",1,2,1\n"
      "c,control,0,0,0,0.1,0.1,,,,\n";
  const Block block = read("control.csv", text).block;
  const auto expect_right = [&](const Block& b) {
    ASSERT_THAT(b.control_points, SizeIs(3));
    const ControlPoint& a = b.control_points[0];
    EXPECT_EQ(a.position, Eigen::Vector3d(1.5, -2.25, 3));
    EXPECT_EQ(a.sigma, Eigen::Vector3d(0.01, 0.01, 0.04));
    ASSERT_THAT(a.measurements, SizeIs(2));
    EXPECT_EQ(a.measurements[0].pixel, Eigen::Vector2d(10.25, 20.5));
    EXPECT_EQ(a.measurements[0].sigma_px, 0.2);
    EXPECT_EQ(a.measurements[1].sigma_px, 0.5);
    EXPECT_EQ(b.control_points[1].role, PointRole::kCheck);
    EXPECT_THAT(b.control_points[2].measurements, SizeIs(0));
  };
  expect_right(block);
  write_control_csv(folder_.path("written.csv"), block);
  expect_right(read("again.csv", fixture::read_file(folder_.path("written.csv"))).block);
  Block odd = block;
  odd.control_points[1].name = "corner, \"north\"\nof 3";
  write_control_csv(folder_.path("written.csv"), odd);
  const Block again = read("again.csv", fixture::read_file(folder_.path("written.csv"))).block;
  EXPECT_EQ(again.control_points[1].name, odd.control_points[1].name);
}

TEST_F(ControlFile, CsvRefusals) {
  const std::string header = "name,x,y,z,image,column_px,row_px\n";
  EXPECT_THAT(refusal("c.csv", "# crs: EPSG:123456\n" + header), HasSubstr("c.csv: coordinate reference system 'EPSG"));
  EXPECT_THAT(refusal("c.csv", "name,x,y\n"), HasSubstr("c.csv:1: column 'z' is missing"));
  EXPECT_EQ(refusal("c.csv", "name,x,z,y\nP1,1,2,3\n"),
            "c.csv:1: column 'image' is missing; each point needs its marks in images, one line for each: image, "
            "column_px, row_px; the header needs name,x,y,z,image,column_px,row_px, and has name,x,z,y");
  EXPECT_EQ(refusal("c.csv", "name,x,y,image,column_px,row_px\n"),
            "c.csv:1: column 'z' is missing; the header needs name,x,y,z,image,column_px,row_px, and has "
            "name,x,y,image,column_px,row_px");
  EXPECT_THAT(refusal("c.csv", "name,x,y,z,image,column_px,row_px,sigma_mm\n"), HasSubstr("unknown key 'sigma_mm'"));
  EXPECT_THAT(refusal("c.csv", header + "a,1,2,3,sub/0.jpg,x,4\n"),
              HasSubstr("c.csv:2: column_px: 'x' is not a number"));
  EXPECT_THAT(refusal("c.csv", header + "a,1,2,3,none.jpg,3,4\n"),
              HasSubstr("c.csv:2: the block has none of the images"));
  for (const char* sigma : {"0", "-1", "1e-300", "1e300"})
    EXPECT_THAT(refusal("c.csv", "name,x,y,z,image,column_px,row_px,sigma_px\na,1,2,3,sub/0.jpg,3,4," +
                                     std::string(sigma) + "\n"),
                HasSubstr("c.csv:2: sigma_px must lie in [1e-06, 10000], not "));
  EXPECT_THAT(refusal("c.csv", header + "a,,2,3,sub/0.jpg,3,4\n"), HasSubstr("c.csv:2: x is empty"));
  EXPECT_THAT(refusal("c.csv", header + "a,nan,2,3,sub/0.jpg,3,4\n"),
              HasSubstr("c.csv:2: x: 'nan' is not a finite number"));
  EXPECT_THAT(refusal("c.csv", header + "a,1,2,1e9,sub/0.jpg,3,4\n"), HasSubstr("c.csv:2: z: 1e+09 is beyond"));
  EXPECT_THAT(refusal("c.csv", header + "a,1,2,3,sub/0.jpg,3,4\na,9,,,sub/1.jpg,3,4\n"), HasSubstr("another x"));
  EXPECT_THAT(refusal("c.csv", header + "a,1,2,3,sub/0.jpg,3,4,5\n"), HasSubstr("8 fields, but the header has only 7"));
  EXPECT_THAT(refusal("c.csv", "# crs: EPSG:32633\n" + header + "a,1e9,2,3,sub/0.jpg,3,4\n"), HasSubstr("c.csv:3"));
}

// One list as the programs of many people write it: shared/data/hard/controls, made of our own points.
TEST_F(ControlFile, GcpListsOfEveryKindMeanTheSame) {
  const std::vector<std::vector<std::string>> rows = {
      {"391430.5", "5820112.25", "45.5", "10.5", "20", "sub/0.jpg", "a"},
      {"391430.5", "5820112.25", "45.5", "11", "21.25", "sub/1.jpg", "a"},
      {"391440", "5820100.75", "NaN", "30", "40", "sub/1.jpg", "b"}};
  struct Kind {
    std::string what, head = "WGS84 UTM 33N", between = " ", end = "\n";
    std::function<std::string(std::string)> image = [](std::string name) { return name; };
    std::string more = "";   // further lines
    bool commas = false;     // decimal commas
    std::string first = "";  // before everything
  };
  const auto upper = [](std::string name) {
    for (char& c : name) c = static_cast<char>(std::toupper(c));
    return name;
  };
  std::vector<Kind> kinds = {
      {.what = "as ODM writes it"},
      {.what = "byte order mark", .first = "\xef\xbb\xbf"},
      {.what = "line ends of Windows", .end = "\r\n"},
      {.what = "line ends of old Macs", .end = "\r"},
      {.what = "tabs", .between = "\t"},
      {.what = "commas", .between = ","},
      {.what = "commas and blanks", .between = ", "},
      {.what = "semicolons", .between = ";"},
      {.what = "decimal commas", .between = ";", .commas = true},
      {.what = "decimal commas between blanks", .commas = true},
      {.what = "other case", .image = upper},
      {.what = "folder", .image = [](std::string n) { return "images/" + n; }},
      {.what = "folder of Windows", .image = [](std::string n) { return "D:\\x\\images\\" + n; }},
      {.what = "without ending", .image = [](std::string n) { return n.substr(0, n.size() - 4); }},
      {.what = "quotes", .image = [](std::string n) { return '"' + n + '"'; }},
      {.what = "comment", .more = "# measured on Monday\n\n"}};
  for (const char* head :
       {"WGS84 UTM 33 N", "WGS 84 / UTM zone 33N", "+init=epsg:32633", "+init=epsg:32633 +no_defs", "EPSG:32633",
        "epsg:32633", "EPSG::32633", "EPSG: 32633", "\"EPSG:32633\"", "EPSG:32633,,,,,,"})
    kinds.push_back({.what = head, .head = head});
  kinds.push_back({.what = "names of the columns", .head = "EPSG:32633\nX Y Z column row image name"});
  for (const Kind& kind : kinds) {
    std::string text = kind.first + kind.head + kind.end + kind.more;
    for (std::vector<std::string> row : rows) {
      row[5] = kind.image(row[5]);
      for (std::size_t f = 0; f < row.size(); ++f) {
        if (kind.commas && f < 5) std::replace(row[f].begin(), row[f].end(), '.', ',');
        text += (f ? kind.between : "") + row[f];
      }
      text += kind.end;
    }
    const Project project = read("gcp_list.txt", text);
    EXPECT_THAT(project.warnings, SizeIs(0)) << kind.what;
    const auto& points = project.block.control_points;
    ASSERT_THAT(points, SizeIs(2)) << kind.what;
    const Eigen::Vector3d place = reference_.to_local(CrsToWgs84("EPSG:32633").to_wgs84({391430.5, 5820112.25, 45.5}));
    EXPECT_LT((points[0].position - place).norm(), 1e-6) << kind.what;
    ASSERT_THAT(points[0].measurements, SizeIs(2)) << kind.what;
    EXPECT_EQ(points[0].measurements[1].pixel, Eigen::Vector2d(11.5, 21.75)) << kind.what;
    EXPECT_EQ(project.block.name_of(points[0].measurements[1].image), "sub/1.jpg") << kind.what;
    EXPECT_EQ(points[1].sigma.z(), 1000) << kind.what;
  }
}

TEST_F(ControlFile, AMeasurementInAnAbsentImageIsAWarning) {
  const std::string good = "13.4 52.52 40 5 6 sub/0.jpg a\n";
  const Project project = read("gcp_list.txt", "WGS84\n" + good + "13.4 52.52 40 5 6 DSC7.jpg a\n");
  EXPECT_THAT(project.block.control_points.at(0).measurements, SizeIs(1));
  EXPECT_THAT(project.warnings,
              ElementsAre(HasSubstr("gcp_list.txt:3: 1 measurement is not used, because the block has no image "
                                    "'DSC7.jpg'; correct the name or delete the line")));
  EXPECT_THAT(refusal("gcp_list.txt", "WGS84\n" + good + "13.4 52.52 40 5 6 SUB/0 a\n"),
              HasSubstr("gcp_list.txt:3: point 'a' is measured twice"));
  write_image_file(folder_.path("images/other/0.jpg"), 200, 100, 77);
  EXPECT_THAT(refusal("gcp_list.txt", "WGS84\n13.4 52.52 40 5 6 0.jpg a\n"),
              HasSubstr("several images of the block have this name; write it with its folder"));
}

TEST_F(ControlFile, GcpListAndOurOwnColumnsInACsvFile) {
  EXPECT_THAT(read("points.csv", "WGS84;;;\n13,4;52,52;40;5;6;sub/0.jpg;a\n").block.control_points, SizeIs(1));
  const Block block =
      read("points.CSV", "\xef\xbb\xbfname;x;y;z;image;column_px;row_px\r\na;1,5;2;3;0.jpg;3,5;4\r\n").block;
  EXPECT_EQ(block.control_points.at(0).position, Eigen::Vector3d(1.5, 2, 3));
  EXPECT_EQ(block.control_points[0].measurements.at(0).pixel, Eigen::Vector2d(3.5, 4));
}

TEST_F(ControlFile, MeasurementsInImagesLeftOutAreWarnings) {
  write_file(folder_.path("images/broken.jpg"), "");
  const Project project =
      read("gcp_list.txt", "WGS84\n13.4 52.52 40 5 6 broken.jpg a\n13.4 52.52 40 5 6 sub/0.jpg a\n");
  EXPECT_THAT(project.block.control_points[0].measurements, SizeIs(1));
  EXPECT_THAT(project.warnings,
              ElementsAre(HasSubstr("gcp_list.txt:2: the measurement of point 'a' is not used, because "
                                    "image 'broken.jpg' was left out")));
}

TEST_F(ControlFile, PointsFarFromTheImagesAreRefused) {
  const std::string right = "13.4 52.52 40 7 8 sub/2.jpg right\n";
  EXPECT_THAT(
      refusal("gcp_list.txt", "WGS84\n52.52 13.4 40 5 6 sub/0.jpg a\n52.5201 13.4 40 9 9 sub/1.jpg b\n" + right),
      ::testing::MatchesRegex("gcp_list.txt: 2 of 3 control points \\('a', 'b'\\) lie [0-9]+ km \\(median\\) from the "
                              "images; with x and y .* exchanged they would lie near the images; exchange these .*"));
  EXPECT_THAT(
      refusal("gcp_list.txt", "EPSG:32632\n391430.5 5820112.25 45.5 10.5 20 sub/0.jpg a\n"),
      ::testing::MatchesRegex("gcp_list.txt: 1 of 1 control points \\('a'\\) lie 4[0-9]+ km from the images; its "
                              "coordinates are probably in another coordinate reference system than "
                              "'EPSG:32632'; correct .*"));
  EXPECT_THAT(
      refusal("c.csv", "name,x,y,z,image,column_px,row_px\na,391430.5,5820112.25,45,sub/0.jpg,3,4\n"),
      HasSubstr("c.csv: 1 of 1 control points ('a') lie 5833 km from the images; the coordinates of the file are "
                "local and count from the origin of the block; name their system"));
  write_file(folder_.path("gcp_list.txt"), "WGS84\n" + right);
  write_file(folder_.path("block.yaml"), "images: images\norigin: [51, 10, 40]\ncontrol: gcp_list.txt\n");
  EXPECT_THAT(read_project(folder_.path("block.yaml")).warnings, ElementsAre(HasSubstr("the origin lies ")))
      << "the control fits the images";
}

TEST_F(ControlFile, SettingsOfTheProjectOverrideTheFile) {
  read("gcp_list.txt", "WGS84\n13.4 52.52 40 5 6 sub/0.jpg a\n13.4001 52.52 NaN 5 6 sub/0.jpg b\n");
  const auto with = [&](const std::string& control) {
    write_file(folder_.path("block.yaml"), "images: images\ncontrol:\n" + control);
    return read_project(folder_.path("block.yaml")).block.control_points;
  };
  const auto points =
      with("  file: gcp_list.txt\n  sigma_horizontal_m: 0.1\n  sigma_vertical_m: 0.2\n  sigma_px: 2\n  check: [b]\n");
  EXPECT_EQ(points[0].sigma, Eigen::Vector3d(0.1, 0.1, 0.2));
  EXPECT_EQ(points[0].role, PointRole::kControl);
  EXPECT_EQ(points[0].measurements[0].sigma_px, 2);
  EXPECT_EQ(points[1].role, PointRole::kCheck);
  EXPECT_EQ(points[1].sigma.z(), 1000) << "an unknown height stays unknown";
  const auto refusal = [&](const std::string& control) { return message_of<InputError>([&] { with(control); }); };
  EXPECT_THAT(refusal("  sigma_px: 2\n"), HasSubstr("block.yaml:3: key 'file' is missing"));
  EXPECT_THAT(refusal("  file: gcp_list.txt\n  check: [c]\n"),
              HasSubstr("block.yaml:4: control.check: the control file"));
  EXPECT_THAT(refusal("  file: gcp_list.txt\n  check: c\n"), HasSubstr("must be a list"));
  EXPECT_THAT(refusal("  file: gcp_list.txt\n  sigma_m: 1\n"), HasSubstr("unknown key 'sigma_m' in 'control'"));
}

TEST(ControlWithoutGps, GivesTheOrigin) {
  ScratchDirectory folder;
  write_image_file(folder.path("images/0.jpg"), 200, 100, 0);
  write_file(folder.path("gcp_list.txt"), "EPSG:32633\n391000 5820000 44 5 6 0.jpg\n391100 5820000 44 8 9 0.jpg\n");
  write_file(folder.path("block.yaml"), "images: images\ncontrol: gcp_list.txt\n");
  const Block block = read_project(folder.path("block.yaml")).block;
  EXPECT_TRUE(block.ground.georeferenced);
  const Eigen::Vector3d difference = block.control_points[1].position - block.control_points[0].position;
  EXPECT_NEAR(difference.norm(), 100 / 0.99975, 0.02) << "the grid's scale 1.6 degrees from the central meridian";
}

}  // namespace
}  // namespace megablock
