#include "io/exchange/export.h"

#include <gmock/gmock.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>
#include <sstream>

#include "geometry/numbers/angles.h"
#include "geometry/transform/body_attitude.h"
#include "io/base/error.h"
#include "io/block/crs.h"
#include "io/exchange/model/export_view.h"
#include "io/project/inputs/pose_csv.h"
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

// Lines of a text file without comments, split at blanks.
std::vector<std::vector<std::string>> words_of(const std::string& path, char separator = ' ') {
  std::istringstream stream(read_file(path));
  std::vector<std::vector<std::string>> lines;
  for (std::string line; std::getline(stream, line);) {
    if (line.starts_with('#')) continue;
    std::istringstream words(line);
    lines.emplace_back();
    for (std::string word; std::getline(words, word, separator);) lines.back().push_back(word);
  }
  return lines;
}

// A COLMAP camera by its published formula (parameters fx fy cx cy k1 k2 p1 p2 [k3 k4 k5 k6]).
Eigen::Vector2d colmap_project(const std::vector<double>& p, const Eigen::Vector3d& X) {
  const double u = X.x() / X.z(), v = X.y() / X.z(), u2 = u * u, v2 = v * v, uv = u * v, r2 = u2 + v2;
  const double k3 = p.size() > 8 ? p[8] : 0;
  const double radial = 1 + p[4] * r2 + p[5] * r2 * r2 + k3 * r2 * r2 * r2;
  const double x = u * radial + 2 * p[6] * uv + p[7] * (r2 + 2 * u2);
  const double y = v * radial + 2 * p[7] * uv + p[6] * (r2 + 2 * v2);
  return {p[0] * x + p[2], p[1] * y + p[3]};
}

struct WrittenModel {
  struct Image {
    Eigen::Quaterniond rotation;
    Eigen::Vector3d translation;
    std::int64_t camera;
    std::string name;
    std::vector<std::pair<Eigen::Vector2d, std::int64_t>> observations;
  };
  std::map<std::int64_t, std::vector<double>> cameras;
  std::map<std::int64_t, std::string> camera_models;
  std::map<std::int64_t, Image> images;
  struct Point {
    Eigen::Vector3d position;
    double error;
    std::vector<std::pair<std::int64_t, std::int64_t>> track;
  };
  std::map<std::int64_t, Point> points;
};

WrittenModel read_colmap_text(const ScratchDirectory& folder) {
  WrittenModel model;
  for (const auto& w : words_of(folder.path("model/cameras.txt"))) {
    for (std::size_t i = 4; i < w.size(); ++i) model.cameras[std::stoll(w[0])].push_back(std::stod(w[i]));
    model.camera_models[std::stoll(w[0])] = w[1] + " " + w[2] + " " + w[3];
  }
  const auto lines = words_of(folder.path("model/images.txt"));
  for (std::size_t i = 0; i + 1 < lines.size(); i += 2) {
    const auto& w = lines[i];
    std::vector<double> v;
    for (std::size_t k = 1; k < 8; ++k) v.push_back(std::stod(w[k]));
    WrittenModel::Image image{{v[0], v[1], v[2], v[3]}, {v[4], v[5], v[6]}, std::stoll(w[8]), w[9], {}};
    for (std::size_t k = 0; k + 2 < lines[i + 1].size(); k += 3)
      image.observations.push_back(
          {{std::stod(lines[i + 1][k]), std::stod(lines[i + 1][k + 1])}, std::stoll(lines[i + 1][k + 2])});
    model.images[std::stoll(w[0])] = image;
  }
  for (const auto& w : words_of(folder.path("model/points3D.txt"))) {
    WrittenModel::Point point{{std::stod(w[1]), std::stod(w[2]), std::stod(w[3])}, std::stod(w[7]), {}};
    for (std::size_t k = 8; k + 1 < w.size(); k += 2) point.track.push_back({std::stoll(w[k]), std::stoll(w[k + 1])});
    model.points[std::stoll(w[0])] = point;
  }
  return model;
}

// Reads plain values one after the other, as COLMAP's documentation of the binary format lists them.
class Bytes {
 public:
  explicit Bytes(std::string data) : data_(std::move(data)) {}
  template <typename Value>
  Value next() {
    Value value;
    EXPECT_LE(at_ + sizeof value, data_.size());
    std::memcpy(&value, data_.data() + at_, sizeof value);
    at_ += sizeof value;
    return value;
  }
  std::string text() {
    const std::string value(data_.c_str() + at_);
    at_ += value.size() + 1;
    return value;
  }
  bool done() const { return at_ == data_.size(); }

