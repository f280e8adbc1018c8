// Given poses decide in matching whether the verticals of two images agree (given_poses_join).
#include "cluster/stages/pipeline/matching.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "adjust/orientation/vertical_check.h"
#include "cluster/job/job.h"
#include "cluster/job/job_record.h"
#include "cluster/stages/common/units.h"
#include "cluster/stages/merge/merge_checkpoint.h"
#include "cluster/terminal/option_checks.h"
#include "io/store/units/features_file.h"
#include "io/store/units/graph_files.h"
#include "tests/support/adjust/seen_verticals.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

std::vector<VerifiedPair> read_all_matches(const JobStore& store, const std::vector<std::string>& units) {
  std::vector<VerifiedPair> all;
  for (const std::string& unit : units)
    for (VerifiedPair& pair : read_matches(store.verified_path(unit))) all.push_back(std::move(pair));
  return all;
}

constexpr std::int64_t kImages = 4;
constexpr int kRivals = 100;

// Two images along either of two streets, with the verticals that they see. Every point is a feature of its own, which
// stands as the vertical does. Besides, every image shows the same marks anywhere, in each image turned otherwise:
// rivals that nothing but a vertical tells from points.
struct UprightStreet {
  Block block;
  std::vector<ImageFeatures> features{kImages};

  UprightStreet() {
    SimulationOptions options;
    options.scene = SimulationOptions::Scene::kStreet;
    options.frames = kImages;
    options.rig_cameras = 1;
    options.points_per_frame = 300;
    SimulatedBlock simulated = simulate_block(options);
    add_seen_verticals(simulated, {.sigma_deg = 0.1, .noise_deg = 0.1});
    block = simulated.block;
    const TrackSet& tracks = simulated.tracks;
    for (std::size_t t = 0; t < tracks.id.size(); ++t) {
      const SiftDescriptor descriptor = next_descriptor();
      for (auto o = static_cast<std::size_t>(tracks.begin[t]); o < static_cast<std::size_t>(tracks.begin[t + 1]); ++o)
        add(tracks.image[o], {tracks.x[o], tracks.y[o], 4, kUpright}, descriptor);
    }
    const Camera& camera = block.cameras[CameraIndex(0)];
    for (int rival = 0; rival < kRivals; ++rival) {
      const SiftDescriptor descriptor = next_descriptor();
      for (ImageIndex image(0); image.value < kImages; ++image.value) {
        const auto place = [&](int size) { return static_cast<std::int32_t>(random_() % static_cast<unsigned>(size)); };
        const std::int32_t x = 1024 * place(camera.width), y = 1024 * place(camera.height);
        add(image, {x, y, 4, static_cast<float>(kUpright + 90 * image.value)}, descriptor);
      }
    }
  }

 private:
  static constexpr float kUpright = 105;  // degrees; the middle of a sector. Down in an image is at 90

  void add(ImageIndex image, const Keypoint& keypoint, const SiftDescriptor& descriptor) {
    ImageFeatures& of = features[static_cast<std::size_t>(image.value)];
    of.image = image;
    of.keypoints.push_back(keypoint);
    of.descriptors.push_back(descriptor);
  }
  SiftDescriptor next_descriptor() {
    SiftDescriptor descriptor;
    for (auto& value : descriptor) value = static_cast<std::uint8_t>(random_() % 91);
    return descriptor;
  }
  std::mt19937_64 random_{1};
};

struct CellMatches {
  std::uint64_t fingerprint = 0, content = 0;
  std::vector<VerifiedPair> pairs;
};

// Of both streets, in one cell, by the stage of a job.
CellMatches matches_of(const Block& block, const std::vector<ImageFeatures>& features, bool by_turn = false,
                       int threads = 1) {
  const ScratchDirectory folder;
  const JobStore store(folder.path("job"));
  store.create();
  const std::string shard = unit_name("features", 0);
  store.write(shard, 0, [&](const std::string& path) { write_features(path, features); });
  const CandidateGraph graph{
      {{ImageIndex(0), ImageIndex(1)}, {ImageIndex(2), ImageIndex(3)}}, {0, 2}, {0, 1}};  // one cell
  RunOptions options;
  options.threads = threads;
  options.quiet = true;
  int argc = 0;
  char** argv = nullptr;
  Communicator ranks(&argc, &argv);
  JobOptions settings;
  settings.matching.by_turn = by_turn;
  const PagedTables tables(store.directory());
  const Job job{.options = options,
                .ranks = ranks,
                .store = store,
                .settings = settings,
                .log = {},
                .block = block,
                .tables = tables,
                .generations = {kImages}};
  JobRecord record{.events = EventLog(store, 0), .stages = {}, .failures = {}, .notes = {}};
  const std::vector<std::string> names =
      run_matching(*find_stage("matching"), job, record, {std::vector<std::uint64_t>(kImages, 7), {shard}}, graph);
  const UnitSeal seal = store.seal(names.at(0)).value();
  return {seal.fingerprint, seal.content_hash, read_all_matches(store, names)};
}

