#include "io/evaluation/evaluate.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "geometry/numbers/angles.h"
#include "io/base/error.h"
#include "io/block/crs.h"
#include "io/block/ground_change.h"
#include "io/block/held_priors.h"
#include "io/simulate/blocks/simulate.h"
#include "io/simulate/files/write.h"
#include "io/simulate/scene/random.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

TEST(EvaluationText, LeavesOutWhatIsNotKnown) {
  Evaluation evaluation;
  evaluation.frames = 3;
  evaluation.position_rms_m = evaluation.position_max_m = evaluation.rotation_rms_deg = 0.5;
  const std::string without = to_text(evaluation);
  EXPECT_EQ(without.find("nan"), std::string::npos) << without;
  EXPECT_EQ(without.find("check points"), std::string::npos);
  evaluation.check_points = 2;
  evaluation.check_rms_horizontal_m = 0.0123;
  evaluation.check_rms_vertical_m = 0.0456;
  EXPECT_NE(to_text(evaluation).find("check points                2, rms 0.0123 m horizontal, 0.0456 m vertical"),
            std::string::npos);
}

// A result whose errors are drawn from the covariances it states.
class EvaluateTest : public testing::Test {
 protected:
  static SimulationOptions options() {
    SimulationOptions options;
    options.frames = 2000;
    options.points_per_frame = 10;
    return options;
  }
  EvaluateTest() {
    simulated_ = simulate_block(options());
    result_.block = simulated_.block;
    result_.state = simulated_.truth;
    result_.gauge = "fixed by priors";
    Random random(7, Random::Purpose::kNoise);
    for (Pose& pose : result_.state.frames) {
      BlockResult::Matrix6 root = BlockResult::Matrix6::Zero();
      for (int i = 0; i < 6; ++i)
        for (int j = 0; j <= i; ++j) root(i, j) = random.uniform(-0.5, 0.5) + (i == j ? 2 : 0);
      root.topRows<3>() *= 1e-4;
      root.bottomRows<3>() *= 0.01;
      PoseIncrement draw;
      draw << random.normal3(), random.normal3();
      pose = pose_update(pose, root * draw);
      result_.frame_covariance.push_back(root * root.transpose());
    }
  }

  SimulatedBlock simulated_;
  BlockResult result_;
};

TEST_F(EvaluateTest, StatedSigmasAreTrue) {
  const Evaluation e = evaluate(result_, simulated_.truth);
  EXPECT_EQ(e.frames, 2000);
  EXPECT_EQ(e.frames_missing, 0);
  EXPECT_FALSE(e.aligned);
  EXPECT_NEAR(e.normalised_error_position, 1, 0.04);
  EXPECT_NEAR(e.normalised_error_rotation, 1, 0.04);
  double sum = 0, largest = 0, angle = 0;
  for (std::size_t f = 0; f < 2000; ++f) {
    const FrameIndex frame(static_cast<std::int64_t>(f));
    const double distance = (result_.state.frames[frame].centre - simulated_.truth.frames[frame].centre).norm();
    sum += distance * distance / 2000;
    largest = std::max(largest, distance);
    angle += std::pow(rotation_angle(result_.state.frames[frame].rotation, simulated_.truth.frames[frame].rotation), 2);
  }
  EXPECT_NEAR(e.position_rms_m, std::sqrt(sum), 1e-12);
  EXPECT_NEAR(e.position_max_m, largest, 1e-12);
  EXPECT_NEAR(e.rotation_rms_deg, std::sqrt(angle / 2000) / kDegree, 1e-9);
  EXPECT_NEAR(e.relative_position_rms_m, std::sqrt(2 * sum), 0.1 * e.position_rms_m);  // independent errors
}