 private:
  std::string data_;
  std::size_t at_ = 0;
};

WrittenModel read_colmap_binary(const ScratchDirectory& folder) {
  WrittenModel model;
  Bytes cameras(read_file(folder.path("model/cameras.bin")));
  for (auto n = cameras.next<std::uint64_t>(); n > 0; --n) {
    const auto id = cameras.next<std::uint32_t>();
    const auto kind = cameras.next<std::int32_t>();
    const auto width = cameras.next<std::uint64_t>(), height = cameras.next<std::uint64_t>();
    model.camera_models[id] = (kind == 4   ? "OPENCV "
                               : kind == 6 ? "FULL_OPENCV "
                                           : "? ") +
                              std::to_string(width) + " " + std::to_string(height);
    for (int i = 0; i < (kind == 4 ? 8 : 12); ++i) model.cameras[id].push_back(cameras.next<double>());
  }
  EXPECT_TRUE(cameras.done());
  Bytes images(read_file(folder.path("model/images.bin")));
  for (auto n = images.next<std::uint64_t>(); n > 0; --n) {
    const auto id = images.next<std::uint32_t>();
    double v[7];
    for (double& value : v) value = images.next<double>();
    WrittenModel::Image image{{v[0], v[1], v[2], v[3]}, {v[4], v[5], v[6]}, images.next<std::uint32_t>(), "", {}};
    image.name = images.text();
    for (auto k = images.next<std::uint64_t>(); k > 0; --k) {
      const double x = images.next<double>(), y = images.next<double>();
      image.observations.push_back({{x, y}, static_cast<std::int64_t>(images.next<std::uint64_t>())});
    }
    model.images[id] = image;
  }
  EXPECT_TRUE(images.done());
  Bytes points(read_file(folder.path("model/points3D.bin")));
  for (auto n = points.next<std::uint64_t>(); n > 0; --n) {
    const auto id = static_cast<std::int64_t>(points.next<std::uint64_t>());
    const double x = points.next<double>(), y = points.next<double>(), z = points.next<double>();
    for (int c = 0; c < 3; ++c) points.next<std::uint8_t>();
    WrittenModel::Point point{{x, y, z}, points.next<double>(), {}};
    for (auto k = points.next<std::uint64_t>(); k > 0; --k) {
      const auto image = points.next<std::uint32_t>();
      point.track.push_back({image, points.next<std::uint32_t>()});
    }
    model.points[id] = point;
  }
  EXPECT_TRUE(points.done());
  return model;
}

// The model projects as we do, and says the same of who sees what.
void expect_equals(const WrittenModel& model, const BlockResult& result) {
  ASSERT_EQ(model.images.size(), 6u) << "frame2 is not oriented";
  std::int64_t observations = 0, points = 0;
  for (std::size_t t = 0; t < result.points.size(); ++t) {
    std::vector<std::int64_t> seen;
    for (auto o = result.tracks.begin[t]; o < result.tracks.begin[t + 1]; ++o) {
      const ImageIndex image = result.tracks.image[static_cast<std::size_t>(o)];
      if (result.kept[static_cast<std::size_t>(o)] && result.block.images[image].frame != FrameIndex(2))
        seen.push_back(o);
    }
    const auto found = model.points.find(result.tracks.id[t].value + 1);
    if (!result.points[t].allFinite() || seen.size() < 2) {
      EXPECT_EQ(found, model.points.end());
      continue;
    }
    ++points;
    ASSERT_NE(found, model.points.end());
    EXPECT_EQ(found->second.position, result.points[t]);
    ASSERT_EQ(found->second.track.size(), seen.size());
    double error = 0;
    for (std::size_t k = 0; k < seen.size(); ++k) {
      ++observations;
      const auto o = static_cast<std::size_t>(seen[k]);
      const ImageIndex index = result.tracks.image[o];
      const auto& image = model.images.at(index.value + 1);
      EXPECT_EQ(found->second.track[k].first, index.value + 1);
      EXPECT_EQ(image.name, result.block.name_of(index));
      const auto& [pixel, point] = image.observations.at(static_cast<std::size_t>(found->second.track[k].second));
      EXPECT_EQ(point, found->first);
      EXPECT_EQ(pixel, Eigen::Vector2d(from_fixed_pixel(result.tracks.x[o]), from_fixed_pixel(result.tracks.y[o])));
      const Eigen::Vector2d theirs =
          colmap_project(model.cameras.at(image.camera), image.rotation * found->second.position + image.translation);
      const Mount& mount = result.block.mount_of(index);
      const Eigen::Vector2d ours =
          project(result.state.cameras[mount.camera],
                  to_camera(result.state.frames[result.block.images[index].frame], mount.pose, result.points[t]));
      EXPECT_LT((theirs - ours).norm(), 1e-9);
      error += (ours - pixel).norm() / static_cast<double>(seen.size());
    }
    EXPECT_NEAR(found->second.error, error, 1e-9);
  }
  EXPECT_GT(observations, 60);
  EXPECT_EQ(static_cast<std::int64_t>(model.points.size()), points);
}

