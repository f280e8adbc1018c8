// Writes the table of images, which the reader can sort.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "geometry/numbers/angles.h"
#include "io/report/drawing/html.h"
#include "io/report/sections/sections.h"

namespace megablock::report {

namespace {

constexpr std::size_t kListedImages = 1500;  // largest number of listed images
constexpr std::size_t kOpen = 40;            // a longer table is folded

// The optional columns that have values in this block.
struct ImageColumns {
  bool camera, tile, part, records, sigmas;
  LengthUnit sigma_unit, place_unit;
};

ImageColumns columns_of(const BlockResult& result, const Figures& f) {
  double most = 0;
  for (const Spread* s : {&f.sigma_east, &f.sigma_north, &f.sigma_up})
    if (std::isfinite(s->p95)) most = std::max(most, s->p95);
  return {result.block.cameras.size() > 1,
          result.tiles.tile_count > 1,
          f.parts.size() > 1,
          !result.image_records.empty(),
          std::isfinite(f.sigma_east.median),
          length_unit(most, ground_unit(f)),
          std::string(ground_unit(f)) == "m" ? LengthUnit{1, "m", 3} : length_unit(0, ground_unit(f))};
}

Table empty_table(const ImageColumns& columns) {
  std::vector<std::string> headings = {"image"};
  if (columns.camera) headings.push_back("camera");
  const std::size_t texts = headings.size();
  if (columns.tile) headings.push_back("tile");
  if (columns.part) headings.push_back("part");
  if (columns.records) headings.insert(headings.end(), {"features", "matched with"});
  headings.insert(headings.end(), {"observations", "rejected", "rms [px]"});
  for (const char* axis : {"E", "N", "U"}) headings.push_back(in_unit(axis, columns.place_unit));
  headings.insert(headings.end(), {"ω [°]", "φ [°]", "κ [°]"});
  if (columns.sigmas) {
    for (const char* axis : {"σE", "σN", "σU"}) headings.push_back(in_unit(axis, columns.sigma_unit));
    headings.push_back("σ rotation [°]");
  }
  return Table(std::move(headings), texts);
}

void add_pose(const BlockResult& result, ImageIndex image, const LengthUnit& unit, std::vector<std::string>& cells) {
  const Pose pose = image_pose(result, image);
  axes_cells(pose.centre, unit, false, cells);
  const OmegaPhiKappa angles = omega_phi_kappa(pose.rotation);
  for (const double a : {angles.omega, angles.phi, angles.kappa}) cells.push_back(fixed(a * kDegreesPerRadian, 4));
}

void add_sigmas(const BlockResult& result, FrameIndex frame, const LengthUnit& unit, std::vector<std::string>& cells) {
  const auto variance = result.frame_covariance[frame].diagonal().cwiseMax(0).eval();
  sigma_cells(variance.tail<3>().cwiseSqrt(), unit, cells);
  // The largest of the three axes, as in the section on accuracy.
  cells.push_back(sigma_text(std::sqrt(variance.head<3>().maxCoeff()) * kDegreesPerRadian));
}

void add_image(const BlockResult& result, const Figures& f, const ImageColumns& columns, ImageIndex image,
               Table& table) {
  const Image& i = result.block.images[image];
  std::vector<std::string> cells = {escape(result.block.name_of(image))};
  if (columns.camera) cells.push_back(escape(result.block.cameras[result.block.camera_of(image)].name));
  if (columns.tile) {
    const auto& tiles = result.tiles.tile_of_frame;
    cells.push_back(tiles.contains(i.frame) && tiles[i.frame].valid() ? count(tiles[i.frame].value) : kMissing);
  }
  if (columns.part) cells.push_back(count(f.part_of_frame[i.frame] + 1));
  if (columns.records) {
    const ImageRecord& record = result.image_records[image];
    cells.insert(cells.end(), {count(record.features), count(record.matched_images)});
  }
  cells.push_back(count(f.observations[image]));
  cells.push_back(
      percent(static_cast<double>(f.measured[image] - f.observations[image]), static_cast<double>(f.measured[image])));
  cells.push_back(fixed(image_rms(f, image), 3));
  add_pose(result, image, columns.place_unit, cells);
  if (columns.sigmas) add_sigmas(result, i.frame, columns.sigma_unit, cells);
  table.add(std::move(cells));
}

// All oriented images in block order. For a huge block, only those with the largest residuals.
std::vector<ImageIndex> listed_images(const BlockResult& result, const Figures& f,
                                      const std::function<void()>& after_reading) {
  if (f.reprojection.oriented_images <= static_cast<std::int64_t>(kListedImages))
    return first_images(result, kListedImages, std::less<ImageIndex>(), after_reading);
  const auto rms = [&](ImageIndex image) {
    const double value = image_rms(f, image);
    return std::isfinite(value) ? value : -1;
  };
  return first_images(
      result, kListedImages, [&](ImageIndex a, ImageIndex b) { return std::pair(-rms(a), a) < std::pair(-rms(b), b); },
      after_reading);
}

}  // namespace

std::string images_section(const BlockResult& result, const Figures& f, const std::function<void()>& after_reading) {
  constexpr std::size_t kAtATime = 64;  // images between two calls of after_reading; their rows are spread over tables
  const std::vector<ImageIndex> images = listed_images(result, f, after_reading);
  if (images.empty() || f.reprojection.oriented_images == 0) return "";
  const ImageColumns columns = columns_of(result, f);
  Table table = empty_table(columns);
  for (std::size_t i = 0; i < images.size(); ++i) {
    if (i % kAtATime == 0) after_reading();
    add_image(result, f, columns, images[i], table);
  }
  const std::int64_t all = f.reprojection.oriented_images;
  std::string note =
      "Observations: number of kept ones; rejected: share of all observations in tracks. Positions are those of the "
      "projection centres in the ground frame";
  if (std::string(ground_unit(f)) != "m") note += ", whose scale is arbitrary";
  note += columns.sigmas ? ", formal sigmas of the frame (rotation: the largest of three axes). " : ". ";
  note += "Click a heading to sort.";
  if (all > static_cast<std::int64_t>(images.size()))
    note += fmt::format(
        " The {} images with the largest residuals of {}; <code>megablock export --format csv</code> "
        "writes all.",
        count(static_cast<std::int64_t>(images.size())), count(all));
  return section("images", "Images",
                 paragraph(note, "muted") +
                     details(fmt::format("{} images", count(static_cast<std::int64_t>(images.size()))),
                             "<div class=tall>" + table.html("sortable small") + "</div>", images.size() <= kOpen));
}

}  // namespace megablock::report
