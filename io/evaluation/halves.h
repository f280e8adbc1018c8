// Compares two results of the same block from independent halves of its observations (split test).
//
// Both adjustments differ from the truth by their own errors, x_1 and x_2. If the sigmas are true, the difference has
// the covariance C_1 + C_2, and the ratio sqrt(mean of d'(C_1 + C_2)^-1 d / n) is 1. Where the datum is free, the
// second result is moved to the first one by the similarity that fits poses best, and the covariances are those after
// such a fit (free_datum.h).
//
// Two halves of the tie points of the same images share every error that belongs to image or camera and not to a
// single tie point: the shape of the lens and of the shutter, errors of the model. Their difference shows nothing of
// it, so a ratio of 1 does not exclude them. Two halves of the images share no image, and show how far the camera
// differs from image to image; what is the same in all images stays unseen there, too.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "io/result/result.h"

namespace megablock {

// Differences of one kind of unknowns: their number, root mean square and ratios to their formal and empirical sigmas.
// NaN: none.
struct HalfDifferences {
  std::int64_t count = 0;
  double rms = std::numeric_limits<double>::quiet_NaN();
  double formal = std::numeric_limits<double>::quiet_NaN();
  double empirical = std::numeric_limits<double>::quiet_NaN();
};

struct CameraDifference {
  std::string camera;
  HalfDifferences parameters;  // without rms: the units of the parameters differ
  struct Parameter {
    std::string name;
    double difference = 0;             // in the unit of the parameter
    double formal = 0, empirical = 0;  // over its sigmas, with sign; NaN: there is none
  };
  std::vector<Parameter> each;
};

// Free parameters of the cameras that both results determine.
std::vector<CameraDifference> compare_cameras(const BlockResult& first, const BlockResult& second);

struct HalvesComparison {
  std::int64_t divisions = 1;
  bool aligned = false;       // the datum is free
  std::int64_t missing = 0;   // frames that one of the two results lacks
  HalfDifferences positions;  // m
  HalfDifferences rotations;  // degrees
  // The same after the similarity that fits all poses best, where priors give the datum. They tell of the tie points,
  // for priors hardly matter then. Only where the results have the covariances between frames.
  HalfDifferences inner_positions, inner_rotations;
  HalfDifferences points;  // control and check points, m; none where the datum is free
  std::vector<CameraDifference> cameras;
  std::vector<CameraDifference> cameras_of_images;  // of halves of the images; empty: not computed
  std::string note;                                 // what is wrong with the ratios; empty: nothing
};

// Throws InputError where the oriented images of a result are too few for halves: halves of the tie points are compared
// over three common ones, and each half of the images needs two.
void require_halves(const BlockResult& result);

// Frames, points and cameras of two halves of the tie points. Throws InputError where they have fewer than three frames
// in common.
HalvesComparison compare_halves(const BlockResult& first, const BlockResult& second);
// Several divisions of the same block together: root mean squares of their differences and ratios. Those of single
// camera parameters are then without sign.
HalvesComparison mean_of(const std::vector<HalvesComparison>& divisions);

std::string to_text(const HalvesComparison& halves);  // lines for the terminal, the last one without its end
std::string to_json(const HalvesComparison& halves);

}  // namespace megablock
