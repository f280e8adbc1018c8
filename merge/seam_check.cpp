#include "merge/seam_check.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>

#include "geometry/chi_square.h"

extern "C" {
void dpstrf_(const char* uplo, const int* n, double* a, const int* lda, int* pivots, int* rank, const double* tolerance,
             double* work, int* info);
}

namespace megablock {

namespace {

constexpr double kRankTolerance = 1e-10;  // of the scaled matrix (unit diagonal)

struct Quadratic {
  Eigen::MatrixXd s;  // full symmetric
  Eigen::VectorXd b;
};

// Condensed normal equations on `wanted`, minimised over the rest.
Quadratic reduced_to(const UpdateMatrix& update, const UnknownList& wanted) {
  UnknownList others;
  for (const Unknown& u : update.unknowns)
    if (find_unknown(wanted, u.id) < 0) others.push_back(u);
  Front front(others, wanted);
  front.add(update);
  const UpdateMatrix reduced = std::move(front).eliminate(0).update;
  const std::int64_t n = total_dimension(wanted);
  Quadratic q{Eigen::MatrixXd::Zero(n, n), Eigen::Map<const Eigen::VectorXd>(reduced.rhs.data(), n)};
  const double* value = reduced.matrix.data();
  for (std::int64_t j = 0; j < n; ++j)
    for (std::int64_t i = j; i < n; ++i) q.s(i, j) = q.s(j, i) = *value++;
  return q;
}

struct Minimum {
  double value = 0;  // b' S^+ b = -2 min q
  std::int64_t rank = 0;
};

// By Cholesky factorisation with diagonal pivoting of the scaled matrix, P'SP = LL' to its rank. The scale leaves rank
// and minimum as they are; b lies in the range, so that the leading rows alone give b'S^+ b = |L_11^-1 b_1|^2.
Minimum minimum(const Eigen::MatrixXd& s, const Eigen::VectorXd& b, const Eigen::VectorXd& scale) {
  Minimum m;
  const int n = static_cast<int>(b.size());
  if (n == 0 || s.diagonal().maxCoeff() <= 0) return m;
  Eigen::MatrixXd factor = scale.asDiagonal() * s * scale.asDiagonal();
  const double tolerance = kRankTolerance * factor.diagonal().maxCoeff();
  std::vector<int> pivots(static_cast<std::size_t>(n));
  std::vector<double> work(2 * static_cast<std::size_t>(n));
  int rank = 0, info = 0;
  dpstrf_("L", &n, factor.data(), &n, pivots.data(), &rank, &tolerance, work.data(), &info);
  Eigen::VectorXd z(rank);
  for (int i = 0; i < rank; ++i) {
    const int row = pivots[static_cast<std::size_t>(i)] - 1;
    z[i] = scale[row] * b[row];
  }
  factor.topLeftCorner(rank, rank).triangularView<Eigen::Lower>().solveInPlace(z);
  m.value = z.squaredNorm();
  m.rank = rank;
  return m;
}

Eigen::VectorXd scale_of(const Eigen::MatrixXd& s) {
  return s.diagonal().unaryExpr([](double d) { return d > 0 ? 1 / std::sqrt(d) : 0.0; });
}

// product: covariance times tile.s.
UnknownCheck check_unknown(const Quadratic& tile, const Eigen::MatrixXd& product, const Unknown& unknown,
                           std::int64_t row, double probability, double variance_factor) {
  UnknownCheck check;
  check.id = unknown.id;
  const auto rows = tile.s.middleRows(row, unknown.dimension);
  const Eigen::MatrixXd own = rows.middleCols(row, unknown.dimension);
  const Eigen::MatrixXd left = own - rows * product.middleCols(row, unknown.dimension);
  // In units of what the tile knows; directions that it alone knows leave nothing to test.
  constexpr double kShared = 1e-6;
  const Eigen::VectorXd scale = scale_of(own);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scale.asDiagonal() * left * scale.asDiagonal());
  const Eigen::VectorXd score =
      eigen.eigenvectors().transpose() * scale.cwiseProduct(tile.b.segment(row, unknown.dimension));
  for (Eigen::Index i = 0; i < score.size(); ++i) {
    if (eigen.eigenvalues()[i] < kShared) continue;
    ++check.degrees;
    check.statistic += score[i] * score[i] / eigen.eigenvalues()[i] / variance_factor;
  }
  if (check.degrees > 0) check.threshold = chi_square_quantile(probability, check.degrees);
  return check;
}

// Keeps the worst, in order.
void insert(const UnknownCheck& check, std::array<UnknownCheck, 4>& worst) {
  const auto badness = [](const UnknownCheck& c) { return c.degrees > 0 ? c.statistic / c.threshold : 0; };
  for (std::size_t i = 0; i < worst.size(); ++i) {
    if (badness(check) <= badness(worst[i])) continue;
    std::copy_backward(worst.begin() + static_cast<std::ptrdiff_t>(i), worst.end() - 1, worst.end());
    worst[i] = check;
    return;
  }
}

}  // namespace