TEST(Export, ColmapTextProjectsAsWeDo) {
  ScratchDirectory folder;
  const BlockResult result = small_result();
  export_result(result, "colmap-text", folder.path("model"));
  const WrittenModel model = read_colmap_text(folder);
  expect_equals(model, result);
  EXPECT_EQ(model.camera_models.at(1), "OPENCV 2000 1500");
  EXPECT_EQ(model.camera_models.at(2), "FULL_OPENCV 2000 1500");
}

TEST(Export, ColmapBinaryHoldsTheSameBits) {
  ScratchDirectory folder;
  const BlockResult result = small_result();
  export_result(result, "colmap-bin", folder.path("model"));
  expect_equals(read_colmap_binary(folder), result);
}

// BAL's projection as its page states it: P = R X + t, p = -P / P.z, p' = f r(p) p.
Eigen::Vector2d bal_project(const double* c, const Eigen::Vector3d& X) {
  const Eigen::Vector3d w(c[0], c[1], c[2]);
  const Eigen::Matrix3d R = Eigen::AngleAxisd(w.norm(), w.normalized()).toRotationMatrix();
  const Eigen::Vector3d P = R * X + Eigen::Vector3d(c[3], c[4], c[5]);
  const Eigen::Vector2d p = -P.head<2>() / P.z();
  const double n = p.squaredNorm();
  return c[6] * (1 + c[7] * n + c[8] * n * n) * p;
}

TEST(Export, BalProjectsAsWeDo) {
  ScratchDirectory folder;
  const BlockResult result = small_result(false);
  export_result(result, "bal", folder.path("problem.txt"));
  std::istringstream stream(read_file(folder.path("problem.txt")));
  std::size_t cameras, points, observations;
  stream >> cameras >> points >> observations;
  const ExportView view = make_export_view(result);
  ASSERT_EQ(cameras, 6u);
  ASSERT_EQ(points, view.tracks.size());
  ASSERT_EQ(observations, view.observations.size());
  struct Row {
    std::size_t camera, point;
    Eigen::Vector2d position;
  };
  std::vector<Row> rows(observations);
  for (Row& row : rows) stream >> row.camera >> row.point >> row.position.x() >> row.position.y();
  std::vector<std::array<double, 9>> parameters(cameras);
  for (auto& camera : parameters)
    for (double& value : camera) stream >> value;
  std::vector<Eigen::Vector3d> positions(points);
  for (Eigen::Vector3d& point : positions) stream >> point.x() >> point.y() >> point.z();
  ASSERT_TRUE(stream);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const Row& row = rows[k];
    const auto i = static_cast<std::int64_t>(row.camera);
    const Eigen::Vector2d theirs = bal_project(parameters[row.camera].data(), positions[row.point]);
    const Intrinsics& in = view.intrinsics(i);
    const Eigen::Vector2d ours = project(in, to_inside(view.pose(i), view.point(static_cast<std::int64_t>(row.point))));
    EXPECT_LT((theirs - Eigen::Vector2d(ours.x() - in[kPrincipalX], in[kPrincipalY] - ours.y())).norm(), 1e-9);
    const Eigen::Vector2d pixel = view.pixel(view.observations[k]);
    EXPECT_LT((row.position - Eigen::Vector2d(pixel.x() - in[kPrincipalX], in[kPrincipalY] - pixel.y())).norm(), 1e-10);
  }
}

