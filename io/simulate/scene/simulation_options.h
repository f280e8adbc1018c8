// The options of the simulator: the scene, what is observed of it, and the errors of all observations.
#pragma once

#include <cstdint>
#include <string>

namespace megablock {

struct SimulationOptions {
  enum class Scene { kAerial, kStreet, kStereopolis, kTargetField, kPanorama } scene = Scene::kAerial;
  // Target field: how the vehicle moves (docs/reference/simulate.md).
  enum class Path { kSingle, kLine, kLoop, kS, kAll, kSparse } path = Path::kS;
  // The defaults of a scene (and of a path on the target field); those below are of the aerial and the street scene.
  static SimulationOptions of(Scene scene, Path path = Path::kS);

  std::int64_t frames = 100;  // number of frames (aerial: single images; else: rigs)
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
  // Stereopolis, rendered: parts of the vehicle are in the images of the level cameras.
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

}  // namespace megablock