// Of what is held nothing tells how far it is off.
TEST_F(EvaluateTest, HeldFramesHaveNoRatio) {
  result_.boundary.assign(result_.block.frames.size(), 0);
  for (std::size_t f = 0; f < result_.block.frames.size(); ++f) {
    const FrameIndex frame(static_cast<std::int64_t>(f));
    result_.block.frames[frame].position_prior = PositionPrior{
        result_.state.frames[frame].centre, Eigen::Vector3d::Constant(kHeldPositionSigma), Eigen::Vector3d::Zero()};
    result_.frame_covariance[frame].bottomRows<3>().setZero();
    result_.frame_covariance[frame].rightCols<3>().setZero();
    result_.frame_covariance[frame].bottomRightCorner<3, 3>().diagonal().setConstant(1e-16);
  }
  const Evaluation e = evaluate(result_, simulated_.truth);
  EXPECT_TRUE(std::isnan(e.normalised_error_position) && std::isnan(e.normalised_error_position_interior));
  EXPECT_NEAR(e.normalised_error_rotation, 1, 0.04);
  EXPECT_NE(to_text(e).find("error / formal sigma        position -, rotation 0.99"), std::string::npos) << to_text(e);
  const auto json = nlohmann::json::parse(to_json(e));
  EXPECT_TRUE(json["normalised_error_position"].is_null());
  EXPECT_TRUE(json["normalised_error_rotation"].is_number());

  // They are not held where the job does not use them.
  result_.provenance.options = {{"adjustment.use_position_priors", "false", "true"}};
  const Evaluation unused = evaluate(result_, simulated_.truth);
  EXPECT_TRUE(std::isfinite(unused.normalised_error_position));
  EXPECT_EQ(to_text(unused).find("held"), std::string::npos) << to_text(unused);
}

TEST_F(EvaluateTest, BoundaryFramesApart) {
  EXPECT_FALSE(std::isfinite(evaluate(result_, simulated_.truth).normalised_error_position_boundary));
  result_.boundary.assign(result_.block.frames.size(), 0);
  for (std::size_t f = 0; f < result_.boundary.size(); f += 2) {
    const FrameIndex frame(static_cast<std::int64_t>(f));
    result_.boundary[frame] = 1;
    result_.frame_covariance[frame] /= 9;
  }
  const Evaluation e = evaluate(result_, simulated_.truth);
  EXPECT_NEAR(e.normalised_error_position_interior, 1, 0.06);
  EXPECT_NEAR(e.normalised_error_rotation_interior, 1, 0.06);
  EXPECT_NEAR(e.normalised_error_position_boundary, 3, 0.18);
  EXPECT_NEAR(e.normalised_error_rotation_boundary, 3, 0.18);
}

TEST_F(EvaluateTest, SigmasTooSmallShow) {
  for (auto& covariance : result_.frame_covariance) covariance /= 4;
  const Evaluation e = evaluate(result_, simulated_.truth);
  EXPECT_NEAR(e.normalised_error_position, 2, 0.08);
  EXPECT_NEAR(e.normalised_error_rotation, 2, 0.08);
  result_.variance_factor = 4;
  const Evaluation scaled = evaluate(result_, simulated_.truth, {EvaluateOptions::Align::kAuto, true});
  EXPECT_NEAR(scaled.normalised_error_position, 1, 0.04);
}

TEST_F(EvaluateTest, AConstantShiftIsNoRelativeError) {
  result_.state = simulated_.truth;
  for (Pose& pose : result_.state.frames) pose.centre += Eigen::Vector3d(3, 0, 4);
  const Evaluation e = evaluate(result_, simulated_.truth);
  EXPECT_NEAR(e.position_rms_m, 5, 1e-9);
  EXPECT_NEAR(e.relative_position_rms_m, 0, 1e-9);
  EXPECT_NEAR(e.rotation_rms_deg, 0, 1e-6);
}