// Parameters that BAL does not have are taken out of the observations: residuals stay what they were, to first order.
TEST(Export, BalKeepsTheRaysOfCamerasItCannotDescribe) {
  ScratchDirectory folder;
  BlockResult result = small_result(true);
  for (std::size_t o = 0; o < result.kept.size(); ++o) {  // exact observations
    const Mount& mount = result.block.mount_of(result.tracks.image[o]);
    std::size_t t = 0;
    while (result.tracks.begin[t + 1] <= static_cast<std::int64_t>(o)) ++t;
    if (!result.points[t].allFinite()) continue;
    const FrameIndex frame = result.block.images[result.tracks.image[o]].frame;
    const Eigen::Vector2d pixel = project(result.state.cameras[mount.camera],
                                          to_camera(result.state.frames[frame], mount.pose, result.points[t]));
    result.tracks.x[o] = to_fixed_pixel(pixel.x());
    result.tracks.y[o] = to_fixed_pixel(pixel.y());
  }
  export_result(result, "bal", folder.path("problem.txt"));
  std::istringstream stream(read_file(folder.path("problem.txt")));
  std::size_t cameras, points, observations;
  stream >> cameras >> points >> observations;
  std::vector<std::array<double, 4>> rows(observations);
  for (auto& row : rows) stream >> row[0] >> row[1] >> row[2] >> row[3];
  std::vector<std::array<double, 9>> parameters(cameras);
  for (auto& camera : parameters)
    for (double& value : camera) stream >> value;
  std::vector<Eigen::Vector3d> positions(points);
  for (Eigen::Vector3d& point : positions) stream >> point.x() >> point.y() >> point.z();
  ASSERT_TRUE(stream);
  for (const auto& row : rows)
    EXPECT_LT(
        (bal_project(parameters[static_cast<std::size_t>(row[0])].data(), positions[static_cast<std::size_t>(row[1])]) -
         Eigen::Vector2d(row[2], row[3]))
            .norm(),
        2e-3)
        << "within the rounding of stored observations";
}

// The sigmas of a camera off the frame's centre against many drawn poses of the frame.
TEST(Export, CsvSigmasAreThoseOfTheProjectionCentre) {
  ScratchDirectory folder;
  BlockResult result = small_result();
  result.block.rigs[RigIndex(0)].mounts[1].pose.centre = {3, -1, 2};
  result.state.mounts[RigIndex(0)][1].centre = {3, -1, 2};
  const Geodetic far{46.99, -90.0, 350};  // the vertical turned by more than a degree
  const Georeference reference(result.block.ground);
  result.state.frames[FrameIndex(0)].centre = reference.to_local(far);
  BlockResult::Matrix6 c = BlockResult::Matrix6::Zero();
  c.diagonal() << 0.02, 0.03, 0.01, 0.05, 0.02, 0.1;
  c(0, 4) = c(4, 0) = 0.01;
  c(2, 3) = c(3, 2) = -0.008;
  c *= 1e-4;
  result.frame_covariance.assign(result.block.frames.size(), c);
  export_result(result, "csv", folder.path("tables"));
  const Eigen::LLT<BlockResult::Matrix6> factor(c);
  std::mt19937_64 engine(8);
  std::normal_distribution<double> normal;
  const Eigen::Quaterniond own = reference.own_from_block(far);
  Eigen::Vector3d local = Eigen::Vector3d::Zero(), world = Eigen::Vector3d::Zero();
  const int draws = 40000;
  const Pose frame = result.state.frames[FrameIndex(0)];
  const Pose mount = result.state.mounts[RigIndex(0)][1];
  for (int i = 0; i < draws; ++i) {
    Eigen::Matrix<double, 6, 1> unit;
    for (double& u : unit) u = normal(engine);
    const Eigen::Matrix<double, 6, 1> d = factor.matrixL() * unit;
    const Pose moved{rotation_update(frame.rotation, d.head<3>()), frame.centre + d.tail<3>()};
    const Eigen::Vector3d error = camera_pose(moved, mount).centre - camera_pose(frame, mount).centre;
    local += error.cwiseAbs2() / draws;
    world += (own * error).cwiseAbs2() / draws;
  }
  const auto local_row = words_of(folder.path("tables/images_local.csv"), ',')[2];
  const auto world_row = words_of(folder.path("tables/images_wgs84.csv"), ',')[2];
  for (std::size_t k = 0; k < 3; ++k) {
    const auto axis = static_cast<Eigen::Index>(k);
    EXPECT_NEAR(std::stod(local_row[12 + k]), std::sqrt(local[axis]), 0.02 * std::sqrt(local[axis]));
    EXPECT_NEAR(std::stod(world_row[10 + k]), std::sqrt(world[axis]), 0.02 * std::sqrt(world[axis]));
  }
  EXPECT_NEAR(std::stod(world_row[13]), std::sqrt(0.02) * 0.01 * 180 / std::numbers::pi, 1e-6);
}

