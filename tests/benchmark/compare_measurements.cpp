// Measures the measurement store (CN-16) at the size of the published one: queries for the observations of an image, of
// a frame, of 16 neighbouring frames (16 000 rows), and near a place (as many), out of 4.6e8.
//
//   compare_measurements [--rows 460000000] [--folder F] [--queries 100] [--seed 1]
//
// The block is made up: streets that are driven twice, a frame of ten cameras every 4 m, 1 000 observations per frame,
// five per point, for 40 % of the points in both passes; tiles of 500 frames; random pixels in 1920 x 1080 and random
// feature rows below 2 000. The program's own functions write names, track files and their index; the benchmark writes
// the result in the same layout, because the program cannot hold a result of this size in memory. Files in --folder are
// kept and not made again. Every query opens a new store and verifies its files: "warm", and "cold" after the kernel
// was told to forget the files of the job. "open" is the same query to the same store once more.
#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <random>

#include "cluster/process/process_memory.h"
#include "io/base/descriptor.h"
#include "io/base/error.h"
#include "io/result/measurements.h"
#include "io/store/units/block_file.h"
#include "io/store/units/tracks_file.h"
#include "tests/support/io/scratch_directory.h"

namespace {

using namespace megablock;
namespace fs = std::filesystem;
using Random = std::mt19937_64;

constexpr std::int64_t kCameras = 10, kFramesPerPass = 250, kPointsPerFrame = 200, kFeatures = 2000;
constexpr std::int64_t kRowsPerTile = 2 * kFramesPerPass * kPointsPerFrame * 5;
constexpr std::int64_t kFeatureBits = 24;

struct Store {
  std::int64_t rows = 460'000'000;
  std::uint64_t seed = 1;
  fs::path folder;
  int queries = 100;
  std::int64_t tiles() const { return std::max<std::int64_t>(1, rows / kRowsPerTile); }
  std::int64_t frames_per_pass() const { return tiles() * kFramesPerPass; }
  std::int64_t frames() const { return 2 * frames_per_pass(); }
};

std::string unit_of(std::int64_t tile) {
  char name[32];
  std::snprintf(name, sizeof name, "tracks/%06lld.h5", static_cast<long long>(tile));
  return name;
}

// Streets of 1 000 frames, 100 m apart; both passes along them.
Eigen::Vector3d position_of(std::int64_t frame, const Store& store) {
  const std::int64_t along = frame % store.frames_per_pass();
  return {4.0 * static_cast<double>(along % 1000), 100.0 * static_cast<double>(along / 1000), 0};
}

struct Batch {
  TrackSet tracks;
  std::vector<Eigen::Vector3d> points;
};

// The points first seen in one pass of a tile, in the order of their tracks. Those of the first pass that are seen in
// both have three measurements in it and two in the second; all others five in successive frames.
Batch points_of(const Store& store, std::int64_t tile, std::int64_t pass) {
  Random random((store.seed * 1'000'003 + static_cast<std::uint64_t>(tile)) * 2 + static_cast<std::uint64_t>(pass));
  const auto below = [&](std::int64_t n) {
    return static_cast<std::int64_t>(random() % static_cast<std::uint64_t>(n));
  };
  const auto uniform = [&](double half) { return half * (static_cast<double>(random() >> 11) * 0x1p-52 - 1); };
  struct Start {
    std::int64_t image, feature;
    auto operator<=>(const Start&) const = default;
  };
  const std::int64_t offset = pass * store.frames_per_pass();
  std::vector<Start> starts;
  for (std::int64_t p = 0; p < kFramesPerPass * kPointsPerFrame; ++p)
    starts.push_back(
        {(offset + tile * kFramesPerPass + below(kFramesPerPass)) * kCameras + below(kCameras), below(kFeatures)});
  std::sort(starts.begin(), starts.end());
  starts.erase(std::unique(starts.begin(), starts.end()), starts.end());
  Batch batch;
  batch.tracks.begin = {0};
  for (const Start& start : starts) {
    const std::int64_t frame = start.image / kCameras;
    const bool twice = pass == 0 && below(5) < 2;
    for (std::int64_t o = 0; o < 5; ++o) {
      const std::int64_t later = twice && o >= 3 ? o - 3 + store.frames_per_pass() : o;
      const std::int64_t last = twice && o >= 3 ? store.frames() : offset + store.frames_per_pass();
      if (frame + later >= last) break;
      const std::int64_t camera = o == 0 ? start.image % kCameras : (start.image + below(3) - 1 + kCameras) % kCameras;
      batch.tracks.image.emplace_back((frame + later) * kCameras + camera);
      batch.tracks.x.push_back(static_cast<std::int32_t>(below(1920 * 1024)));
      batch.tracks.y.push_back(static_cast<std::int32_t>(below(1080 * 1024)));
      batch.tracks.feature.push_back(static_cast<std::int32_t>(o == 0 ? start.feature : below(kFeatures)));
    }
    batch.tracks.id.emplace_back((start.image << kFeatureBits) + start.feature);
    batch.tracks.begin.push_back(batch.tracks.observation_count());
    batch.points.push_back(position_of(frame, store) + Eigen::Vector3d(uniform(15), uniform(15), uniform(8)));
  }
  return batch;
}

void append(TrackSet& to, const TrackSet& from) {
  const auto join = [](auto& a, const auto& b) { a.insert(a.end(), b.begin(), b.end()); };
  const std::int64_t before = to.observation_count();
  for (std::size_t t = 1; t < from.begin.size(); ++t) to.begin.push_back(before + from.begin[t]);
  join(to.id, from.id);
  join(to.image, from.image);
  join(to.x, from.x);
  join(to.y, from.y);
  join(to.feature, from.feature);
}

void write_tiles_of_tracks(const Store& store, const JobStore& job) {
  for (std::int64_t t = 0; t < store.tiles(); ++t) {
    if (job.up_to_date(unit_of(t), static_cast<std::uint64_t>(t))) continue;  // a store that was begun
    TrackSet tracks;
    tracks.begin = {0};
    for (const std::int64_t pass : {0, 1}) append(tracks, points_of(store, t, pass).tracks);
    job.write(unit_of(t), static_cast<std::uint64_t>(t), [&](const std::string& path) { write_tracks(path, tracks); });
  }
}

// In the layout of result/block.h5, as far as questions by place read it.
void write_result_of(const Store& store, const std::string& path) {
  Hdf5Writer file(path, "result", Hdf5Storage::kDisk);
  file.group("points");
  file.group("observations");
  for (const char* name : {"points/id", "points/begin", "points/track"}) file.growing<std::int64_t>(name);
  file.growing<double>("points/position", {3});
  file.growing<float>("points/box", {6});
  file.growing<float>("points/district", {6});
  for (const char* name :
       {"points/tile", "observations/image", "observations/x", "observations/y", "observations/feature"})
    file.growing<std::int32_t>(name);
  file.growing<std::uint8_t>("observations/kept");
  for (const char* name : {"observations/residual_x", "observations/residual_y"}) file.growing<float>(name);
  file.append("points/begin", std::vector<std::int64_t>{0});
  std::int64_t points = 0, rows = 0;
  std::vector<Eigen::Vector3d> waiting;  // for a box
  std::vector<float> boxes;
  const auto bound = [&](std::ptrdiff_t whole) {
    const std::vector<float> more = boxes_of({waiting.begin(), waiting.begin() + whole});
    boxes.insert(boxes.end(), more.begin(), more.end());
    waiting.erase(waiting.begin(), waiting.begin() + whole);
  };
  Random random(store.seed);
  for (const std::int64_t pass : {0, 1})
    for (std::int64_t t = 0; t < store.tiles(); ++t) {
      const Batch batch = points_of(store, t, pass);
      std::vector<std::int64_t> id, begin, track;
      std::vector<double> position;
      for (std::size_t p = 0; p < batch.points.size(); ++p) {
        id.push_back(points++);
        begin.push_back(rows + batch.tracks.begin[p + 1]);
        track.push_back(batch.tracks.id[p].value);
        position.insert(position.end(), batch.points[p].data(), batch.points[p].data() + 3);
      }
      rows = begin.back();
      file.append("points/id", id);
      file.append("points/begin", begin);
      file.append("points/track", track);
      file.append("points/position", position);
      file.append("points/tile", std::vector<std::int32_t>(id.size(), static_cast<std::int32_t>(t)));
      waiting.insert(waiting.end(), batch.points.begin(), batch.points.end());
      bound(std::ssize(waiting) / kPointRun * kPointRun);
      std::vector<std::int32_t> image;
      std::vector<std::uint8_t> kept;
      std::vector<float> residual;
      for (const ImageIndex i : batch.tracks.image) {
        image.push_back(static_cast<std::int32_t>(i.value));
        kept.push_back(random() % 50 != 0);
        residual.push_back(static_cast<float>(static_cast<double>(random() % 2001) * 1e-3 - 1 + 1e-7));
      }
      file.append("observations/image", image);
      file.append("observations/x", batch.tracks.x);
      file.append("observations/y", batch.tracks.y);
      file.append("observations/feature", batch.tracks.feature);
      file.append("observations/kept", kept);
      file.append("observations/residual_x", residual);
      std::reverse(residual.begin(), residual.end());
      file.append("observations/residual_y", residual);
    }
  bound(std::ssize(waiting));
  file.append("points/box", boxes);
  file.append("points/district", districts_of(boxes));
  file.close();
}

double seconds_of(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// For the command: 'megablock measurements JOB --frame f000123'.
void write_names(const Store& store, const JobStore& job) {
  if (job.up_to_date("block.h5", 1)) return;
  Block block;
  block.rigs.emplace_back();
  for (std::int64_t f = 0; f < store.frames(); ++f) {
    char name[32];
    std::snprintf(name, sizeof name, "f%06lld", static_cast<long long>(f));
    block.frames.emplace_back();
    block.frames.back().name = name;
    block.frames.back().rig = RigIndex(0);
    for (int c = 0; c < kCameras; ++c)
      block.add_image(std::string(name) + "/" + std::to_string(c), {FrameIndex(f), c, 0});
  }
  for (int c = 0; c < kCameras; ++c) {
    block.cameras.emplace_back();
    block.cameras.back().name = std::to_string(c);
    block.cameras.back().intrinsics = {1000, 960, 540, 0, 0, 0, 0, 0};
    block.rigs[RigIndex(0)].mounts.push_back({CameraIndex(c), {}});
  }
  job.write("block.h5", 1, [&](const std::string& path) { write_block(path, block); });
}

// Two processes, as HDF5 takes one thread at a time.
void make(const Store& store, const JobStore& job) {
  job.create();
  const pid_t child = fork();
  if (child < 0) throw ComputeError("no second process");
  if (child == 0) {
    int code = 0;
    try {
      if (!job.up_to_date("result/block.h5", 1))
        job.write("result/block.h5", 1, [&](const std::string& path) { write_result_of(store, path); });
    } catch (const std::exception& error) {
      std::fprintf(stderr, "compare_measurements: %s\n", error.what());
      code = 1;
    }
    _exit(code);
  }
  write_names(store, job);
  write_tiles_of_tracks(store, job);
  std::vector<std::string> names;
  for (std::int64_t t = 0; t < store.tiles(); ++t) names.push_back(unit_of(t));
  job.write("tracks/index.txt", 1, [&](const std::string& path) {
    std::ofstream list(path);
    for (const std::string& name : names) list << name << '\n';
  });
  const double seconds = seconds_of([&] { update_measurement_index(job, names); });
  std::printf("index by image of %lld tiles made in %.1f s, peak %.0f MiB\n", static_cast<long long>(store.tiles()),
              seconds, peak_rss_mib());
  int status = 0;
  waitpid(child, &status, 0);
  if (status != 0) throw ComputeError("the result could not be written");
  job.write_text("job.json", "{}");  // last: the store is whole
}

void forget_files(const JobStore& job) {
  for (const std::string& name : job.list("")) {
    const Descriptor file(job.path(name), O_RDONLY);
    posix_fadvise(file.id(), 0, 0, POSIX_FADV_DONTNEED);
  }
}

struct Question {
  const char* name;
  std::function<Measurements(const MeasurementStore&, Random&)> ask;
};

std::vector<Question> questions(const Store& store) {
  const auto frames = [&store](std::int64_t count) {
    return [&store, count](const MeasurementStore& opened, Random& random) {
      const auto first = static_cast<std::int64_t>(random() % static_cast<std::uint64_t>(store.frames() - count + 1));
      std::vector<ImageIndex> images;
      for (std::int64_t i = first * kCameras; i < (first + count) * kCameras; ++i) images.emplace_back(i);
      return opened.of_images(images);
    };
  };
  return {{"one image",
           [&store](const MeasurementStore& opened, Random& random) {
             const auto images = static_cast<std::uint64_t>(store.frames() * kCameras);
             return opened.of_images({ImageIndex(static_cast<std::int64_t>(random() % images))});
           }},
          {"one frame", frames(1)},
          {"16 frames", frames(16)},
          {"a place", [&store](const MeasurementStore& opened, Random& random) {
             const auto frame = static_cast<std::int64_t>(random() % static_cast<std::uint64_t>(store.frames()));
             return opened.near({position_of(frame, store), 20});
           }}};
}

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + std::ssize(values) / 2, values.end());
  return values[values.size() / 2];
}

