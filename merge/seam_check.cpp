#include "merge/seam_check.h"

#include <cblas.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <numeric>
#include <set>

#include "geometry/chi_square.h"

extern "C" {
void dpotrf_(const char* uplo, const int* n, double* a, const int* lda, int* info);
void dpstrf_(const char* uplo, const int* n, double* a, const int* lda, int* pivots, int* rank, const double* tolerance,
             double* work, int* info);
}

namespace megablock {

namespace {

constexpr double kRankTolerance = 1e-10;  // of the scaled matrix (unit diagonal)
// Information about a frame's turn, of the most there is of any in the tile: below, its turn is not asked for.
constexpr double kVisibleTurn = 0.25;

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

// The lower triangle of D S D.
Eigen::MatrixXd scaled(const UpdateMatrix& update, const Eigen::VectorXd& scale) {
  const Eigen::Index n = scale.size();
  Eigen::MatrixXd matrix(n, n);
  const double* value = update.matrix.data();
  for (Eigen::Index j = 0; j < n; ++j)
    for (Eigen::Index i = j; i < n; ++i) matrix(i, j) = *value++ * scale[i] * scale[j];
  return matrix;
}

template <typename Matrix>
Eigen::Matrix<double, Matrix::RowsAtCompileTime, 1> scale_of(const Matrix& s) {
  return s.diagonal().unaryExpr([](double d) { return d > 0 ? 1 / std::sqrt(d) : 0.0; });
}

// Quantiles of one alarm probability.
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

// The score of some scalar unknowns; `own`: what the tile knows of them, `left`: A.
template <int Size>
UnknownCheck check_score(const Eigen::Matrix<double, Size, 1>& score, const Eigen::Matrix<double, Size, Size>& own,
                         const Eigen::Matrix<double, Size, Size>& left, double variance_factor, Limits& limits) {
  UnknownCheck check;
  // In units of what the tile knows; directions that it alone knows leave nothing to test.
  constexpr double kShared = 1e-6;
  const Eigen::Matrix<double, Size, 1> scale = scale_of(own);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, Size, Size>> eigen(scale.asDiagonal() * left *
                                                                               scale.asDiagonal());
  const Eigen::Matrix<double, Size, 1> along = eigen.eigenvectors().transpose() * scale.cwiseProduct(score);
  for (Eigen::Index i = 0; i < along.size(); ++i) {
    if (eigen.eigenvalues()[i] < kShared) continue;
    ++check.degrees;
    check.statistic += along[i] * along[i] / eigen.eigenvalues()[i] / variance_factor;
  }
  if (check.degrees > 0) check.threshold = limits.of(check.degrees);
  return check;
}

// All checks of a tile. product: covariance times tile.s.
std::vector<UnknownCheck> check_unknowns(const Quadratic& tile, const Eigen::MatrixXd& product,
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
  Limits wholes(probability / kKinds / static_cast<double>(unknowns.size()));
  for (std::size_t u = 0; u < unknowns.size(); ++u) {
    const Eigen::Index row = rows[u], n = unknowns[u].dimension;
    const Eigen::MatrixXd own = tile.s.block(row, row, n, n);
    const Eigen::MatrixXd left = own - tile.s.middleRows(row, n) * product.middleCols(row, n);
    add(check_score<Eigen::Dynamic>(tile.b.segment(row, n), own, left, variance_factor, wholes), unknowns[u].id, {},
        false);
    if (unknowns[u].id.kind != UnknownKind::kFrame) continue;
    turns.push_back({unknowns[u].id, row, left.diagonal().head<kTurn>().sum()});
    most = std::max(most, turns.back().information);
  }
  std::erase_if(turns, [&](const Turn& t) { return t.information < kVisibleTurn * most; });

  std::vector<Eigen::Index> wanted;
  for (const Turn& turn : turns)
    for (Eigen::Index k = 0; k < kTurn; ++k) wanted.push_back(turn.row + k);
  const Eigen::VectorXd score = tile.b(wanted);
  const Eigen::MatrixXd own = tile.s(wanted, wanted);
  const Eigen::MatrixXd left = own - tile.s(wanted, Eigen::all) * product(Eigen::all, wanted);
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

// The worst by excess that have no unknown in common.
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

// By Cholesky factorisation of the matrix scaled to a unit diagonal (the scale leaves rank and minimum as they are):
// without pivoting, which is several times as fast, where no pivot comes near to vanishing; else with it, P'SP = LL' to
// its rank. b lies in the range, so that the leading rows alone give b'S^+ b = |L_11^-1 b_1|^2.
LeastSquares least_squares(const UpdateMatrix& condensed) {
  constexpr double kPlainlyThere = 1e-7;  // pivot, of a unit diagonal
  const int n = static_cast<int>(total_dimension(condensed.unknowns));
  Eigen::VectorXd scale(n);
  std::int64_t entry = 0;  // of the diagonal
  for (int k = 0; k < n; entry += n - k++) {
    const double diagonal = condensed.matrix[static_cast<std::size_t>(entry)];
    scale[k] = diagonal > 0 ? 1 / std::sqrt(diagonal) : 0;
  }
  if (n == 0 || scale.maxCoeff() == 0) return {};
  const Eigen::VectorXd b = scale.cwiseProduct(Eigen::Map<const Eigen::VectorXd>(condensed.rhs.data(), n));
  Eigen::MatrixXd factor = scaled(condensed, scale);
  int info = 0;
  dpotrf_("L", &n, factor.data(), &n, &info);
  if (info == 0 && factor.diagonal().minCoeff() > std::sqrt(kPlainlyThere))
    return {factor.triangularView<Eigen::Lower>().solve(b).squaredNorm(), n};

  factor = Eigen::MatrixXd();  // makes room first
  factor = scaled(condensed, scale);
  const double tolerance = kRankTolerance;
  std::vector<int> pivots(static_cast<std::size_t>(n));
  std::vector<double> work(2 * static_cast<std::size_t>(n));
  int rank = 0;
  dpstrf_("L", &n, factor.data(), &n, pivots.data(), &rank, &tolerance, work.data(), &info);
  Eigen::VectorXd leading(rank);
  for (int i = 0; i < rank; ++i) leading[i] = b[pivots[static_cast<std::size_t>(i)] - 1];
  factor.topLeftCorner(rank, rank).triangularView<Eigen::Lower>().solveInPlace(leading);
  return {leading.squaredNorm(), rank};
}

SeamReport check_seam(std::int64_t node, const LeastSquares& left, const LeastSquares& right,
                      const Front::Result& together, double probability, double variance_factor) {
  const FrontFactor& factor = together.factor;
  const std::int64_t eliminated = total_dimension(factor.eliminated);
  double squares = 0;  // of z, which has further columns in free blocks
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
  check.own_chi2 = (sums.weighted_squares - sums.decrement_squared - alone.value) / variance_factor;
  check.own_degrees =
      sums.residuals - (sums.unknowns - static_cast<std::int64_t>(sums.held.size()) - sums.held_points) - alone.rank;

  // The rest's normal equations on the boundary: C^-1 - S, so (C^-1 - S)^-1 s = (I - C S)^-1 C s.
  const CovarianceMatrix c = boundary.restricted_to(condensed.unknowns);
  const Eigen::Index n = own.b.size();
  if (n == 0) return check;
  const Eigen::Map<const Eigen::MatrixXd> covariance(c.matrix.data(), n, n);
  Eigen::MatrixXd product(n, n);
  const int size = static_cast<int>(n);
  cblas_dsymm(CblasColMajor, CblasLeft, CblasLower, size, size, 1, c.matrix.data(), size, own.s.data(), size, 0,
              product.data(), size);
  const Eigen::MatrixXd system = Eigen::MatrixXd::Identity(n, n) - product;
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> solver;
  solver.setThreshold(kRankTolerance);
  solver.compute(system);
  const Eigen::VectorXd moved = solver.solve(covariance * own.b);
  check.degrees = alone.rank - (n - solver.rank());
  check.statistic = std::max(0.0, alone.value + own.b.dot(moved)) / variance_factor;
  if (check.degrees > 0) check.threshold = chi_square_quantile(probability, check.degrees);

  check.worst = worst_of(check_unknowns(own, product, condensed.unknowns, probability, variance_factor));
  return check;
}

bool UnknownCheck::shares_unknown(const UnknownCheck& check) const {
  const auto among = [&](const UnknownId& u) { return u.index >= 0 && (u == check.id || u == check.other); };
  return among(id) || among(other);
}

std::vector<std::string> describe_disagreements(const std::vector<TileCheck>& tiles, const UnknownName& name) {
  std::vector<std::pair<std::int64_t, UnknownCheck>> all;  // tile, what it disagrees about
  for (const TileCheck& tile : tiles)
    for (const UnknownCheck& check : tile.worst)
      if (check.degrees > 0) all.emplace_back(tile.tile, check);
  std::stable_sort(all.begin(), all.end(),
                   [](const auto& a, const auto& b) { return a.second.excess() > b.second.excess(); });

  const double decisive = -2 * std::log(kSeamAlarmProbability);
  constexpr std::size_t kLines = 3;
  std::vector<std::string> lines;
  std::size_t more = 0;
  std::vector<UnknownCheck> said;
  for (const auto& [tile, check] : all) {
    if (!check.alarm()) break;
    if (std::any_of(said.begin(), said.end(), [&](const UnknownCheck& s) { return s.shares_unknown(check); })) continue;
    said.push_back(check);
    if (lines.size() == kLines) {
      ++more;
      continue;
    }
    std::set<std::int64_t> suspects{tile};
    for (const auto& [rival, other] : all)
      if (other.shares_unknown(check) && other.excess() > check.excess() - decisive) suspects.insert(rival);
    std::string who, what = name(check.id);
    for (const std::int64_t suspect : suspects) who += (who.empty() ? "" : " and ") + std::to_string(suspect);
    if (check.other.index >= 0) what += " and " + name(check.other);
    if (check.turn) what = "the turn of " + what;
    char figures[120];
    std::snprintf(figures, sizeof figures, ": T = %.0f with %lld degrees of freedom (limit %.0f)", check.statistic,
                  static_cast<long long>(check.degrees), check.threshold);
    lines.push_back((suspects.size() > 1
                         ? "tiles " + who + " see " + what + " differently, one of them wrongly"
                         : "tile " + who + " sees " + what + " differently from the rest of the block") +
                    figures);
  }
  if (more > 0) lines.push_back(std::to_string(more) + " more unknowns that tiles see differently");
  return lines;
}

std::vector<std::string> describe_seams(const std::vector<SeamReport>& seams, const std::vector<TileCheck>& tiles) {
  const TileCheck* worst = nullptr;
  const auto excess = [](const TileCheck& t) { return t.threshold > 0 ? t.statistic / t.threshold : 0; };
  for (const TileCheck& tile : tiles)
    if (worst == nullptr || excess(tile) > excess(*worst)) worst = &tile;
  std::vector<std::string> lines;
  for (const SeamReport& seam : seams) {
    if (!seam.alarm()) continue;
    char line[240];
    std::snprintf(
        line, sizeof line,
        "seam at node %lld: T = %.0f with %lld degrees of freedom (limit %.0f), its sides differ %.1f times what "
        "their sigmas explain",
        static_cast<long long>(seam.node), seam.statistic, static_cast<long long>(seam.degrees), seam.threshold,
        std::sqrt(seam.statistic / static_cast<double>(seam.degrees)));
    lines.emplace_back(line);
    if (worst != nullptr)
      lines.back() += "; tile " + std::to_string(worst->tile) + " disagrees most with the rest of the block";
  }
  return lines;
}

}  // namespace megablock