TEST(Export, CsvGivesPosesInBothFrames) {
  ScratchDirectory folder;
  BlockResult result = small_result();
  // An image 10 km north, near nadir in its own vertical, its top 30 degrees east of north.
  const Georeference reference(result.block.ground);
  const Geodetic far{46.93, -91.99, 350};
  const double degree = std::numbers::pi / 180;
  const Eigen::Quaterniond own = rotation_from(BodyAttitude{30 * degree, 5 * degree, 2 * degree});
  result.state.frames[FrameIndex(0)] = {own * reference.own_from_block(far), reference.to_local(far)};
  export_result(result, "csv", folder.path("tables"));
  const auto world = words_of(folder.path("tables/images_wgs84.csv"), ',');
  ASSERT_EQ(world.size(), 7u);
  EXPECT_EQ(world[1][0], "frame0/0.jpg");
  EXPECT_NEAR(std::stod(world[1][1]), 46.93, 1e-10);
  EXPECT_NEAR(std::stod(world[1][2]), -91.99, 1e-10);
  EXPECT_NEAR(std::stod(world[1][3]), 350, 1e-4);
  EXPECT_NEAR(std::stod(world[1][7]), 30, 1e-8);
  EXPECT_NEAR(std::stod(world[1][8]), 5, 1e-8);
  EXPECT_NEAR(std::stod(world[1][9]), 2, 1e-8);
  const auto local = words_of(folder.path("tables/images_local.csv"), ',');
  ASSERT_EQ(local.size(), 7u);
  for (std::size_t row = 1; row < local.size(); ++row) {
    std::vector<double> v;
    for (std::size_t k = 3; k < 12; ++k) v.push_back(std::stod(local[row][k]));
    const ExportView view = make_export_view(result);
    const Pose pose = view.pose(static_cast<std::int64_t>(row) - 1);
    EXPECT_EQ(Eigen::Vector3d(v[0], v[1], v[2]), pose.centre);
    EXPECT_LT(rotation_angle(rotation_from(OmegaPhiKappa{v[3] * degree, v[4] * degree, v[5] * degree}), pose.rotation),
              1e-9);
    EXPECT_LT(rotation_angle(rotation_from(BodyAttitude{v[6] * degree, v[7] * degree, v[8] * degree}), pose.rotation),
              1e-9);
  }
  const PoseTable frames = read_pose_csv(folder.path("tables/frames.csv"));
  ASSERT_EQ(frames.names.size(), 3u);
  EXPECT_EQ(frames.poses[2].centre, result.state.frames[FrameIndex(3)].centre);
  const auto cameras = words_of(folder.path("tables/cameras.csv"), ',');
  ASSERT_EQ(cameras.size(), 3u);
  EXPECT_EQ(cameras[2][3], "brown");
  EXPECT_EQ(std::stod(cameras[2][9]), 0.013);
}

