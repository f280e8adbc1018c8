// Ranks and minima of singular matrices come from Cholesky factors alone. A positive semidefinite A is scaled to a unit
// diagonal and factorised with pivoting, P'AP = L L', until the largest pivot that is left is below a tolerance; the
// number of pivots is its rank, and for b in the range of A the leading rows give b'A^+ b = |L_11^-1 (P'b)_1|^2.
//
// A tile against the rest: with C the covariance of the separator unknowns in the block, C^-1 is the sum of S of the
// tile and of the condensed equations of the rest. At the optimum of the block the gradients cancel, so the rest has
// -s. Hence
//
//     T = s'S^+ s + s'(C^-1 - S)^+ s.
//
// C^-1 is never formed. With a root C = F F' the rest is C^-1 - S = F^-T (I - F'S F) F^-1, so that with W = I - F'S F
//
//     s'(C^-1 - S)^+ s = (F's)' W^+ (F's),    rank(C^-1 - S) = rank W.
//
// Some unknowns u of the tile alone: let x be the separator unknowns of the block and v the difference of the tile in
// u. The tile has the equations S (x + E v), E the columns of u, and the rest those of x. Eliminating x leaves A v = g
// with
//
//     A = S_uu - S_u C S_u',    g = s_u,
//
// where S_u C S_u' = (F'S_u')'(F'S_u'): `seen` is F'S, and every u takes only its columns.
#include "merge/checks/seam_check.h"

#include <cblas.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "geometry/numbers/chi_square.h"
#include "geometry/numbers/decompositions.h"
#include "geometry/numbers/student.h"

extern "C" {
void dpotrf_(const char* uplo, const int* n, double* a, const int* lda, int* info);
void dpstrf_(const char* uplo, const int* n, double* a, const int* lda, int* pivots, int* rank, const double* tolerance,
             double* work, int* info);
}

namespace megablock {

namespace {

constexpr double kRankTolerance = 1e-10;  // smallest pivot of a matrix that is scaled to a unit diagonal
// The share of the information about a direction that the other side has. Below this share nothing is left to test, and
// the share is lost in the rounding of the whole.
constexpr double kShared = 1e-6;
// A frame whose rotation has less than this share of the largest information in the tile is not tested for a turn.
constexpr double kVisibleTurn = 0.25;
// The least variance factor that is compared with. Residuals without noise have a smaller one, and its ratio has no
// meaning.
constexpr double kNoNoise = 0.01;
// The form q of the head of seam_check.h, as full matrices.
struct Quadratic {
  Eigen::MatrixXd s;  // full symmetric
  Eigen::VectorXd b;
};

Quadratic unpacked(const UpdateMatrix& update) {
  const std::int64_t n = total_dimension(update.unknowns);
  Quadratic q{Eigen::MatrixXd(n, n), Eigen::Map<const Eigen::VectorXd>(update.rhs.data(), n)};
  const double* value = update.matrix.data();
  for (std::int64_t j = 0; j < n; ++j)
    for (std::int64_t i = j; i < n; ++i) q.s(i, j) = q.s(j, i) = *value++;
  return q;
}

// The lower triangle of D S D, with D the diagonal matrix of `scale`.
Eigen::MatrixXd scaled(const UpdateMatrix& update, const Eigen::VectorXd& scale) {
  const Eigen::Index n = scale.size();
  Eigen::MatrixXd matrix(n, n);
  const double* value = update.matrix.data();
  for (Eigen::Index j = 0; j < n; ++j)
    for (Eigen::Index i = j; i < n; ++i) matrix(i, j) = *value++ * scale[i] * scale[j];
  return matrix;
}

// P'AP = LL' of a positive semidefinite A, to its rank; L is the lower trapezoid of `lower`.
struct SemidefiniteFactor {
  Eigen::MatrixXd lower;
  std::vector<int> pivots;  // row i of P'A is row pivots[i] - 1 of A; empty: P = I
  int rank = 0;

