// Reads position and attitude of an image from its header: EXIF, and the XMP of the makers of drones. Internal to io/.
//
// Position. WGS84, height in metres. EXIF counts before XMP, because programs that improve positions afterwards (PPK)
// rewrite EXIF alone. GPSLatitude and GPSLongitude are degrees, minutes, seconds without a sign, which is in the tags
// ...Ref (S, W); GPSAltitudeRef 1 means a negative height. Heights count as above the ellipsoid. The datum that makers
// really use differs (DJI without RTK and Skydio: above sea level) and no tag says it reliably.
//
// Sigmas, the first that is stated:
//     drone-dji:RtkStdLon, RtkStdLat, RtkStdHgt      m; the larger of the first two is the horizontal one
//     Camera:GPSXYAccuracy, GPSZAccuracy             m
//     GPSHPositioningError                           m, horizontal
//     drone-dji:RtkFlag                              50: 0.03 and 0.06 m; 32 to 49: 0.5 and 1 m (below)
// RtkFlag is 16 for a single, 32 to 49 for a float and 50 for a fixed solution (DJI, manuals of Mavic 3E and P1).
//
// Attitudes, the first complete set. All angles in degrees, yaw clockwise from north:
//     drone-dji, drone, drone-parrot, drone-skydio   of the viewing direction; pitch -90 = nadir (YawPitchRoll of
//                                                    geometry/transform/rotation.h)
//     Camera                                         Yaw, Pitch, Roll as Pix4D defines them: pitch 0 = nadir, 90 =
//                                                    forward (BodyAttitude of geometry/transform/body_attitude.h)
// Some makers write angles of the first kind into Camera; a pitch within 20 degrees of -90 is taken so, because a
// camera of the other kind would look backward. senseFly counts roll the other way round, as ODM found.
//
// Sources: DJI's manuals ("XMP Data List"); developer.parrot.com, metadata of images; Pix4D, Specifications of
// xmp.camera tags, and Yaw Pitch Roll and Omega Phi Kappa angles; OpenAthena (MetadataExtractor) for Skydio and Autel;
// OpenDroneMap/ODM opendm/photo for senseFly.
#pragma once

#include "io/images/header_fields.h"
#include "io/images/image_header.h"

namespace megablock {

// Sets position, its sigmas, fix, attitude and compass of the header. `make` must be set.
void read_header_pose(const ExifFields& exif, const XmpFields& xmp, ImageHeader& header);

}  // namespace megablock
