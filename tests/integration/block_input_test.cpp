// Runs whole jobs with bad blocks and tie points. The job must end with an error that names the fault, or report it and
// give good results for everything else.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

#include "cluster/process/exit_codes.h"
#include "geometry/similarity/similarity.h"
#include "io/base/error.h"
#include "io/evaluation/remarks/remarks.h"
#include "io/result/result.h"
#include "io/store/hdf5/hdf5_file.h"
#include "tests/integration/block_folder.h"
#include "tests/support/merge/two_cities.h"

namespace megablock {
namespace {

using testing::HasSubstr;

constexpr const char* kTiles = "tiles: {tile_max_frames: 15, min_tiles_from: 10}\n";
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

SimulationOptions aerial(std::int64_t frames) {
  SimulationOptions options;
  options.frames = frames;
  options.points_per_frame = 80;
  return options;
}

// Observations for which it does not hold are left out, and tracks of fewer than two.
template <typename Keep>
void keep_observations(SimulatedBlock& s, const Keep& keep) {
  TrackSet tracks;
  tracks.begin = {0};
  for (std::int64_t t = 0; t < s.tracks.track_count(); ++t) {
    for (std::int64_t o = s.tracks.begin[static_cast<std::size_t>(t)];
         o < s.tracks.begin[static_cast<std::size_t>(t + 1)]; ++o) {
      const auto row = static_cast<std::size_t>(o);
      if (!keep(row)) continue;
      tracks.image.push_back(s.tracks.image[row]);
      tracks.x.push_back(s.tracks.x[row]);
      tracks.y.push_back(s.tracks.y[row]);
      tracks.feature.push_back(s.tracks.feature[row]);
    }
    const std::size_t count = tracks.image.size() - static_cast<std::size_t>(tracks.begin.back());
    if (count < 2) {
      for (auto* column : {&tracks.x, &tracks.y, &tracks.feature}) column->resize(column->size() - count);
      tracks.image.resize(tracks.image.size() - count);
      continue;
    }
    tracks.id.push_back(s.tracks.id[static_cast<std::size_t>(t)]);
    tracks.begin.push_back(tracks.observation_count());
  }
  s.tracks = std::move(tracks);
}

class BlockInput : public testing::Test {
 protected:
  BlockResult adjust(const SimulatedBlock& s, int expected = kExitDone) {
    folder_.write(s, kTiles);
    EXPECT_EQ(folder_.run(), expected);
    return read_result(folder_.job("result/block.h5"));
  }
  std::string refusal(const SimulatedBlock& s) {
    folder_.write(s, kTiles);
    try {
      folder_.run();
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), Not(HasSubstr("\n")));
      return error.what();
    }
    return "nothing was refused";
  }
  // rms over the oriented frames of [first, end), in place or after the best similarity.
  static double error_m(const SimulatedBlock& s, const BlockResult& result, std::size_t first, std::size_t end,
                        bool in_place = true) {
    std::vector<Eigen::Vector3d> found, truth;
    for (std::size_t f = first; f < end; ++f) {
      const FrameIndex frame(static_cast<std::int64_t>(f));
      if (!result.state.oriented[frame]) continue;
      found.push_back(result.state.frames[frame].centre);
      truth.push_back(s.truth.frames[frame].centre);
    }
    const Similarity similarity = in_place ? Similarity() : fit_similarity(found, truth).value();
    double sum = 0;
    for (std::size_t i = 0; i < found.size(); ++i) sum += (similarity(found[i]) - truth[i]).squaredNorm();
    return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, found.size())));
  }
  static std::string said(const BlockResult& result) {
    std::string text = result.gauge;
    for (const std::string& note : result.notes) text += "\n" + note;
    for (const FailedUnit& failure : result.failures) text += "\n" + failure.unit + ": " + failure.reason;
    return text;
  }
  std::string report() const {
    std::ifstream in(folder_.job("result/report.html"));
    return {std::istreambuf_iterator<char>(in), {}};
  }

  BlockFolder folder_;
};

constexpr double kGood = 0.06;  // metres, of three axes; positions are known to 0.05 each