  Eigen::MatrixXd rows_permuted(Eigen::MatrixXd m) const {  // P'm
    if (!pivots.empty()) m = Eigen::MatrixXd(m(order(), Eigen::all));
    return m;
  }
  Eigen::MatrixXd columns_permuted(Eigen::MatrixXd m) const {  // mP
    if (!pivots.empty()) m = Eigen::MatrixXd(m(Eigen::all, order()));
    return m;
  }
  // b'A^+ b for a b in the range of A. The leading rows alone then give it: |L_11^-1 b_1|^2.
  double least_squares(const Eigen::VectorXd& b) const {
    Eigen::VectorXd leading = rows_permuted(b).topRows(rank);
    lower.topLeftCorner(rank, rank).triangularView<Eigen::Lower>().solveInPlace(leading);
    return leading.squaredNorm();
  }

 private:
  std::vector<int> order() const {
    std::vector<int> rows = pivots;
    for (int& row : rows) --row;
    return rows;
  }
};

// Factorises the lower triangle that `matrix()` returns, whose diagonal is at most about one. The rank is the number of
// pivots above `tolerance`. The factorisation without pivoting is several times as fast; it is kept where every pivot
// is clearly above zero.
template <typename Make>
SemidefiniteFactor semidefinite_factor(const Make& matrix, double tolerance = kRankTolerance) {
  // All pivots of the unpivoted factorisation above this value leave no doubt about the rank. Otherwise the pivoted one
  // decides.
  const double plainly_there = std::max(1e-7, tolerance);
  SemidefiniteFactor factor{matrix(), {}, 0};
  const int n = factor.rank = static_cast<int>(factor.lower.rows());
  int info = 0;
  dpotrf_("L", &n, factor.lower.data(), &n, &info);
  if (info == 0 && (n == 0 || factor.lower.diagonal().minCoeff() > std::sqrt(plainly_there))) return factor;

  factor.lower = Eigen::MatrixXd();  // makes room first
  factor.lower = matrix();
  factor.pivots.resize(static_cast<std::size_t>(n));
  std::vector<double> work(2 * static_cast<std::size_t>(n));
  dpstrf_("L", &n, factor.lower.data(), &n, factor.pivots.data(), &factor.rank, &tolerance, work.data(), &info);
  return factor;
}

template <typename Matrix>
Eigen::Matrix<double, Matrix::RowsAtCompileTime, 1> scale_of(const Matrix& s) {
  return s.diagonal().unaryExpr([](double d) { return d > 0 ? 1 / std::sqrt(d) : 0.0; });
}

// A root F of a covariance matrix, C = FF'. The matrix is scaled to a unit diagonal and factorised, F = D P L. Columns
// of L are zero for held unknowns, and where the rest of the covariance is below rounding.
class CovarianceRoot {
 public:
  explicit CovarianceRoot(const CovarianceMatrix& c) {
    const Eigen::Index n = total_dimension(c.unknowns);
    const Eigen::Map<const Eigen::MatrixXd> matrix(c.matrix.data(), n, n);
    scale_ = matrix.diagonal().cwiseMax(0).cwiseSqrt();
    // Held unknowns have variance zero; their scale is zero in both directions.
    const Eigen::VectorXd inverse = scale_of(matrix);
    factor_ =
        semidefinite_factor([&]() -> Eigen::MatrixXd { return inverse.asDiagonal() * matrix * inverse.asDiagonal(); });
    factor_.lower.rightCols(n - factor_.rank).setZero();
  }
  Eigen::MatrixXd transposed_times(Eigen::MatrixXd m) const {  // F'm, in the memory of m
    m.array().colwise() *= scale_.array();
    m = factor_.rows_permuted(std::move(m));
    multiply(CblasLeft, CblasTrans, m);
    return m;
  }
  Eigen::MatrixXd times(Eigen::MatrixXd m) const {  // mF
    m.array().rowwise() *= scale_.transpose().array();
    m = factor_.columns_permuted(std::move(m));
    multiply(CblasRight, CblasNoTrans, m);
    return m;
  }

