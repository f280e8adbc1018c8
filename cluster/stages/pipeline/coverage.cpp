#include "cluster/stages/pipeline/coverage.h"

#include <fmt/core.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "cluster/job/job_options.h"
#include "cluster/job/messages.h"
#include "cluster/job/work_queue.h"
#include "cluster/mpi/collective.h"
#include "cluster/process/process_memory.h"
#include "io/base/error.h"
#include "io/base/file_error.h"
#include "io/base/hash.h"
#include "io/store/units/block_file.h"
#include "io/store/units/tracks_file.h"
#include "io/text/csv_row.h"
#include "io/text/plausible.h"
#include "io/text/settings_reader.h"

namespace megablock {

namespace {

constexpr int kGrid = 4;  // cells of an image in each direction
constexpr const char *kTable = "result/coverage.csv", *kMinShare = "coverage.min_share";
constexpr const char* kHeader = "image,observations,covered_share,images_per_point";

using Coverages = IndexedVector<ImageIndex, ImageCoverage>;

int cell_of(std::int32_t position, std::int32_t size_px) {
  return std::clamp(static_cast<int>(kGrid * from_fixed_pixel(position) / size_px), 0, kGrid - 1);
}

// Of the image sizes, which cut the cells. Where all cameras have one size, images that are added change nothing.
std::uint64_t hash_sizes(const Block& block) {
  Hasher hasher;
  const auto size = [](const Camera& camera) { return std::pair(camera.width, camera.height); };
  const bool one_size = std::ranges::all_of(
      block.cameras, [&](const Camera& camera) { return size(camera) == size(block.cameras.front()); });
  for (const Camera& camera : block.cameras) {
    hasher.add(camera.width).add(camera.height);
    if (one_size) return hasher.value();
  }
  for (ImageIndex i(0); block.images.contains(i); ++i.value) hasher.add(block.camera_of(i).value);
  return hasher.value();
}

void write_unit(const std::string& path, const std::map<ImageIndex, ImageCoverage>& coverage) {
  std::ofstream out(path);
  for (const auto& [image, c] : coverage)
    out << image.value << ' ' << c.observations << ' ' << c.images_of_points << ' ' << c.cells << '\n';
  if (!out.flush()) throw InputError(path + ": cannot be written; check the disk");
}

// The sums over the tiles.
Coverages read_units(const Job& job, const std::vector<Unit>& units) {
  Coverages all(job.block.images.size(), ImageCoverage());
  for (const Unit& unit : units) {
    if (!job.store.up_to_date(unit.name, unit.fingerprint)) continue;  // failed, and recorded so
    std::ifstream in(job.store.verified_path(unit.name));
    std::int64_t image = 0;
    for (ImageCoverage c; in >> image >> c.observations >> c.images_of_points >> c.cells;)
      if (all.contains(ImageIndex(image))) all[ImageIndex(image)].add(c);
  }
  return all;
}

std::string table_of(const Coverages& coverage, const NameTable<ImageIndex>& names) {
  std::string csv = std::string(kHeader) + '\n';
  for (ImageIndex i(0); coverage.contains(i); ++i.value) {
    const ImageCoverage& c = coverage[i];
    const auto count = static_cast<double>(std::max<std::int64_t>(c.observations, 1));
    csv += fmt::format("{},{},{:.4f},{:.2f}\n", csv_field(names[i]), c.observations, c.covered_share(),
                       static_cast<double>(c.images_of_points) / count);
  }
  return csv;
}

// A table that says the same stays as it is.
void write_table(const JobStore& store, const std::string& csv) {
  if (std::filesystem::is_directory(store.path(kTable))) throw_file_error(store.path(kTable), "written", EISDIR);
  std::ifstream in(store.path(kTable));
  if (std::string(std::istreambuf_iterator<char>(in), {}) != csv) store.write_text(kTable, csv);
}

}  // namespace

const OptionSection kCoverageSection = {"coverage", nullptr,
                                        [](OptionVisitor& visitor, JobOptions& options) {
                                          visitor.number("min_share",
                                                         options.numbers.try_emplace(kMinShare, 0.25).first->second);
                                        },
                                        [](const JobOptions& options) {
                                          require_within(options.numbers.at(kMinShare), {0, 1}, "min_share");
                                        }};

double ImageCoverage::covered_share() const { return std::popcount(cells) / double{kGrid * kGrid}; }

void ImageCoverage::add(const ImageCoverage& other) {
  observations += other.observations;
  images_of_points += other.images_of_points;
  cells |= other.cells;
}

std::map<ImageIndex, ImageCoverage> coverage_of(const TrackSet& tracks, const Block& block) {
  std::map<ImageIndex, ImageCoverage> coverage;
  for (std::int64_t t = 0; t < tracks.track_count(); ++t)
    for (auto o = static_cast<std::size_t>(tracks.begin[t]); o < static_cast<std::size_t>(tracks.begin[t + 1]); ++o) {
      const Camera& camera = block.cameras[block.camera_of(tracks.image[o])];
      const int cell = kGrid * cell_of(tracks.y[o], camera.height) + cell_of(tracks.x[o], camera.width);
      coverage[tracks.image[o]].add({1, tracks.begin[t + 1] - tracks.begin[t], static_cast<std::uint16_t>(1 << cell)});
    }
  return coverage;
}

std::string coverage_note(const Coverages& coverage, const NameTable<ImageIndex>& names, double min_share) {
  constexpr int kNamed = 5;
  std::string named;
  std::int64_t poor = 0, seen = 0;
  for (ImageIndex i(0); coverage.contains(i); ++i.value) {
    if (coverage[i].observations == 0) continue;  // the orientation names it
    ++seen;
    if (coverage[i].covered_share() >= min_share || ++poor > kNamed) continue;
    named += (named.empty() ? "" : ", ") + std::string(names[i]);
  }
  if (poor == 0) return "";
  if (poor > kNamed) named += fmt::format(" and {} more", poor - kNamed);
  return fmt::format("{} of {} images {} tie points in less than {:.0f} % of their area: {}; all images are in {}",
                     poor, seen, poor == 1 ? "has" : "have", 100 * min_share, named, kTable);
}

// Row by row, because the table is as long as the block has images.
void check_coverage(const JobStore& store) {
  const std::string path = store.path(kTable), remedy = "; delete it and run the job again, which writes it anew";
  const std::vector<std::string> columns = csv_fields(kHeader);
  if (store.list(find_stage(kCoverageStage)->folder()).empty()) return;
  if (!std::filesystem::exists(path)) throw StoreError(path + ": is missing; run the job again, which writes it");
  std::ifstream file = open_input(path);
  std::string row;
  std::int64_t lines = 0;
  const NameTable<ImageIndex> names = read_image_names(store.verified_path("block.h5"));
  if (!read_csv_row(file, path, row, lines) || csv_fields(row) != columns)
    throw StoreError(path + ":1: the header is not '" + kHeader + "'" + remedy);
  ImageIndex image(0);
  for (std::int64_t line = 2; read_csv_row(file, path, row, lines); line = lines + 1, ++image.value) {
    const std::string where = path + ":" + std::to_string(line);
    const std::vector<std::string> fields = csv_fields(row);
    if (fields.size() != columns.size() || image.value >= std::ssize(names) || fields[0] != names[image])
      throw StoreError(where + ": is not the row of the block's image " + std::to_string(image.value) + remedy);
    for (std::size_t f = 1; f < fields.size(); ++f)
      if (!(parse_number(fields[f], columns[f], where) >= 0))
        throw StoreError(where + ": " + columns[f] + " must not be negative" + remedy);
  }
  if (image.value < std::ssize(names))
    throw StoreError(path + ": has rows of " + std::to_string(image.value) + " of " + std::to_string(names.size()) +
                     " images" + remedy);
}

void run_coverage(const Stage& stage, const Job& job, JobRecord& record, const std::vector<std::string>& tracks) {
  const std::uint64_t sizes = hash_sizes(job.block);
  std::vector<Unit> units;
  for (const std::string& track : tracks) {
    const UnitSeal seal = *job.store.seal(track);
    Unit unit;
    unit.name = stage.folder() + track.substr(track.find('/'), track.find('.') - track.find('/')) + ".txt";
    unit.fingerprint = Hasher().add(stage.algorithm).add(sizes).add(seal.content_hash).value();
    unit.cost = static_cast<double>(seal.length);
    unit.write = [&job, track](const std::string& path) {
      write_unit(path, coverage_of(read_tracks(job.store.verified_path(track)), job.block));
    };
    units.push_back(std::move(unit));
  }
  run_stage(job, record, stage, units);
  const std::string note = on_first_rank(job.ranks, [&] {
    const Coverages coverage = read_units(job, units);
    const NameTable<ImageIndex> names = read_image_names(job.store.verified_path("block.h5"));
    write_table(job.store, table_of(coverage, names));
    return coverage_note(coverage, names, job.settings.numbers.at(kMinShare));
  });
  return_freed_memory();
  if (!note.empty()) add_note(job, record, stage.name, note);
}

}  // namespace megablock
