// Projects or linearises many image observations at once. The observations lie side by side in lanes, and the kernels
// use the widest vectors of the processor. The bits are the same for all widths. The formulas are those of linearise.h.
//
// The kernels know Brown's camera model only (LaneView::simple). For other cameras the caller overwrites the values of
// the lane (linearise_in_camera).
#pragma once

#include <algorithm>
#include <span>

#include "adjust/lanes/lane_kernels.h"
#include "adjust/terms/linearise.h"

namespace megablock {

// The widest kernels of this processor. And the kernels of a width in doubles (2: any processor, 4: AVX2, 8: AVX-512),
// or nullptr where the processor has no such vectors.
const lane_kernels::Kernels& lane_kernels_of_processor();
const lane_kernels::Kernels* lane_kernels_of_width(int width);

// The values that all observations of an image share, in the layout of the kernels.
struct alignas(64) LaneView {
  std::array<double, lane_kernels::kViewSize> values{};
  bool simple = false;  // the camera has Brown's model; otherwise the values have no meaning
  explicit LaneView(const ImageView& view);
};

// The images of a tile at a state. The threads of a tile share it.
struct SeenImages {
  std::vector<ImageView> views;
  std::vector<LaneView> lanes;
  SeenImages(const TileProblem& problem, const TileState& state);
};

// A buffer of doubles that begins at a cache line.
class AlignedValues {
 public:
  AlignedValues() = default;
  AlignedValues(const AlignedValues&) = delete;  // first_ would point to the buffer of the original
  AlignedValues& operator=(const AlignedValues&) = delete;
  void resize(std::int64_t count);  // loses the contents
  double* data() { return first_; }
  const double* data() const { return first_; }

 private:
  std::vector<double> storage_;
  double* first_ = nullptr;
};

class ObservationLanes {
 public:
  // Number of lanes that fit into the first-level cache together with their values.
  static constexpr std::int64_t kUsual = 64;
  // Tests pass other kernels than the widest.
  explicit ObservationLanes(const lane_kernels::Kernels& kernels = lane_kernels_of_processor()) : kernels_(&kernels) {}

  // Removes all lanes, and makes room for this many.
  void reserve(std::int64_t lanes);
  void clear() { size_ = 0; }
  void clear_from(std::int64_t lane) { size_ = lane; }
  // The view outlives the lanes.
  void add(const LaneView& view, const Eigen::Vector3d& point, double x, double y, double inverse_sigma) {
    views_[static_cast<std::size_t>(size_)] = view.values.data();
    double* record = records_.data() + lane_kernels::kRecordSize * size_++;
    record[0] = point.x();
    record[1] = point.y();
    record[2] = point.z();
    record[3] = x;
    record[4] = y;
    record[5] = inverse_sigma;
  }
  // Replaces the view and the point of a lane; the measured coordinates stay.
  void see(std::int64_t lane, const LaneView& view, const Eigen::Vector3d& point) {
    views_[static_cast<std::size_t>(lane)] = view.values.data();
    std::copy_n(point.data(), 3, records_.data() + lane_kernels::kRecordSize * lane);
  }
  std::int64_t size() const { return size_; }
  std::int64_t padded_size() const { return lane_kernels::padded(size_); }  // number of lanes that the kernels process
  std::int64_t capacity() const { return capacity_; }

  // project() computes residuals alone, NaN behind the camera; linearise() computes all values.
  void project();
  void linearise();

  // Value v of lane i stands at values()[v * capacity() + i].
  double* values() { return values_.data(); }
  const double* values() const { return values_.data(); }
  double& value(int v, std::int64_t lane) { return values_.data()[v * capacity_ + lane]; }
  double value(int v, std::int64_t lane) const { return values_.data()[v * capacity_ + lane]; }
  Eigen::Vector2d residual(std::int64_t lane) const;
  Eigen::Vector3d from_frame(std::int64_t lane) const;
  Eigen::Matrix<double, 2, 3> by_point(std::int64_t lane) const;
  void set(std::int64_t lane, const Eigen::Vector2d& residual, const Eigen::Vector3d& from_frame,
           const Eigen::Matrix<double, 2, 3>& by_point);

 private:
  void pad();

  const lane_kernels::Kernels* kernels_;
  std::int64_t size_ = 0, capacity_ = 0;
  std::vector<const double*> views_;  // [capacity]
  AlignedValues records_, values_;
};

}  // namespace megablock