 private:
  void multiply(CBLAS_SIDE side, CBLAS_TRANSPOSE transpose, Eigen::MatrixXd& m) const {
    const auto n = static_cast<int>(scale_.size());
    cblas_dtrmm(CblasColMajor, side, CblasLower, transpose, CblasNonUnit, static_cast<int>(m.rows()),
                static_cast<int>(m.cols()), 1, factor_.lower.data(), n, m.data(), static_cast<int>(m.rows()));
  }
  Eigen::VectorXd scale_;
  SemidefiniteFactor factor_;
};

// The quantiles of one alarm probability, computed once for each number of degrees.
class Limits {
 public:
  explicit Limits(double probability) : probability_(probability) {}
  double of(std::int64_t degrees) {
    const auto [place, fresh] = known_.emplace(degrees, 0);
    if (fresh) place->second = chi_square_quantile(probability_, degrees);
    return place->second;
  }

 private:
  double probability_;
  std::map<std::int64_t, double> known_;
};

// Tests the score of some scalar unknowns. `own` is the tile's information about them, `left` is A.
template <int Size>
UnknownCheck check_score(const Eigen::Matrix<double, Size, 1>& score, const Eigen::Matrix<double, Size, Size>& own,
                         const Eigen::Matrix<double, Size, Size>& left, double variance_factor, Limits& limits) {
  UnknownCheck check;
  // g'A^+ g by the eigenvectors of A, in units in which the tile's information has a unit diagonal. An eigenvalue is
  // then the share of this information that is left for v. Below kShared it is rounding.
  const Eigen::Matrix<double, Size, 1> scale = scale_of(own);
  const SymmetricEigen eigen = symmetric_eigen(scale.asDiagonal() * left * scale.asDiagonal());
  const Eigen::Matrix<double, Size, 1> along = eigen.vectors.transpose() * scale.cwiseProduct(score);
  for (Eigen::Index i = 0; i < along.size(); ++i) {
    if (eigen.values[i] < kShared) continue;
    ++check.degrees;
    check.statistic += along[i] * along[i] / eigen.values[i] / variance_factor;
  }
  if (check.degrees > 0) check.threshold = limits.of(check.degrees);
  return check;
}

// Makes all checks of a tile. `seen` is F'S with C = FF', so that seen'seen = S C S.
std::vector<UnknownCheck> check_unknowns(const Quadratic& tile, const Eigen::MatrixXd& seen,
                                         const UnknownList& unknowns, double probability, double variance_factor) {
  constexpr int kKinds = 3, kTurn = 3;  // a frame's first three scalar unknowns are its rotation
  const std::vector<std::int64_t> rows = row_offsets(unknowns);
  std::vector<UnknownCheck> checks;
  const auto add = [&](UnknownCheck check, const UnknownId& id, const UnknownId& other, bool turn) {
    if (check.degrees == 0) return;
    check.id = id;
    check.other = other;
    check.turn = turn;
    checks.push_back(check);
  };

  struct Turn {
    UnknownId frame;
    Eigen::Index row;
    double information;
  };
  std::vector<Turn> turns;
  double most = 0;
  // The limits follow Bonferroni: each kind gets a third of the probability, divided by the number of its tests.
  Limits wholes(probability / kKinds / static_cast<double>(unknowns.size()));
  for (std::size_t u = 0; u < unknowns.size(); ++u) {
    const Eigen::Index row = rows[u], n = unknowns[u].dimension;
    const Eigen::MatrixXd own = tile.s.block(row, row, n, n);
    const Eigen::MatrixXd left = own - seen.middleCols(row, n).transpose() * seen.middleCols(row, n);
    add(check_score<Eigen::Dynamic>(tile.b.segment(row, n), own, left, variance_factor, wholes), unknowns[u].id, {},
        false);
    if (unknowns[u].id.kind != UnknownKind::kFrame) continue;
    turns.push_back({unknowns[u].id, row, left.diagonal().head<kTurn>().sum()});
    most = std::max(most, turns.back().information);
  }
  std::erase_if(turns, [&](const Turn& t) { return t.information < kVisibleTurn * most; });
  if (turns.empty()) return checks;

  std::vector<Eigen::Index> wanted;
  for (const Turn& turn : turns)
    for (Eigen::Index k = 0; k < kTurn; ++k) wanted.push_back(turn.row + k);
  const Eigen::VectorXd score = tile.b(wanted);
  const Eigen::MatrixXd own = tile.s(wanted, wanted);
  const Eigen::MatrixXd seen_turns = seen(Eigen::all, wanted);
  Eigen::MatrixXd left = own;
  cblas_dsyrk(CblasColMajor, CblasLower, CblasTrans, static_cast<int>(own.rows()), static_cast<int>(seen.rows()), -1,
              seen_turns.data(), static_cast<int>(seen.rows()), 1, left.data(), static_cast<int>(own.rows()));
  // One product gives A of all rotations; each test takes its block.
  left.triangularView<Eigen::StrictlyUpper>() = left.transpose();
  const auto count = static_cast<double>(turns.size());
  Limits singles(probability / kKinds / count), pairs(probability / kKinds / (0.5 * count * (count - 1)));
  std::array<Eigen::Index, 2 * kTurn> both;
  for (std::size_t i = 0; i < turns.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i) * kTurn;
    std::iota(both.begin(), both.begin() + kTurn, row);
    add(check_score<kTurn>(score.segment<kTurn>(row), own.block<kTurn, kTurn>(row, row),
                           left.block<kTurn, kTurn>(row, row), variance_factor, singles),
        turns[i].frame, {}, true);
    for (std::size_t j = i + 1; j < turns.size(); ++j) {
      std::iota(both.begin() + kTurn, both.end(), static_cast<Eigen::Index>(j) * kTurn);
      add(check_score<2 * kTurn>(score(both), own(both, both), left(both, both), variance_factor, pairs),
          turns[i].frame, turns[j].frame, true);
    }
  }
  return checks;
}

// The worst checks by excess of which no two have an unknown in common.
std::array<UnknownCheck, 4> worst_of(std::vector<UnknownCheck> checks) {
  std::stable_sort(checks.begin(), checks.end(),
                   [](const UnknownCheck& a, const UnknownCheck& b) { return a.excess() > b.excess(); });
  std::array<UnknownCheck, 4> worst;
  auto free = worst.begin();
  for (const UnknownCheck& check : checks) {
    if (free == worst.end()) break;
    if (std::none_of(worst.begin(), free, [&](const UnknownCheck& w) { return w.shares_unknown(check); }))
      *free++ = check;
  }
  return worst;
}

}  // namespace

