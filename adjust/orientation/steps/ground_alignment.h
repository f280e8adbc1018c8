// Transforms the first rotations and centres from their arbitrary coordinate frame to the ground frame, or to the frame
// of a free block.
// Internal to adjust/: it is not installed.
#pragma once

#include "adjust/orientation/steps/levelling.h"
#include "adjust/orientation/steps/track_intersection.h"
#include "geometry/similarity/similarity.h"
#include "geometry/vanishing/interpretation_plane.h"

namespace megablock {

// Says how far the averaged rotations refer to the ground already: not at all, by the vertical, or by all three angles.
enum class GroundAngles { kNone, kLevel, kAll };
// kAll with attitude priors or given poses, kLevel with the verticals of three images or more, else kNone.
GroundAngles known_angles(const OrientationGraph& graph);

// The direction `down` of the ground in the axes of `values`, from the known positions and the centres of the frames.
// First centres are bent, and one bend moves many of them. The covariance therefore counts one position for each
// unknown only, with the residuals among its errors. Empty where the positions do not determine the direction (on a
// line, or too few).
std::optional<AxisDirection> down_by_positions(const OrientationGraph& graph, const OrientationValues& values,
                                               const Eigen::Vector3d& down);

// Fits a robust similarity from the oriented frames to the known positions (priors and given poses). Empty with fewer
// than two of them. Positions on one line leave the rotation about the line open. It then follows from
//  * the rotations, if they refer to the ground already (kAll), else
//  * their vertical (kLevel; positions off one line then turn the heading only), else
//  * gravity: images that look across the line at points more than 25 m away are taken to look down (nadir); in all
//    others the y axis of the camera is taken to point down (street).
std::optional<Similarity> similarity_to_ground(const OrientationGraph& graph, const OrientationValues& values,
                                               double median_distance, GroundAngles known);

// The mean axes of the images of oriented frames, in the axes of `values`.
MeanAxes mean_axes(const OrientationGraph& graph, const OrientationValues& values);

// The share of the known positions that a similarity brings within four sigmas of the centres of their frames. The
// sigmas allow for the bend of first centres, a twentieth of the extent of the positions.
double share_that_fits(const OrientationGraph& graph, const OrientationValues& values, const Similarity& to_ground);

// The similarity to the frame of a free block. Its origin is the centroid of the frames, and the mean baseline of
// linked frames is one unit (unless `keep_scale`). The principal plane of the centres is horizontal, with the mean
// viewing and y directions of the images downwards, and the frame farthest from the centroid lies on the positive x
// axis. Angles that are known already are kept: all of them, or the vertical.
Similarity similarity_to_free_frame(const OrientationGraph& graph, const OrientationValues& values, GroundAngles known,
                                    bool keep_scale);

}  // namespace megablock
