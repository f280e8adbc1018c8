// Trains the match filter (match_filter.h) on tracks whose outliers are known, from simulated blocks for
// example.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "io/block/tracks.h"
#include "match/filter/match_filter.h"

namespace megablock {

// A match with its label.
struct LabelledMatch {
  MatchSample sample;
  bool right = true;
};

// Returns at most one match from each track: a pair of observations of different frames, as matching would find it,
// whose images the trajectory relates. `wrong` has one element per observation: 0 for a right one, otherwise the kind
// of the mistake (Verdict in io/simulate/scene/simulated_block.h). A match is wrong when one of its observations is, or
// when both show an object that moved between the frames. Throws InputError where `wrong` has the wrong length.
std::vector<LabelledMatch> labelled_matches(const Block& block, const TrackSet& tracks,
                                            const std::vector<std::uint8_t>& wrong, const TrustOptions& trust,
                                            std::uint64_t seed);

struct TrainingOptions {
  std::vector<MatchFeature> features = {MatchFeature::kReprojection, MatchFeature::kDistance, MatchFeature::kAngle};
  int samples = 466;  // number of training samples, half of them right
  std::uint64_t seed = 1;
};

struct TrainedFilter {
  std::string yaml;  // the model, as MatchFilter reads it
  // Share of correct answers on other samples than the training ones, right and wrong in equal number.
  double correct = 0;
  std::int64_t tested = 0;
  std::array<double, 2> correct_of{};  // of the wrong matches, of the right ones
};

// Trains the filter; five-fold cross-validation chooses penalty and width. The result depends only on the input and the
// seed. Throws InputError where there are too few matches of a kind.
TrainedFilter train_filter(const std::vector<LabelledMatch>& matches, const TrainingOptions& options);

}  // namespace megablock
