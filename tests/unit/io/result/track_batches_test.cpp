// A result whose tracks come in batches gives the same file, figures and page as a result in memory.
#include "io/result/track_batches.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <utility>

#include "io/evaluation/remarks/remarks.h"
#include "io/report/report.h"
#include "tests/support/io/made_up_result.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

// Tracks in memory, so many at a time.
class SlicedTracks final : public TrackBatches {
 public:
  SlicedTracks(const TrackResults& tracks, std::size_t size) : tracks_(tracks), size_(size) {}
  std::int64_t track_count() const override { return tracks_.tracks.track_count(); }
  void visit(const Visit& visit) const override {
    for (std::size_t first = 0; first < tracks_.tracks.id.size(); first += size_) {
      TrackResults batch;
      batch.append(tracks_, first, std::min(first + size_, tracks_.tracks.id.size()));
      visit(batch);
    }
  }

 private:
  const TrackResults& tracks_;
  std::size_t size_;
};

std::string contents(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

class TrackBatchesTest : public testing::Test {
 protected:
  TrackBatchesTest() : result_(made_up_result(small_block())) {
    for (const TrackIndex id : result_.tracks.id) {
      result_.file_tracks.emplace_back(7 * id.value);
      result_.file_tiles.emplace_back(id.value % 3);
    }
    result_.digest = result_digest(result_);
    without_ = result_;
    static_cast<TrackResults&>(without_) = {};
    without_.digest.clear();
  }

  const ScratchDirectory scratch_;
  BlockResult result_, without_;
};

TEST_F(TrackBatchesTest, GiveTheSameFile) {
  write_result(scratch_.path("whole.h5"), result_);
  for (const std::size_t size : {std::size_t{1}, std::size_t{13}, result_.points.size()}) {
    BlockResult streamed = without_;
    write_result(scratch_.path("streamed.h5"), streamed, SlicedTracks(result_, size));
    EXPECT_EQ(streamed.digest, result_.digest);
    EXPECT_TRUE(contents(scratch_.path("streamed.h5")) == contents(scratch_.path("whole.h5")));
  }
}

// Tables that lie in a file can leave memory one by one, and the report's with them.
TEST_F(TrackBatchesTest, SayWhenATableHasBeenReadAndGiveTheSame) {
  std::int64_t tables = 0, readings = 0;
  write_result(scratch_.path("whole.h5"), result_);
  BlockResult streamed = without_;
  write_result(scratch_.path("streamed.h5"), streamed, SlicedTracks(result_, 13), [&] { ++tables; });
  EXPECT_TRUE(contents(scratch_.path("streamed.h5")) == contents(scratch_.path("whole.h5")));
  EXPECT_GT(tables, 50);  // datasets

  without_.digest = result_.digest;
  const auto read = [&] { ++readings; };
  Report report(without_, SlicedTracks(result_, 29), read);
  EXPECT_GT(std::exchange(readings, 0), 3);  // passes
  EXPECT_EQ(std::move(report).html(without_, {"job", 0, nullptr, read}), report_html(result_, {"job", 0}));
  EXPECT_GT(readings, 18);  // sections, and more than one in some
}

TEST_F(TrackBatchesTest, ClearedTracksTakeOthers) {
  TrackResults batch;
  batch.append(result_, 3, 40);
  batch.clear();
  EXPECT_EQ(batch.tracks.track_count(), 0);
  batch.append(result_, 40, 50);
  TrackResults fresh;
  fresh.append(result_, 40, 50);
  EXPECT_EQ(batch.tracks.begin, fresh.tracks.begin);
  EXPECT_EQ(batch.tracks.image, fresh.tracks.image);
  EXPECT_EQ(batch.points, fresh.points);
  EXPECT_EQ(batch.kept, fresh.kept);
  EXPECT_EQ(batch.redundancy_y, fresh.redundancy_y);
  EXPECT_EQ(batch.file_tiles, fresh.file_tiles);
}

TEST_F(TrackBatchesTest, AreReadBackFromTheFile) {
  write_result(scratch_.path("result.h5"), result_);
  const StoredTracks stored(scratch_.path("result.h5"));
  ASSERT_EQ(stored.track_count(), result_.tracks.track_count());
  TrackResults all;
  stored.visit([&](const TrackResults& batch) { all.append(batch, 0, batch.tracks.id.size()); });
  const BlockResult whole = read_result(scratch_.path("result.h5"));
  EXPECT_EQ(all.tracks.id, result_.tracks.id);
  EXPECT_EQ(all.tracks.begin, result_.tracks.begin);
  EXPECT_EQ(all.tracks.x, whole.tracks.x);
  EXPECT_EQ(all.kept, result_.kept);
  EXPECT_EQ(all.file_tracks, result_.file_tracks);
  EXPECT_EQ(all.file_tiles, result_.file_tiles);
  const BlockResult rest = read_result_without_tracks(scratch_.path("result.h5"));
  EXPECT_TRUE(rest.points.empty());
  EXPECT_EQ(rest.digest, whole.digest);
  EXPECT_EQ(rest.state.oriented, whole.state.oriented);
}

TEST_F(TrackBatchesTest, GiveTheSameFigures) {
  const SlicedTracks sliced(result_, 17);
  const ReprojectionStatistics whole = reprojection_statistics(result_);
  const ReprojectionStatistics streamed = reprojection_statistics(without_, sliced);
  EXPECT_GT(whole.observations, 0);
  EXPECT_EQ(streamed.observations, whole.observations);
  EXPECT_EQ(streamed.points, whole.points);
  EXPECT_EQ(streamed.rms_px, whole.rms_px);
  EXPECT_EQ(streamed.mean_px, whole.mean_px);
  EXPECT_EQ(remarks(without_, sliced), remarks(result_));
}

TEST_F(TrackBatchesTest, GiveTheSamePage) {
  without_.digest = result_.digest;
  EXPECT_EQ(report_html(without_, SlicedTracks(result_, 29), {"job", 0}), report_html(result_, {"job", 0}));
}

TEST_F(TrackBatchesTest, SamplesAreSpreadEvenly) {
  const TrackResults sample = sample_of(SlicedTracks(result_, 10), 40);
  ASSERT_LE(sample.tracks.track_count(), 40);
  ASSERT_GE(sample.tracks.track_count(), 20);
  const std::int64_t step = sample.tracks.id[1].value - sample.tracks.id[0].value;
  for (std::size_t t = 0; t < sample.tracks.id.size(); ++t) {
    const auto from = static_cast<std::size_t>(step) * t;
    EXPECT_EQ(sample.tracks.id[t], result_.tracks.id[from]);
    EXPECT_EQ(sample.points[t], result_.points[from]);
    EXPECT_EQ(sample.tracks.begin[t + 1] - sample.tracks.begin[t],
              result_.tracks.begin[from + 1] - result_.tracks.begin[from]);
  }
  EXPECT_EQ(sample_of(WholeTracks(TrackResults()), 10).tracks.track_count(), 0);
}

}  // namespace
}  // namespace megablock
