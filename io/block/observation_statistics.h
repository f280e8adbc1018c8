// What the adjustment says of its observations, by kind: are the stated sigmas true?
//
// The redundancy number of a residual v with weighted Jacobian J (divided by sigma, multiplied by the robust loss's
// sqrt(rho')) is r = 1 - J Q J', Q the posterior covariance (Baarda 1968). Over all residuals the numbers add up to
// the degrees of freedom; the variance component of a kind is sum v^2 / sum r (Foerstner 1979): its square root is the
// factor between the sigma that the residuals show and the stated one. At wrong weights the components are biased
// towards one another; estimated again with the sigmas that they give, they settle.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace megablock {

enum class ObservationKind : std::uint8_t {
  kTieImage,            // image measurements of tie points
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
  kVertical,    // where images see down
};
inline constexpr std::size_t kObservationKinds = 14;

// "image, tie points" ...: for tables.
const char* name_of(ObservationKind kind);
// "image_tie" ...: a word for json and HDF5.
const char* word_of(ObservationKind kind);

struct ObservationStatistics {
  std::int64_t count = 0;       // scalar residuals
  double weighted_squares = 0;  // sum rho' (v / sigma)^2
  double redundancy = 0;        // sum of redundancy numbers
  double scale = 1;             // sigma of the adjustment over the stated one
  void add(double weighted_square, double redundancy_number) {
    ++count;
    weighted_squares += weighted_square;
    redundancy += redundancy_number;
  }
  // Sigma that the residuals show over the stated one; NaN with less than one redundant observation.
  double sigma_factor() const {
    return redundancy >= 1 ? scale * std::sqrt(weighted_squares / redundancy) : std::nan("");
  }
};

struct ObservationTable {
  std::array<ObservationStatistics, kObservationKinds> kinds{};
  ObservationStatistics& operator[](ObservationKind kind) { return kinds[static_cast<std::size_t>(kind)]; }
  const ObservationStatistics& operator[](ObservationKind kind) const { return kinds[static_cast<std::size_t>(kind)]; }
  void add(const ObservationTable& other);  // in the order of the calls
};

}  // namespace megablock
