// From the arbitrary frame of averaged rotations and first centres to the ground frame, or to the frame of a free
// block.
#pragma once

#include "adjust/orientation/steps/track_intersection.h"
#include "geometry/similarity/similarity.h"
#include "geometry/vanishing/interpretation_plane.h"

namespace megablock {

// What of the averaged rotations refers to the ground already.
enum class GroundAngles { kNone, kLevel, kAll };
// By attitude priors and given poses, or by the verticals of three images or more.
GroundAngles known_angles(const OrientationGraph& graph);

// Where the known positions say that `down` of the ground is, in the axes of `values`, of which only the frames'
// centres count. First centres bend, and one bend moves many of them: the covariance is that of a single position for
// each of the unknowns, with the residuals among its errors. Empty where they say nothing (on a line, fewer than
// three).
std::optional<AxisDirection> down_by_positions(const OrientationGraph& graph, const OrientationValues& values,
                                               const Eigen::Vector3d& down);

// Similarity that brings the oriented frames onto the known positions (priors and given poses), robustly; empty with
// fewer than two of them. Positions on one line leave the rotation about the line open; it follows from
//  * the rotations as they are, when these refer to the ground already (kAll: attitude priors or given poses), else
//  * their level (kLevel: verticals; more positions than a line turn the heading alone then, too), else
//  * gravity: images that look across the line over more than 25 m distance look down (nadir), all others have the
//    camera's y axis pointing down (street).
std::optional<Similarity> similarity_to_ground(const OrientationGraph& graph, const OrientationValues& values,
                                               double median_distance, GroundAngles known);

// Similarity to the frame of a free block: centroid of the frames at the origin, mean baseline of the linked frames one
// unit (`keep_scale`: as it is), first principal plane of the centres horizontal with the images' mean viewing and y
// directions downwards, the frame farthest from the centroid on the positive x axis. Of what is known of the rotations
// it keeps all, or the level.
Similarity similarity_to_free_frame(const OrientationGraph& graph, const OrientationValues& values, GroundAngles known,
                                    bool keep_scale);

}  // namespace megablock
