// Collects statistics of the residuals of each kind of observation, which show whether its stated sigmas are true.
//
// A residual v with the weighted Jacobian J (divided by sigma, multiplied by sqrt(rho') of the robust loss) has the
// redundancy number r = 1 - J Q J', where Q is the posterior covariance (W. Baarda, 1968). The redundancy numbers of
// all residuals add up to the degrees of freedom. The variance component of a kind of observations is sum v^2 / sum
// r (W. Foerstner, 1979); its square root is the factor between the sigma that the residuals show and the stated one.
// With wrong weights the components are biased towards each other; repeated with the new sigmas, they converge.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>

namespace megablock {

enum class ObservationKind : std::uint8_t {
  kTieImage,            // image observations of tie points
  kControlImage,        // of control points
  kCheckImage,          // of check points
  kPositionHorizontal,  // GNSS positions of frames
  kPositionHeight,
  kAttitude,          // of frames
  kRelativeRotation,  // between frames
  kRelativePosition,
  kControlHorizontal,  // given coordinates of control points
  kControlHeight,
  kIntrinsics,  // prior values of cameras
  kMount,       // prior values of mounts
  kLine,        // lines known to be vertical or horizontal
  kVertical,    // verticals that images see
  kDistance,    // known distances of frames
};

// The properties of each ObservationKind, in the same order.
struct ObservationKindRow {
  const char* name;              // for tables
  const char* word;              // for json and HDF5
  bool estimates_sigma = false;  // merge: {estimate_sigmas: true} scales its sigma (adjust/tile/sigma_scales.h)
};
inline constexpr ObservationKindRow kObservationKindTable[] = {
    {"image, tie points", "image_tie"},
    {"image, control points", "image_control"},
    {"image, check points", "image_check"},
    {"position, horizontal", "position_horizontal", true},
    {"position, height", "position_height", true},
    {"attitude", "attitude", true},
    {"relative rotation", "relative_rotation", true},
    {"relative position", "relative_position", true},
    {"control, horizontal", "control_horizontal"},
    {"control, height", "control_height"},
    {"camera, prior values", "intrinsics"},
    {"mount, prior values", "mount"},
    {"lines of known direction", "line"},
    {"vertical in images", "vertical", true},
    {"distance between frames", "distance"},
};
inline constexpr std::size_t kObservationKinds = std::size(kObservationKindTable);

constexpr const char* name_of(ObservationKind kind) {
  return kObservationKindTable[static_cast<std::size_t>(kind)].name;
}
constexpr const char* word_of(ObservationKind kind) {
  return kObservationKindTable[static_cast<std::size_t>(kind)].word;
}
constexpr bool estimates_sigma(ObservationKind kind) {
  return kObservationKindTable[static_cast<std::size_t>(kind)].estimates_sigma;
}

struct ObservationStatistics {
  std::int64_t count = 0;       // number of scalar residuals
  double weighted_squares = 0;  // sum of rho' (v / sigma)^2
  double redundancy = 0;        // sum of redundancy numbers
  double scale = 1;             // the sigma that the adjustment used, over the stated one
  void add(double weighted_square, double redundancy_number) {
    ++count;
    weighted_squares += weighted_square;
    redundancy += redundancy_number;
  }
  // The sigma that the residuals show, over the stated one. NaN with less than one redundant observation.
  double sigma_factor() const {
    return redundancy >= 1 ? scale * std::sqrt(weighted_squares / redundancy) : std::nan("");
  }
};

struct ObservationTable {
  std::array<ObservationStatistics, kObservationKinds> kinds{};
  ObservationStatistics& operator[](ObservationKind kind) { return kinds[static_cast<std::size_t>(kind)]; }
  const ObservationStatistics& operator[](ObservationKind kind) const { return kinds[static_cast<std::size_t>(kind)]; }
  void add(const ObservationTable& other);  // the result depends on the order of the calls, through rounding
};

}  // namespace megablock
