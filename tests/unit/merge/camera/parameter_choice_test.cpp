// The choice of parameters from forms that are made from known distributions.
#include "merge/camera/parameter_choice.h"

#include <gmock/gmock.h>

#include <random>

namespace megablock {
namespace {

using testing::HasSubstr;

// A camera of Brown's model whose estimates from each group of images scatter independently. `truth`: what the images
// of all groups have in common, from the start, in units of `sigma`, the sigma of one group.
struct Images {
  int groups = 12;
  int images = 0;  // 0: one in each group
  std::vector<double> truth = std::vector<double>(10, 0);
  std::vector<double> sigma = {5, 5, 5, 1e-3, 1e-3, 1e-3, 1e-4, 1e-4, 1, 1};
  double between = 1;  // sigmas from group to group over the sigmas that the normal equations state
  unsigned seed = 1;

  CameraForms forms() const {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    const Eigen::VectorXd scale = Eigen::Map<const Eigen::VectorXd>(sigma.data(), kRows);
    const Eigen::MatrixXd information = scale.cwiseInverse().cwiseAbs2().asDiagonal();  // of one group
    std::vector<Eigen::VectorXd> own;
    for (int g = 0; g < groups; ++g) {
      Eigen::VectorXd k(kRows);
      for (Eigen::Index p = 0; p < kRows; ++p)
        k(p) = scale(p) * (truth[static_cast<std::size_t>(p)] + between * normal(random));
      own.push_back(k);
    }
    // Sums of quadratic forms with one matrix: their minimum is the mean, their least value the scatter.
    const auto form_without = [&](int left_out) {
      CameraForm form{Eigen::VectorXd::Zero(kRows), Eigen::MatrixXd::Zero(kRows, kRows), 0};
      double count = 0;
      for (int g = 0; g < groups; ++g)
        if (g != left_out) form.minimum += own[static_cast<std::size_t>(g)], ++count;
      form.minimum /= count;
      form.information = count * information;
      for (int g = 0; g < groups; ++g)
        if (g != left_out) {
          const Eigen::VectorXd d = own[static_cast<std::size_t>(g)] - form.minimum;
          form.least += kResiduals + d.dot(information * d);
        }
      return form;
    };
    CameraForms result{form_without(-1), {}, images > 0 ? images : groups};
    for (int g = 0; g < groups; ++g) result.without.push_back(form_without(g));
    return result;
  }

