// Reads and writes the block as it was read from the project file and the image headers
// (docs/reference/file-formats.md, "Block").
#include "io/store/units/block_file.h"

#include <algorithm>
#include <functional>

#include "io/store/hdf5/hdf5_cameras.h"
#include "io/store/hdf5/hdf5_tables.h"
#include "io/store/units/hdf5_block.h"
#include "io/store/units/hdf5_block_observations.h"

namespace megablock {

namespace {

void put_ground(Hdf5Writer& file, const GroundFrame& ground) {
  file.group("ground", "local topocentric frame: east, north, up; metres");
  file.attribute("ground", "georeferenced", static_cast<std::uint8_t>(ground.georeferenced));
  file.attribute("ground", "latitude_deg", ground.latitude_deg);
  file.attribute("ground", "longitude_deg", ground.longitude_deg);
  file.attribute("ground", "height_m", ground.height_m);
  file.attribute("ground", "crs", ground.crs);
}

GroundFrame get_ground(const Hdf5Reader& file) {
  GroundFrame ground;
  ground.georeferenced = file.attribute<std::uint8_t>("ground", "georeferenced") != 0;
  ground.latitude_deg = file.attribute<double>("ground", "latitude_deg");
  ground.longitude_deg = file.attribute<double>("ground", "longitude_deg");
  ground.height_m = file.attribute<double>("ground", "height_m");
  ground.crs = file.text_attribute("ground", "crs");
  return ground;
}

constexpr const char *kReadout = "cameras/readout", *kEstimateReadout = "cameras/estimate_readout";
constexpr const char *kChoose = "cameras/choose", *kChoice = "cameras/choice";

void put_cameras(Hdf5Writer& file, const IndexedVector<CameraIndex, Camera>& cameras) {
  std::vector<std::int32_t> size;
  for (const Camera& camera : cameras) size.insert(size.end(), {camera.width, camera.height});
  const auto models = column(cameras, [](const Camera& c) { return c.intrinsics.model(); });
  file.group("cameras", "one row per physical camera");
  file.texts("cameras/name", column(cameras, [](const Camera& c) { return c.name; }));
  file.matrix("cameras/size", size, 2, {"px", "width, height"});
  put_models(file, models);
  put_parameters(file, "cameras/start_intrinsics", models,
                 column(cameras, [](const Camera& c) { return c.intrinsics.data(); }), "start values");
  put_parameters(file, "cameras/prior_sigma", models,
                 column(cameras, [](const Camera& c) { return c.prior_sigma.data(); }),
                 "prior sigmas; 0: held, infinity: free without prior");
  file.vector("cameras/focal_known", column(cameras, [](const Camera& c) -> std::uint8_t { return c.focal_known; }),
              {"", "1: from EXIF, sensor table or project file; 0: a guess"});
  file.texts("cameras/mask_path", column(cameras, [](const Camera& c) { return c.mask_path; }));
  if (std::any_of(cameras.begin(), cameras.end(),
                  [](const Camera& c) { return c.readout_s != 0 || c.estimate_readout; })) {
    file.vector(kReadout, column(cameras, [](const Camera& c) { return c.readout_s; }),
                {"s", "from the first row of an image to the last; 0: no rolling shutter"});
    file.vector(kEstimateReadout, column(cameras, [](const Camera& c) -> std::uint8_t { return c.estimate_readout; }),
                {"", "1: found from the images"});
  }
  if (std::none_of(cameras.begin(), cameras.end(), [](const Camera& c) { return c.choose || !c.choice.empty(); }))
    return;
  file.vector(kChoose, column(cameras, [](const Camera& c) -> std::uint8_t { return c.choose; }),
              {"", "1: the block decides which parameters are estimated"});
  file.texts(kChoice, column(cameras, [](const Camera& c) { return c.choice; }), {"", "what it decided, and why"});
}

IndexedVector<CameraIndex, Camera> get_cameras(const Hdf5Reader& file) {
  const std::vector<std::string> names = file.texts("cameras/name");
  const auto count = static_cast<std::int64_t>(names.size());
  const auto size = file.matrix<std::int32_t>("cameras/size", 2, count);
  const std::vector<CameraModel> models = get_models(file, count);
  const auto known = file.vector<std::uint8_t>("cameras/focal_known", count);
  const std::vector<std::string> masks = file.texts("cameras/mask_path", count);
  const bool any_readout = file.has(kReadout);
  const auto readout = any_readout ? file.vector<double>(kReadout, count) : std::vector<double>(names.size());
  const auto estimate =
      any_readout ? file.vector<std::uint8_t>(kEstimateReadout, count) : std::vector<std::uint8_t>(names.size());
  const bool any_choice = file.has(kChoose);
  const auto choose = any_choice ? file.vector<std::uint8_t>(kChoose, count) : std::vector<std::uint8_t>(names.size());
  const auto choice = any_choice ? file.texts(kChoice, count) : std::vector<std::string>(names.size());
  IndexedVector<CameraIndex, Camera> cameras(names.size());
  std::vector<double*> intrinsics, sigma;
  for (std::size_t i = 0; i < names.size(); ++i) {
    Camera& camera = cameras[CameraIndex(static_cast<std::int64_t>(i))];
    camera.name = names[i];
    camera.width = size[2 * i];
    camera.height = size[2 * i + 1];
    camera.intrinsics = Intrinsics(models[i]);
    camera.focal_known = known[i] != 0;
    camera.mask_path = masks[i];
    camera.readout_s = readout[i];
    camera.estimate_readout = estimate[i] != 0;
    camera.choose = choose[i] != 0;
    camera.choice = choice[i];
    intrinsics.push_back(camera.intrinsics.data());
    sigma.push_back(camera.prior_sigma.data());
  }
  get_parameters(file, "cameras/start_intrinsics", models, intrinsics);
  get_parameters(file, "cameras/prior_sigma", models, sigma);
  return cameras;
}

void put_rigs(Hdf5Writer& file, const IndexedVector<RigIndex, Rig>& rigs) {
  std::vector<Mount> mounts;
  for (const Rig& rig : rigs) mounts.insert(mounts.end(), rig.mounts.begin(), rig.mounts.end());
  file.group("rigs", "one row per rig");
  file.texts("rigs/name", column(rigs, [](const Rig& r) { return r.name; }));
  file.vector("rigs/mounts", column(rigs, [](const Rig& r) { return static_cast<std::int32_t>(r.mounts.size()); }),
              {"", "number of mounts: rows of the group 'mounts', in the order of the rigs"});
  file.group("mounts",
             "one row per camera of a rig, and one for its receiver, if it has one; a rig without cameras is a group of "
             "positions");
  file.vector("mounts/camera", column(mounts, [](const Mount& m) { return m.camera.value; }),
              {"", "row in cameras; -1: the receiver"});
  file.group("mounts/start");
  write_poses(file, "mounts/start", column(mounts, [](const Mount& m) { return m.pose; }), "camera", "rig");
  file.vector("mounts/rotation_sigma", column(mounts, [](const Mount& m) { return m.rotation_sigma_rad; }),
              {"rad", "prior sigma; 0: held"});
  file.vector("mounts/position_sigma", column(mounts, [](const Mount& m) { return m.position_sigma_m; }),
              {"m", "prior sigma; 0: held"});
}

IndexedVector<RigIndex, Rig> get_rigs(const Hdf5Reader& file) {
  const std::vector<std::string> names = file.texts("rigs/name");
  const std::vector<Pose> poses = read_poses(file, "mounts/start");
  const auto count = static_cast<std::int64_t>(poses.size());
  const auto begin = begin_of(file, "rigs/mounts",
                              file.vector<std::int64_t>("rigs/mounts", static_cast<std::int64_t>(names.size())), count);
  const auto cameras = file.vector<std::int64_t>("mounts/camera", count);
  const auto rotation_sigma = file.vector<double>("mounts/rotation_sigma", count);
  const auto position_sigma = file.vector<double>("mounts/position_sigma", count);
  IndexedVector<RigIndex, Rig> rigs;
  for (std::size_t r = 0; r < names.size(); ++r) {
    Rig rig{names[r], {}};
    for (auto m = static_cast<std::size_t>(begin[r]); m < static_cast<std::size_t>(begin[r + 1]); ++m)
      rig.mounts.push_back({CameraIndex(cameras[m]), poses[m], rotation_sigma[m], position_sigma[m]});
    rigs.push_back(std::move(rig));
  }
  return rigs;
}

// A frame without a prior has 0 in `present` and a row of NaN.
void put_frame_priors(Hdf5Writer& file, const IndexedVector<FrameIndex, Frame>& frames) {
  const auto position = [](auto member) {
    return [member](const Frame& f) -> Eigen::Vector3d {
      return f.position_prior ? (*f.position_prior).*member : absent_vector();
    };
  };
  file.group("frames/position_prior", "GNSS positions of the antenna; rows of NaN: none");
  file.vector("frames/position_prior/present",
              column(frames, [](const Frame& f) -> std::uint8_t { return f.position_prior.has_value(); }));
  file.matrix("frames/position_prior/position", vectors3(frames, position(&PositionPrior::position)), 3,
              {"m", "ground frame"});
  file.matrix("frames/position_prior/sigma", vectors3(frames, position(&PositionPrior::sigma)), 3,
              {"m", "east, north, up"});
  file.matrix("frames/position_prior/lever_arm", vectors3(frames, position(&PositionPrior::lever_arm)), 3,
              {"m", "antenna in the rig: antenna = C + R' lever_arm"});
  file.vector("frames/position_prior/group",
              column(frames,
                     [](const Frame& f) {
                       return f.position_prior ? f.position_prior->group.value : RigIndex().value;
                     }),
              {"", "row in rigs of the group with a shift of its own; -1: none"});
  file.matrix("frames/position_prior/shifted",
              vectors3(frames,
                       [](const Frame& f) -> Eigen::Vector3d {
                         return f.position_prior ? Eigen::Vector3d(f.position_prior->shifted.cast<double>())
                                                 : absent_vector();
                       }),
              3,
              {"", "1 for each axis along which the group is shifted"});

  file.group("frames/attitude_prior", "observed attitudes in the ground frame; rows of NaN: none");
  file.vector("frames/attitude_prior/present",
              column(frames, [](const Frame& f) -> std::uint8_t { return f.attitude_prior.has_value(); }));
  file.matrix("frames/attitude_prior/rotation_wxyz",
              quaternions(frames,
                          [](const Frame& f) {
                            return f.attitude_prior ? f.attitude_prior->rotation_cw : absent_quaternion();
                          }),
              4, {"", "unit quaternion, ground -> rig"});
  file.matrix("frames/attitude_prior/sigma",
              vectors3(frames,
                       [](const Frame& f) -> Eigen::Vector3d {
                         return f.attitude_prior ? f.attitude_prior->sigma_rad : absent_vector();
                       }),
              3, {"rad", "about the rig's x, y, z axes"});

  file.group("frames/given", "approximate poses from a file; rows of NaN: none");
  file.vector("frames/given/present",
              column(frames, [](const Frame& f) -> std::uint8_t { return f.given_pose.has_value(); }));
  write_poses(file, "frames/given",
              column(frames,
                     [](const Frame& f) {
                       return f.given_pose ? *f.given_pose : Pose{absent_quaternion(), absent_vector()};
                     }),
              "rig", "ground frame");
}

// Priors are read kind by kind, so that only the columns of one kind are in memory.
void get_position_priors(const Hdf5Reader& file, IndexedVector<FrameIndex, Frame>& frames) {
  const auto count = static_cast<std::int64_t>(frames.size());
  const auto present = file.vector<std::uint8_t>("frames/position_prior/present", count);
  const auto position = file.matrix<double>("frames/position_prior/position", 3, count);
  const auto sigma = file.matrix<double>("frames/position_prior/sigma", 3, count);
  const auto lever_arm = file.matrix<double>("frames/position_prior/lever_arm", 3, count);
  std::vector<std::int64_t> group(frames.size(), RigIndex().value);  // earlier versions had no groups
  std::vector<double> shifted(3 * frames.size(), 0);
  if (file.has("frames/position_prior/group")) {
    group = file.vector<std::int64_t>("frames/position_prior/group", count);
    shifted = file.matrix<double>("frames/position_prior/shifted", 3, count);
  }
  for (std::size_t i = 0; i < frames.size(); ++i)
    if (present[i])
      frames[FrameIndex(static_cast<std::int64_t>(i))].position_prior = PositionPrior{
          vector3(position, i), vector3(sigma, i), vector3(lever_arm, i), RigIndex(group[i]),
          vector3(shifted, i).cast<std::uint8_t>()};
}

void get_attitude_priors(const Hdf5Reader& file, IndexedVector<FrameIndex, Frame>& frames) {
  const auto count = static_cast<std::int64_t>(frames.size());
  const auto present = file.vector<std::uint8_t>("frames/attitude_prior/present", count);
  const auto attitude = file.matrix<double>("frames/attitude_prior/rotation_wxyz", 4, count);
  const auto sigma = file.matrix<double>("frames/attitude_prior/sigma", 3, count);
  for (std::size_t i = 0; i < frames.size(); ++i)
    if (present[i])
      frames[FrameIndex(static_cast<std::int64_t>(i))].attitude_prior =
          AttitudePrior{quaternion(attitude, i), vector3(sigma, i)};
}

void get_given_poses(const Hdf5Reader& file, IndexedVector<FrameIndex, Frame>& frames) {
  const auto count = static_cast<std::int64_t>(frames.size());
  const auto present = file.vector<std::uint8_t>("frames/given/present", count);
  const std::vector<Pose> given = read_poses(file, "frames/given", count);
  for (std::size_t i = 0; i < frames.size(); ++i)
    if (present[i]) frames[FrameIndex(static_cast<std::int64_t>(i))].given_pose = given[i];
}

void put_frames(Hdf5Writer& file, const IndexedVector<FrameIndex, Frame>& frames) {
  file.group("frames", "one row per frame: a pose of a rig");
  file.texts("frames/name", std::ssize(frames), [&](std::int64_t i) { return frames[FrameIndex(i)].name; });
  file.vector("frames/rig", column(frames, [](const Frame& f) { return f.rig.value; }), {"", "row in rigs"});
  file.vector("frames/pass", column(frames, [](const Frame& f) { return f.pass; }),
              {"", "acquisition line, -1: unknown"});
  file.vector("frames/time", column(frames, [](const Frame& f) { return f.time_s; }),
              {"s", "of acquisition, since 1970; NaN: unknown"});
  put_frame_priors(file, frames);
}

IndexedVector<FrameIndex, Frame> get_frames(const Hdf5Reader& file) {
  const std::vector<std::string> names = file.texts("frames/name");
  const auto count = static_cast<std::int64_t>(names.size());
  const auto rigs = file.vector<std::int64_t>("frames/rig", count);
  const auto passes = file.vector<std::int64_t>("frames/pass", count);
  const auto times = file.vector<double>("frames/time", count);
  IndexedVector<FrameIndex, Frame> frames(names.size());
  for (std::size_t i = 0; i < names.size(); ++i) {
    Frame& frame = frames[FrameIndex(static_cast<std::int64_t>(i))];
    frame.name = names[i];
    frame.rig = RigIndex(rigs[i]);
    frame.pass = passes[i];
    frame.time_s = times[i];
  }
  get_position_priors(file, frames);
  get_attitude_priors(file, frames);
  get_given_poses(file, frames);
  return frames;
}

void put_images(Hdf5Writer& file, const IndexedVector<ImageIndex, Image>& images, const Block& block) {
  file.group("images", "one row per exposure");
  const std::int64_t count = std::ssize(images);
  file.texts("images/name", count, [&](std::int64_t i) { return block.name_of(ImageIndex(i)); });
  file.texts("images/path", count, [&](std::int64_t i) { return block.path_of(ImageIndex(i)); },
             {"", "image file; empty for simulated tie points"});
  file.vector("images/frame", column(images, [](const Image& i) { return i.frame.value; }), {"", "row in frames"});
  file.vector("images/mount", column(images, [](const Image& i) { return static_cast<std::int32_t>(i.mount); }),
              {"", "mount within the frame's rig"});
  constexpr std::size_t kImagesAtATime = 1 << 16;
  std::vector<std::int64_t> cameras;
  cameras.reserve(images.size());
  for (const Image& image : images) {
    if (cameras.size() % kImagesAtATime == 0) file.rest();
    // The block may not have been checked, and its indices may refer to nothing. The camera is then unknown; the reader
    // does not use this column.
    const bool sound = block.frames.contains(image.frame) && block.rigs.contains(block.frames[image.frame].rig) &&
                       image.mount >= 0 &&
                       static_cast<std::size_t>(image.mount) < block.rig_of(image.frame).cameras().size();
    cameras.push_back(sound ? block.rig_of(image.frame).mounts[static_cast<std::size_t>(image.mount)].camera.value
                            : -1);
  }
  file.vector("images/camera", cameras, {"", "row in cameras (follows from frame and mount)"});
  file.vector("images/file_hash", column(images, [](const Image& i) { return i.file_hash; }),
              {"", "XXH3 of the image file, 0: none"});
}

// The folder before the image names in their paths. It is the same for all images, so only the first path is read.
std::string get_image_folder(const Hdf5Reader& file) {
  if (file.shape("images/path") != file.shape("images/name")) file.fail("images/path", "must have one row per image");
  if (file.shape("images/name") == std::vector<std::int64_t>{0}) return "";
  const std::string path = file.text_rows("images/path", {{0, 1}}).front();
  const std::string name = file.text_rows("images/name", {{0, 1}}).front();
  // Paths are folder + name, so only the folder need be kept in memory.
  return path.ends_with(name) ? path.substr(0, path.size() - name.size()) : "";
}

std::int64_t image_count(const Hdf5Reader& file) {
  const std::vector<std::int64_t> shape = file.shape("images/name");
  for (const char* name : {"images/frame", "images/mount", "images/file_hash"})
    if (shape.size() != 1 || file.shape(name) != shape) file.fail(name, "must have one row per image");
  return shape[0];
}

// Calls visit(rows) for `count` rows in batches.
void visit_rows(std::int64_t count, const std::function<void(const std::vector<RowRange>&)>& visit) {
  constexpr std::int64_t kBatch = 1 << 16;
  for (std::int64_t first = 0; first < count; first += kBatch) visit({{first, std::min(kBatch, count - first)}});
}

IndexedVector<ImageIndex, Image> get_images(const Hdf5Reader& file) {
  IndexedVector<ImageIndex, Image> images;
  const std::int64_t count = image_count(file);
  images.reserve(static_cast<std::size_t>(count));
  visit_rows(count, [&](const std::vector<RowRange>& rows) {
    const auto frames = file.rows<std::int64_t>("images/frame", rows);
    const auto mounts = file.rows<std::int32_t>("images/mount", rows);
    const auto hashes = file.rows<std::uint64_t>("images/file_hash", rows);
    for (std::size_t i = 0; i < frames.size(); ++i) images.push_back({FrameIndex(frames[i]), mounts[i], hashes[i]});
  });
  return images;
}

NameTable<ImageIndex> get_image_names(const Hdf5Reader& file) {
  NameTable<ImageIndex> names;
  const std::int64_t count = image_count(file);
  names.reserve(static_cast<std::size_t>(count));
  visit_rows(count, [&](const std::vector<RowRange>& rows) {
    for (const std::string& name : file.text_rows("images/name", rows)) names.push_back(name);
  });
  return names;
}

Block get_block_without_names(const Hdf5Reader& file) {
  Block block;
  block.ground = get_ground(file);
  block.cameras = get_cameras(file);
  block.rigs = get_rigs(file);
  block.frames = get_frames(file);
  block.image_folder = get_image_folder(file);
  block.images = get_images(file);
  block.relative_poses = get_relative_poses(file);
  block.control_points = get_control(file);
  block.lines = get_lines(file);
  block.verticals = get_verticals(file);
  get_frame_measurements(file, block);
  return block;
}

}  // namespace

void put_block(Hdf5Writer& file, const Block& block) {
  put_ground(file, block.ground);
  put_cameras(file, block.cameras);
  put_rigs(file, block.rigs);
  put_frames(file, block.frames);
  put_images(file, block.images, block);
  put_relative_poses(file, block.relative_poses);
  put_control(file, block.control_points);
  put_lines(file, block.lines);
  put_verticals(file, block.verticals);
  put_frame_measurements(file, block);
}

Block get_block(const Hdf5Reader& file) {
  NameTable<ImageIndex> names = get_image_names(file);  // before the tables, because it moves in memory while it grows
  Block block = get_block_without_names(file);
  block.image_names = std::move(names);
  return block;
}

void write_block(const std::string& path, const Block& block, std::function<void()> after_table) {
  Hdf5Writer file(path, "block");
  if (after_table) file.after_datasets(std::move(after_table));
  put_block(file, block);
  file.close();
}

Block read_block(const std::string& path) { return get_block(Hdf5Reader(path, "block")); }

Block read_block_without_names(const std::string& path) { return get_block_without_names(Hdf5Reader(path, "block")); }

NameTable<ImageIndex> read_image_names(const std::string& path) { return get_image_names(Hdf5Reader(path, "block")); }

}  // namespace megablock
