// Tracks of many matches (CN-13): time and memory, and that the cells in which pairs were matched do not matter.
//
//   compare_tracks [images = 5000] [features = 2000]
//
// Points are seen by five successive images, all pairs of which match; three matches in a hundred are wrong.
#include <cstdio>
#include <cstdlib>
#include <ctime>

#include "cluster/process_memory.h"
#include "io/hash.h"
#include "match/tracks.h"

namespace {

using namespace megablock;

constexpr int kLength = 5;

double processor_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

// The pairs of one cut after the other, as cells are read: pair i lies in cell i % cells.
std::vector<VerifiedPair> pairs_of(int images, int features, int cells) {
  std::vector<std::pair<int, int>> all;
  for (int a = 0; a < images; ++a)
    for (int b = a + 1; b < images && b / kLength == a / kLength; ++b) all.emplace_back(a, b);
  std::vector<VerifiedPair> pairs;
  for (int cell = cells - 1; cell >= 0; --cell)
    for (std::size_t i = static_cast<std::size_t>(cell); i < all.size(); i += static_cast<std::size_t>(cells)) {
      VerifiedPair pair;
      pair.a = ImageIndex(all[i].first);
      pair.b = ImageIndex(all[i].second);
      pair.model = PairModel::kEssential;
      for (int f = 0; f < features; ++f) {
        const bool wrong = (f * 7 + all[i].first * 31 + all[i].second * 17) % 100 < 3;
        pair.feature_a.push_back(f);
        pair.feature_b.push_back(wrong ? (f + 1) % features : f);
      }
      pairs.push_back(std::move(pair));
    }
  return pairs;
}

std::uint64_t hash_of(const TrackSet& tracks) {
  Hasher hasher;
  hasher.add(tracks.id).add(tracks.begin).add(tracks.image).add(tracks.x).add(tracks.y).add(tracks.feature);
  return hasher.value();
}

}  // namespace

int main(int argc, char** argv) {
  const int images = argc > 1 ? std::atoi(argv[1]) : 5000, features = argc > 2 ? std::atoi(argv[2]) : 2000;
  IndexedVector<ImageIndex, std::vector<Keypoint>> keypoints(static_cast<std::size_t>(images));
  for (auto& own : keypoints)
    for (int f = 0; f < features; ++f) own.push_back({f % 64 << 14, f / 64 << 14, 4, 0});
  for (const int cells : {1, 7, 64}) {
    const std::vector<VerifiedPair> pairs = pairs_of(images, features, cells);
    const double held = peak_rss_mib(), begun = processor_seconds();
    const TrackSet tracks = build_tracks(keypoints, pairs, {});
    std::printf(
        "%d cells: %lld matches of %zu pairs, %lld tracks, %lld observations, hash %016llx; %.1f s of processor "
        "time, %.0f MiB, of which matches and keypoints %.0f\n",
        cells, static_cast<long long>(pairs.size()) * features, pairs.size(),
        static_cast<long long>(tracks.track_count()), static_cast<long long>(tracks.observation_count()),
        static_cast<unsigned long long>(hash_of(tracks)), processor_seconds() - begun, peak_rss_mib(), held);
    std::fflush(stdout);
    reset_peak_rss();
  }
}
