// Computes the information of one tile about the datum: how far its priors determine the similarities of each part
// (similarity_information.h).
#include <algorithm>

#include "merge/datum/gauge.h"
#include "merge/plan/unknowns.h"

namespace megablock {

namespace {

constexpr double kAtReference = 1e-9;  // metres: a mount nearer to its rig's reference is not moved by a scale

// Fills the parts of a tile.
class PartBuilder {
 public:
  PartBuilder(const TileProblem& problem, const TilePlan& plan, const TileState& state)
      : problem_(problem), plan_(plan), state_(state), part_(plan.part_of_frame) {}

  std::vector<GaugePart> build() {
    parts_.resize(at(plan_.part_count));
    describe_frames();
    std::vector<SimilarityInformation*> information;
    for (GaugePart& part : parts_) information.push_back(&part);
    add_similarity_information(problem_, state_, part_, information);
    list_free_mounts();
    return std::move(parts_);
  }

 private:
  // Frames are visited in ascending order, so that the first frame of a part is its lowest one.
  void describe_frames() {
    for (std::size_t f = 0; f < part_.size(); ++f) {
      if (part_[f] < 0) continue;
      GaugePart& part = parts_[at(part_[f])];
      const std::int64_t id = problem_.frames[f].value;
      const Eigen::Vector3d& centre = state_.frames[f].centre;
      if (part.frames++ == 0) {
        part.lowest_frame = id;
        part.lowest_centre = centre;
        part.extreme_frames.fill(id);
        part.extreme_centres.colwise() = centre;
      }
      part.centre += centre;
      for (int axis = 0; axis < 3; ++axis) {
        const int low = 2 * axis, high = low + 1;
        if (centre[axis] < part.extreme_centres(axis, low)) set_extreme(part, low, id, centre);
        if (centre[axis] > part.extreme_centres(axis, high)) set_extreme(part, high, id, centre);
      }
      if (find_unknown(plan_.boundary, {UnknownKind::kFrame, 0, id}) >= 0) part.boundary_frames.push_back(id);
    }
    for (GaugePart& part : parts_) {
      part.centre /= static_cast<double>(part.frames);
      const double extent = (part.extreme_centres.colwise() - part.centre).colwise().norm().maxCoeff();
      if (extent > 0) part.extent = extent;
    }
  }
  static void set_extreme(GaugePart& part, int side, std::int64_t id, const Eigen::Vector3d& centre) {
    part.extreme_frames[static_cast<std::size_t>(side)] = id;
    part.extreme_centres.col(side) = centre;
  }

  GaugePart& part_of(LocalFrame frame) { return parts_[at(part_[at(frame.value)])]; }

  // A free mount that sees points carries the scale of one part to all others that it sees. A mount without kept
  // observations, or one that a scale does not move, carries nothing.
  void list_free_mounts() {
    std::vector<std::uint8_t> moved(problem_.mounts.size(), 0);
    for (std::size_t m = 0; m < moved.size(); ++m)
      moved[m] = problem_.mount_free[m] && similarity_of_mount(problem_, state_, m).norm() > kAtReference;
    if (std::ranges::find(moved, 1) == moved.end()) return;
    std::vector<std::uint8_t> sees(problem_.images.size(), 0);
    for (std::int64_t p = 0; p < problem_.point_count(); ++p) {
      if (!problem_.active(p)) continue;
      for (std::int64_t row = problem_.begin[at(p)]; row < problem_.begin[at(p + 1)]; ++row)
        if (problem_.kept[at(row)]) sees[at(problem_.image[at(row)].value)] = 1;
    }
    for (std::size_t i = 0; i < sees.size(); ++i) {
      const TileImage& image = problem_.images[i];
      if (!sees[i] || !moved[at(image.mount)]) continue;
      const MountId& mount = problem_.mounts[at(image.mount)];
      part_of(image.frame).mounts.push_back({UnknownKind::kMount, mount.mount, mount.rig.value});
    }
    for (GaugePart& part : parts_) {
      std::ranges::sort(part.mounts);
      part.mounts.erase(std::unique(part.mounts.begin(), part.mounts.end()), part.mounts.end());
    }
  }

  const TileProblem& problem_;
  const TilePlan& plan_;
  const TileState& state_;
  const std::vector<std::int64_t>& part_;  // of every frame row
  std::vector<GaugePart> parts_;
};

}  // namespace

Bytes TileGauge::to_bytes() const {
  ByteWriter out;
  out.value<std::uint64_t>(parts.size());
  for (const GaugePart& part : parts) {
    out.values(part.boundary_frames);
    out.value(part.frames);
    out.value(part.lowest_frame);
    out.value(part.extreme_frames);
    out.value(part.extent);
    for (const double* v : {part.lowest_centre.data(), part.centre.data()}) out.values(std::vector<double>(v, v + 3));
    out.values(std::vector<double>(part.extreme_centres.data(), part.extreme_centres.data() + 18));
    for (const Matrix77* m : {&part.normal, &part.held}) out.values(std::vector<double>(m->data(), m->data() + 49));
    out.values(part.mounts);
  }
  return out.take();
}

TileGauge TileGauge::from_bytes(const Bytes& bytes) {
  ByteReader in(bytes);
  TileGauge gauge;
  const auto count = in.value<std::uint64_t>();
  const auto fill = [&](double* target, std::size_t size) {
    const std::vector<double> values = in.values<double>();
    if (values.size() != size) throw StoreError("merge: a tile's datum has the wrong size");
    std::copy(values.begin(), values.end(), target);
  };
  for (std::uint64_t i = 0; i < count; ++i) {
    GaugePart part;
    part.boundary_frames = in.values<std::int64_t>();
    part.frames = in.value<std::int64_t>();
    part.lowest_frame = in.value<std::int64_t>();
    part.extreme_frames = in.value<std::array<std::int64_t, 6>>();
    part.extent = in.value<double>();
    fill(part.lowest_centre.data(), 3);
    fill(part.centre.data(), 3);
    fill(part.extreme_centres.data(), 18);
    fill(part.normal.data(), 49);
    fill(part.held.data(), 49);
    part.mounts = in.values<UnknownId>();
    gauge.parts.push_back(part);
  }
  if (!in.at_end()) throw StoreError("merge: a tile's datum has the wrong size");
  return gauge;
}

TileGauge tile_gauge(const TileProblem& problem, const TilePlan& plan, const TileState& state) {
  return {PartBuilder(problem, plan, state).build()};
}

}  // namespace megablock
