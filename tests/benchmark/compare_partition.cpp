// Measures the partition of a large image graph into tiles and a merge tree.
//
//   compare_partition [--scene aerial|street] [--frames 1000000] [--tile-max-frames 500]
//
// aerial: a square block with overlaps of 80 % along and 60 % across the rows; a link has 300 tracks times the common
// share of the areas of two images. street: a grid of streets 100 m apart, driven twice, with a frame every 4 m; frames
// up to 20 m apart are linked, also those of the other drive and of crossing streets. Prints time, peak memory, tiles
// and their balance, and the shares of frames with links to another tile and of frames in separators.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>

#include "cluster/process/process_memory.h"
#include "io/block/registration.h"
#include "partition/tiles/tiles.h"

namespace {

using namespace megablock;

FrameGraph aerial_graph(std::int64_t frames) {
  const auto columns = static_cast<std::int64_t>(std::sqrt(static_cast<double>(frames)));
  const std::int64_t rows = frames / columns;
  FrameGraph graph;
  graph.frame_count = rows * columns;
  const auto number = [&](std::int64_t row, std::int64_t column) { return FrameIndex(row * columns + column); };
  for (std::int64_t row = 0; row < rows; ++row)
    for (std::int64_t column = 0; column < columns; ++column)
      for (std::int64_t down = 0; down <= 2 && row + down < rows; ++down)
        for (std::int64_t along = down == 0 ? 1 : -4; along <= 4; ++along) {
          if (column + along < 0 || column + along >= columns) continue;
          const double shared =
              (1 - 0.2 * std::abs(static_cast<double>(along))) * (1 - 0.4 * static_cast<double>(down));
          const auto weight = static_cast<std::int64_t>(300 * shared);
          if (weight > 0) graph.edges.push_back({number(row, column), number(row + down, column + along), weight});
        }
  std::sort(graph.edges.begin(), graph.edges.end());
  return graph;
}

// Every street is driven twice along its whole length; frames by their place in a raster of 20 m.
FrameGraph street_graph(std::int64_t frames) {
  constexpr double kSpacing = 100, kStep = 4, kReach = 20;
  const double side = kSpacing * std::round(std::sqrt(static_cast<double>(frames) * kStep / 4 / kSpacing));
  const auto streets = static_cast<std::int64_t>(side / kSpacing);
  struct Place {
    double x, y;
  };
  std::vector<Place> places;
  for (int direction = 0; direction < 2; ++direction)
    for (std::int64_t street = 0; street < streets; ++street)
      for (int drive = 0; drive < 2; ++drive)
        for (double s = 0; s < side && static_cast<std::int64_t>(places.size()) < frames; s += kStep) {
          const double across = static_cast<double>(street) * kSpacing + 3 * drive;
          places.push_back(direction == 0 ? Place{s, across} : Place{across, s});
        }
  const auto cells = static_cast<std::int64_t>(side / kReach) + 2;
  std::vector<std::vector<std::int32_t>> raster(static_cast<std::size_t>(cells * cells));
  const auto cell = [&](double v) { return static_cast<std::int64_t>(v / kReach); };
  for (std::size_t i = 0; i < places.size(); ++i)
    raster[static_cast<std::size_t>(cell(places[i].y) * cells + cell(places[i].x))].push_back(
        static_cast<std::int32_t>(i));
  FrameGraph graph;
  graph.frame_count = static_cast<std::int64_t>(places.size());
  for (std::size_t i = 0; i < places.size(); ++i)
    for (std::int64_t row = std::max<std::int64_t>(0, cell(places[i].y) - 1);
         row <= std::min(cells - 1, cell(places[i].y) + 1); ++row)
      for (std::int64_t column = std::max<std::int64_t>(0, cell(places[i].x) - 1);
           column <= std::min(cells - 1, cell(places[i].x) + 1); ++column)
        for (const std::int32_t j : raster[static_cast<std::size_t>(row * cells + column)]) {
          const Place& other = places[static_cast<std::size_t>(j)];
          const double distance = std::hypot(places[i].x - other.x, places[i].y - other.y);
          if (static_cast<std::size_t>(j) > i && distance < kReach)
            graph.edges.push_back({FrameIndex(static_cast<std::int64_t>(i)), FrameIndex(j),
                                   static_cast<std::int64_t>(20 + 300 * (1 - distance / kReach))});
        }
  std::sort(graph.edges.begin(), graph.edges.end());
  return graph;
}

double processor_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

void measure(const FrameGraph& graph, const TileOptions& options) {
  const double held = peak_rss_mib(), begun = processor_seconds();
  const Tiles tiles = make_tiles(graph, options);
  const double seconds = processor_seconds() - begun;

  std::vector<std::int64_t> size(static_cast<std::size_t>(tiles.tile_count));
  for (const TileIndex tile : tiles.tile_of_frame) ++size[static_cast<std::size_t>(tile.value)];
  std::vector<std::uint8_t> boundary(static_cast<std::size_t>(graph.frame_count));
  for (const FrameEdge& edge : graph.edges)
    if (tiles.tile_of_frame[edge.a] != tiles.tile_of_frame[edge.b])
      boundary[static_cast<std::size_t>(edge.a.value)] = boundary[static_cast<std::size_t>(edge.b.value)] = 1;
  const auto separating = std::count_if(tiles.separator_depth.begin(), tiles.separator_depth.end(),
                                        [](std::int32_t depth) { return depth >= 0; });
  const double mean = static_cast<double>(graph.frame_count) / static_cast<double>(tiles.tile_count);
  std::printf(
      "%lld frames, %zu links: %lld tiles of %lld to %lld frames (%.0f in the mean, the largest %.1f %% above); %.1f "
      "%% of the frames have links to another tile, %.1f %% separate halves of the tree, %lld those of the root; %.1f "
      "s of processor time, %.0f MiB, of which the links %.0f\n",
      static_cast<long long>(graph.frame_count), graph.edges.size(), static_cast<long long>(tiles.tile_count),
      static_cast<long long>(*std::min_element(size.begin(), size.end())),
      static_cast<long long>(*std::max_element(size.begin(), size.end())), mean,
      100 * (static_cast<double>(*std::max_element(size.begin(), size.end())) / mean - 1),
      100.0 * static_cast<double>(std::count(boundary.begin(), boundary.end(), 1)) /
          static_cast<double>(graph.frame_count),
      100.0 * static_cast<double>(separating) / static_cast<double>(graph.frame_count),
      static_cast<long long>(std::count(tiles.separator_depth.begin(), tiles.separator_depth.end(), 0)), seconds,
      peak_rss_mib(), held);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Tiles and merge tree of a large image graph");
  std::string scene = "aerial";
  std::int64_t frames = 1'000'000;
  TileOptions options;
  app.add_option("--scene", scene)->check(CLI::IsMember({"aerial", "street"}));
  app.add_option("--frames", frames)->check(CLI::PositiveNumber);
  app.add_option("--tile-max-frames", options.tile_max_frames)->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  measure(scene == "aerial" ? aerial_graph(frames) : street_graph(frames), options);
}