TEST_F(BlockInput, SoundBlock) {
  const SimulatedBlock s = simulate_block(aerial(60));
  const BlockResult result = adjust(s);
  EXPECT_GE(result.tiles.tile_count, 4);
  EXPECT_LT(error_m(s, result, 0, 60), kGood);
  EXPECT_THAT(said(result), testing::Not(HasSubstr("disagrees")));
}

// All tie points of one tile's images are noise. What is kept of them agrees by chance: the tile is named, an image is
// either where its position says or named with the distance, and the rest of the block is as good as ever.
TEST_F(BlockInput, TileWithoutOneGoodObservation) {
  const SimulatedBlock good = simulate_block(aerial(60));
  const BlockResult sound = adjust(good);
  const TileIndex wrong = sound.tiles.tile_of_frame[FrameIndex(0)];
  const auto in_wrong = [&](ImageIndex i) { return sound.tiles.tile_of_frame[good.block.images[i].frame] == wrong; };
  std::vector<bool> touched(60, false);  // frames that share a track with it
  for (std::int64_t t = 0; t < good.tracks.track_count(); ++t) {
    const auto first = good.tracks.image.begin() + good.tracks.begin[t],
               end = good.tracks.image.begin() + good.tracks.begin[t + 1];
    if (std::any_of(first, end, in_wrong))
      for (auto i = first; i != end; ++i) touched[static_cast<std::size_t>(good.block.images[*i].frame.value)] = true;
  }
  ASSERT_LT(std::ranges::count(touched, true), 50);
  ASSERT_GT(std::ranges::count_if(good.tracks.image, in_wrong), 500);

  for (const std::uint64_t seed : {1, 2, 3, 4, 5, 6}) {
    SimulatedBlock s = good;
    std::mt19937_64 random(seed);
    std::uniform_int_distribution<std::int32_t> x(0, 1920 * 1024 - 1), y(0, 1280 * 1024 - 1);
    for (std::size_t o = 0; o < s.tracks.image.size(); ++o)
      if (in_wrong(s.tracks.image[o])) s.tracks.x[o] = x(random), s.tracks.y[o] = y(random);
    // Points of noise alone may keep the adjustment from coming to an end, and then it says so.
    folder_.write(s, kTiles);
    const int code = folder_.run();
    const BlockResult result = read_result(folder_.job("result/block.h5"));
    EXPECT_EQ(code, said(result).find("did not converge") == std::string::npos ? kExitDone : kExitFailedUnits) << seed;
    const std::string tile = "tile " + std::to_string(wrong.value);
    EXPECT_THAT(said(result), testing::ContainsRegex(tile + " keeps few observations: [0-9]+ of [0-9]+ tie")) << seed;
    std::int64_t far_off = 0;
    for (FrameIndex f(0); f.value < 60; ++f.value) {
      ASSERT_TRUE(result.state.frames[f].centre.allFinite()) << seed;
      ASSERT_TRUE(result.frame_covariance[f].allFinite()) << seed;
      if (!result.state.oriented[f]) continue;
      // The positions are known to 0.05 m an axis. The corner of six sigmas is the text's (remarks.h).
      const Eigen::Vector3d d = result.state.frames[f].centre - s.block.frames[f].position_prior->position;
      far_off += d.cwiseQuotient(s.block.frames[f].position_prior->sigma).norm() > 6;
      if (touched[static_cast<std::size_t>(f.value)]) continue;
      EXPECT_LT(error_m(s, result, static_cast<std::size_t>(f.value), static_cast<std::size_t>(f.value) + 1),
                3 * kGood)
          << f.value << ", " << seed;  // as good as ever
    }
    EXPECT_LT(far_off, 15) << seed;  // the tile's images alone
    const std::vector<std::string> named = remarks(result);
    if (far_off > 0) {
      EXPECT_THAT(named, testing::Contains(testing::ContainsRegex(
                             "^" + std::to_string(far_off) + " of [0-9]+ positions differs? from the block by more")))
          << seed;
    }
  }
}

// No tie point reaches fifteen of the images.
TEST_F(BlockInput, ImagesWithoutTiePoints) {
  SimulatedBlock s = simulate_block(aerial(60));
  keep_observations(s, [&](std::size_t o) { return s.block.images[s.tracks.image[o]].frame.value >= 15; });
  const BlockResult result = adjust(s);
  for (FrameIndex f(0); f.value < 60; ++f.value) {
    EXPECT_EQ(result.state.oriented[f], f.value >= 15);
    if (f.value >= 15) continue;
    EXPECT_THAT(said(result), HasSubstr(s.block.frames[f].name + ": no other image shares enough verified matches"));
  }
  EXPECT_LT(error_m(s, result, 15, 60), kGood);
}

