// Finds the images that see a place.
#include "io/simulate/blocks/observe.h"

#include <algorithm>
#include <cmath>

namespace megablock {

Observer::Observer(const Layout& layout, double margin_px) : layout_(layout), margin_px_(margin_px) {
  const Block& block = layout.block;
  for (std::size_t i = 0; i < block.images.size(); ++i) {
    const ImageIndex image(static_cast<std::int64_t>(i));
    const Image& entry = block.images[image];
    const Pose& mount = layout.truth.mounts[block.frames[entry.frame].rig][static_cast<std::size_t>(entry.mount)];
    const Pose pose = camera_pose(layout.truth.frames[entry.frame], mount);
    views_.push_back({pose.rotation.toRotationMatrix(), pose.centre, block.camera_of(image).value});
  }
  // Far outside the image the distortion polynomial turns back and would give false pixels. Therefore only rays inside
  // the corners of the image are projected.
  for (std::size_t c = 0; c < block.cameras.size(); ++c) {
    const Camera& camera = block.cameras[CameraIndex(static_cast<std::int64_t>(c))];
    double radius_sq = 0;
    for (const double u : {0.0, 1.0})
      for (const double v : {0.0, 1.0}) {
        const auto corner = unproject(layout.truth.cameras[CameraIndex(static_cast<std::int64_t>(c))],
                                      {u * camera.width, v * camera.height});
        if (corner) radius_sq = std::max(radius_sq, corner->squaredNorm());
      }
    all_around_.push_back(sees_sideways(camera.intrinsics.model()));
    max_radius_sq_.push_back(1.05 * radius_sq);
  }

  // The frames are sorted into cells as large as the range, by counting sort.
  cell_m_ = layout.scene->range_m();
  Eigen::Vector2d low = layout.truth.frames.front().centre.head<2>(), high = low;
  for (const Pose& pose : layout.truth.frames) {
    low = low.cwiseMin(pose.centre.head<2>());
    high = high.cwiseMax(pose.centre.head<2>());
  }
  origin_ = low;
  columns_ = static_cast<std::int64_t>((high.x() - low.x()) / cell_m_) + 1;
  rows_ = static_cast<std::int64_t>((high.y() - low.y()) / cell_m_) + 1;
  const auto cell_of = [&](const Pose& pose) {
    const Eigen::Vector2d place = (pose.centre.head<2>() - origin_) / cell_m_;
    return static_cast<std::int64_t>(place.y()) * columns_ + static_cast<std::int64_t>(place.x());
  };
  cell_begin_.assign(static_cast<std::size_t>(columns_ * rows_ + 1), 0);
  for (const Pose& pose : layout.truth.frames) ++cell_begin_[static_cast<std::size_t>(cell_of(pose) + 1)];
  for (std::size_t c = 1; c < cell_begin_.size(); ++c) cell_begin_[c] += cell_begin_[c - 1];
  cell_frames_.resize(layout.truth.frames.size());
  std::vector<std::int64_t> next(cell_begin_.begin(), cell_begin_.end() - 1);
  for (std::size_t f = 0; f < cell_frames_.size(); ++f) {
    const FrameIndex frame(static_cast<std::int64_t>(f));
    auto& row = next[static_cast<std::size_t>(cell_of(layout.truth.frames[frame]))];
    cell_frames_[static_cast<std::size_t>(row++)] = frame.value;
  }
}

void Observer::look(std::int64_t frame, const SurfacePoint& point, std::vector<SimulatedObservation>& seen) const {
  const Pose& pose = layout_.truth.frames[FrameIndex(frame)];
  if ((pose.centre - point.position).head<2>().norm() > layout_.scene->range_m()) return;
  // All cameras of the rig are tested from its origin: their lever arms are small against the surfaces.
  if (!layout_.scene->visible(pose.centre, point)) return;
  const auto cameras = static_cast<std::int64_t>(layout_.block.rigs[RigIndex(0)].mounts.size());
  for (std::int64_t i = frame * cameras; i < (frame + 1) * cameras; ++i) {
    const ImageIndex image(i);
    if (const auto pixel = pixel_of(image, point.position)) seen.push_back({image, *pixel});
  }
}

std::optional<Eigen::Vector2d> Observer::pixel_of(ImageIndex image, const Eigen::Vector3d& place) const {
  const View& view = views_[static_cast<std::size_t>(image.value)];
  const Eigen::Vector3d inside = view.rotation * (place - view.centre);
  const bool all_around = all_around_[static_cast<std::size_t>(view.camera)] != 0;
  // No camera sees closer than half a metre. This also excludes points behind a camera that sees to one side.
  if ((all_around ? inside.norm() : inside.z()) < 0.5) return std::nullopt;
  const CameraIndex camera(view.camera);
  const double radius_sq = inside.head<2>().squaredNorm() / (inside.z() * inside.z());
  if (!all_around && radius_sq > max_radius_sq_[static_cast<std::size_t>(view.camera)]) return std::nullopt;
  const Camera& size = layout_.block.cameras[camera];
  const Eigen::Vector2d pixel =
      layout_.motions.empty() ? project(layout_.truth.cameras[camera], inside) : rolling_pixel(image, place);
  if (!pixel.allFinite()) return std::nullopt;
  if (pixel.x() < margin_px_ || pixel.x() > size.width - margin_px_ || pixel.y() < margin_px_ ||
      pixel.y() > size.height - margin_px_)
    return std::nullopt;
  return pixel;
}

Eigen::Vector2d Observer::rolling_pixel(ImageIndex image, const Eigen::Vector3d& place) const {
  const Image& entry = layout_.block.images[image];
  const CameraIndex camera = layout_.block.camera_of(image);
  const RigIndex rig = layout_.block.frames[entry.frame].rig;
  return moving_pixel({layout_.truth.cameras[camera],
                       layout_.truth.frames[entry.frame],
                       layout_.truth.mounts[rig][static_cast<std::size_t>(entry.mount)],
                       layout_.motions[static_cast<std::size_t>(entry.frame.value)],
                       {layout_.readout_s, static_cast<double>(layout_.block.cameras[camera].height)}},
                      place);
}

std::vector<SimulatedObservation> Observer::observations_of(const SurfacePoint& point) const {
  std::vector<SimulatedObservation> seen;
  // A frame within the range lies in the cell of the point or in one of its eight neighbours, because a cell is as
  // large as the range.
  const Eigen::Vector2d place = (point.position.head<2>() - origin_) / cell_m_;
  const auto column = static_cast<std::int64_t>(std::floor(place.x())),
             row = static_cast<std::int64_t>(std::floor(place.y()));
  for (std::int64_t r = std::max<std::int64_t>(0, row - 1); r <= std::min(rows_ - 1, row + 1); ++r)
    for (std::int64_t c = std::max<std::int64_t>(0, column - 1); c <= std::min(columns_ - 1, column + 1); ++c) {
      const auto cell = static_cast<std::size_t>(r * columns_ + c);
      for (std::int64_t k = cell_begin_[cell]; k < cell_begin_[cell + 1]; ++k)
        look(cell_frames_[static_cast<std::size_t>(k)], point, seen);
    }
  std::sort(seen.begin(), seen.end(),
            [](const SimulatedObservation& a, const SimulatedObservation& b) { return a.image < b.image; });
  return seen;
}

}  // namespace megablock
