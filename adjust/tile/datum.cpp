// The mathematics is in datum.h. Names: a component's `centre` is c, its `extent` is L, `normal` is the sum (J S)'(J
// S), and move() gives the columns of S that act on a point or a frame, in the order phi, t, s:
//
//     dC = -[C - c]x phi + L t + (C - c) s,      dw = -phi
//
// All seven are numbers without unit (rad, parts of L, parts of the scale), so that the eigenvalues of the 7 x 7 matrix
// can be compared.
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
#include <type_traits>

#include "adjust/terms/linearise.h"
#include "adjust/terms/terms.h"
#include "geometry/numbers/decompositions.h"

namespace megablock {

namespace {

using Similarity6 = Eigen::Matrix<double, 6, 7>;  // columns: phi, t, s
using Similarity3 = Eigen::Matrix<double, 3, 7>;
using Normal7 = Eigen::Matrix<double, 7, 7>;

// The components of the frames, joined by active points and by observations between frames. The lowest frame names its
// component.
class Components {
 public:
  explicit Components(const TileProblem& problem) : parent_(problem.frames.size()) {
    std::iota(parent_.begin(), parent_.end(), 0);
    for (std::int64_t p = 0; p < problem.point_count(); ++p) {
      if (!problem.active(p)) continue;
      const std::int32_t first = frame_of_point(problem, p);
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
  static std::int32_t frame_of_point(const TileProblem& problem, std::int64_t p) {
    for (std::int64_t row = problem.begin[p]; row < problem.begin[p + 1]; ++row)
      if (problem.kept[row]) return problem.images[problem.image[row].value].frame.value;
    return -1;
  }

 private:
  void join(std::int32_t a, std::int32_t b) {
    a = of(a), b = of(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }
  std::vector<std::int32_t> parent_;
};

struct Component {
  std::vector<std::int32_t> frames;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double extent = 1;
  Normal7 normal = Normal7::Zero();

  Similarity3 move(const Eigen::Vector3d& position) const {
    const Eigen::Vector3d arm = position - centre;
    Similarity3 result;
    result << -skew<double>(arm), extent * Eigen::Matrix3d::Identity(), arm;
    return result;
  }
  Similarity6 move(const Pose& frame) const {
    Similarity6 result = Similarity6::Zero();
    result.topLeftCorner<3, 3>() = -Eigen::Matrix3d::Identity();
    result.bottomRows<3>() = move(frame.centre);
    return result;
  }
  template <typename Derived>
  void add(const Eigen::MatrixBase<Derived>& residual_by_similarity) {
    normal += residual_by_similarity.transpose() * residual_by_similarity;
  }
};

// The scale of a component that sees a rig: known where two held mounts of the rig are apart, and by the priors of free
// mounts. Every mount that the component sees counts once.
void add_mounts(const TileProblem& problem, const TileState& state, Components& components,
                std::vector<Component>& all) {
  // Pairs of a component and a mount that it sees.
  std::vector<std::pair<std::int32_t, std::int32_t>> seen;
  for (const TileImage& image : problem.images) seen.emplace_back(components.of(image.frame.value), image.mount);
  std::sort(seen.begin(), seen.end());
  seen.erase(std::unique(seen.begin(), seen.end()), seen.end());
  for (const auto& [component, mount] : seen) {
    // A held base gives the scale. It counts as a scale that is known to 1e-3, which is firm beside kNull.
    if (rig_gives_scale(problem, state, static_cast<std::size_t>(mount))) all[component].normal(6, 6) += 1e6;
    for (const auto& term : problem.mount_priors) {
      if (term.mount != mount) continue;
      // A scale of 1 + s moves the centre of the mount by s C_m. The prior of the mount resists this.
      PoseIncrement scaled = PoseIncrement::Zero();
      scaled.tail<3>() = state.mounts[mount].centre;
      all[component].normal(6, 6) += (linearise_mount(state.mounts[mount], term).by_mount * scaled).squaredNorm();
    }
  }
}

void add_term(const TermDatum& term, const TileState& state, Component& c) {
  const Pose& frame = state.frames[term.frame];
  if (term.base_to >= 0) {
    const Eigen::Vector3d base = state.frames[term.base_to].centre - frame.centre;
    // The residual (|b| - d) / sigma, or (b - T) / sigma, changes by |b| / sigma for a scale of one.
    c.normal(6, 6) += base.squaredNorm() / (term.base_sigma_m * term.base_sigma_m);
    return;
  }
  std::visit(
      [&](const auto& by_frame) {
        if constexpr (!std::is_same_v<std::decay_t<decltype(by_frame)>, std::monostate>)
          c.add(by_frame * c.move(frame));
      },
      term.by_frame);
}

void add_priors(const TileProblem& problem, const TileState& state, Components& components,
                std::vector<Component>& all) {
  for (const ObservationType* type : observation_types()) {
    for (std::size_t row = 0; row < type->count(problem); ++row) {
      const TermDatum term = type->datum(problem, state, row);
      if (term.frame >= 0) add_term(term, state, all[components.of(term.frame)]);
    }
  }
  for (const auto& term : problem.point_priors) {
    if (!problem.active(term.point.value)) continue;
    Component& c = all[components.of(Components::frame_of_point(problem, term.point.value))];
    c.add(term.sigma.cwiseInverse().asDiagonal() * c.move(state.points[term.point.value]));
  }
  add_mounts(problem, state, components, all);
}

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
DatumDefect defect_of(const Component& c, const TileState& state) {
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
  moves << c.move(state.frames[defect.first.value]), c.move(state.frames[farthest]);
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
  add_priors(problem, state, components, all);
  std::vector<DatumDefect> defects;
  for (const Component& c : all) {
    if (c.frames.empty()) continue;
    DatumDefect defect = defect_of(c, state);
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