TEST_F(BlockInput, FrameSeenByOnePoint) {
  SimulatedBlock s = simulate_block(aerial(60));
  const auto of_frame = [&](std::size_t o) { return s.block.images[s.tracks.image[o]].frame.value == 31; };
  std::size_t kept = 0;  // of the point that most frames see: links to a few would be too weak for any tile
  std::int64_t longest = 0;
  for (std::size_t t = 0; t + 1 < s.tracks.begin.size(); ++t)
    for (auto o = static_cast<std::size_t>(s.tracks.begin[t]); o < static_cast<std::size_t>(s.tracks.begin[t + 1]); ++o)
      if (const std::int64_t length = s.tracks.begin[t + 1] - s.tracks.begin[t]; of_frame(o) && length > longest)
        kept = o, longest = length;
  keep_observations(s, [&](std::size_t o) { return !of_frame(o) || o == kept; });
  const BlockResult result = adjust(s);
  EXPECT_FALSE(result.state.oriented[FrameIndex(31)]);
  EXPECT_THAT(said(result), HasSubstr("f000031.jpg: oriented at first, but too few of its observations hold"));
  EXPECT_LT(error_m(s, result, 0, 31), kGood);
  EXPECT_LT(error_m(s, result, 32, 60), kGood);
}

// Two blocks with one camera, 200 km apart, in one job; with positions and free.
TEST_F(BlockInput, TwoCities) {
  for (const bool free : {false, true}) {
    SimulationOptions options = aerial(30);
    if (free) options.gps_sigma_m = 0;
    SimulatedBlock s = simulate_block(options);
    append_city(s, SimulatedBlock(s), {200e3, 0, 0});
    const BlockResult result = adjust(s);
    EXPECT_THAT(report(), HasSubstr("consists of 2 parts"));
    if (free) {
      EXPECT_EQ(result.free_parts.size(), 2u) << result.gauge;
      for (const FreePart& part : result.free_parts) EXPECT_EQ(part.defect, 7);
      EXPECT_EQ(std::ranges::count(result.state.oriented, std::uint8_t{1}), 60);
      for (const std::size_t first : {0, 30}) {  // each by itself is as good as its sigmas, at inner constraints, say
        double expected = 0;
        for (std::size_t f = first; f < first + 30; ++f)
          expected += result.frame_covariance[FrameIndex(static_cast<std::int64_t>(f))].diagonal().tail<3>().sum() / 30;
        EXPECT_LT(error_m(s, result, first, first + 30, false), 1.5 * std::sqrt(expected));
        EXPECT_LT(std::sqrt(expected), 3 * kGood);
      }
    } else {
      EXPECT_LT(error_m(s, result, 0, 30), kGood);
      EXPECT_LT(error_m(s, result, 30, 60), kGood);
    }
    std::filesystem::remove_all(folder_.path("job"));
  }
}

TEST_F(BlockInput, OneImage) {
  SimulationOptions options = aerial(20);
  options.gps_sigma_m = 0;
  SimulatedBlock s = simulate_block(options);
  keep_observations(s, [](std::size_t) { return false; });
  folder_.write(s, kTiles);
  EXPECT_THAT([&] { folder_.run(); }, testing::ThrowsMessage<Error>(HasSubstr("no two frames are held together")));
}

