// Writes results for other programs: tables as CSV, points and projection centres as PLY, footprints as GeoJSON.
// Internal to io/: it is not installed.
#pragma once

#include <string>

#include "io/result/result.h"

namespace megablock {

// Writes a folder with these files:
//
//   frames.csv        name,qw,qx,qy,qz,x,y,z,pass of each oriented frame; io/project/inputs/pose_csv.h reads back the
//                     same bits
//   images_local.csv  image,frame,camera,x_m,y_m,z_m,omega_deg,phi_deg,kappa_deg,yaw_deg,pitch_deg,roll_deg of each
//                     oriented image in the block's ground frame, and the sigmas of its projection centre and rotation
//                     if there are covariances
//   images_wgs84.csv  image,latitude_deg,longitude_deg,height_m, and the angles and sigmas relative to the vertical at
//                     the image (east, north, up at its position); only of georeferenced blocks
//   cameras.csv       name,width,height,model, the parameters of all models of the block, and their sigmas; cells of
//                     parameters that a camera does not have are empty
//   mounts.csv        rig,mount,camera,x_m,y_m,z_m,qw,qx,qy,qz (rig -> camera) and sigmas along and about the axes of
//                     the rig; only of blocks with rigs of two or more cameras
//
// omega, phi, kappa are those of geometry/transform/rotation.h; yaw, pitch, roll are those of
// geometry/transform/body_attitude.h.
void export_csv(const BlockResult& result, const std::string& folder);

// Writes a binary little-endian PLY file. Points (grey) and projection centres (red) are vertices with coordinates in
// double precision in the block's ground frame. Comments of the header give the origin.
void export_ply(const BlockResult& result, const std::string& path);

// Writes the footprints of the oriented images (WGS84, RFC 7946): the corners of each image on the horizontal plane at
// the median height of the points that it sees. If the ray of a corner does not meet this plane, a Point is written
// instead. Throws InputError if the block is not georeferenced.
void export_geojson(const BlockResult& result, const std::string& path);

}  // namespace megablock