SeamReport check_seam(std::int64_t node, const UpdateMatrix& left, const UpdateMatrix& right, double probability,
                      double variance_factor) {
  SeamReport report;
  report.node = node;
  UnknownList common;
  for (const Unknown& u : left.unknowns)
    if (find_unknown(right.unknowns, u.id) >= 0) common.push_back(u);
  if (common.empty()) return report;
  const Quadratic a = reduced_to(left, common), b = reduced_to(right, common);
  const Eigen::VectorXd scale = scale_of(a.s + b.s);
  const Minimum ma = minimum(a.s, a.b, scale), mb = minimum(b.s, b.b, scale);
  const Minimum both = minimum(a.s + b.s, a.b + b.b, scale);
  report.degrees = ma.rank + mb.rank - both.rank;
  report.statistic = std::max(0.0, ma.value + mb.value - both.value) / variance_factor;
  if (report.degrees > 0) report.threshold = chi_square_quantile(probability, report.degrees);
  return report;
}

TileCheck check_tile(std::int64_t tile, const UpdateMatrix& condensed, const CovarianceMatrix& boundary,
                     double probability, double variance_factor) {
  TileCheck check;
  check.tile = tile;
  const Quadratic own = reduced_to(condensed, condensed.unknowns);
  const Eigen::VectorXd scale = scale_of(own.s);
  const Minimum alone = minimum(own.s, own.b, scale);
  const SubtreeSums& sums = condensed.sums;
  check.own_chi2 = (sums.weighted_squares - sums.decrement_squared - alone.value) / variance_factor;
  check.own_degrees =
      sums.residuals - (sums.unknowns - static_cast<std::int64_t>(sums.held.size()) - sums.held_points) - alone.rank;

  // The rest's normal equations on the boundary: C^-1 - S, so (C^-1 - S)^-1 s = (I - C S)^-1 C s.
  const CovarianceMatrix c = boundary.restricted_to(condensed.unknowns);
  const Eigen::Index n = own.b.size();
  if (n == 0) return check;
  const Eigen::Map<const Eigen::MatrixXd> covariance(c.matrix.data(), n, n);
  const Eigen::MatrixXd product = covariance * own.s;
  const Eigen::MatrixXd system = Eigen::MatrixXd::Identity(n, n) - product;
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> solver;
  solver.setThreshold(kRankTolerance);
  solver.compute(system);
  const Eigen::VectorXd moved = solver.solve(covariance * own.b);
  check.degrees = alone.rank - (n - solver.rank());
  check.statistic = std::max(0.0, alone.value + own.b.dot(moved)) / variance_factor;
  if (check.degrees > 0) check.threshold = chi_square_quantile(probability, check.degrees);

  const std::vector<std::int64_t> rows = row_offsets(condensed.unknowns);
  for (std::size_t u = 0; u < condensed.unknowns.size(); ++u)
    insert(check_unknown(own, product, condensed.unknowns[u], rows[u],
                         probability / static_cast<double>(condensed.unknowns.size()), variance_factor),
           check.worst);
  return check;
}

std::vector<std::string> describe_disagreements(const std::vector<TileCheck>& tiles, const UnknownName& name) {
  std::vector<double> blame(tiles.size(), 0);
  std::map<UnknownId, std::vector<std::size_t>> by_unknown;  // tiles that see it differently
  for (std::size_t t = 0; t < tiles.size(); ++t)
    for (const UnknownCheck& check : tiles[t].worst) {
      if (!check.alarm()) continue;
      blame[t] += check.excess();
      by_unknown[check.id].push_back(t);
    }
  std::vector<std::pair<double, std::string>> lines;
  for (auto& [id, who] : by_unknown) {
    std::stable_sort(who.begin(), who.end(), [&](std::size_t a, std::size_t b) { return blame[a] > blame[b]; });
    const auto& worst = tiles[who.front()].worst;
    const UnknownCheck& check =
        *std::find_if(worst.begin(), worst.end(), [&, wanted = id](const UnknownCheck& c) { return c.id == wanted; });
    const bool either = who.size() > 1 && blame[who[1]] > 0.5 * blame[who[0]];
    char line[240];
    std::snprintf(line, sizeof line, "T = %.0f with %lld degrees of freedom (limit %.0f)", check.statistic,
                  static_cast<long long>(check.degrees), check.threshold);
    lines.emplace_back(check.excess(), (either ? "tiles " + std::to_string(tiles[who[0]].tile) + " and " +
                                                     std::to_string(tiles[who[1]].tile) + " see " + name(id) +
                                                     " differently, one of them wrongly: "
                                               : "tile " + std::to_string(tiles[who[0]].tile) + " sees " + name(id) +
                                                     " differently from the rest of the block: ") +
                                           line);
  }
  std::stable_sort(lines.begin(), lines.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  constexpr std::size_t kLines = 3;
  std::vector<std::string> result;
  for (std::size_t i = 0; i < std::min(kLines, lines.size()); ++i) result.push_back(std::move(lines[i].second));
  if (lines.size() > kLines)
    result.push_back(std::to_string(lines.size() - kLines) + " more unknowns that tiles see differently");
  return result;
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
