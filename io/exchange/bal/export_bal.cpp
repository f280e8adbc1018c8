#include "io/exchange/bal/export_bal.h"

#include "io/exchange/bal/bal_camera.h"
#include "io/exchange/model/export_view.h"
#include "io/text/text_writer.h"

namespace megablock {

namespace {

// Observations in the image coordinates of the files. Observations that cannot be converted are left out, and points
// with fewer than two others as well.
struct BalObservations {
  std::vector<std::int64_t> tracks;  // rows of view.tracks
  std::vector<std::int64_t> begin = {0};
  std::vector<std::int64_t> image, rank;
  std::vector<Eigen::Vector2d> position;
};

BalObservations bal_observations(const ExportView& view) {
  for (std::int64_t i = 0; i < view.image_count(); ++i)
    check_bal_model(view.result.block.cameras[view.camera_index(i)].name, view.intrinsics(i).model());
  const ObservationsByImage by_image = observations_by_image(view);
  BalObservations all;
  for (std::int64_t t = 0; t < view.track_count(); ++t) {
    const std::size_t before = all.image.size();
    for (auto k = static_cast<std::size_t>(view.begin[static_cast<std::size_t>(t)]);
         k < static_cast<std::size_t>(view.begin[static_cast<std::size_t>(t) + 1]); ++k) {
      const std::int64_t o = view.observations[k], i = view.image_of(o);
      const auto position = to_bal_image(view.intrinsics(i), view.pixel(o));
      if (!position) continue;
      all.image.push_back(i);
      all.rank.push_back(by_image.rank[k]);
      all.position.push_back(*position);
    }
    if (all.image.size() < before + 2) {
      all.image.resize(before);
      all.rank.resize(before);
      all.position.resize(before);
      continue;
    }
    all.tracks.push_back(t);
    all.begin.push_back(static_cast<std::int64_t>(all.image.size()));
  }
  return all;
}

}  // namespace

void export_bal(const BlockResult& result, const std::string& path) {
  const ExportView view = make_export_view(result);
  const BalObservations all = bal_observations(view);
  TextWriter writer(path);
  writer.print("{} {} {}\n", view.image_count(), all.tracks.size(), all.image.size());
  for (std::size_t t = 0; t < all.tracks.size(); ++t)
    for (auto k = static_cast<std::size_t>(all.begin[t]); k < static_cast<std::size_t>(all.begin[t + 1]); ++k)
      writer.print("{} {} {} {}\n", all.image[k], t, all.position[k].x(), all.position[k].y());
  for (std::int64_t i = 0; i < view.image_count(); ++i) {
    const BalCamera camera = to_bal(view.pose(i), view.intrinsics(i));
    // The rotation vector of R = S R_cw, world to camera.
    const Eigen::Vector3d w = rotation_log<double>(Eigen::Quaterniond(camera.rotation));
    const Eigen::Vector3d& t = camera.translation;
    for (const double v : {w.x(), w.y(), w.z(), t.x(), t.y(), t.z(), camera.focal, camera.k1, camera.k2})
      writer.print("{}\n", v);
  }
  for (const std::int64_t t : all.tracks)
    for (const double v : {view.point(t).x(), view.point(t).y(), view.point(t).z()}) writer.print("{}\n", v);
  writer.close();
}

void export_bundler(const BlockResult& result, const std::string& path) {
  const ExportView view = make_export_view(result);
  const BalObservations all = bal_observations(view);
  TextWriter writer(path), list(path + ".list.txt");
  writer.print("# Bundle file v0.3\n{} {}\n", view.image_count(), all.tracks.size());
  for (std::int64_t i = 0; i < view.image_count(); ++i) {
    const BalCamera camera = to_bal(view.pose(i), view.intrinsics(i));
    writer.print("{} {} {}\n", camera.focal, camera.k1, camera.k2);
    for (int r = 0; r < 3; ++r)
      writer.print("{} {} {}\n", camera.rotation(r, 0), camera.rotation(r, 1), camera.rotation(r, 2));
    writer.print("{} {} {}\n", camera.translation.x(), camera.translation.y(), camera.translation.z());
    list.print("{} 0 {}\n", view.image_name(i), camera.focal);
  }
  for (std::size_t t = 0; t < all.tracks.size(); ++t) {
    const Eigen::Vector3d& p = view.point(all.tracks[t]);
    writer.print("{} {} {}\n128 128 128\n{}", p.x(), p.y(), p.z(), all.begin[t + 1] - all.begin[t]);
    for (auto k = static_cast<std::size_t>(all.begin[t]); k < static_cast<std::size_t>(all.begin[t + 1]); ++k)
      writer.print(" {} {} {} {}", all.image[k], all.rank[k], all.position[k].x(), all.position[k].y());
    writer.print("\n");
  }
  writer.close();
  list.close();
}

}  // namespace megablock
