// Simulated blocks with known truth: one options-driven generator behind all pipeline tests and `megablock simulate`.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "io/block.h"
#include "io/tracks.h"

namespace megablock {

struct SimulationOptions {
  enum class Scene { kAerial, kStreet, kStereopolis, kTargetField, kPanorama } scene = Scene::kAerial;
  // Target field: how the vehicle moves (docs/simulate.md).
  enum class Path { kSingle, kLine, kLoop, kS, kAll, kSparse } path = Path::kS;
  // The defaults of a scene (and of a path on the target field); those below are of the aerial and the street scene.
  static SimulationOptions of(Scene scene, Path path = Path::kS);

  std::int64_t frames = 100;  // number of frames (aerial: single photos; else: rigs)
  std::uint64_t seed = 1;
  // Aerial: rows with overlaps over terrain.
  double forward_overlap = 0.8, side_overlap = 0.6;
  double height_m = 100;  // above mean terrain
  double terrain_relief_m = 15;
  // Street, Stereopolis: grid of `street_spacing_m`, a frame each `frame_distance_m`, `rig_cameras` cameras.
  double street_spacing_m = 100, frame_distance_m = 4;
  int rig_cameras = 4;
  // Stereopolis: every street is driven `drives` times, forth and back, on `days` days.
  int drives = 2, days = 2;
  bool bridge = true;  // one street passes over another one, where a drive is long enough for both
  // Stereopolis: trajectory. Shares of the frames whose satellites are masked, and that have none (a part of those);
  // mean length of a masked stretch; mean of the largest horizontal drift in one, m, and its largest change from frame
  // to frame, m, which keeps the drift of shorter stretches smaller.
  double gnss_masked_share = 0.5, gnss_absent_share = 0.04;
  int gnss_masked_frames = 1500;
  double drift_m = 3, drift_per_frame_m = 0.007;
  // Stereopolis: crossings with 8 to 40 control points each, a seventh of them check points; all of zone
  // `held_out_zone` are (-1: of none).
  int control_zones = 0, held_out_zone = -1;
  std::uint64_t vehicle_seed = 0;  // Stereopolis, target field: seed of cameras and mounts; 0: `seed`
  // Stereopolis, rendered: parts of the vehicle are in the pictures of the level cameras.
  bool vehicle = false;
  // Street, Stereopolis, rendered: share of the houses whose facades repeat every 3.4 m along and 3 m up.
  double repeated_facades = 0;
  // Stereopolis, target field: sigmas per axis of the given mounts, which are also stated; 0: held at the truth.
  double mount_position_error_m = 0.005, mount_rotation_error_deg = 0.5;
  // Panorama: a camera turned about a point (panorama_rotations), from which the projection centre lies off_centre_m
  // ahead; distances of the points are panorama_radius_m times 1 +- depth_spread.
  double panorama_radius_m = 10, depth_spread = 0, off_centre_m = 0;
  // Observations.
  int points_per_frame = 300;  // observations per frame
  double mean_track = 5;
  double image_noise_px = 0.5;  // sigma per axis
  double outlier_share = 0;     // wrong matches
  // Priors.
  double gps_sigma_m = 0.05;      // <= 0: no position priors. Stated sigma = true sigma, save for Stereopolis
  double gps_share = 1;           // share of frames with a position prior
  double attitude_sigma_deg = 0;  // <= 0: no attitude priors
  double relative_position_sigma_m = 0, relative_rotation_sigma_deg = 0.01;  // successive frames; <= 0: none
  double start_position_error_m = 1, start_rotation_error_deg = 1;           // of given poses; < 0: no given poses
  // > 0, with relative poses: given poses are these, integrated from the true first one over a whole pass, or over
  // stretches of start_chain_frames successive frames, and each is off by one vector of up to this length, m.
  double start_offset_m = 0;
  int start_chain_frames = 0;  // 0: whole passes
  int control_points = 0, check_points = 0;
  double control_sigma_m = 0.01;
  // Camera truth and what the block says of it.
  int image_width = 1920, image_height = 1280;
  double focal_px = 1400;
  std::string camera_model = "brown";
  int published_camera = 0;  // 1 to 4: the true camera is one of panorama.h; see use_published_camera. 0: none
  double start_focal = 1;    // focal length that the block starts from, over the nominal one
  bool distortion = true;    // true camera has k1, k2, p1, p2 (other models: all terms); the block starts from zero
  bool calibrate = true;     // camera parameters free (else held at the truth)
  bool free_cameras = true;  // Stereopolis, target field: cameras free (else held at the truth, mounts as `calibrate`)
  // Aerial, street, panorama: the true camera is that of the published simulations (1 to 4), with its size and focal
  // length. Throws InputError for another number.
  void use_published_camera(int number);
  void check() const;  // throws InputError
};

// What a simulated observation shows.
enum class Verdict : std::uint8_t {
  kRight = 0,     // the point, with image_noise_px
  kStray = 1,     // anything, anywhere in the image
  kRepeated = 2,  // another place of a repeated facade, in which neighbouring observations of the track agree
  kVehicle = 3    // a spot on a moving vehicle, the same one in neighbouring observations
};

// State of the satellites at a frame of a simulated trajectory.
enum class Gnss : std::uint8_t { kNone = 0, kMasked = 1, kClear = 2 };

struct SimulatedTracks {
  TrackSet tracks;                      // noisy observations
  std::vector<Eigen::Vector3d> points;  // true positions [tracks]
  std::vector<std::uint8_t> outlier;    // [observations] Verdict; 0 = right
};

// Everything of a block; its tracks are all of them, or none where they went to a sink.
struct SimulatedBlock : SimulatedTracks {
  Block block;  // what a job is given
  BlockState truth;
  std::vector<Eigen::Vector3d> control_truth;  // true positions [block.control_points]
  std::vector<Gnss> gnss;                      // [frames] Stereopolis; else empty
};

SimulatedBlock simulate_block(const SimulationOptions& options);

// The same block, its tracks handed over in batches in the order of their indices. The memory is that of one batch and
// of the frames and images.
using TrackSink = std::function<void(const SimulatedTracks&)>;
inline constexpr std::int64_t kTrackBatch = 1 << 20;  // observations
SimulatedBlock simulate_block(const SimulationOptions& options, const TrackSink& sink,
                              std::int64_t batch_observations = kTrackBatch);

// What becomes of a block.yaml that is in the folder and differs from what would be written.
enum class EditedProject { kRefuse, kOverwrite };

// Renders the images of a small block (textured terrain and boxes, ray cast, Brown distortion) as JPEG with EXIF GPS
// into folder/images, and writes the project files around them:
//   folder/block.yaml, folder/truth.csv and truth.h5 (poses of the frames), folder/control.csv (control and check
//   points, with roles and sigmas), folder/gcp_list.txt (the control points for other programs), folder/poses.csv (the
//   given poses; block.yaml does not use them), folder/rig_cameras.json and rig_assignments.json (street: the rig,
//   held), folder/truth_masks/<camera>.png (vehicle: where it is in the pictures; block.yaml does not use them)
// Attitude priors and relative poses have no place in these files and are not written.
void write_rendered_block(const SimulationOptions& options, const std::string& folder,
                          EditedProject edited = EditedProject::kRefuse);
// The tie-point level, streamed to the files: folder/block.yaml (with `tie_points: tie_points.h5`, `block: given.h5`),
// truth.csv, truth.h5 (poses, cameras), truth_tracks.h5 (points, wrong observations).
void write_simulated_block(const SimulationOptions& options, const std::string& folder,
                           EditedProject edited = EditedProject::kRefuse,
                           std::int64_t batch_observations = kTrackBatch);
// Of truth_tracks.h5: positions of the points and verdicts on the observations, no tracks.
SimulatedTracks read_truth_tracks(const std::string& path);

}  // namespace megablock