  CameraChoice choose(const std::function<CameraForms(const CameraForms&)>& change = {}) const {
    const ChoiceCamera camera{CameraModel(), {0, 1, 2, 3, 4, 5, 6, 7, 8, 9}, 0};
    Eigen::VectorXd prior(kRows);
    prior << 70, 30, 30, 0.2, 0.2, 0.2, 0.01, 0.01, 14, 14;
    const MakeForms make = [&](const std::vector<std::uint8_t>&) { return change ? change(forms()) : forms(); };
    return choose_parameters(make, {camera}, Eigen::VectorXd::Zero(kRows), prior, {}).front();
  }
  static constexpr Eigen::Index kRows = 10;
  static constexpr double kResiduals = 50;  // squares of other residuals in a group
};

constexpr ParameterMask kFirst = mask_of(kFocal) | mask_of(kPrincipalX) | mask_of(kPrincipalY);

// What is at its start in truth predicts nothing. One standard error lets some of it pass by chance.
TEST(ParameterChoice, HoldsWhatIsAtItsStart) {
  int estimated = 0;
  constexpr int kTrials = 400;
  for (unsigned seed = 0; seed < kTrials; ++seed) {
    Images images;
    images.seed = seed;
    const ParameterMask choice = images.choose().estimated;
    EXPECT_EQ(choice & kFirst, kFirst);
    estimated += count_of(choice & ~kFirst);
  }
  EXPECT_LE(estimated, 0.05 * 7 * kTrials);
}

TEST(ParameterChoice, EstimatesWhatEveryImageShows) {
  Images images;
  images.truth[kRadial1] = images.truth[kDecentring2] = images.truth[kAffinity] = 12;
  const CameraChoice choice = images.choose();
  EXPECT_EQ(choice.estimated,
            kFirst | mask_of(kRadial1) | mask_of(kDecentring1) | mask_of(kDecentring2) | mask_of(kAffinity));
  EXPECT_THAT(choice.reason, HasSubstr("estimated: f; cx, cy; k1 ("));
  EXPECT_THAT(choice.reason, HasSubstr("held: k2 ("));
}

// A lower radial term stays with a higher one.
TEST(ParameterChoice, KeepsLowerRadialTerms) {
  Images images;
  images.truth[kRadial3] = 12;
  EXPECT_EQ(images.choose().estimated, kFirst | mask_of(kRadial1) | mask_of(kRadial2) | mask_of(kRadial3));
}

// The normal equations say 10 sigma; images contradict each other by as much.
TEST(ParameterChoice, BelievesImagesMoreThanTheNormalEquations) {
  int estimated = 0;
  constexpr int kTrials = 200;
  for (unsigned seed = 0; seed < kTrials; ++seed) {
    Images images;
    images.seed = seed;
    images.between = 10;
    images.truth[kAffinity] = 3;  // sigmas of one group: 10 formal sigmas of twelve, 1 between groups
    estimated += contains(images.choose().estimated, kAffinity);
  }
  EXPECT_LE(estimated, 0.25 * kTrials);
}

// Too small to predict images better by a thousandth: held where it is two standard errors, estimated where
// all images ask for it alike, because poses would be bent by more than their sigmas.
TEST(ParameterChoice, HoldsWhatPredictsImagesHardlyBetterUnlessItIsCertain) {
  Images images;
  images.groups = 40;
  images.truth[kAffinity] = 0.12;  // raises the error by 0.03 %
  images.between = 0.2;            // the raise is two standard errors
  int estimated = 0;
  for (images.seed = 1; images.seed <= 100; ++images.seed) estimated += contains(images.choose().estimated, kAffinity);
  EXPECT_LE(estimated, 20);
  images.between = 0.02;
  EXPECT_TRUE(contains(images.choose().estimated, kAffinity));
}

// The sigma of the focal length tells how much images contradict each other, which the normal equations do not know.
TEST(ParameterChoice, TheScatterOfTheFocalLengthIsThatBetweenImages) {
  double squares = 0, stated = 0;
  constexpr int kTrials = 200;
  for (unsigned seed = 1; seed <= kTrials; ++seed) {
    Images images;
    images.seed = seed;
    images.between = 4;
    CameraForms forms = images.forms();
    const CameraChoice choice = images.choose();
    squares += std::pow(forms.all.minimum[kFocal], 2) / kTrials;  // the truth is 0
    stated += std::pow(choice.focal_scatter_px, 2) / kTrials;
  }
  EXPECT_NEAR(std::sqrt(squares), 4 * 5 / std::sqrt(12), 0.8);
  EXPECT_NEAR(std::sqrt(stated / squares), 1, 0.15);
}

// Several small terms that together predict images better: the last ones stay.
TEST(ParameterChoice, DoesNotHoldManySmallTermsInTurn) {
  Images images;
  images.groups = 40;
  images.between = 0.02;
  images.truth = {0, 0, 0, 0, 0, 0.2, 0, 0.2, 0.2, 0.2};
  EXPECT_NE(images.choose().estimated, kFirst);
}

// A guess of the start is not made a truth, however little the images say.
TEST(ParameterChoice, LeavesWeakParametersToTheirPriors) {
  Images images;
  images.sigma[kPrincipalY] = 90;  // 26 of twelve groups, of 30 a priori
  const CameraChoice choice = images.choose();
  EXPECT_EQ(choice.estimated & kFirst, kFirst);
  EXPECT_THAT(choice.reason, HasSubstr("cx, cy (mostly by its prior)"));
}

// Nothing is released that the tie points of few images do not predict.
TEST(ParameterChoice, OfFewImagesTestsAllParameters) {
  Images images;
  images.images = 2;
  images.groups = 20;
  images.truth[kRadial1] = images.truth[kAffinity] = 12;
  const CameraChoice choice = images.choose();
  EXPECT_EQ(choice.estimated, mask_of(kRadial1));
  EXPECT_THAT(choice.reason, HasSubstr("b1 (too few images)"));
  EXPECT_THAT(choice.reason, HasSubstr("left-out tie points"));
}

// The forms at the optimum of the choice count: what they show to be needed is released again.
TEST(ParameterChoice, ReleasesWhatTheNewOptimumNeeds) {
  Images far, near;
  near.truth[kRadial1] = near.truth[kAffinity] = 12;
  int calls = 0;
  const CameraChoice choice = far.choose([&](const CameraForms& forms) { return calls++ ? near.forms() : forms; });
  EXPECT_EQ(calls, 2);
  EXPECT_EQ(choice.estimated, kFirst | mask_of(kRadial1) | mask_of(kAffinity)) << choice.reason;
}

}  // namespace
}  // namespace megablock
