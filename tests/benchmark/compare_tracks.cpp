// Measures how tracks are built from more matches than the memory can hold (CN-13): time, memory, and agreement with
// the truth. The result must not depend on the cells in which pairs were matched.
//
//   compare_tracks [matches = 20000000] [cells = 1] [scratch = /tmp/megablock-compare-tracks]
//
// The images have 400 features and form a sequence. Five successive images see a point, so every image matches its four
// predecessors; three per cent of the matches are wrong. The matches are made pair by pair and are never in memory
// together; pair i belongs to cell i % cells. Prints the numbers of matches and tracks, a hash of all tracks, the share
// of true neighbours (features of the same point in successive images) that are in one track, processor time and peak
// memory.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <random>

#include "cluster/process/process_memory.h"
#include "io/base/hash.h"
#include "match/tracks/match_order.h"
#include "match/tracks/tracks.h"

namespace {

using namespace megablock;

constexpr int kLength = 5, kPoints = 400;  // images of a point; points of an image

double processor_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

// Of the points of an image, those of slot s change every kLength images, each slot in an image of its own.
std::int64_t point_of(std::int64_t image, int slot) { return (image + slot % kLength) / kLength * kPoints + slot; }

// Rows are spread over the features, 2 000 of an image, of which every fifth is matched.
std::int32_t row_of(std::int64_t image, int slot) {
  return static_cast<std::int32_t>((slot + image * 37) % kPoints * 5 + image % 5);
}
int slot_of(std::int64_t image, std::int32_t row) {
  return static_cast<int>(((row - image % 5) / 5 + kPoints - image * 37 % kPoints) % kPoints);
}

VerifiedPair make_pair(std::int64_t a, std::int64_t b) {
  VerifiedPair pair;
  pair.a = ImageIndex(a);
  pair.b = ImageIndex(b);
  pair.model = PairModel::kEssential;
  std::minstd_rand generator(static_cast<std::uint32_t>(1 + a * 8 + (b - a)));
  std::vector<std::pair<std::int32_t, std::int32_t>> rows;
  for (int slot = 0; slot < kPoints; ++slot) {
    if (point_of(a, slot) != point_of(b, slot)) continue;
    const bool wrong = generator() % 100 < 3;
    rows.emplace_back(row_of(a, slot), row_of(b, wrong ? static_cast<int>(generator() % kPoints) : slot));
  }
  std::sort(rows.begin(), rows.end());
  for (const auto& [i, j] : rows) {
    pair.feature_a.push_back(i);
    pair.feature_b.push_back(j);
  }
  return pair;
}

}  // namespace

int main(int argc, char** argv) {
  const std::int64_t wanted = argc > 1 ? std::atoll(argv[1]) : 20'000'000;
  const std::int64_t cells = argc > 2 ? std::atoll(argv[2]) : 1;
  MatchMemory memory;
  memory.scratch_file = argc > 3 ? argv[3] : "/tmp/megablock-compare-tracks";
  constexpr std::int64_t kMatchesPerImage = kPoints * (kLength - 1) / 2;  // 4/5 + 3/5 + 2/5 + 1/5 of its points
  const std::int64_t images = wanted / kMatchesPerImage;

  const double begun = processor_seconds();
  TrackBuilder builder(static_cast<std::size_t>(images), memory);
  std::int64_t matches = 0;
  for (std::int64_t cell = 0; cell < cells; ++cell)
    for (std::int64_t pair = cell; pair < images * (kLength - 1); pair += cells) {
      const std::int64_t a = pair / (kLength - 1), b = a + 1 + pair % (kLength - 1);
      if (b >= images) continue;
      const VerifiedPair made = make_pair(a, b);
      matches += static_cast<std::int64_t>(made.feature_a.size());
      builder.add(made);
    }
  const double added = processor_seconds();
  builder.build();
  const double built = processor_seconds();

  Hasher hasher;
  std::int64_t tracks = 0, observations = 0, joined = 0;
  builder.visit(2, [&](const Track& track) {
    hasher.add(track.images).add(track.features);
    ++tracks;
    observations += static_cast<std::int64_t>(track.images.size());
    for (std::size_t i = 1; i < track.images.size(); ++i) {
      const std::int64_t a = track.images[i - 1].value, b = track.images[i].value;
      joined += point_of(a, slot_of(a, track.features[i - 1])) == point_of(b, slot_of(b, track.features[i]));
    }
  });
  std::printf(
      "%lld matches in %lld cells: %lld tracks, %lld observations, hash %016llx; %.2f %% of the true neighbours "
      "joined, "
      "%.2f %% of the joined wrong; %.1f s to make and sort them, %.1f s to unite, %.1f s to read the tracks "
      "(processor); peak %.0f MiB\n",
      static_cast<long long>(matches), static_cast<long long>(cells), static_cast<long long>(tracks),
      static_cast<long long>(observations), static_cast<unsigned long long>(hasher.value()),
      100.0 * static_cast<double>(joined) / (static_cast<double>(images) * kPoints * (kLength - 1) / kLength),
      100.0 * (1 - static_cast<double>(joined) / static_cast<double>(observations - tracks)), added - begun,
      built - added, processor_seconds() - built, peak_rss_mib());
}
