#include "io/evaluation/remarks/remarks.h"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

#include "io/evaluation/figures.h"
#include "io/report/report.h"
#include "tests/support/io/made_up_result.h"

namespace megablock {
namespace {

using testing::HasSubstr;

// One part whose positions leave `defect` parameters free.
BlockResult free_result(std::int32_t defect, std::size_t positions, bool attitudes) {
  BlockResult result = made_up_result(small_block());
  result.block.control_points.clear();
  result.control.clear();
  std::size_t kept = 0;
  for (Frame& frame : result.block.frames) {
    if (!frame.position_prior) frame.position_prior = PositionPrior{};
    if (kept++ >= positions) frame.position_prior.reset();
    if (!attitudes) frame.attitude_prior.reset();
  }
  result.free_parts = {{FrameIndex(0), defect}};
  result.gauge = "free, inner constraints: defect " + std::to_string(defect);
  return result;
}

TEST(Remarks, SaysInPlainWordsWhatAFreeDatumLeavesOpen) {
  EXPECT_TRUE(datum_texts(made_up_result(small_block())).empty());
  BlockResult line = free_result(1, 3, false);
  const double sigma = 28 * std::numbers::pi / 180;
  for (auto& covariance : line.frame_covariance) covariance(1, 1) = sigma * sigma;
  EXPECT_EQ(datum_texts(line),
            std::vector<std::string>{
                "The datum is free: nothing determines the rotation about the line on which the positions or control "
                "points lie (sigma of the rotations 28 degrees); heights and attitudes are not usable; add attitudes "
                "or control points away from that line, or verticals where walls are seen ('megablock verticals')"});
  EXPECT_THAT(report_html(line),
              HasSubstr("<li class=look>The datum is free: nothing determines the rotation about the line"));

  const auto first = [](const BlockResult& result) { return datum_texts(result).at(0); };
  EXPECT_THAT(first(free_result(1, 1, true)), HasSubstr("nothing determines scale;"));
  EXPECT_THAT(first(free_result(4, 0, true)), HasSubstr("nothing determines place and scale;"));
  EXPECT_THAT(first(free_result(4, 1, false)), HasSubstr("nothing determines direction and scale;"));
  EXPECT_THAT(first(free_result(7, 0, false)), HasSubstr("nothing determines place, direction and scale;"));

  line.block.verticals.resize(1);
  EXPECT_THAT(first(line), testing::Not(HasSubstr("megablock verticals")));
}

// Starts that are a kilometre off: positions have no weight, and adding some is no remedy.
TEST(Remarks, NamesPositionsThatDoNotHoldTheDatum) {
  BlockResult result = made_up_result(small_block());
  result.free_parts = {{FrameIndex(0), 4}};
  EXPECT_THAT(datum_texts(result).at(0), testing::Not(HasSubstr("do not determine it")));
  for (Frame& frame : result.block.frames) frame.position_prior->position.x() += 1000;
  EXPECT_THAT(datum_texts(result).at(0),
              testing::AllOf(HasSubstr("The datum is free: nothing determines "),
                             HasSubstr("; 59 of its 59 positions do not determine it, because they differ from the "
                                       "block by 1000 m (median): correct start values ('poses') that are far off"),
                             testing::Not(HasSubstr("add positions"))));
}

TEST(Remarks, NamesTheAxisAboutWhichRotationsAreWeak) {
  BlockResult result = free_result(0, 3, false);
  result.free_parts.clear();  // just not free
  const auto weak_about = [&](const Eigen::Vector3d& axis) {
    const double sigma = 28 * std::numbers::pi / 180;
    for (auto& covariance : result.frame_covariance)
      covariance.topLeftCorner<3, 3>() = 1e-8 * Eigen::Matrix3d::Identity() + sigma * sigma * axis * axis.transpose();
    return datum_texts(result).at(0);
  };
  const std::string end =
      " are known to 28 degrees only (sigma): heights and attitudes are not usable; add control points or attitudes";
  const std::string verticals = ", or verticals where walls are seen ('megablock verticals')";
  EXPECT_EQ(weak_about({0, -1, 0}), "The rotations about a level axis of azimuth 0 degrees" + end + verticals);
  EXPECT_EQ(weak_about({-1, 0, 0}), "The rotations about a level axis of azimuth 90 degrees" + end + verticals);
  EXPECT_EQ(
      weak_about({0, 0, -1}),
      "The rotations about the vertical are known to 28 degrees only (sigma): directions in plan are not usable; add "
      "control points or attitudes");
  EXPECT_THAT(weak_about(Eigen::Vector3d(-0.5, 0, -std::sqrt(0.75))),
              testing::StartsWith("The rotations about an axis 60 degrees above azimuth 90 are known to"));
  for (auto& covariance : result.frame_covariance) covariance.setIdentity();
  EXPECT_EQ(datum_texts(result).at(0).find("about"), std::string::npos) << "about every axis alike";
}

TEST(Remarks, TiePointsThatFitFarWorseThanAssumed) {
  BlockResult result = made_up_result(small_block());
  const auto remark = [&] { return misstated_texts(result); };
  result.image_sigma_px = 3.9;
  EXPECT_TRUE(remark().empty()) << "what was assumed is not known";
  result.provenance.options.push_back({"adjustment.image_sigma_px", "0.5", "0.5"});
  const std::string start = "Tie points fit to 3.9 px only, 7.8 times the 0.5 px of adjustment.image_sigma_px: ";
  result.block.control_points.clear();
  for (Frame& frame : result.block.frames) {
    frame.position_prior =
        PositionPrior{Eigen::Vector3d::Zero(), Eigen::Vector3d::Constant(1e-8), Eigen::Vector3d::Zero()};
    frame.attitude_prior->sigma_rad.setConstant(0.5 * std::numbers::pi / 180);
  }
  ASSERT_EQ(remark().size(), 1u);
  EXPECT_EQ(remark()[0],
            start +
                "the observations that place the block contradict the images (positions are held, attitudes are stated "
                "to 0.5 degrees), the camera model is wrong, or many matches are wrong; state larger sigmas, and run "
                "with "
                "'adjustment: {use_position_priors: false, use_attitude_priors: false}' to see how the images "
                "alone fit");
  EXPECT_THAT(report_html(result), testing::AllOf(HasSubstr("<li class=look>Tie points fit to 3.9 px only"),
                                                  testing::Not(HasSubstr("Residuals agree with their sigmas"))));
  for (Frame& frame : result.block.frames) frame.position_prior.reset(), frame.attitude_prior.reset();
  EXPECT_EQ(remark()[0],
            start + "the camera model is wrong, or many matches are wrong; see cameras and images in the report");
  result.image_sigma_px = 1.4;  // blurred images
  EXPECT_TRUE(remark().empty());
  result.image_sigma_px = 0.5;  // held, and the residuals say otherwise
  result.observation_table[ObservationKind::kTieImage] = {1000, 9 * 900, 900, 1};
  result.provenance.options.back().value = "0.4";
  EXPECT_THAT(remark().at(0), testing::StartsWith("Tie points fit to 1.5 px only, 3.8 times the 0.4 px"));
}

TEST(Remarks, ManyMeasurementsNearTheLimitOfScreening) {
  BlockResult result = made_up_result(small_block());
  result.image_sigma_px = 0.45;
  const auto said = [&] {
    for (const std::string& line : remarks(result))
      if (line.find("limit of screening") != std::string::npos) return line;
    return std::string();
  };
  result.free_parts = {{FrameIndex(0), 7}};
  EXPECT_EQ(said(), "") << "the limit is not known";
  result.provenance.options.push_back({"adjustment.max_residual_sigmas", "4", "4"});  // 1.8 px
  EXPECT_EQ(said(), "") << "normal errors";
  std::int64_t near = 0, all = 0;
  for (std::size_t o = 0; o < result.kept.size(); ++o) {
    if (!std::isfinite(result.residual_x[o])) continue;
    if (++all % 200 != 0) continue;
    ++near;
    result.kept[o] = o % 2;  // kept or not
    result.residual_x[o] = 0;
    result.residual_y[o] = near % 2 ? -1.65F : 1.95F;
  }
  EXPECT_THAT(said(), testing::AllOf(testing::ContainsRegex("^[0-9]+ of " + std::to_string(all) +
                                                            " tie point observations "
                                                            "\\(0\\.[45][0-9] %\\) lie within 10 % of the limit"),
                                     HasSubstr("'adjustment: {image_sigma_px: 0.45, estimate_image_sigma: false, "
                                               "max_residual_sigmas: 1000}'")));
  EXPECT_THAT(report_html(result), HasSubstr("lie within 10 % of the limit of screening"));
  result.provenance.options.back().value = "1000";
  for (std::size_t o = 0; o < result.kept.size(); o += 500) result.residual_y[o] = 450;
  EXPECT_EQ(said(), "") << "nothing is screened, and gross errors are near the limit by chance";
  result.provenance.options.back().value = "4";
  EXPECT_THAT(said(), HasSubstr("of the limit"));
  result.tiles.tile_count = 1;
  EXPECT_EQ(said(), "") << "there is no division";
  result.tiles.tile_count = 4;
  result.free_parts.clear();
  EXPECT_EQ(said(), "") << "positions of frames hide it";
}

TEST(Remarks, SigmaNaughtThatIsFarFromOne) {
  BlockResult result = made_up_result(small_block());
  result.image_sigma_px = 0.13;
  result.degrees_of_freedom = 41230;
  result.variance_factor = 2.2;  // 1.48 times
  EXPECT_EQ(sigma_naught_text(result), "");
  result.variance_factor = 5.12;
  result.provenance.options.push_back({"adjustment.estimate_image_sigma", "false", "true"});
  EXPECT_EQ(sigma_naught_text(result),
            "Residuals are 2.3 times as large as the stated sigmas predict (variance factor 5.12, 41230 degrees of "
            "freedom; the sigma of tie points is held at 0.13 px): the formal sigmas are too small by this factor; "
            "'merge: {scale_sigma: true}' multiplies them by it");
  EXPECT_THAT(remarks(result), testing::ElementsAre(sigma_naught_text(result)));
  EXPECT_THAT(report_html(result), HasSubstr("<li class=look>Residuals are 2.3 times as large"));
  result.sigma_scaled = true;
  EXPECT_THAT(sigma_naught_text(result), testing::EndsWith("): the formal sigmas are multiplied by it"));
  result.sigma_scaled = false;
  result.provenance.options.pop_back();
  result.variance_factor = 0.04;
  EXPECT_THAT(sigma_naught_text(result),
              testing::AllOf(testing::StartsWith("Residuals are 0.20 times as large"),
                             HasSubstr("41230 degrees of freedom): the formal sigmas are too large by this factor")));
  result.degrees_of_freedom = 3;
  EXPECT_EQ(sigma_naught_text(result), "") << "by chance";
  result.variance_factor = 5.12;
  EXPECT_EQ(sigma_naught_text(result), "") << "by chance";
}

TEST(Remarks, KindsThatAreWorseThanStated) {
  BlockResult result = made_up_result(small_block());
  result.observation_table = {};
  ObservationStatistics& attitudes = result.observation_table[ObservationKind::kAttitude];
  attitudes = {54, 31 * 50, 50, 1};  // 5.57 times
  const auto first = [&] { return misstated_texts(result).at(0); };
  EXPECT_THAT(first(), testing::StartsWith(
                           "Residuals of attitude (54 observations) are 5.6 times as large as the stated sigmas"));
  EXPECT_THAT(first(),
              testing::EndsWith("; 'merge: {estimate_sigmas: true}' estimates these sigmas from the residuals"));
  EXPECT_THAT(report_html(result), HasSubstr("<li class=look>Residuals of attitude (54 observations) are 5.6 times"));
  EXPECT_EQ(remarks(result).size(), 1u);
  result.provenance.options.push_back({"merge.estimate_sigmas", "true", "false"});
  EXPECT_THAT(first(), testing::EndsWith("; the adjustment used estimated sigmas ('merge: {estimate_sigmas: true}')"));
  attitudes.weighted_squares = 3.9 * 50;  // not twice
  EXPECT_TRUE(misstated_texts(result).empty());
  attitudes = {3, 6, 1.2, 1};  // 2.2 times, by chance
  EXPECT_TRUE(misstated_texts(result).empty());
  result.observation_table[ObservationKind::kControlHeight] = {20, 900, 9, 1};
  EXPECT_THAT(first(), testing::AllOf(HasSubstr("control, height (20 observations) are 10.0"),
                                      testing::Not(HasSubstr("estimate_sigmas"))));
}

TEST(Remarks, PositionsAndAttitudesThatTheBlockContradicts) {
  BlockResult result = made_up_result(small_block());
  const std::size_t frames = result.block.frames.size();
  for (std::size_t f = 0; f < frames; ++f) {  // as the block says
    Frame& frame = result.block.frames[FrameIndex(f)];
    const Pose& pose = result.state.frames[FrameIndex(f)];
    frame.position_prior = PositionPrior{pose.centre, Eigen::Vector3d::Constant(0.5), Eigen::Vector3d::Zero()};
    frame.attitude_prior = AttitudePrior{pose.rotation, Eigen::Vector3d::Constant(0.05)};
  }
  const auto contradicted = [&] { return contradicted_texts(result, report::figures_of(result)); };
  EXPECT_TRUE(contradicted().empty());
  const auto turn = [&](std::size_t f, double angle) {
    Eigen::Quaterniond& rotation = result.block.frames[FrameIndex(f)].attitude_prior->rotation_cw;
    rotation = Eigen::AngleAxisd(angle, Eigen::Vector3d(0.6, 0, 0.8)) * rotation;
  };
  turn(1, 0.29), turn(3, 1);  // 5.8 sigmas; a frame that is not oriented
  EXPECT_TRUE(contradicted().empty());
  turn(5, 0.31), turn(0, std::numbers::pi);
  result.block.frames[FrameIndex(2)].position_prior->position.y() += 40;
  const std::string of = " of " + std::to_string(frames - 1);
  const auto name = [&](std::size_t f) { return result.block.frames[FrameIndex(f)].name; };
  EXPECT_THAT(contradicted(),
              testing::ElementsAre(
                  "1" + of + " positions differs from the block by more than 6 sigmas: " + name(2) + " by 40 m",
                  "2" + of + " attitudes differ from the block by more than 6 sigmas: " + name(0) +
                      " by 180 degrees, " + name(5) + " by 18 degrees"));
  EXPECT_EQ(remarks(result).size(), 2u);
  EXPECT_THAT(report_html(result), HasSubstr("<li class=look>1" + of + " positions differs"));
}

}  // namespace
}  // namespace megablock