TEST(Export, CsvOfMounts) {
  const ScratchDirectory folder;
  BlockResult result = small_result();
  BlockResult::Matrix6 covariance = BlockResult::Matrix6::Zero();
  covariance.diagonal() << 1e-6, 4e-6, 9e-6, 1e-4, 4e-4, 9e-4;
  result.mount_covariance.push_back({BlockResult::Matrix6::Zero(), covariance});
  export_result(result, "csv", folder.path("tables"));
  const auto mounts = words_of(folder.path("tables/mounts.csv"), ',');
  ASSERT_EQ(mounts.size(), 3u);
  ASSERT_EQ(mounts[0].size(), 16u);
  EXPECT_EQ(mounts[2][2], "camera 1");
  std::vector<double> v;
  for (std::size_t k = 3; k < 16; ++k) v.push_back(std::stod(mounts[2][k]));
  const Pose& pose = result.state.mounts[RigIndex(0)][1];
  EXPECT_EQ(Eigen::Vector3d(v[0], v[1], v[2]), pose.centre);
  EXPECT_EQ(Eigen::Quaterniond(v[3], v[4], v[5], v[6]).coeffs(), pose.rotation.coeffs());
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(v[7 + k], 0.01 * (k + 1), 1e-7);
    EXPECT_NEAR(v[10 + k], 1e-3 * (k + 1) * kDegreesPerRadian, 1e-6);
    EXPECT_EQ(std::stod(mounts[1][10 + k]), 0);  // held
  }
  result.mount_covariance.clear();
  export_result(result, "csv", folder.path("tables"));
  EXPECT_EQ(words_of(folder.path("tables/mounts.csv"), ',')[0].size(), 10u);
}

TEST(Export, CsvOfALocalBlockHasNoGeodeticTable) {
  ScratchDirectory folder;
  BlockResult result = small_result();
  result.block.ground = GroundFrame{};
  export_result(result, "csv", folder.path("tables"));
  EXPECT_TRUE(std::filesystem::exists(folder.path("tables/images_local.csv")));
  EXPECT_FALSE(std::filesystem::exists(folder.path("tables/images_wgs84.csv")));
}

TEST(Export, PlyHoldsDoublesAndTheOrigin) {
  ScratchDirectory folder;
  const BlockResult result = small_result();
  export_result(result, "ply", folder.path("points.ply"));
  const std::string text = read_file(folder.path("points.ply"));
  const std::size_t body = text.find("end_header\n") + 11;
  const ExportView view = make_export_view(result);
  const std::size_t vertices = view.tracks.size() + view.images.size();
  EXPECT_THAT(text.substr(0, body), HasSubstr("element vertex " + std::to_string(vertices) + "\n"));
  EXPECT_THAT(text.substr(0, body), HasSubstr("latitude 46.84 longitude -91.99 height 200"));
  ASSERT_EQ(text.size() - body, vertices * 27);
  Bytes bytes(text.substr(body + 27 * view.tracks.size()));
  for (std::int64_t i = 0; i < view.image_count(); ++i) {
    const double x = bytes.next<double>(), y = bytes.next<double>(), z = bytes.next<double>();
    EXPECT_EQ(Eigen::Vector3d(x, y, z), view.pose(i).centre);
    EXPECT_EQ(bytes.next<std::uint8_t>(), 255);
    bytes.next<std::uint16_t>();
  }
}

TEST(Export, GeoJsonFootprintsLieUnderTheCamera) {
  ScratchDirectory folder;
  BlockResult result = small_result();
  result.state.frames[FrameIndex(1)].rotation = rotation_from(YawPitchRoll{0, 0, 0});  // looks at the horizon
  export_result(result, "geojson", folder.path("f.geojson"));
  const auto json = nlohmann::json::parse(read_file(folder.path("f.geojson")));
  ASSERT_EQ(json["features"].size(), 6u);
  const auto& nadir = json["features"][0];
  EXPECT_EQ(nadir["properties"]["image"], "frame0/0.jpg");
  ASSERT_EQ(nadir["geometry"]["type"], "Polygon");
  const auto& ring = nadir["geometry"]["coordinates"][0];
  ASSERT_EQ(ring.size(), 5u);
  EXPECT_EQ(ring[0], ring[4]);
  const Georeference reference(result.block.ground);
  double area = 0;
  std::vector<Eigen::Vector3d> corners;
  for (const auto& c : ring) corners.push_back(reference.to_local({c[1], c[0], 200}));
  for (std::size_t k = 0; k < 4; ++k)
    area += corners[k].head<2>().homogeneous().cross(corners[k + 1].head<2>().homogeneous()).z() / 2;
  // About 100 m x 2000 / 1500 by 100 m, a little larger or smaller by distortion and tilt; anticlockwise.
  EXPECT_NEAR(area, 133 * 100, 2500);
  EXPECT_EQ(json["features"][2]["geometry"]["type"], "Point");
  result.block.ground = GroundFrame{};
  EXPECT_THAT(message_of<InputError>([&] { export_result(result, "geojson", folder.path("f.geojson")); }),
              HasSubstr("not georeferenced"));
}

}  // namespace
}  // namespace megablock
