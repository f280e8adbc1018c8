#include "io/result/result_precision.h"

#include <string>
#include <utility>

#include "io/store/hdf5/hdf5_cameras.h"
#include "io/store/hdf5/hdf5_matrices.h"

namespace megablock {

namespace {

std::int64_t row_count(const auto& items) { return static_cast<std::int64_t>(items.size()); }

using MountCovariances = IndexedVector<RigIndex, std::vector<BlockResult::Matrix6>>;

// The covariances of a result, formal or empirical, and the names of their datasets.
template <typename Covariances>
struct PrecisionOf {
  Covariances& of;
  std::string prefix;  // of the names
  std::string name(const char* group, const char* dataset) const { return std::string(group) + "/" + prefix + dataset; }
};

// Writes one row per mount, in the order of the group 'mounts'.
void put_mount_covariances(Hdf5Writer& file, const std::string& name, const MountCovariances& rigs) {
  std::vector<BlockResult::Matrix6> mounts;
  for (const auto& rig : rigs) mounts.insert(mounts.end(), rig.begin(), rig.end());
  file.array(name, flattened<double>(mounts), {row_count(mounts), 6, 6},
             {"rad, m", "posterior, of (rotation increment about the rig's axes, centre); held: 0"});
}

MountCovariances get_mount_covariances(const Hdf5Reader& file, const std::string& name,
                                       const IndexedVector<RigIndex, Rig>& rigs) {
  std::int64_t count = 0;
  for (const Rig& rig : rigs) count += row_count(rig.mounts);
  const auto mounts = square_matrices<BlockResult::Matrix6>(file.array<double>(name, {count, 6, 6}));
  MountCovariances covariances;
  auto next = mounts.begin();
  for (const Rig& rig : rigs) {
    const auto first = std::exchange(next, next + row_count(rig.mounts));
    covariances.push_back(std::vector<BlockResult::Matrix6>(first, next));
  }
  return covariances;
}

void put_frame_covariances(Hdf5Writer& file, const std::string& name,
                           const IndexedVector<FrameIndex, BlockResult::Matrix6>& frames, const char* description) {
  static_assert(sizeof(BlockResult::Matrix6) == 36 * sizeof(double));  // the matrices can be written without a copy
  if (!frames.empty())
    file.dataset(name, ElementType::kDouble, frames.data(), {row_count(frames), 6, 6}, {"rad, m", description});
}

void get_frame_covariances(const Hdf5Reader& file, const std::string& name, const Block& block,
                           IndexedVector<FrameIndex, BlockResult::Matrix6>& frames) {
  if (file.has(name))
    frames = IndexedVector<FrameIndex, BlockResult::Matrix6>(
        square_matrices<BlockResult::Matrix6>(file.array<double>(name, {row_count(block.frames), 6, 6})));
}

template <typename Covariances>
void put_precision(Hdf5Writer& file, const PrecisionOf<Covariances>& precision) {
  const auto& of = precision.of;
  put_frame_covariances(file, precision.name("frames", "covariance"), of.frame_covariance,
                        "posterior, of (rotation increment about the ground axes, centre)");
  put_frame_covariances(file, precision.name("frames", "aligned_covariance"), of.aligned_covariance,
                        "the same after the best-fit similarity of all positions");
  if (const BlockResult::JointCovariance& joint = of.joint_covariance; !joint.frames.empty()) {
    const std::int64_t n = joint.matrix.rows();
    file.vector(precision.name("joint", "frame"), column(joint.frames, [](FrameIndex f) { return f.value; }),
                {"", "of the rows of the covariance, ascending"});
    file.array(precision.name("joint", "covariance"),
               std::vector<double>(joint.matrix.data(), joint.matrix.data() + joint.matrix.size()), {n, n},
               {"rad, m", "of the poses of a small block together"});
  }
  if (!of.camera_covariance.empty())
    put_covariances(file, precision.name("cameras", "covariance"), of.camera_covariance);
  if (!of.mount_covariance.empty())
    put_mount_covariances(file, precision.name("mounts", "covariance"), of.mount_covariance);
}

template <typename Covariances>
void get_precision(const Hdf5Reader& file, const Block& block, const PrecisionOf<Covariances>& precision) {
  auto& of = precision.of;
  get_frame_covariances(file, precision.name("frames", "covariance"), block, of.frame_covariance);
  get_frame_covariances(file, precision.name("frames", "aligned_covariance"), block, of.aligned_covariance);
  if (const std::string name = precision.name("joint", "frame"); file.has(name)) {
    for (const std::int64_t frame : file.vector<std::int64_t>(name)) of.joint_covariance.frames.emplace_back(frame);
    const std::int64_t n = 6 * row_count(of.joint_covariance.frames);
    const std::vector<double> values = file.array<double>(precision.name("joint", "covariance"), {n, n});
    of.joint_covariance.matrix = Eigen::Map<const Eigen::MatrixXd>(values.data(), n, n);
  }
  if (const std::string name = precision.name("cameras", "covariance"); file.has(name))
    of.camera_covariance = IndexedVector<CameraIndex, Eigen::MatrixXd>(
        get_covariances(file, name, column(block.cameras, [](const Camera& c) { return c.intrinsics.model(); })));
  if (const std::string name = precision.name("mounts", "covariance"); file.has(name))
    of.mount_covariance = get_mount_covariances(file, name, block.rigs);
}

}  // namespace

void put_precision(Hdf5Writer& file, const BlockResult& result) {
  if (!result.joint_covariance.frames.empty()) file.group("joint", "poses of a small block together");
  put_precision(file, PrecisionOf<const BlockResult>{result, ""});
  put_precision(file, PrecisionOf<const BlockResult::Empirical>{result.empirical, "empirical_"});
}

void get_precision(const Hdf5Reader& file, BlockResult& result) {
  get_precision(file, result.block, PrecisionOf<BlockResult>{result, ""});
  get_precision(file, result.block, PrecisionOf<BlockResult::Empirical>{result.empirical, "empirical_"});
}

}  // namespace megablock