// Every question is first put to a store whose files the kernel has forgotten, then again.
void measure(const Store& store, const JobStore& job) {
  std::printf("%-10s %8s %12s %12s %12s %12s %12s\n", "", "rows", "cold, ms", "warm, ms", "90 %, ms", "processor",
              "open, ms");
  for (const Question& question : questions(store)) {
    std::vector<double> rows, cold, warm, processor, open;
    for (int q = 0; q < store.queries; ++q) {
      const Random random(store.seed * 1000 + static_cast<std::uint64_t>(q));
      const auto ask = [&](const MeasurementStore& opened) {
        Random own = random;
        return question.ask(opened, own).size();
      };
      forget_files(job);
      cold.push_back(1e3 * seconds_of([&] { ask(MeasurementStore(job.directory())); }));
      const MeasurementStore opened(job.directory());
      const std::clock_t begun = std::clock();
      warm.push_back(1e3 * seconds_of([&] { rows.push_back(static_cast<double>(ask(opened))); }));
      processor.push_back(1e3 * static_cast<double>(std::clock() - begun) / CLOCKS_PER_SEC);
      open.push_back(1e3 * seconds_of([&] { ask(opened); }));
    }
    std::sort(warm.begin(), warm.end());
    std::printf("%-10s %8.0f %12.2f %12.2f %12.2f %12.2f %12.2f\n", question.name, median(rows), median(cold),
                median(warm), warm[warm.size() * 9 / 10], median(processor), median(open));
    std::fflush(stdout);
  }
}

