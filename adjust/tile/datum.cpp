// The mathematics is in similarity_information.h.
//
// The minimal constraint. Let V be the eigenvectors of the free directions and M the 12 x 7 matrix by which a
// similarity moves two frames, rotations in radians and centres in units of L. The constraint is V' M' m = 0 for the
// increments m of the two frames since the start, with a weight of 1e3. Of all solutions that differ by a free
// similarity it selects the one whose two frames have moved least along it. The two frames are the first one and the
// one farthest from it, because the rotation and the scale show best there.
#include "adjust/tile/datum.h"

#include <ceres/autodiff_cost_function.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "adjust/terms/similarity_information.h"
#include "adjust/terms/terms.h"
#include "geometry/numbers/decompositions.h"

namespace megablock {

namespace {

// The components of the frames, joined by active points and by observations between frames. The lowest frame names its
// component.
class Components {
 public:
  explicit Components(const TileProblem& problem) : parent_(problem.frames.size()) {
    std::iota(parent_.begin(), parent_.end(), 0);
    for (std::int64_t p = 0; p < problem.point_count(); ++p) {
      if (!problem.active(p)) continue;
      const auto first = static_cast<std::int32_t>(frame_of_point(problem, p));
      for (std::int64_t row = problem.begin[p]; row < problem.begin[p + 1]; ++row)
        if (problem.kept[row]) join(first, problem.images[problem.image[row].value].frame.value);
    }
    for (const ObservationType* type : observation_types()) {
      for (std::size_t row = 0; row < type->count(problem); ++row) {
        const TermUnknowns term = type->unknowns(problem, row);
        if (term.frame_count == 2) join(term.frame[0], term.frame[1]);
      }
    }
  }
  std::int32_t of(std::int32_t frame) {
    while (parent_[frame] != frame) frame = parent_[frame] = parent_[parent_[frame]];
    return frame;
  }

 private:
  void join(std::int32_t a, std::int32_t b) {
    a = of(a), b = of(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }
  std::vector<std::int32_t> parent_;
};

struct Component : SimilarityInformation {
  std::vector<std::int32_t> frames;
};

std::vector<Component> find_components(const TileProblem& problem, const TileState& state, Components& components) {
  std::vector<Component> all(problem.frames.size());  // at the lowest frame of each component; the others stay empty
  for (std::size_t f = 0; f < problem.frames.size(); ++f)
    all[components.of(static_cast<std::int32_t>(f))].frames.push_back(static_cast<std::int32_t>(f));
  for (Component& c : all) {
    if (c.frames.empty()) continue;
    for (std::int32_t f : c.frames) c.centre += state.frames[f].centre / static_cast<double>(c.frames.size());
    double squares = 0;
    for (std::int32_t f : c.frames) squares += (state.frames[f].centre - c.centre).squaredNorm();
    // The extent is 1 where all centres coincide; t is then in metres.
    if (squares > 0) c.extent = std::sqrt(squares / static_cast<double>(c.frames.size()));
  }
  return all;
}

// The increments of the two frames along the free directions, in units of 1e-3 of the extent or 1e-3 rad.
DatumDefect defect_of(const Component& c, const TileProblem& problem, const TileState& state) {
  DatumDefect defect;
  const SymmetricEigen eigen = symmetric_eigen(c.normal);
  constexpr double kNull = 1e-11;  // share of the largest eigenvalue; the matrix itself has errors of 1e-15
  const double threshold = kNull * eigen.values(6);
  // The eigenvalues are ascending: the free directions are the first ones.
  while (defect.dimension < 7 && eigen.values(defect.dimension) <= threshold) ++defect.dimension;
  if (defect.dimension == 0) return defect;

  defect.first = LocalFrame(c.frames.front());
  const Eigen::Vector3d origin = state.frames[defect.first.value].centre;
  std::int32_t farthest = c.frames.front();
  double distance = 0;
  for (std::int32_t f : c.frames) {
    const double d = (state.frames[f].centre - origin).norm();
    if (d > distance) distance = d, farthest = f;
  }
  defect.second = LocalFrame(farthest);

  Eigen::Matrix<double, 12, 7> moves;
  const auto move = [&](std::int32_t frame) {
    const auto row = static_cast<std::size_t>(frame);
    return similarity_of_frame(state.frames[row].centre, reference_place(problem, state, row), c.centre, c.extent);
  };
  moves << move(defect.first.value), move(farthest);
  moves.middleRows<3>(3) /= c.extent;
  moves.middleRows<3>(9) /= c.extent;
  Eigen::Matrix<double, 12, 1> unit = Eigen::Matrix<double, 12, 1>::Constant(1e3);
  unit.segment<3>(3) /= c.extent;
  unit.segment<3>(9) /= c.extent;
  defect.constraints.topRows(defect.dimension) =
      eigen.vectors.leftCols(defect.dimension).transpose() * moves.transpose() * unit.asDiagonal();
  return defect;
}

struct DatumConstraint {
  Eigen::Matrix<double, 7, 12> rows;
  Pose first, second;

  template <typename Scalar>
  bool operator()(const Scalar* a, const Scalar* b, Scalar* result) const {
    Eigen::Matrix<Scalar, 12, 1> increments;
    increments << increment(first, a), increment(second, b);
    const Eigen::Matrix<Scalar, 7, 1> product = rows.cast<Scalar>() * increments;
    std::copy_n(product.data(), 7, result);
    return true;
  }
  template <typename Scalar>
  static Eigen::Matrix<Scalar, 6, 1> increment(const Pose& from, const Scalar* to) {
    Eigen::Matrix<Scalar, 6, 1> d;
    d << rotation_log<Scalar>(from.rotation.conjugate().cast<Scalar>() * residual::rotation_of(to)),
        residual::centre_of(to) - from.centre.cast<Scalar>();
    return d;
  }
};

}  // namespace

std::vector<DatumDefect> datum_defects(const TileProblem& problem, const TileState& state) {
  Components components(problem);
  std::vector<Component> all = find_components(problem, state, components);
  std::vector<std::int64_t> component_of_frame;
  for (std::size_t f = 0; f < all.size(); ++f)
    component_of_frame.push_back(components.of(static_cast<std::int32_t>(f)));
  std::vector<SimilarityInformation*> information;
  for (Component& c : all) information.push_back(&c);
  add_similarity_information(problem, state, component_of_frame, information);
  std::vector<DatumDefect> defects;
  for (const Component& c : all) {
    if (c.frames.empty()) continue;
    DatumDefect defect = defect_of(c, problem, state);
    if (defect.dimension > 0) defects.push_back(defect);
  }
  return defects;
}

void constrain_datum(const std::vector<DatumDefect>& defects, CeresTile& tile) {
  for (const DatumDefect& defect : defects) {
    double *a = tile.frame(defect.first.value), *b = tile.frame(defect.second.value);
    // Ceres takes no residual of the same block twice. A component of one frame gets no constraint.
    if (a == b || !tile.problem().HasParameterBlock(a) || !tile.problem().HasParameterBlock(b)) continue;
    auto* constraint = new DatumConstraint{defect.constraints, from_block(a), from_block(b)};
    tile.problem().AddResidualBlock(
        new ceres::AutoDiffCostFunction<DatumConstraint, 7, kPoseBlock, kPoseBlock>(constraint), nullptr, a, b);
  }
}

}  // namespace megablock