// The matrix is scaled to a unit diagonal, which leaves rank and minimum unchanged.
LeastSquares least_squares(const UpdateMatrix& condensed) {
  const Eigen::Index n = total_dimension(condensed.unknowns);
  Eigen::VectorXd scale(n);
  std::int64_t entry = 0;  // of the diagonal
  for (Eigen::Index k = 0; k < n; entry += n - k++) {
    const double diagonal = condensed.matrix[static_cast<std::size_t>(entry)];
    scale[k] = diagonal > 0 ? 1 / std::sqrt(diagonal) : 0;
  }
  if (n == 0 || scale.maxCoeff() == 0) return {};
  const SemidefiniteFactor factor = semidefinite_factor([&] { return scaled(condensed, scale); });
  return {factor.least_squares(scale.cwiseProduct(Eigen::Map<const Eigen::VectorXd>(condensed.rhs.data(), n))),
          factor.rank};
}

SeamReport check_seam(std::int64_t node, const LeastSquares& left, const LeastSquares& right,
                      const Front::Result& together, double probability, double variance_factor) {
  const FrontFactor& factor = together.factor;
  const std::int64_t eliminated = total_dimension(factor.eliminated);
  double squares = 0;  // |z|^2; in free blocks z has further columns
  for (std::int64_t i = 0; i < eliminated; ++i)
    squares += factor.z[static_cast<std::size_t>(i)] * factor.z[static_cast<std::size_t>(i)];
  const LeastSquares& rest = together.update.alone;
  SeamReport report;
  report.node = node;
  report.degrees = left.rank + right.rank - (eliminated - std::ssize(factor.held)) - rest.rank;
  report.statistic = std::max(0.0, left.value + right.value - squares - rest.value) / variance_factor;
  if (report.degrees > 0) report.threshold = chi_square_quantile(probability, report.degrees);
  return report;
}