// Sigmas of zero, below, and none at all.
TEST_F(BlockInput, SigmasThatAreNone) {
  SimulationOptions options = aerial(12);
  options.control_points = 4;
  options.attitude_sigma_deg = 0.1;
  const SimulatedBlock good = simulate_block(options);
  for (const double wrong : {0.0, -0.1, kNaN}) {
    SimulatedBlock s = good;
    s.block.frames[FrameIndex(3)].position_prior->sigma.z() = wrong;
    EXPECT_THAT(refusal(s), HasSubstr("frame '" + s.block.frames[FrameIndex(3)].name + "': position prior"));
    s = good;
    s.block.frames[FrameIndex(4)].attitude_prior->sigma_rad.x() = wrong;
    EXPECT_THAT(refusal(s), HasSubstr("frame '" + s.block.frames[FrameIndex(4)].name + "': attitude prior"));
    s = good;
    s.block.control_points[1].sigma.y() = wrong;
    EXPECT_THAT(refusal(s),
                HasSubstr("control point '" + s.block.control_points[1].name + "': sigmas must be positive"));
    s = good;
    s.block.control_points[2].measurements[0].sigma_px = wrong;
    EXPECT_THAT(refusal(s), HasSubstr("control point '" + s.block.control_points[2].name +
                                      "': an image measurement is not finite"));
    s = good;
    s.block.relative_poses.push_back({FrameIndex(0), FrameIndex(1), Pose(), 1e-3, wrong});
    EXPECT_THAT(refusal(s), HasSubstr("relative pose of frames '"));
    if (wrong == 0) continue;  // held
    s = good;
    s.block.cameras.front().prior_sigma[0] = wrong;
    EXPECT_THAT(refusal(s), HasSubstr("a prior sigma is negative or not a number"));
  }
  for (const char* sigma : {"0", "-0.5", "nan"}) {
    folder_.write(good, std::string("adjustment: {image_sigma_px: ") + sigma + "}\n");
    try {
      folder_.run();
      ADD_FAILURE() << sigma << " was taken";
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr("image_sigma_px"));
      EXPECT_THAT(error.what(), HasSubstr("block.yaml:3"));
    }
  }
}

TEST_F(BlockInput, MountsWithHalfASigma) {
  SimulationOptions options = aerial(8);
  options.scene = SimulationOptions::Scene::kStreet;
  const SimulatedBlock good = simulate_block(options);
  for (const auto& [rotation, position] : {std::pair(0.01, 0.0), {0.01, -1.0}, {kNaN, 0.1}}) {
    SimulatedBlock s = good;
    s.block.rigs.front().mounts[1].rotation_sigma_rad = rotation;
    s.block.rigs.front().mounts[1].position_sigma_m = position;
    EXPECT_THAT(refusal(s), HasSubstr("the sigmas of a mount must be both positive, or both 0 to hold it"));
  }
}

// Coordinates are integers of 2^-10 px; a file with other numbers may hold NaN.
TEST_F(BlockInput, ObservationsThatAreNoNumbers) {
  const SimulatedBlock s = simulate_block(aerial(12));
  folder_.write(s);
  {
    std::vector<double> x(s.tracks.x.begin(), s.tracks.x.end());
    x[7] = kNaN;
    Hdf5Writer file(folder_.path("tie_points.h5"), "tracks");
    file.group("tracks", "");
    file.group("observations", "");
    std::vector<std::int64_t> ids(s.tracks.id.size(), 1), counts, images;
    ids[0] = 0;
    std::int64_t previous_first = 0;
    for (std::size_t t = 0; t < ids.size(); ++t) {
      counts.push_back(s.tracks.begin[t + 1] - s.tracks.begin[t]);
      std::int64_t previous = previous_first;
      previous_first = s.tracks.image[static_cast<std::size_t>(s.tracks.begin[t])].value;
      for (auto o = static_cast<std::size_t>(s.tracks.begin[t]); o < static_cast<std::size_t>(s.tracks.begin[t + 1]);
           ++o) {
        images.push_back(s.tracks.image[o].value - previous);
        previous = s.tracks.image[o].value;
      }
    }
    file.integers("tracks/id_difference", ids, {});
    file.integers("tracks/observations", counts, {});
    file.integers("observations/image_difference", images, {});
    file.vector("observations/x", x, {});
    file.vector("observations/y", s.tracks.y, {});
    file.vector("observations/feature", s.tracks.feature, {});
    file.close();
  }
  try {
    folder_.run();
    ADD_FAILURE() << "taken";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("tie_points.h5: observations/x: holds floating-point numbers where integers are expected"));
  }

  SimulationOptions options = aerial(12);
  options.control_points = 4;
  SimulatedBlock control = simulate_block(options);
  control.block.control_points[1].measurements[2].pixel.x() = kNaN;
  EXPECT_THAT(refusal(control), HasSubstr("control point '" + control.block.control_points[1].name +
                                          "': an image measurement is not finite"));
}

}  // namespace
}  // namespace megablock
