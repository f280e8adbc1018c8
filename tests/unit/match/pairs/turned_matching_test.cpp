// The rotation between two vertical images from their matches, with outliers.
#include "match/pairs/turned_matching.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include "geometry/numbers/angles.h"
#include "match/pairs/upright_matching.h"

namespace megablock {
namespace {

struct MatchedPair {
  ImageFeatures a, b;
  std::vector<std::pair<std::int32_t, std::int32_t>> matches;
};

struct View {
  double turn_deg = 0;
  double turn_error_deg = 8;
  double size = 1;            // in b, relative to a
  double octave_error = 0.1;  // of sizes
};

// The first `right` matches agree with the view; the others have any turn, and any size within an octave.
MatchedPair matched_pair(const View& view, int right, int wrong, std::uint64_t seed) {
  std::mt19937_64 generator(seed);
  std::uniform_real_distribution<double> any_turn(0, 360), octave(-1, 1);
  std::normal_distribution<double> error(0, 1);
  MatchedPair pair;
  const auto add = [](ImageFeatures& image, double turn, double size) {
    turn -= 360 * std::floor(turn / 360);
    image.keypoints.push_back({0, 0, static_cast<float>(size), static_cast<float>(turn)});
  };
  for (int i = 0; i < right + wrong; ++i) {
    const double turn = any_turn(generator), size = 8 * std::exp2(octave(generator));
    const double turned =
        i < right ? turn + view.turn_deg + view.turn_error_deg * error(generator) : any_turn(generator);
    const double octaves = i < right ? std::log2(view.size) + view.octave_error * error(generator) : octave(generator);
    add(pair.a, turn, size);
    add(pair.b, turned, size * std::exp2(octaves));
    pair.matches.emplace_back(i, i);
  }
  return pair;
}

std::optional<double> found_turn(const View& view, int right, int wrong, std::uint64_t seed) {
  const MatchedPair pair = matched_pair(view, right, wrong, seed);
  return turn_from_above(pair.a, pair.b, pair.matches);
}

TEST(TurnedMatching, FindsTheTurn) {
  for (const double turn_deg : {-175., -90., -14., 0., 1., 15., 44., 120., 180.})
    for (std::uint64_t seed = 1; seed <= 50; ++seed) {
      const auto found = found_turn({.turn_deg = turn_deg, .size = 1.3}, 60, 15, seed);
      ASSERT_TRUE(found) << turn_deg << " " << seed;
      EXPECT_LT(std::abs(std::remainder(*found / kDegree - turn_deg, 360)), 6) << turn_deg << " " << seed;
    }
}

TEST(TurnedMatching, NoRightMatchIsNoTurn) {
  for (const int matches : {12, 40, 300}) {
    int taken = 0;
    for (std::uint64_t seed = 1; seed <= 2000; ++seed) taken += found_turn({}, 0, matches, seed).has_value();
    EXPECT_LE(taken, 2) << matches;
  }
}

TEST(TurnedMatching, FewMatchesAreNoTurn) {
  EXPECT_FALSE(found_turn({}, 0, 0, 1));
  EXPECT_FALSE(found_turn({}, 4, 0, 1));
  EXPECT_TRUE(found_turn({}, 12, 0, 1));
}

TEST(TurnedMatching, SpreadTurnsAreNoTurn) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed)
    EXPECT_FALSE(found_turn({.turn_error_deg = 180}, 40, 0, seed)) << seed;
}

// Images from along a street: near objects grow faster.
TEST(TurnedMatching, AStreetIsNotSeenFromAbove) {
  int taken = 0;
  for (std::uint64_t seed = 1; seed <= 1000; ++seed)
    taken += found_turn({.size = 1.2, .octave_error = 0.4}, 60, 15, seed).has_value();
  EXPECT_LE(taken, 1);
}

TEST(TurnedMatching, RightMatchesAgreeInSector) {
  const MatchedPair pair = matched_pair({.turn_deg = 73, .turn_error_deg = 5}, 200, 0, 7);
  const auto turn = turn_from_above(pair.a, pair.b, pair.matches);
  ASSERT_TRUE(turn);
  const auto of_a = sectors_from(pair.a, 0), of_b = sectors_from(pair.b, *turn);
  for (std::size_t i = 0; i < of_a.size(); ++i) {
    const int apart = std::abs(of_a[i] - of_b[i]);
    EXPECT_TRUE(apart <= 1 || apart == kUprightSectors - 1) << i;
  }
}

}  // namespace
}  // namespace megablock
