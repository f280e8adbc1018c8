#include "match/verification/false_pairs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <random>

#include "geometry/numbers/angles.h"
#include "geometry/transform/rotation.h"

namespace megablock {
namespace {

// Images on a ring about a tower with four sides. Neighbours show the same; images a quarter of a turn apart show sides
// that look alike, so that their pair has the rotation by which they would show the same side.
struct Ring {
  std::vector<PairEvidence> pairs;
  std::vector<std::uint8_t> is_false;  // the truth
};

constexpr int kImages = 24, kSide = kImages / 4;

Eigen::Quaterniond heading(int image) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(2 * std::numbers::pi * image / kImages, Eigen::Vector3d::UnitY()));
}

PairEvidence pair_of(int a, int b, const Eigen::Quaterniond& rotation, double share, std::int64_t expected,
                     std::mt19937& random) {
  std::normal_distribution<double> normal(0, 1);
  const Eigen::Vector3d noise(normal(random), normal(random), normal(random));
  std::binomial_distribution<std::int64_t> found(expected, share);
  return {ImageIndex(a), ImageIndex(b), rotation_exp<double>(1.5 * kDegree * noise) * rotation, expected,
          found(random)};
}

// `reach`: true pairs are up to so many images apart. `false_share`: q of false pairs; 0: none.
Ring ring(unsigned seed, double false_share, double scale = 1, int reach = 3) {
  std::mt19937 random(seed);
  Ring result;
  for (int a = 0; a < kImages; ++a)
    for (int b = a + 1; b < kImages; ++b) {
      const int apart = std::min(b - a, kImages - b + a);
      if (apart <= reach) {
        const Eigen::Quaterniond truth = heading(b) * heading(a).conjugate();
        // A wrong focal length scales the angles of the pairs.
        const Eigen::Quaterniond measured = rotation_exp<double>(scale * rotation_log<double>(truth));
        result.pairs.push_back(pair_of(a, b, measured, 0.75 - 0.06 * apart, 400, random));
        result.is_false.push_back(0);
        continue;
      }
      // Place on the side, -3 to 2, and the fold of one side onto another one.
      const int folded = (b % kSide) - (a % kSide);
      if (false_share == 0 || std::abs(folded) > 1) continue;
      const Eigen::Quaterniond alike = heading(folded);
      result.pairs.push_back(pair_of(a, b, alike, false_share, 120, random));
      result.is_false.push_back(1);
    }
  return result;
}

class FalsePairsOfARing : public testing::TestWithParam<unsigned> {};

TEST_P(FalsePairsOfARing, AreFoundAmongMoreTrueOnesThanNot) {
  const Ring made = ring(GetParam(), 0.2);
  const std::int64_t all = std::count(made.is_false.begin(), made.is_false.end(), 1);
  ASSERT_GT(2 * all, std::ssize(made.pairs));  // most pairs are false
  const FalsePairs judged = find_false_pairs(made.pairs);
  for (std::size_t p = 0; p < made.pairs.size(); ++p)
    EXPECT_EQ(judged.is_false[p], made.is_false[p]) << made.pairs[p].a.value << ' ' << made.pairs[p].b.value;
  EXPECT_EQ(judged.count(), all);
}

// With focal lengths that are a third too long or too short the ring does not close; no true pair is lost for that.
TEST_P(FalsePairsOfARing, AreFoundWithAWrongFocalLength) {
  for (const double scale : {0.75, 1.33}) {
    const Ring made = ring(GetParam(), 0.2, scale);
    const FalsePairs judged = find_false_pairs(made.pairs);
    std::int64_t found = 0;
    for (std::size_t p = 0; p < made.pairs.size(); ++p) {
      if (!made.is_false[p]) {
        EXPECT_EQ(judged.is_false[p], 0);
      }
      found += judged.is_false[p] && made.is_false[p];
    }
    EXPECT_GT(static_cast<double>(found), 0.6 * static_cast<double>(judged.is_false.size()) / 2);
  }
}

// Pairs of a plane that were given the wrong one of its two orientations. They have little in common, as their images
// are far apart, but they are true.
TEST_P(FalsePairsOfARing, PlanesMayHaveTheirOtherOrientation) {
  std::vector<PairEvidence> pairs = ring(GetParam(), 0).pairs;
  for (PairEvidence& pair : pairs) {
    const std::int64_t apart = std::min(pair.b.value - pair.a.value, kImages - pair.b.value + pair.a.value);
    if (apart < 3) continue;
    pair.found = pair.expected / 5;
    pair.twin = pair.rotation;
    pair.rotation = Eigen::AngleAxisd(45 * kDegree, Eigen::Vector3d::UnitX()) * pair.rotation;
  }
  EXPECT_EQ(find_false_pairs(pairs).count(), 0);
  for (PairEvidence& pair : pairs) pair.twin.reset();
  EXPECT_GT(find_false_pairs(pairs).count(), 0) << "the twin decides";
}