// A free block is judged after a similarity: the figures are those of the block before it was moved.
TEST_F(EvaluateTest, AFreeBlockIsAlignedFirst) {
  const Evaluation before = evaluate(result_, simulated_.truth, {EvaluateOptions::Align::kAlways, false});
  const double scale = 0.02;
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(1.1, Eigen::Vector3d(1, 2, -1).normalized()));
  for (std::size_t f = 0; f < 2000; ++f) {
    const FrameIndex frame(static_cast<std::int64_t>(f));
    Pose& pose = result_.state.frames[frame];
    pose.centre = scale * (turn * pose.centre) + Eigen::Vector3d(5, 6, 7);
    pose.rotation = pose.rotation * turn.conjugate();
    BlockResult::Matrix6 m = BlockResult::Matrix6::Zero();
    m.topLeftCorner<3, 3>() = turn.toRotationMatrix();
    m.bottomRightCorner<3, 3>() = scale * turn.toRotationMatrix();
    result_.frame_covariance[frame] = m * result_.frame_covariance[frame] * m.transpose();
  }
  result_.gauge = "free, inner constraints over 2000 frames";
  const Evaluation after = evaluate(result_, simulated_.truth);
  EXPECT_TRUE(after.aligned);
  EXPECT_NEAR(after.position_rms_m, before.position_rms_m, 1e-8);
  EXPECT_NEAR(after.rotation_rms_deg, before.rotation_rms_deg, 1e-8);
  EXPECT_NEAR(after.normalised_error_position, before.normalised_error_position, 1e-6);
  EXPECT_NEAR(after.normalised_error_rotation, before.normalised_error_rotation, 1e-6);
  EXPECT_NEAR(after.normalised_error_position, 1, 0.04);
}

TEST_F(EvaluateTest, FramesAreMatchedByName) {
  PoseTable truth = pose_table(simulated_.block, simulated_.truth);
  std::reverse(truth.names.begin(), truth.names.end());
  std::reverse(truth.poses.begin(), truth.poses.end());
  const Evaluation all = evaluate(result_, truth);
  EXPECT_NEAR(all.normalised_error_position, 1, 0.04);
  truth.names.resize(500);
  truth.poses.resize(500);
  truth.names[0] = "elsewhere.jpg";
  result_.state.oriented[FrameIndex(1998)] = 0;
  const Evaluation part = evaluate(result_, truth);
  EXPECT_EQ(part.frames, 498);
  EXPECT_EQ(part.frames_missing, 2);
  for (auto& name : truth.names) name = "x" + name;
  EXPECT_THROW(evaluate(result_, truth), InputError);
}

// A list may write images without the folder in which they lie, as positions and control may.
TEST_F(EvaluateTest, FramesAreMatchedByImagesInOtherFolders) {
  PoseTable truth = pose_table(simulated_.block, simulated_.truth);
  Block& block = result_.block;
  std::vector<ImageIndex> first(block.frames.size());
  for (ImageIndex i(0); block.images.contains(i); ++i.value) {
    ImageIndex& of_frame = first[static_cast<std::size_t>(block.images[i].frame.value)];
    if (!of_frame.valid()) of_frame = i;
  }
  for (std::size_t f = 0; f < first.size(); ++f) truth.names[f] = "campaign/" + block.name_of(first[f]);
  EXPECT_EQ(evaluate(result_, truth).frames, 2000);
}

// The same truth about another origin: the figures stay.
TEST_F(EvaluateTest, TheTruthMayHaveAnotherOrigin) {
  PoseTable truth = pose_table(simulated_.block, simulated_.truth);
  const Evaluation before = evaluate(result_, truth);
  const Georeference old_ground(*truth.ground);
  GroundFrame other = *truth.ground;
  other.latitude_deg += 0.02;
  other.longitude_deg -= 0.03;
  other.height_m += 50;
  const Georeference new_ground(other);
  const Geodetic old_origin{truth.ground->latitude_deg, truth.ground->longitude_deg, truth.ground->height_m};
  const Eigen::Vector3d moved_origin = new_ground.to_local(old_origin);
  // Axes of the old frame in the new one, by differences.
  Eigen::Matrix3d axes;
  for (int k = 0; k < 3; ++k)
    axes.col(k) = (new_ground.to_local(old_ground.to_geodetic(1000 * Eigen::Vector3d::Unit(k))) - moved_origin) / 1000;
  for (Pose& pose : truth.poses) {
    pose.centre = new_ground.to_local(old_ground.to_geodetic(pose.centre));
    pose.rotation = (pose.rotation * Eigen::Quaterniond(axes).conjugate()).normalized();
  }
  truth.ground = other;
  const Evaluation after = evaluate(result_, truth);
  EXPECT_GT(moved_origin.norm(), 2000);
  EXPECT_NEAR(after.position_rms_m, before.position_rms_m, 1e-6);
  EXPECT_NEAR(after.rotation_rms_deg, before.rotation_rms_deg, 1e-6);
  EXPECT_NEAR(after.normalised_error_rotation, before.normalised_error_rotation, 1e-4);
}

