#include "cluster/stages/common/growth.h"

#include <gtest/gtest.h>

#include "adjust/problem/tile_problem.h"
#include "adjust/terms/build_problem.h"
#include "cluster/job/given_tracks.h"
#include "cluster/stages/common/problem_hash.h"
#include "cluster/stages/registration/frame_tracks.h"
#include "io/simulate/blocks/simulate.h"
#include "io/store/units/tracks_file.h"
#include "tests/support/adjust/known_lines.h"
#include "tests/support/adjust/seen_verticals.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

TEST(Growth, GenerationOfAnImage) {
  const std::vector<std::int64_t> generations = {10, 11, 20};
  EXPECT_EQ(generation_of(generations, ImageIndex(0)), 0u);
  EXPECT_EQ(generation_of(generations, ImageIndex(9)), 0u);
  EXPECT_EQ(generation_of(generations, ImageIndex(10)), 1u);
  EXPECT_EQ(generation_of(generations, ImageIndex(11)), 2u);
  EXPECT_EQ(generation_of(generations, ImageIndex(19)), 2u);
}

TEST(Growth, FirstImagesAreABlockOfTheirOwn) {
  SimulationOptions options;
  options.scene = SimulationOptions::Scene::kStreet;
  options.frames = 6;
  options.rig_cameras = 3;
  Block block = simulate_block(options).block;
  Camera later = block.cameras[CameraIndex(0)];
  later.name = "later";
  block.rigs.push_back({"later", {Mount{block.cameras.next_index(), {}}}});
  block.cameras.push_back(later);
  block.add_image("later.jpg", {block.frames.next_index(), 0, 0});
  Frame frame;
  frame.name = "later";
  frame.rig = RigIndex(1);
  block.frames.push_back(frame);
  check(block);

  block.lines.push_back({"edge", KnownLine::Direction::kVertical, {{ImageIndex(7), {1, 2}, {3, 90}, 1}}});
  block.verticals.push_back({ImageIndex(5), Eigen::Vector3d::UnitY(), Eigen::Matrix3d::Identity(), {}, {}});
  block.verticals.push_back({ImageIndex(7), Eigen::Vector3d::UnitY(), Eigen::Matrix3d::Identity(), {}, {}});
  const Block part = first_images(block, 6);
  EXPECT_NO_THROW(check(part));
  EXPECT_EQ(part.images.size(), 6u);
  EXPECT_EQ(part.image_names.size(), 6u);
  EXPECT_EQ(part.verticals.size(), 1u);
  EXPECT_EQ(part.frames.size(), 2u);
  EXPECT_EQ(part.rigs.size(), 1u);
  EXPECT_EQ(part.cameras.size(), 3u);
  EXPECT_EQ(first_images(block, std::ssize(block.images)).cameras.size(), 4u);
}

std::uint64_t hash_of(const TileProblem& problem, const TileState& state) {
  Hasher hasher;
  add_to_hash(hasher, problem, state);
  return hasher.value();
}

