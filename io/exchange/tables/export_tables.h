// Tables and images of a result for other programs: CSV, PLY, GeoJSON.
#pragma once

#include <string>

#include "io/result/result.h"

namespace megablock {

// A folder with
//   frames.csv        name,qw,qx,qy,qz,x,y,z,pass of each oriented frame (io/project/inputs/pose_csv.h: reads back to
//   the same bits) images_local.csv
//   image,frame,camera,x_m,y_m,z_m,omega_deg,phi_deg,kappa_deg,yaw_deg,pitch_deg,roll_deg
//                     of each oriented image in the block's frame, and the sigmas of its projection centre and rotation
//                     when there are covariances
//   images_wgs84.csv  image,latitude_deg,longitude_deg,height_m, the angles and the sigmas in the image's own vertical
//                     (east, north, up at its position); only of georeferenced blocks
//   cameras.csv       name,width,height,f,cx,cy,k1,k2,k3,p1,p2 and sigmas
//   mounts.csv        rig,mount,camera,x_m,y_m,z_m,qw,qx,qy,qz (rig -> camera) and sigmas along and about the axes of
//                     the rig; only of blocks with rigs of two cameras and more
// omega, phi, kappa as in geometry/transform/rotation.h; yaw, pitch, roll as in geometry/transform/body_attitude.h.
void export_csv(const BlockResult& result, const std::string& folder);

// Binary little-endian PLY: points (grey) and projection centres (red) as vertices with double coordinates in the
// block's frame; the header's comments give the origin.
void export_ply(const BlockResult& result, const std::string& path);

// Footprints of the oriented images (WGS84, RFC 7946): the image's corners on the horizontal plane at the median height
// of the points it sees; a Point instead where a corner does not look down on it. InputError without georeference.
void export_geojson(const BlockResult& result, const std::string& path);

}  // namespace megablock