TEST_F(EvaluateTest, CheckPointsAreCompared) {
  ControlPoint point;
  point.role = PointRole::kCheck;
  point.position = {10, 20, 30};
  result_.block.control_points = {point, point, point};
  result_.block.control_points[2].role = PointRole::kControl;
  const double none = Evaluation::kNone;
  result_.control.resize(3);
  result_.control[0].adjusted = {10.3, 20.4, 31.2};
  result_.control[1].adjusted = {none, none, none};
  result_.control[2].adjusted = {10, 20.01, 30};
  const Evaluation e = evaluate(result_, simulated_.truth);
  EXPECT_EQ(e.check_points, 1);
  EXPECT_NEAR(e.check_rms_m, 1.3, 1e-12);
  EXPECT_NEAR(e.check_rms_horizontal_m, 0.5, 1e-12);
  EXPECT_NEAR(e.check_rms_vertical_m, 1.2, 1e-12);
  EXPECT_NEAR(e.control_rms_m, 0.01, 1e-12);
}

// Drawn with the sum of both covariances, of which the variance factor scales the adjusted one only.
TEST_F(EvaluateTest, CheckPointsAreHeldAgainstBothSigmas) {
  Random random(11, Random::Purpose::kNoise);
  const Eigen::Vector3d adjusted_sigma(0.03, 0.04, 0.12), stated_sigma(0.05, 0.05, 0.1);
  for (int i = 0; i < 2000; ++i) {
    ControlPoint point;
    point.role = PointRole::kCheck;
    point.sigma = stated_sigma;
    point.position = stated_sigma.cwiseProduct(random.normal3());
    result_.block.control_points.push_back(point);
    const Eigen::Matrix3d covariance = adjusted_sigma.cwiseAbs2().asDiagonal();
    result_.control.push_back({adjusted_sigma.cwiseProduct(random.normal3()), covariance, {}});
  }
  EXPECT_NEAR(evaluate(result_, simulated_.truth).normalised_error_check, 1, 0.04);
  for (auto& control : result_.control) control.covariance /= 4;
  result_.variance_factor = 4;
  EXPECT_GT(evaluate(result_, simulated_.truth).normalised_error_check, 1.15);
  const EvaluateOptions scaled{EvaluateOptions::Align::kAuto, true};
  EXPECT_NEAR(evaluate(result_, simulated_.truth, scaled).normalised_error_check, 1, 0.04);
  result_.sigma_scaled = true;  // already done
  EXPECT_GT(evaluate(result_, simulated_.truth, scaled).normalised_error_check, 1.15);
}

TEST_F(EvaluateTest, JsonHasNullForWhatDoesNotExist) {
  result_.frame_covariance.clear();
  const auto json = nlohmann::json::parse(to_json(evaluate(result_, simulated_.truth)));
  EXPECT_EQ(json["frames"], 2000);
  EXPECT_TRUE(json["normalised_error_position"].is_null());
  EXPECT_TRUE(json["check_rms_m"].is_null());
  EXPECT_FALSE(json["aligned"].get<bool>());
  EXPECT_GT(json["position_rms_m"].get<double>(), 0);
}

TEST_F(EvaluateTest, TruthIsReadFromFiles) {
  const ScratchDirectory folder;
  write_simulated_block(options(), folder.path());
  const Evaluation direct = evaluate(result_, simulated_.truth);
  for (const std::string name : {"", "truth.csv", "truth.h5"}) {
    const Evaluation e = evaluate(result_, folder.path(name));
    EXPECT_NEAR(e.position_rms_m, direct.position_rms_m, 1e-12) << name;
    EXPECT_NEAR(e.rotation_rms_deg, direct.rotation_rms_deg, 1e-9) << name;
  }
}

TEST_F(EvaluateTest, TooFewFramesToAlign) {
  for (auto& oriented : result_.state.oriented) oriented = 0;
  result_.state.oriented[FrameIndex(0)] = result_.state.oriented[FrameIndex(1)] = 1;
  result_.gauge = "free, two frames";
  EXPECT_THROW(evaluate(result_, simulated_.truth), InputError);
}

}  // namespace
}  // namespace megablock