void expect_same(const CellMatches& a, const CellMatches& b) {
  EXPECT_EQ(a.fingerprint, b.fingerprint);
  EXPECT_EQ(a.content, b.content);
}

class MatchingByVerticals : public testing::Test {
 protected:
  static constexpr std::int64_t kOne = 2;  // whose pose or vertical differs from the others'; of the second pair
  Pose& pose(std::int64_t image) {
    return *street_.block.frames[street_.block.images[ImageIndex(image)].frame].given_pose;
  }
  CellMatches matched() const { return matches_of(street_.block, street_.features); }
  CellMatches matched_without_its_vertical() const {
    Block without = street_.block;
    without.verticals.erase(without.verticals.begin() + kOne);
    return matches_of(without, street_.features);
  }

  UprightStreet street_;
};

// A pair whose given poses contradict its verticals is matched as if one of these were not there, other pairs as ever.
TEST_F(MatchingByVerticals, PosesThatContradictThemLeaveThemOut) {
  const CellMatches together = matched(), apart = matched_without_its_vertical();
  ASSERT_EQ(together.pairs.size(), 2u);
  ASSERT_EQ(apart.pairs.size(), 2u);
  EXPECT_NE(together.fingerprint, apart.fingerprint);
  EXPECT_EQ(together.pairs[0].putative, apart.pairs[0].putative);
  EXPECT_EQ(together.pairs[1].putative + kRivals, apart.pairs[1].putative);
  pose(kOne).rotation = pose(kOne).rotation * rotation_exp<double>({60 * kDegree, 0, 0});
  expect_same(matched(), apart);
}

// Approximate poses, and none, say nothing against verticals.
TEST_F(MatchingByVerticals, RoughPosesAndNoneKeepThem) {
  const CellMatches together = matched();
  pose(kOne).rotation = pose(kOne).rotation * rotation_exp<double>({10 * kDegree, 0, 0});
  expect_same(matched(), together);
  street_.block.frames[street_.block.images[ImageIndex(kOne)].frame].given_pose.reset();
  expect_same(matched(), together);
}

// By poses in axes of an imported model, which are any, no vertical is down (kAgainstPoses); pairs are joined all the
// same.
TEST_F(MatchingByVerticals, PosesInAxesOfTheirOwnKeepThem) {
  const CellMatches together = matched();
  const Eigen::Quaterniond turn = rotation_exp<double>({0.6, 0.4, -1});
  for (std::int64_t image = 0; image < kImages; ++image)
    pose(image) = {pose(image).rotation * turn.conjugate(), turn * pose(image).centre};
  const std::vector<SetAsideVertical> aside = against_given_poses(street_.block);
  ASSERT_EQ(aside.size(), static_cast<std::size_t>(kImages));
  for (const SetAsideVertical& vertical : aside) EXPECT_EQ(vertical.verdict, VerticalVerdict::kAgainstPoses);
  expect_same(matched(), together);
}

// Without verticals the turn of a pair leaves out what they do; on any number of threads it is the same.
TEST_F(MatchingByVerticals, TheTurnDoesWithoutThem) {
  const CellMatches upright = matched();
  street_.block.verticals.clear();
  const CellMatches turned = matches_of(street_.block, street_.features, true);
  ASSERT_EQ(turned.pairs.size(), 2u);
  for (std::size_t pair = 0; pair < 2; ++pair) EXPECT_EQ(turned.pairs[pair].putative, upright.pairs[pair].putative);
  expect_same(matches_of(street_.block, street_.features, true, 2), turned);
  const CellMatches all = matches_of(street_.block, street_.features);
  EXPECT_NE(all.fingerprint, turned.fingerprint);
  EXPECT_EQ(all.pairs[0].putative, turned.pairs[0].putative + kRivals);
}

}  // namespace
}  // namespace megablock