void print_bytes(const Store& store, const JobStore& job) {
  double tracks = 0, rows = 0;
  for (std::int64_t t = 0; t < store.tiles(); ++t) {
    tracks += static_cast<double>(fs::file_size(job.path(unit_of(t))));
    if (t % 97 == 0) rows += static_cast<double>(read_tracks(job.path(unit_of(t))).observation_count());
  }
  const double total = rows / static_cast<double>((store.tiles() + 96) / 97) * static_cast<double>(store.tiles());
  const auto index = static_cast<double>(fs::file_size(job.path("measurements.h5")));
  std::printf("%.3g rows of %lld images in %lld tiles: %.2f bytes per row, of which index %.3f; result %.2f\n", total,
              static_cast<long long>(store.frames() * kCameras), static_cast<long long>(store.tiles()),
              (tracks + index) / total, index / total,
              static_cast<double>(fs::file_size(job.path("result/block.h5"))) / total);
}

}  // namespace

int main(int argc, char** argv) {
  Store store;
  CLI::App app("Questions to a measurement store of any size");
  app.add_option("--rows", store.rows, "Measurements, about")->check(CLI::Range(1'000'000LL, 10'000'000'000LL));
  app.add_option("--folder", store.folder, "Where the store goes and stays; by default nothing stays");
  app.add_option("--queries", store.queries, "Of each kind")->check(CLI::Range(1, 100'000));
  app.add_option("--seed", store.seed, "Of the block and of the questions");
  CLI11_PARSE(app, argc, argv);
  try {
    const ScratchDirectory scratch;
    if (store.folder.empty()) store.folder = scratch.path();
    const JobStore job((store.folder / "job").string());
    if (!fs::exists(job.path("job.json"))) std::printf("made in %.0f s\n", seconds_of([&] { make(store, job); }));
    print_bytes(store, job);
    measure(store, job);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "compare_measurements: %s\n", error.what());
    return 1;
  }
  return 0;
}
