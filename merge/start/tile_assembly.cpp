#include "merge/start/tile_assembly.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>

#include "adjust/independent_models/model_assembly.h"
#include "io/base/error.h"

namespace megablock {

namespace {

bool finite(const Pose& pose) { return pose.centre.allFinite() && pose.rotation.coeffs().allFinite(); }

double extent_of(const AlignmentTile& tile) {
  Eigen::AlignedBox3d box;
  for (const Pose& pose : tile.poses)
    if (finite(pose)) box.extend(pose.centre);
  return box.isEmpty() ? 0 : box.diagonal().norm();
}

bool tells(const AlignmentTile& tile, std::size_t row) {
  return tile.observations[row] >= kFewestAlignmentObservations && finite(tile.poses[row]);
}

// The frames that two or more tiles hold with enough observations, ascending.
std::vector<FrameIndex> shared_frames(const std::vector<AlignmentTile>& tiles) {
  std::vector<FrameIndex> all, shared;
  for (const AlignmentTile& tile : tiles)
    for (std::size_t i = 0; i < tile.frames.size(); ++i)
      if (tells(tile, i)) all.push_back(tile.frames[i]);
  std::sort(all.begin(), all.end());
  for (std::size_t i = 1; i < all.size(); ++i)
    if (all[i] == all[i - 1] && (shared.empty() || shared.back() != all[i])) shared.push_back(all[i]);
  return shared;
}

// The sigma of a frame falls with the square root of its observations. Only the ratios of the sigmas matter, because
// each link scales them by its misfits. A model holds only frames that another tile holds too: the others would not
// link anything.
Model model_of(const AlignmentTile& tile, std::size_t number, const std::vector<FrameIndex>& shared) {
  constexpr double kOrder = 1e-6;  // share of the extent, and rad: below any misfit, because links only enlarge sigmas
  Model model;
  model.number = static_cast<std::int64_t>(number);
  const double extent = extent_of(tile);
  if (!(extent > 0) || !std::isfinite(extent)) return model;
  for (std::size_t i = 0; i < tile.frames.size(); ++i) {
    if (!tells(tile, i) || !std::binary_search(shared.begin(), shared.end(), tile.frames[i])) continue;
    const double order = kOrder / std::sqrt(static_cast<double>(tile.observations[i]));
    model.images.push_back({tile.frames[i].value, tile.poses[i], order * extent, order});
  }
  return model;
}

// Finds the similarity that moves the assembled tiles of a part back to their mean place before the assembly.
//
// The mean of rotations with the unit quaternions q_i is the eigenvector of sum q_i q_i' with the largest eigenvalue; q
// and -q count the same (Markley, Cheng, Crassidis and Oshman 2007, "Averaging quaternions"). Every frame adds the
// inverse rotation of its tile once. The scale is the ratio of the sums of distances from the mean, and the mean goes
// to the mean. A similarity fitted to the projection centres would turn at will about a line of them.
class WayBack {
 public:
  void add(const AlignmentTile& tile, const Similarity& assembled) {
    const Eigen::Vector4d turn = assembled.rotation.conjugate().coeffs();
    for (const Pose& pose : tile.poses) {
      if (!finite(pose)) continue;
      turns_ += turn * turn.transpose();
      from_.push_back(assembled(pose.centre));
      to_.push_back(pose.centre);
    }
  }
  Similarity similarity() const {
    Similarity back;
    if (from_.empty()) return back;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> solver(turns_);
    // The eigenvalues ascend.
    back.rotation = Eigen::Quaterniond(Eigen::Vector4d(solver.eigenvectors().col(3)));
    const Eigen::Vector3d from = mean(from_), to = mean(to_);
    const double size_from = size(from_, from), size_to = size(to_, to);
    if (size_from > 0 && size_to > 0) back.scale = size_to / size_from;
    back.translation = to - back.scale * (back.rotation * from);
    return back;
  }

 private:
  using Places = std::vector<Eigen::Vector3d>;
  static Eigen::Vector3d mean(const Places& places) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& place : places) sum += place;
    return sum / static_cast<double>(places.size());
  }
  static double size(const Places& places, const Eigen::Vector3d& middle) {
    double sum = 0;
    for (const Eigen::Vector3d& place : places) sum += (place - middle).norm();
    return sum;
  }

  Eigen::Matrix4d turns_ = Eigen::Matrix4d::Zero();  // sum of q q' over the unit quaternions
  Places from_, to_;
};

}  // namespace

std::vector<Similarity> assemble_tiles(const std::vector<AlignmentTile>& tiles) {
  const std::vector<FrameIndex> shared = shared_frames(tiles);
  std::vector<Model> models;
  for (std::size_t t = 0; t < tiles.size(); ++t) models.push_back(model_of(tiles[t], t, shared));
  AssemblyOptions options;
  options.covariances = false;
  options.links.scale_sigmas = true;
  AssembledModels assembled;
  try {
    assembled = assemble_models(models, options);
  } catch (const ComputeError&) {  // no tile moves; they are aligned afterwards in any case
    return std::vector<Similarity>(tiles.size());
  }
  // The assembly has an arbitrary datum, one for each part.
  std::map<std::int64_t, WayBack> parts;  // by the number of the part
  for (std::size_t t = 0; t < tiles.size(); ++t) parts[assembled.part[t]].add(tiles[t], assembled.similarity[t]);
  std::map<std::int64_t, Similarity> back;
  for (const auto& [number, part] : parts) back[number] = part.similarity();
  std::vector<Similarity> result;
  for (std::size_t t = 0; t < tiles.size(); ++t) result.push_back(back.at(assembled.part[t]) * assembled.similarity[t]);
  return result;
}

}  // namespace megablock
