#include "io/exchange/bal/import_bal.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include "io/text/number_reader.h"

namespace megablock {

namespace {

std::string numbered(const char* prefix, std::int64_t i) {
  std::string digits = std::to_string(i);
  if (digits.size() < 6) digits.insert(0, 6 - digits.size(), '0');
  return prefix + digits;
}

// The smallest image about its centre that holds all observations of the camera.
Camera make_camera(const std::string& name, const BalCamera& bal, const Eigen::Vector2d& extent) {
  Camera camera;
  camera.name = name;
  camera.width = 2 * std::max(1, static_cast<int>(std::ceil(extent.x())));
  camera.height = 2 * std::max(1, static_cast<int>(std::ceil(extent.y())));
  camera.intrinsics = {bal.focal, camera.width / 2.0, camera.height / 2.0, bal.k1, bal.k2, 0, 0, 0};
  // The principal point is the origin of the file's image coordinates and cannot be known better: it is held.
  camera.prior_sigma = {0.05 * bal.focal, 0, 0, 0.2, 0.2, 0, 0, 0};
  camera.focal_known = true;
  return camera;
}

}  // namespace

ImportedBlock block_from_bal(const BalProblem& problem, const std::vector<std::string>& names) {
  std::vector<Eigen::Vector2d> extent(problem.cameras.size(), Eigen::Vector2d::Zero());
  for (const BalObservation& o : problem.observations) {
    Eigen::Vector2d& e = extent[static_cast<std::size_t>(o.camera)];
    e = e.cwiseMax(o.position.cwiseAbs());
  }
  ImportedBlock imported;
  Block& block = imported.block;
  for (std::size_t c = 0; c < problem.cameras.size(); ++c) {
    const std::string name = names.empty() ? numbered("image", static_cast<std::int64_t>(c)) : names[c];
    block.rigs.push_back({name, {Mount{block.cameras.next_index(), {}}}});
    block.cameras.push_back(make_camera(name, problem.cameras[c], extent[c]));
    Frame frame;
    frame.name = name;
    frame.rig = RigIndex(static_cast<std::int64_t>(c));
    frame.given_pose = pose_from_bal(problem.cameras[c]);
    block.add_image(name, {block.frames.next_index(), 0, 0});
    block.frames.push_back(std::move(frame));
  }
  check(block);
  imported.state = initial_state(block);

  std::vector<BalObservation> sorted = problem.observations;
  std::stable_sort(sorted.begin(), sorted.end(), [](const BalObservation& a, const BalObservation& b) {
    return std::pair(a.point, a.camera) < std::pair(b.point, b.camera);
  });
  TrackSet& tracks = imported.tracks;
  tracks.begin.push_back(0);
  std::size_t o = 0;
  for (std::size_t p = 0; p < problem.points.size(); ++p) {
    for (; o < sorted.size() && sorted[o].point == static_cast<std::int64_t>(p); ++o) {
      const ImageIndex image(sorted[o].camera);
      if (static_cast<std::int64_t>(tracks.image.size()) > tracks.begin.back() && tracks.image.back() == image)
        continue;  // of two observations in one image, the first counts
      const Camera& camera = block.cameras[CameraIndex(sorted[o].camera)];
      tracks.image.push_back(image);
      // u = cx + x', v = cy - y': their y axis points up.
      tracks.x.push_back(to_fixed_pixel(camera.intrinsics[kPrincipalX] + sorted[o].position.x()));
      tracks.y.push_back(to_fixed_pixel(camera.intrinsics[kPrincipalY] - sorted[o].position.y()));
      tracks.feature.push_back(-1);
    }
    tracks.id.push_back(TrackIndex(static_cast<std::int64_t>(p)));
    tracks.begin.push_back(static_cast<std::int64_t>(tracks.image.size()));
  }
  imported.points = problem.points;
  return imported;
}

BalProblem read_bal(const std::string& path) {
  NumberReader reader(path);
  const std::int64_t cameras = reader.integer("number of cameras", 1, kMany);
  const std::int64_t points = reader.integer("number of points", 0, kMany);
  const std::int64_t observations = reader.integer("number of observations", 0, kMany);
  BalProblem problem;
  for (std::int64_t i = 0; i < observations; ++i) {
    BalObservation o;
    o.camera = reader.integer("camera of an observation", 0, cameras - 1);
    o.point = reader.integer("point of an observation", 0, points - 1);
    o.position.x() = reader.number("x of an observation", kFarthestPixel);
    o.position.y() = reader.number("y of an observation", kFarthestPixel);
    problem.observations.push_back(o);
  }
  for (std::int64_t c = 0; c < cameras; ++c) {
    constexpr const char* kParameters = "a camera's parameters";
    BalCamera camera;
    Eigen::Vector3d rotation;
    for (double& value : rotation) value = reader.number(kParameters);
    camera.rotation = rotation_exp<double>(rotation).normalized().toRotationMatrix();
    for (double& value : camera.translation) value = reader.number(kParameters);
    camera.focal = reader.number(kParameters);
    if (!(camera.focal > 0)) reader.fail("focal length of camera " + std::to_string(c) + " is not positive");
    camera.k1 = reader.number(kParameters);
    camera.k2 = reader.number(kParameters);
    problem.cameras.push_back(camera);
  }
  for (std::int64_t p = 0; p < points; ++p) {
    Eigen::Vector3d point;
    for (double& value : point) value = reader.number("a point's coordinates");
    problem.points.push_back(point);
  }
  if (!reader.at_end()) reader.fail("more numbers than the first line announces");
  return problem;
}

namespace {

std::vector<std::string> read_list(const std::string& path, std::size_t count) {
  if (!std::filesystem::is_regular_file(path)) return {};
  NumberReader reader(path);
  std::vector<std::string> names;
  while (!reader.at_end()) {
    names.emplace_back(reader.rest_of_line());
    // A line may be "name 0 focal". The last two words are removed if they are numbers.
    std::string& name = names.back();
    for (int i = 0; i < 2; ++i) {
      const auto blank = name.find_last_of(' ');
      if (blank != std::string::npos && name.find_first_not_of("0123456789.eE+-", blank + 1) == std::string::npos)
        name.erase(blank);
    }
  }
  if (names.size() != count)
    reader.fail("lists " + std::to_string(names.size()) + " images, the bundle file has " + std::to_string(count));
  return names;
}

bool is_rotation(const Eigen::Matrix3d& r) {
  return (r * r.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-3 && r.determinant() > 0;
}

// Reads a camera. A camera with focal length 0 has no rotation matrix.
BalCamera read_bundler_camera(NumberReader& reader, std::int64_t c) {
  BalCamera camera;
  camera.focal = reader.number("a camera's focal length");
  if (camera.focal < 0) reader.fail("focal length of camera " + std::to_string(c) + " is negative");
  camera.k1 = reader.number("a camera's k1");
  camera.k2 = reader.number("a camera's k2");
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) camera.rotation(row, column) = reader.number("a camera's rotation");
  if (camera.focal > 0 && !is_rotation(camera.rotation))
    reader.fail("camera " + std::to_string(c) + " has no rotation matrix");
  for (double& value : camera.translation) value = reader.number("a camera's translation");
  return camera;
}

}  // namespace

ImportedBlock import_bal(const std::string& path) { return block_from_bal(read_bal(path), {}); }

// Reads a Bundler file. Cameras with focal length 0 are left out: the program that wrote the file did not orient them.
ImportedBlock import_bundler(const std::string& path) {
  NumberReader reader(path);
  if (!reader.rest_of_line().starts_with("# Bundle file v0.3")) reader.fail("is no Bundler file (v0.3)");
  const std::int64_t cameras = reader.integer("number of cameras", 1, kMany);
  const std::int64_t points = reader.integer("number of points", 0, kMany);
  std::vector<std::string> names = read_list(path + ".list.txt", static_cast<std::size_t>(cameras)), kept_names;
  BalProblem problem;
  std::vector<std::int64_t> place(static_cast<std::size_t>(cameras), -1);
  for (std::int64_t c = 0; c < cameras; ++c) {
    const BalCamera camera = read_bundler_camera(reader, c);
    if (camera.focal == 0) continue;
    place[static_cast<std::size_t>(c)] = static_cast<std::int64_t>(problem.cameras.size());
    kept_names.push_back(names.empty() ? numbered("image", c) : names[static_cast<std::size_t>(c)]);
    problem.cameras.push_back(camera);
  }
  for (std::int64_t p = 0; p < points; ++p) {
    Eigen::Vector3d point;
    for (double& value : point) value = reader.number("a point's coordinates");
    problem.points.push_back(point);
    for (int c = 0; c < 3; ++c) reader.number("a point's colour");
    const std::int64_t views = reader.integer("a point's number of views", 0, cameras);
    for (std::int64_t v = 0; v < views; ++v) {
      BalObservation o;
      o.point = p;
      o.camera = place[static_cast<std::size_t>(reader.integer("camera of a view", 0, cameras - 1))];
      reader.number("key of a view");
      o.position.x() = reader.number("x of a view", kFarthestPixel);
      o.position.y() = reader.number("y of a view", kFarthestPixel);
      if (o.camera >= 0) problem.observations.push_back(o);
    }
  }
  if (!reader.at_end()) reader.fail("more numbers than the second line announces");
  return block_from_bal(problem, kept_names);
}

}  // namespace megablock