TEST_P(FalsePairsOfARing, BlocksWithoutContradictionsKeepAll) {
  for (const double scale : {1.0, 0.75, 1.33}) {
    const Ring made = ring(GetParam(), 0, scale);
    EXPECT_EQ(find_false_pairs(made.pairs).count(), 0);
  }
}

// Shares that are alike do not tell which pairs are wrong.
TEST_P(FalsePairsOfARing, NothingIsDecidedWhereSharesAreAlike) {
  Ring made = ring(GetParam(), 0.2);
  for (PairEvidence& p : made.pairs) p.found = p.expected / 2;
  EXPECT_EQ(find_false_pairs(made.pairs).count(), 0);
}

// True pairs of images with little overlap have a small share, and their rotations agree with the others.
TEST_P(FalsePairsOfARing, SmallSharesAloneProveNothing) {
  Ring made = ring(GetParam(), 0);
  for (std::size_t p = 0; p < made.pairs.size(); p += 3) made.pairs[p].found /= 5;
  EXPECT_EQ(find_false_pairs(made.pairs).count(), 0);
}

TEST_P(FalsePairsOfARing, TheOrderOfPairsIsOfNoMatter) {
  Ring made = ring(GetParam(), 0.2);
  const FalsePairs judged = find_false_pairs(made.pairs);
  std::vector<std::size_t> order(made.pairs.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::shuffle(order.begin(), order.end(), std::mt19937(GetParam()));
  std::vector<PairEvidence> shuffled;
  for (const std::size_t p : order) shuffled.push_back(made.pairs[p]);
  const FalsePairs again = find_false_pairs(shuffled);
  for (std::size_t i = 0; i < order.size(); ++i) EXPECT_EQ(again.is_false[i], judged.is_false[order[i]]);
}

INSTANTIATE_TEST_SUITE_P(Seeds, FalsePairsOfARing, testing::Range(1u, 11u));

// Two images of the same 20 x 20 features, of which `share` are matched in the pair, and all in two other pairs each.
std::vector<VerifiedPair> pairs_of_grid(double share) {
  std::mt19937 random(1);
  std::bernoulli_distribution is_matched(share);
  std::vector<VerifiedPair> pairs(5);
  const std::array<std::pair<int, int>, 5> images = {{{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}}};
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    pairs[p].a = ImageIndex(images[p].first);
    pairs[p].b = ImageIndex(images[p].second);
    pairs[p].model = PairModel::kEssential;
    for (std::int32_t k = 0; k < 400; ++k)
      if (p > 0 || is_matched(random)) {
        pairs[p].feature_a.push_back(k);
        pairs[p].feature_b.push_back(k);
      }
  }
  return pairs;
}

// The features are 10 px apart, and one more makes the images 800 px wide.
IndexedVector<ImageIndex, std::vector<Keypoint>> keypoints_of_grid() {
  IndexedVector<ImageIndex, std::vector<Keypoint>> keypoints;
  keypoints.resize(4);
  for (ImageIndex i(0); keypoints.contains(i); ++i.value) {
    for (int k = 0; k < 400; ++k)
      keypoints[i].push_back({(10 + 10 * (k % 20)) << 10, (10 + 10 * (k / 20)) << 10, 3, 0});
    keypoints[i].push_back({790 << 10, 590 << 10, 3, 0});
  }
  return keypoints;
}

TEST(EvidenceOfPairs, CountsTheFeaturesThatAreFoundAgain) {
  const auto keypoints = keypoints_of_grid();
  for (const double share : {0.8, 0.5}) {
    const std::vector<VerifiedPair> pairs = pairs_of_grid(share);
    const std::vector<PairEvidence> one = evidence_of_pairs(pairs, keypoints, 1);
    const std::vector<PairEvidence> three = evidence_of_pairs(pairs, keypoints, 3);
    ASSERT_EQ(one.size(), pairs.size());
    EXPECT_GT(one[0].expected, 600);  // of twice 400, those among matches
    EXPECT_NEAR(static_cast<double>(one[0].found) / static_cast<double>(one[0].expected), share, 0.05);
    for (std::size_t p = 0; p < pairs.size(); ++p) {
      EXPECT_EQ(one[p].expected, three[p].expected);
      EXPECT_EQ(one[p].found, three[p].found);
    }
  }
}

// A feature that lies off the matches of a pair is not expected there: the other image may not show it.
TEST(EvidenceOfPairs, FeaturesOffTheOverlapAreNotExpected) {
  const auto keypoints = keypoints_of_grid();
  std::vector<VerifiedPair> pairs = pairs_of_grid(1);
  const auto right_half = [](std::int32_t k) { return k % 20 >= 10; };
  std::erase_if(pairs[0].feature_a, right_half);
  std::erase_if(pairs[0].feature_b, right_half);
  const PairEvidence of_half = evidence_of_pairs(pairs, keypoints, 1)[0];
  // 4 % of the width are 32 px: three more columns of 20 features in two images at most.
  EXPECT_LE(of_half.expected, of_half.found + 120);
  EXPECT_GE(of_half.found, 400);
}

}  // namespace
}  // namespace megablock
