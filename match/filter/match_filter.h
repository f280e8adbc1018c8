// Separates right from wrong matches by a support vector machine with radial basis functions (C. Cortes and V. Vapnik,
// 1995; Cannelle 2013). It judges a match by its errors (match_errors.h) in a relative orientation that is trusted,
// such as that of a trajectory over a short time. Epipolar geometry alone cannot reject a wrong match on the epipolar
// line; the distance and the ray angle can.
//
// The features, each normalised to mean 0 and standard deviation 1 over the training samples, are
//
//     ln(1 + r_im / sigma)    sigma: as expected from the trusted orientation (TrustedPair::epipolar_sigma_px)
//     asinh(d / 1 m)          d the smaller of d_1 and d_2, negative behind a camera
//     ln(1 + alpha / 1 deg)
//     ln(1 + r_M / 1 cm)      only for comparison, as it does not improve the filter
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "match/filter/match_errors.h"
#include "match/verification/trusted_pair.h"

namespace megablock {

// A match as the filter sees it.
struct MatchSample {
  MatchErrors errors;
  double sigma_px = 1;  // expected standard deviation of errors.reprojection_px
};

// Errors and sigma of the match of two pixels (keypoints of the images). Empty where a pixel has no ray.
std::optional<MatchSample> match_sample(const TrustedPair& pair, const Camera& camera_a, const Eigen::Vector2d& a,
                                        const Camera& camera_b, const Eigen::Vector2d& b);

enum class MatchFeature { kReprojection = 0, kDistance = 1, kAngle = 2, kRayDistance = 3 };
// The value of a feature before normalisation.
double value_of(MatchFeature feature, const MatchSample& sample);

class MatchFilter {
 public:
  // The model that comes with the program, or one from a file that train-filter has written. All throw InputError for
  // anything else.
  static MatchFilter shipped();
  static MatchFilter load(const std::string& path);
  explicit MatchFilter(const std::string& yaml);
  ~MatchFilter();
  MatchFilter(MatchFilter&&) noexcept;

  // For each sample 1 if it is right, 0 if it is wrong. May be called from several threads at once.
  std::vector<std::uint8_t> right(const std::vector<MatchSample>& samples) const;
  std::uint64_t hash() const { return hash_; }  // of the model, for the fingerprint of a stage

 private:
  struct Model;
  std::unique_ptr<Model> model_;
  std::uint64_t hash_ = 0;
};

}  // namespace megablock
