// Holds the options of the simulator: the scene, the observations, and their errors.
//
// The noise of priors and of control points is normal and independent per axis, and its sigma is the one that the block
// states. Weighted residuals of the truth therefore have the variance 1. Only the trajectory of Stereopolis breaks this
// rule on purpose (trajectory.h): there the stated sigmas are too small.
#pragma once

#include <cstdint>
#include <string>

namespace megablock {

struct SimulationOptions {
  enum class Scene {
    kAerial,
    kStreet,
    kStereopolis,
    kTargetField,
    kPanorama,
    kCourtyard,
    kTower
  } scene = Scene::kAerial;
  // Target field: the path of the vehicle (docs/reference/simulate.md).
  enum class Path { kSingle, kLine, kLoop, kS, kAll, kSparse } path = Path::kS;
  // The defaults of a scene (and of a path on the target field). The initial values below are those of the aerial and
  // the street scene.
  static SimulationOptions of(Scene scene, Path path = Path::kS);

  std::int64_t frames = 100;  // number of frames (aerial: single images; else: rigs)
  std::uint64_t seed = 1;
  // Aerial: overlaps in the flight line and between lines.
  double forward_overlap = 0.8, side_overlap = 0.6;
  double height_m = 100;  // above mean terrain
  double terrain_relief_m = 15;
  // Street, Stereopolis: distance of the streets, distance of the frames, number of cameras.
  double street_spacing_m = 100, frame_distance_m = 4;
  int rig_cameras = 4;
  // Stereopolis: number of drives over every street, in both directions, and number of days.
  int drives = 2, days = 2;
  bool bridge = true;  // one street crosses another one on a bridge, if a drive is long enough for both
  // Stereopolis: the trajectory. Shares of the frames with masked satellites, and of those without any satellite (a
  // part of the former); mean length of a masked stretch, frames; mean of the largest horizontal drift in a stretch,
  // metres; and largest change of the drift between frames, metres, which limits the drift of short stretches.
  double gnss_masked_share = 0.5, gnss_absent_share = 0.04;
  int gnss_masked_frames = 1500;
  double drift_m = 3, drift_per_frame_m = 0.007;
  // Stereopolis: number of crossings with 8 to 40 control points each, of which a seventh are check points. All points
  // of zone `held_out_zone` are check points (-1: no such zone).
  int control_zones = 0, held_out_zone = -1;
  std::uint64_t vehicle_seed = 0;  // Stereopolis, target field: seed of cameras and mounts; 0: `seed`
  // Stereopolis, rendered: whether the level cameras see parts of the vehicle.
  bool vehicle = false;
  // Street, Stereopolis, rendered: share of the houses whose facades repeat every 3.4 m along the street and 3 m
  // upwards.
  double repeated_facades = 0;
  // Courtyard, tower: the share of detail that each of the four like facades has of its own.
  double own_detail = 0.4;
  // Stereopolis, target field: true and stated sigmas per axis of the given mounts; 0: held at the truth.
  double mount_position_error_m = 0.005, mount_rotation_error_deg = 0.5;
  // Panorama: the camera turns about a point (panorama_rotations()), and its projection centre is off_centre_m ahead of
  // this point. The distances of the tie points are panorama_radius_m times 1 +- depth_spread.
  double panorama_radius_m = 10, depth_spread = 0, off_centre_m = 0;
  // Observations.
  int points_per_frame = 300;  // observations per frame
  double mean_track = 5;
  double image_noise_px = 0.5;  // sigma per axis
  double outlier_share = 0;     // share of wrong matches
  // Priors.
  double gps_sigma_m = 0.05;      // <= 0: no position priors. Stated = true sigma, except for Stereopolis
  double gps_share = 1;           // share of frames with a position prior
  double attitude_sigma_deg = 0;  // <= 0: no attitude priors
  // The antenna lies off its stated lever arm, and the attitudes are turned against the rig, by these lengths along
  // kOffReceiver (io/simulate/blocks/priors.h).
  double lever_arm_error_m = 0, boresight_error_deg = 0;
  double relative_position_sigma_m = 0, relative_rotation_sigma_deg = 0.01;  // of successive frames; <= 0: none
  double start_position_error_m = 1, start_rotation_error_deg = 1;           // of given poses; < 0: no given poses
  // > 0, with relative poses: the given poses are the integrated relative poses, from the true pose of the first frame
  // of each pass, or of each stretch of start_chain_frames frames. Each pass or stretch is then shifted by a vector of
  // up to this length, metres.
  double start_offset_m = 0;
  int start_chain_frames = 0;  // 0: whole passes
  int control_points = 0, check_points = 0;
  double control_sigma_m = 0.01;
  // The true camera, and its initial values in the block.
  int image_width = 1920, image_height = 1280;
  double focal_px = 1400;
  std::string camera_model = "brown";
  int published_camera = 0;  // 1 to 4: the true camera is one of panorama.h (use_published_camera()). 0: none
  double start_focal = 1;    // initial focal length of the block, over the nominal one
  bool distortion = true;    // the true camera has k1, k2, p1, p2 (other models: all terms); initial values are zero
  // Brown's model: largest affinity b1 and skew b2 of the true camera, as a share of the focal length. They are free
  // then, and zero at first.
  double affinity = 0;
  // Aerial, street: rolling shutter. The readout time of all rows, ms (0: none), the readout time that the block states
  // over the true one, and the speed. The path is smooth then, so that its velocity has a meaning.
  double readout_ms = 0, start_readout = 1, speed_mps = 10;
  bool calibrate = true;     // camera parameters are free; otherwise held at the truth
  bool free_cameras = true;  // Stereopolis, target field: cameras are free; otherwise held (mounts as `calibrate`)
  // Aerial, street, panorama: takes a camera of the published simulations (1 to 4) with its size and focal length as
  // the true camera. Throws InputError for another number.
  void use_published_camera(int number);
  void check() const;  // throws InputError
};

}  // namespace megablock