TileCheck check_tile(std::int64_t tile, const UpdateMatrix& condensed, const CovarianceMatrix& boundary,
                     double probability, double variance_factor) {
  TileCheck check;
  check.tile = tile;
  const Quadratic own = unpacked(condensed);
  const LeastSquares alone = least_squares(condensed);
  const SubtreeSums& sums = condensed.sums;
  // The tile's weighted squares, lowered to their minimum by its inner unknowns and points (the decrement) and by its
  // separator unknowns (alone).
  check.own_chi2 = (sums.weighted_squares - sums.decrement_squared - alone.value) / variance_factor;
  check.own_degrees =
      sums.residuals - (sums.unknowns - static_cast<std::int64_t>(sums.held.size()) - sums.held_points) - alone.rank;

  const Eigen::Index n = own.b.size();
  if (n == 0) return check;
  Eigen::MatrixXd seen;
  {
    const CovarianceRoot root(boundary.restricted_to(condensed.unknowns));
    seen = root.transposed_times(own.s);
    // The normal equations of the rest of the block on the separator unknowns are C^-1 - S. With C = FF', the matrix W
    // = I - F'SF has the same nullity, and s'(C^-1 - S)^+ s = (F's)'W^+ (F's).
    const auto w = [&] {
      Eigen::MatrixXd matrix = root.times(seen);
      matrix = -matrix;
      matrix.diagonal().array() += 1;
      return matrix;
    };
    const SemidefiniteFactor rest = semidefinite_factor(w, kShared);
    check.degrees = alone.rank - (n - rest.rank);
    check.statistic = std::max(0.0, alone.value + rest.least_squares(root.transposed_times(own.b))) / variance_factor;
    if (check.degrees > 0) check.threshold = chi_square_quantile(probability, check.degrees);
  }

  check.worst = worst_of(check_unknowns(own, seen, condensed.unknowns, probability, variance_factor));
  return check;
}

bool UnknownCheck::shares_unknown(const UnknownCheck& check) const {
  const auto among = [&](const UnknownId& u) { return u.index >= 0 && (u == check.id || u == check.other); };
  return among(id) || among(other);
}

std::vector<NoisyTile> noisy_tiles(const std::vector<TileCheck>& tiles) {
  std::vector<const TileCheck*> left;
  double squares = 0, degrees = 0;  // sums over `left`
  for (const TileCheck& tile : tiles) {
    if (tile.own_degrees <= 0) continue;
    left.push_back(&tile);
    squares += tile.own_chi2;
    degrees += static_cast<double>(tile.own_degrees);
  }
  // The variance factor of the tile over that of all others that are still in the list.
  const auto ratio = [&](const TileCheck* tile) {
    const auto own = static_cast<double>(tile->own_degrees);
    return tile->own_chi2 / own / std::max(kNoNoise, (squares - tile->own_chi2) / (degrees - own));
  };
  // The normal deviate of F (E. Paulson, Ann. Math. Stat. 13, 1942), whose cube root is nearly normally distributed:
  // with f_1 and f_2 degrees of freedom and v_i = 2 / (9 f_i), it is ((1 - v_2) F^(1/3) - (1 - v_1)) / sqrt(v_2 F^(2/3)
  // + v_1).
  const auto deviate = [&](const TileCheck* tile) {
    const auto own = static_cast<double>(tile->own_degrees);
    const double root = std::cbrt(ratio(tile) / kUsualVarianceRatio);
    const double variance = 2 / (9 * own), others = 2 / (9 * (degrees - own));
    return ((1 - others) * root - (1 - variance)) / std::sqrt(others * root * root + variance);
  };
  const double probability = kSeamAlarmProbability / static_cast<double>(tiles.size());
  std::vector<NoisyTile> noisy;
  // The worst tile is taken out before the others are judged, so that its own residuals do not excuse them or it.
  while (left.size() > 1) {
    const auto worst = std::ranges::max_element(left, {}, deviate);
    if (!(normal_exceeds(deviate(*worst)) < probability)) break;
    noisy.push_back({(*worst)->tile, ratio(*worst)});
    squares -= (*worst)->own_chi2;
    degrees -= static_cast<double>((*worst)->own_degrees);
    left.erase(worst);
  }
  return noisy;
}

}  // namespace megablock
