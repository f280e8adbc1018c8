// Right and wrong matches told apart by a support vector machine with radial basis functions (CN-15; Cannelle 2013,
// Cortes and Vapnik 1995) on what a trusted relative orientation says of them (match_errors.h).
//
// Features, each brought to mean 0 and deviation 1 over the training samples:
//
//     ln(1 + r_im / sigma)    sigma: what the trust in the orientation lets expect (TrustedPair::epipolar_sigma_px)
//     asinh(d / 1 m)          d the smaller of d_1 and d_2, negative behind a camera
//     ln(1 + alpha / 1 deg)
//     ln(1 + r_M / 1 cm)      only for comparison: it makes the filter no better
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "match/filter/match_errors.h"
#include "match/verification/trusted_pair.h"

namespace megablock {

struct MatchSample {
  MatchErrors errors;
  double sigma_px = 1;  // expected of errors.reprojection_px
};

// Errors of the match of two pixels (keypoints of the images) and their sigma; empty where a pixel has no ray.
std::optional<MatchSample> match_sample(const TrustedPair& pair, const Camera& camera_a, const Eigen::Vector2d& a,
                                        const Camera& camera_b, const Eigen::Vector2d& b);

enum class MatchFeature { kReprojection = 0, kDistance = 1, kAngle = 2, kRayDistance = 3 };
double value_of(MatchFeature feature, const MatchSample& sample);

class MatchFilter {
 public:
  // The model that comes with the program, or that of a file of train-filter. InputError when it is none.
  static MatchFilter shipped();
  static MatchFilter load(const std::string& path);
  explicit MatchFilter(const std::string& yaml);
  ~MatchFilter();
  MatchFilter(MatchFilter&&) noexcept;

  // [samples] 1: right. Any number of threads may ask.
  std::vector<std::uint8_t> right(const std::vector<MatchSample>& samples) const;
  std::uint64_t hash() const { return hash_; }  // of the model

 private:
  struct Model;
  std::unique_ptr<Model> model_;
  std::uint64_t hash_ = 0;
};

}  // namespace megablock
