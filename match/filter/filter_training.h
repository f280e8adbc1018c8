// Training of the match filter (match_filter.h) from tracks whose wrong observations are known.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "io/block/tracks.h"
#include "match/filter/match_filter.h"

namespace megablock {

struct LabelledMatch {
  MatchSample sample;
  bool right = true;
};

// Matches of the tracks of images that the trajectory relates: one of each track at most, pairs of different frames, as
// matching would find them. wrong [observations]: 0 right, else the number of a mistake (simulate.h, Verdict); a match
// is wrong when one of the two is, or when both show a thing that moved between the frames.
std::vector<LabelledMatch> labelled_matches(const Block& block, const TrackSet& tracks,
                                            const std::vector<std::uint8_t>& wrong, const TrustOptions& trust,
                                            std::uint64_t seed);

struct TrainingOptions {
  std::vector<MatchFeature> features = {MatchFeature::kReprojection, MatchFeature::kDistance, MatchFeature::kAngle};
  int samples = 466;  // half of them right; InputError when there are not as many
  std::uint64_t seed = 1;
};

struct TrainedFilter {
  std::string yaml;    // what MatchFilter reads
  double correct = 0;  // share of the samples that were not trained on, as many right as wrong ones
  std::int64_t tested = 0;
  std::array<double, 2> correct_of{};  // of the wrong, of the right ones
};

// Penalty and width are chosen by five-fold cross-validation. Deterministic by the seed.
TrainedFilter train_filter(const std::vector<LabelledMatch>& matches, const TrainingOptions& options);

}  // namespace megablock
