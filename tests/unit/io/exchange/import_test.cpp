#include "io/exchange/import.h"

#include <gmock/gmock.h>

#include <cstring>

#include "io/base/error.h"
#include "io/exchange/export.h"
#include "io/exchange/model/export_view.h"
#include "io/exchange/model/imported_block.h"
#include "io/project/project.h"
#include "io/store/units/tracks_file.h"
#include "tests/support/io/image_files.h"
#include "tests/support/io/scratch_directory.h"
#include "tests/support/io/small_result.h"

namespace megablock {
namespace {

using fixture::message_of;
using fixture::read_file;
using fixture::small_result;
using fixture::write_file;
using ::testing::HasSubstr;

// Residuals of an imported model are those of the result it was exported from, in the files' order.
void expect_same_residuals(const ImportedBlock& imported, const BlockResult& result, double tolerance_px) {
  const ExportView view = make_export_view(result);
  ASSERT_EQ(imported.block.images.size(), view.images.size());
  ASSERT_EQ(imported.points.size(), view.tracks.size());
  ASSERT_EQ(imported.tracks.image.size(), view.observations.size());
  EXPECT_NO_THROW(check(imported.block));
  for (std::size_t t = 0; t < imported.points.size(); ++t)
    for (auto k = static_cast<std::size_t>(imported.tracks.begin[t]);
         k < static_cast<std::size_t>(imported.tracks.begin[t + 1]); ++k) {
      const ImageIndex image = imported.tracks.image[k];
      const std::int64_t i = view.image_of(view.observations[k]);
      ASSERT_EQ(image.value, i);
      const Pose& pose = *imported.block.frames[imported.block.images[image].frame].given_pose;
      const Eigen::Vector2d theirs =
          project(imported.state.cameras[imported.block.camera_of(image)], to_inside(pose, imported.points[t])) -
          Eigen::Vector2d(from_fixed_pixel(imported.tracks.x[k]), from_fixed_pixel(imported.tracks.y[k]));
      const Eigen::Vector2d ours =
          project(view.intrinsics(i), to_inside(view.pose(i), view.point(static_cast<std::int64_t>(t)))) -
          view.pixel(view.observations[k]);
      EXPECT_LT((theirs - ours).norm(), tolerance_px);
    }
}

TEST(Import, ColmapTextReturnsTheModel) {
  ScratchDirectory folder;
  const BlockResult result = small_result();
  export_result(result, "colmap-text", folder.path("model"));
  const ImportedBlock imported = import_block("colmap-text", folder.path("model"));
  expect_same_residuals(imported, result, 1e-9);
  EXPECT_EQ(imported.block.name_of(ImageIndex(1)), "frame0/1.jpg");
  EXPECT_EQ(imported.block.cameras.size(), 2u);
  EXPECT_EQ(imported.state.cameras[CameraIndex(1)], result.state.cameras[CameraIndex(1)]);
}

TEST(Import, BalAndBundlerReturnTheResiduals) {
  ScratchDirectory folder;
  const BlockResult result = small_result(false);
  for (const std::string format : {"bal", "bundler"}) {
    export_result(result, format, folder.path(format));
    const ImportedBlock imported = import_block(format, folder.path(format));
    expect_same_residuals(imported, result, 1.5e-3);  // observations are rounded to 2^-10 px again
    EXPECT_EQ(imported.block.name_of(ImageIndex(1)), format == "bal" ? "image000001" : "frame0/1.jpg");
  }
}

TEST(Import, WritesAProjectThatReads) {
  ScratchDirectory folder;
  export_result(small_result(false), "bal", folder.path("problem.txt"));
  const ImportedBlock imported = import_block("bal", folder.path("problem.txt"));
  write_imported(imported, folder.path("project"));
  const Project project = read_project(folder.path("project/block.yaml"));
  EXPECT_EQ(project.block.images.size(), 6u);
  EXPECT_TRUE(project.block.frames[FrameIndex(5)].given_pose);
  EXPECT_EQ(read_tracks(project.tie_points).x, imported.tracks.x);
}

// An imported model as if it were the result of a job.
BlockResult as_result(const ImportedBlock& imported) {
  BlockResult result;
  result.block = imported.block;
  result.state = imported.state;
  result.tracks = imported.tracks;
  result.points = imported.points;
  result.kept.assign(imported.tracks.image.size(), 1);
  result.residual_x.assign(result.kept.size(), 0.f);
  result.residual_y.assign(result.kept.size(), 0.f);
  result.tiles.tile_count = 1;
  result.tiles.tile_of_frame.assign(imported.block.frames.size(), TileIndex(0));
  result.tiles.component.assign(imported.block.frames.size(), 0);
  result.boundary.assign(imported.block.frames.size(), 0);
  return result;
}

// The same but for the rounding of C = -R' t and back.
void expect_same_model(const ImportedBlock& a, const ImportedBlock& b) {
  ASSERT_EQ(a.block.images.size(), b.block.images.size());
  for (ImageIndex i(0); a.block.images.contains(i); ++i.value) {
    EXPECT_EQ(a.block.name_of(i), b.block.name_of(i));
    EXPECT_EQ(a.block.camera_of(i), b.block.camera_of(i));
    const Pose &p = a.state.frames[FrameIndex(i.value)], &q = b.state.frames[FrameIndex(i.value)];
    EXPECT_LT((p.centre - q.centre).norm(), 1e-12);
    EXPECT_LT(rotation_angle(p.rotation, q.rotation), 1e-12);
  }
  EXPECT_TRUE(a.state.cameras == b.state.cameras && a.points == b.points);
  EXPECT_TRUE(a.tracks.begin == b.tracks.begin && a.tracks.image == b.tracks.image);
  EXPECT_TRUE(a.tracks.x == b.tracks.x && a.tracks.y == b.tracks.y);
}

TEST(Import, WhatWasImportedIsExportedAgainAlike) {
  ScratchDirectory folder;
  for (const std::string& format : import_formats()) {
    SCOPED_TRACE(format);
    // The first import rounds observations about the principal point (BAL, Bundler) and forgets rigs and residuals.
    export_result(small_result(format.starts_with("colmap")), format, folder.path(format + "0"));
    const ImportedBlock first = import_block(format, folder.path(format + "0"));
    export_result(as_result(first), format, folder.path(format + "1"));
    expect_same_model(import_block(format, folder.path(format + "1")), first);
  }
}

TEST(Import, ColmapBinaryIsColmapText) {
  ScratchDirectory folder;
  for (const std::string format : {"colmap-text", "colmap-bin"})
    export_result(small_result(), format, folder.path(format));
  const ImportedBlock text = import_block("colmap-text", folder.path("colmap-text"));
  const ImportedBlock binary = import_block("colmap-bin", folder.path("colmap-bin"));
  write_imported(text, folder.path("a"));
  write_imported(binary, folder.path("b"));
  for (const std::string name : {"given.h5", "tie_points.h5"})
    EXPECT_EQ(read_file(folder.path("a/" + name)), read_file(folder.path("b/" + name))) << name;
  EXPECT_EQ(text.points, binary.points);
}

TEST(Import, BadBinaryModelsAreRefusedByByte) {
  ScratchDirectory folder;
  export_result(small_result(), "colmap-bin", folder.path("model"));
  const auto refusal = [&](const std::string& name, auto change) {
    const std::string file = folder.path("model/" + name), before = read_file(file);
    std::string content = before;
    change(content);
    write_file(file, content);
    const std::string message = message_of<InputError>([&] { import_block("colmap-bin", folder.path("model")); });
    write_file(file, before);
    return message;
  };
  const auto cut = [](std::string& content) { content.resize(content.size() - 5); };
  for (const std::string name : {"cameras.bin", "images.bin", "points3D.bin"}) {
    EXPECT_THAT(refusal(name, cut), HasSubstr(name + ", byte "));
    EXPECT_THAT(refusal(name, cut), HasSubstr("ends before"));
    EXPECT_THAT(refusal(name, [](std::string& content) { content.clear(); }), HasSubstr("ends before the count"));
    EXPECT_THAT(refusal(name, [](std::string& content) { content += 'x'; }), HasSubstr("more bytes"));
    EXPECT_THAT(refusal(name, [](std::string& content) { content[7] = '\x7f'; }), HasSubstr("ends before"));
  }
  EXPECT_THAT(refusal("cameras.bin", [](std::string& content) { content[12] = 99; }),
              HasSubstr("camera model 'number 99' is not supported"));
  const auto far_away = [](std::string& content) {
    const double x = 1e300;
    std::memcpy(&content[16], &x, sizeof x);  // behind the count and the id
  };
  EXPECT_THAT(refusal("points3D.bin", far_away), HasSubstr("a point's coordinates: 1e+300 is too large to be right"));
  EXPECT_THAT(message_of<InputError>([&] { import_block("colmap-bin", folder.path("none")); }),
              HasSubstr("cannot be read"));
}

TEST(Import, ASmallBundlerFileByHand) {
  ScratchDirectory folder;
  // A camera at (0, 0, 10) that looks down -z, another not oriented; the point at (1, 2, 0) is seen at f / 10 * (1, 2).
  write_file(folder.path("b.out"),
             "# Bundle file v0.3\n2 1\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n"
             "1000 0 0\n1 0 0\n0 1 0\n0 0 1\n0 0 -10\n1 2 0\n9 9 9\n2 1 7 100 200 0 3 5 5\n");
  const ImportedBlock imported = import_block("bundler", folder.path("b.out"));
  ASSERT_EQ(imported.block.images.size(), 1u);
  EXPECT_EQ(imported.block.name_of(ImageIndex(0)), "image000001");
  const Camera& camera = imported.block.cameras[CameraIndex(0)];
  EXPECT_EQ(camera.width, 200);
  EXPECT_EQ(camera.height, 400);
  const Pose& pose = *imported.block.frames[FrameIndex(0)].given_pose;
  EXPECT_LT((pose.centre - Eigen::Vector3d(0, 0, 10)).norm(), 1e-12);
  const Eigen::Vector2d pixel = project(camera.intrinsics, to_inside(pose, imported.points[0]));
  EXPECT_LT((pixel - Eigen::Vector2d(100 + 100, 200 - 200)).norm(), 1e-12) << "right and up";
  EXPECT_EQ(imported.tracks.x[0], to_fixed_pixel(200));
  EXPECT_EQ(imported.tracks.y[0], to_fixed_pixel(0));
}

TEST(Import, BadFilesAreRefusedByLine) {
  ScratchDirectory folder;
  const auto refusal = [&](const std::string& format, const std::string& text) {
    write_file(folder.path("f"), text);
    return message_of<InputError>([&] { import_block(format, folder.path("f")); });
  };
  EXPECT_THAT(refusal("bal", "1 1 1\n0 0 1 x\n"), HasSubstr("f:2: y of an observation: 'x' is not a number"));
  EXPECT_THAT(refusal("bal", "1 1 1\n1 0 1 1\n"), HasSubstr("f:2: camera of an observation: 1 is outside 0..0"));
  EXPECT_THAT(refusal("bal", "1 1 1\n0 0 1 1\n1\n2\n"), HasSubstr("ends before a camera's parameters"));
  EXPECT_THAT(refusal("bal", "1 0 0\n0 0 0 0 0 0 -5 0 0\n"), HasSubstr("focal length of camera 0"));
  EXPECT_THAT(refusal("bal", "1 0 0\n0\n0\n0\n0\n0\n0\n-5\n0\n0\n"), HasSubstr("f:8: focal length of camera 0"));
  EXPECT_THAT(refusal("bal", "1 0 0\n0\n0\n0\n1e300\n0\n0\n5\n0\n0\n"),
              HasSubstr("f:5: a camera's parameters: 1e300 is too large to be right"));
  EXPECT_THAT(refusal("bal", "1 1 1\n0 0 1 1e300\n"), HasSubstr("f:2: y of an observation: 1e300 is too large"));
  EXPECT_THAT(refusal("bal", "1 0 0\n0 0 0 0 0 0 5 0 0 7\n"), HasSubstr("more numbers"));
  EXPECT_THAT(refusal("bal", ""), HasSubstr("ends before number of cameras"));
  EXPECT_THAT(refusal("bundler", "1 1\n"), HasSubstr("no Bundler file"));
  EXPECT_THAT(refusal("bundler", "# Bundle file v0.3\n1 0\n5 0 0 2 0 0 0 1 0 0 0 1 0 0 0\n"),
              HasSubstr("no rotation matrix"));
  EXPECT_THAT(refusal("bundler", "# Bundle file v0.3\n1 0\n5 0 0\n2 0 0\n0 1 0\n0 0 1\n0 0 0\n"),
              HasSubstr("f:6: camera 0 has no rotation matrix"));
  EXPECT_THAT(refusal("bundler", "# Bundle file v0.3\n1 0\n-5 0 0\n1 0 0\n0 1 0\n0 0 1\n0 0 0\n"),
              HasSubstr("f:3: focal length of camera 0 is negative"));
  EXPECT_THAT(refusal("bundler", "Bundle\n1 0\n"), HasSubstr("f:1: is no Bundler file"));
  EXPECT_THAT(refusal("nvm", ""), HasSubstr("'nvm' is not an import format"));
  EXPECT_THAT(message_of<InputError>([&] { import_block("bal", folder.path("none")); }), HasSubstr("cannot be read"));
  EXPECT_THAT(message_of<InputError>([&] { import_block("colmap-text", folder.path()); }), HasSubstr("cannot be read"));
}

TEST(Import, BadColmapModelsAreRefusedByLine) {
  ScratchDirectory folder;
  const auto refusal = [&](const std::string& cameras, const std::string& images, const std::string& points) {
    write_file(folder.path("cameras.txt"), cameras);
    write_file(folder.path("images.txt"), images);
    write_file(folder.path("points3D.txt"), points);
    return message_of<InputError>([&] { import_block("colmap-text", folder.path()); });
  };
  const std::string camera = "# comment\n1 SIMPLE_RADIAL 100 80 90 50 40 -0.1\n";
  const std::string image = "1 1 0 0 0 0 0 0 1 a b.jpg\n10 20 7 30 40 -1\n";
  EXPECT_EQ(refusal(camera, image, "7 1 2 3 0 0 0 0.1 1 0\n"), "");
  EXPECT_EQ(refusal(camera, "1 1 0 0 0 0 0 0 1 a.jpg\n\n2 1 0 0 0 0 0 0 1 b.jpg\n\n", ""), "") << "no observations";
  EXPECT_THAT(refusal(camera, image, ""), HasSubstr("images.txt:2: an observation names point 7"));
  EXPECT_THAT(refusal("1 FISHEYE 100 80 90 50 40\n", image, ""), HasSubstr("cameras.txt:1: camera model 'FISHEYE'"));
  EXPECT_THAT(refusal("1 OPENCV_FISHEYE 100 80 90 91 50 40 0 0 0 0\n", image, ""),
              HasSubstr("in the model opencv-fisheye only square pixels"));
  EXPECT_THAT(refusal("x PINHOLE 100 80 90 90 50 40\n", image, ""), HasSubstr("'x' is not a whole number"));
  EXPECT_THAT(refusal("1 SIMPLE_RADIAL 100 80 90 50 40\n2 SIMPLE_RADIAL 100 80 90 50 40 -0.1\n", image, ""),
              HasSubstr("cameras.txt:1: the line ends before all 4 parameters of SIMPLE_RADIAL"));
  EXPECT_THAT(refusal("1 PINHOLE 100 80 90 90 50 40 0.1\n", image, ""),
              HasSubstr("cameras.txt:1: the line has more than all 4 parameters of PINHOLE"));
  EXPECT_THAT(refusal(camera, "1 1 0 0 0 0 0\n0 1 a.jpg\n\n", ""),
              HasSubstr("images.txt:1: the line ends before an image's translation"));
  EXPECT_THAT(refusal(camera, "1 1 0 0 0 0 0 0 2 a.jpg\n\n", ""), HasSubstr("names a camera"));
  EXPECT_THAT(refusal(camera, "1 2 0 0 0 0 0 0 1 a.jpg\n\n", ""), HasSubstr("not a unit quaternion"));
  EXPECT_THAT(refusal(camera, "1 1 0 0 0 0 0 0 1 a.jpg\n\n2 1 0 0 0 0 0 0 1 a.jpg\n\n", ""),
              HasSubstr("appears twice"));
}

}  // namespace
}  // namespace megablock