TEST(ProblemHash, HoldsEveryTermAndStartValue) {
  SimulationOptions options;
  options.scene = SimulationOptions::Scene::kStreet;
  options.frames = 12;
  options.points_per_frame = 40;
  options.attitude_sigma_deg = 1;
  options.relative_position_sigma_m = 0.05;
  options.control_points = 8;
  SimulatedBlock simulated = simulate_block(options);
  add_known_lines(simulated, 10, 1);
  add_seen_verticals(simulated, {.by_radial = 0.02});
  for (Mount& mount : simulated.block.rigs[RigIndex(0)].mounts) mount.rotation_sigma_rad = 0.01;
  simulated.block.rigs[RigIndex(0)].mounts[0].rotation_sigma_rad = 0;
  for (Camera& camera : simulated.block.cameras) camera.prior_sigma[kFocal] = 20;
  Tiles tiles;
  tiles.tile_count = 1;
  tiles.tile_of_frame.assign(simulated.block.frames.size(), TileIndex(0));
  const BlockState start = initial_state(simulated.block);
  const TileProblem problem = make_tile_problem(simulated.block, start, tiles, TileIndex(0), simulated.tracks, {});
  const TileState state =
      make_tile_state(problem, start, std::vector<Eigen::Vector3d>(problem.points.size(), Eigen::Vector3d::Zero()));
  for (const std::size_t terms :
       {problem.positions.size(), problem.attitudes.size(), problem.relatives.size(), problem.point_priors.size(),
        problem.intrinsic_priors.size(), problem.mount_priors.size(), problem.lines.size(), problem.verticals.size()})
    ASSERT_GT(terms, 0u) << "the block must have every kind of term";
  const std::uint64_t reference = hash_of(problem, state);
  EXPECT_EQ(hash_of(problem, state), reference);

  const auto differs = [&](auto change) {
    TileProblem p = problem;
    TileState s = state;
    change(p, s);
    return hash_of(p, s) != reference;
  };
  EXPECT_TRUE(differs([](auto& p, auto&) { p.x[0] += 1; }));
  EXPECT_TRUE(differs([](auto& p, auto&) { p.inverse_sigma.back() *= 2; }));
  EXPECT_TRUE(differs([](auto& p, auto&) { p.kept[0] ^= 1; }));
  EXPECT_TRUE(differs([](auto& p, auto&) { p.positions.at(0).prior.position.x() += 1; }));
  EXPECT_TRUE(differs([](auto& p, auto&) { p.attitudes.at(0).prior.sigma_rad.x() *= 2; }));
  EXPECT_TRUE(differs([](auto& p, auto&) { p.relatives.at(0).position_sigma_m *= 2; }));
  EXPECT_TRUE(differs([](auto& p, auto&) { p.point_priors.at(0).position.z() += 1; }));
  EXPECT_TRUE(differs([](auto& p, auto&) { p.intrinsic_priors.at(0).sigma[0] *= 2; }));
  EXPECT_TRUE(differs([](auto& p, auto&) { p.mount_priors.at(0).rotation_sigma_rad *= 2; }));
  EXPECT_TRUE(differs([](auto& p, auto&) { p.lines.at(0).weight *= 2; }));
  EXPECT_TRUE(differs([](auto& p, auto&) { p.line_loss.scale *= 2; }));
  EXPECT_TRUE(differs([](auto& p, auto&) { p.verticals.at(0).weight(0, 1) += 1; }));
  EXPECT_TRUE(differs([](auto& p, auto&) { p.verticals.at(0).camera[0] += 1; }));
  EXPECT_TRUE(differs([](auto& p, auto&) { p.verticals.at(0).by_camera(1, 0) += 1; }));
  EXPECT_TRUE(differs([](auto& p, auto&) { p.vertical_loss.scale *= 2; }));
  EXPECT_TRUE(differs([](auto& p, auto&) { p.attitude_loss.scale *= 2; }));
  EXPECT_TRUE(differs([](auto& p, auto&) { p.camera_free.at(0) ^= 1; }));
  EXPECT_TRUE(differs([](auto& p, auto&) { p.image_loss.scale *= 2; }));
  EXPECT_TRUE(differs([](auto&, auto& s) { s.frames[0].centre.x() += 1e-9; }));
  EXPECT_TRUE(differs([](auto&, auto& s) { s.cameras[0][kRadial1] += 1e-9; }));
  EXPECT_TRUE(differs([](auto&, auto& s) { s.mounts[0].centre.x() += 1e-9; }));
  EXPECT_FALSE(differs([](auto& p, auto&) { p.points.back().index += 1; })) << "only the place in the block";
}

TEST(GivenTracks, GoToTheirOwnersHoweverFewAreHeld) {
  SimulationOptions options;
  options.frames = 60;
  options.points_per_frame = 40;
  const SimulatedBlock simulated = simulate_block(options);
  const TrackSet& all = simulated.tracks;
  Tiles tiles = single_tile(simulated.block);
  tiles.tile_count = 7;  // the sixth stays empty
  for (std::int64_t f = 0; f < options.frames; ++f)
    tiles.tile_of_frame[FrameIndex(f)] = f % 11 == 0 ? TileIndex() : TileIndex(f / 12 == 4 ? 6 : f / 12);
  const ScratchDirectory scratch;
  write_tracks(scratch.path("tie_points.h5"), all);
  for (const std::int64_t held : {std::int64_t{1} << 24, std::int64_t{300}, std::int64_t{1}}) {
    std::int64_t tile = 0, dealt = 0;
    deal_given_tracks(
        scratch.path("tie_points.h5"), simulated.block, tiles, scratch.path("waiting/tracks"),
        [&](const TrackSet& own) {
          std::int64_t row = 0;
          for (std::int64_t t = 0; t < all.track_count(); ++t) {
            const ImageIndex* images = all.image.data();
            if (owner_tile(simulated.block, tiles, images + all.begin[t], images + all.begin[t + 1]).value != tile)
              continue;
            ASSERT_LT(row, own.track_count());
            ASSERT_EQ(own.id[row], all.id[t]);
            ASSERT_EQ(own.begin[row + 1] - own.begin[row], all.begin[t + 1] - all.begin[t]);
            for (std::int64_t o = 0; o < all.begin[t + 1] - all.begin[t]; ++o) {
              const std::int64_t a = own.begin[row] + o, b = all.begin[t] + o;
              ASSERT_EQ(std::tuple(own.image[a], own.x[a], own.y[a], own.feature[a]),
                        std::tuple(all.image[b], all.x[b], all.y[b], all.feature[b]));
            }
            ++row;
          }
          EXPECT_EQ(row, own.track_count());
          dealt += row;
          ++tile;
        },
        {}, held);
    EXPECT_EQ(tile, 7);
    EXPECT_GT(dealt, 300);
    EXPECT_FALSE(std::filesystem::exists(scratch.path("waiting/tracks")));
  }
}

}  // namespace
}  // namespace megablock
