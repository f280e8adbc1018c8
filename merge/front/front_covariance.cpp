// Computes the covariance of a front, block by block (front.h).
//
// With X = K_PE K_EE^-1 = Y L^-1 [p x e], the unknowns of E depend on those of P by x_E = K_EE^-1 b_E - X'x_P. Given
// x_P they have the covariance K_EE^-1, and x_P itself has C_PP from the parent. Both parts are independent, hence
//
//     C_PE = -C_PP X,    C_EE = L^-T L^-1 + X' C_PP X = L^-T L^-1 - X' C_PE.
//
// This is the recursion of K. Takahashi, J. Fagan and M.-S. Chin (1973) in blocks: of the inverse of the whole normal
// matrix only those elements are computed that the fronts hold. It is complete, because the front of the parent holds
// all unknowns of P, and so its covariance has all of C_PP. A sweep with lambda = 0 must have made the factors: a
// damped factor gives covariances that are too small.
//
// A held unknown has a unit row and column in L. Its one in the right-hand side of L^-1 is replaced by zero, so that
// its row and column of L^-1 and X vanish, and with them its variance and covariances.
#include <cblas.h>

#include <algorithm>

#include "merge/front/front.h"
#include "merge/front/front_rows.h"

namespace megablock {

CovarianceMatrix CovarianceMatrix::restricted_to(const UnknownList& wanted) const {
  const std::vector<std::int64_t> rows = scalar_rows(wanted, rows_in(unknowns, wanted, "covariance"));
  const std::int64_t n = total_dimension(unknowns);
  CovarianceMatrix part{wanted, {}};
  part.matrix.reserve(rows.size() * rows.size());
  for (std::int64_t column : rows)
    for (std::int64_t row : rows) part.matrix.push_back(matrix[static_cast<std::size_t>(row + column * n)]);
  return part;
}

bool CovarianceMatrix::block(const UnknownId& row, const UnknownId& column, double* out) const {
  const std::int64_t r = find_unknown(unknowns, row), c = find_unknown(unknowns, column);
  if (r < 0 || c < 0) return false;
  const std::vector<std::int64_t> offsets = row_offsets(unknowns);
  const std::int64_t n = offsets.back();
  for (std::int64_t j = offsets[static_cast<std::size_t>(c)]; j < offsets[static_cast<std::size_t>(c) + 1]; ++j)
    for (std::int64_t i = offsets[static_cast<std::size_t>(r)]; i < offsets[static_cast<std::size_t>(r) + 1]; ++i)
      *out++ = matrix[static_cast<std::size_t>(i + j * n)];
  return true;
}

namespace {

// Writes the unknowns, then the lower triangle column by column. `fill(j, out)` writes rows j to n of column j to
// `out`.
template <typename Fill>
Bytes bytes_of_triangle(const UnknownList& unknowns, Fill&& fill) {
  const std::int64_t n = total_dimension(unknowns);
  ByteWriter out;
  out.reserve(2 * sizeof(std::uint64_t) + unknowns.size() * sizeof(Unknown) + at(n * (n + 1) / 2) * sizeof(double));
  out.values(unknowns);
  out.value(static_cast<std::uint64_t>(n * (n + 1) / 2));
  std::vector<double> column(at(n));
  for (std::int64_t j = 0; j < n; ++j) {
    fill(j, column.data());
    out.elements(column.data(), at(n - j));
  }
  return out.take();
}

}  // namespace

Bytes CovarianceMatrix::to_bytes() const {
  const std::int64_t n = total_dimension(unknowns);
  return bytes_of_triangle(unknowns,
                           [&](std::int64_t j, double* out) { std::copy_n(matrix.begin() + j + j * n, n - j, out); });
}

CovarianceMatrix CovarianceMatrix::from_bytes(const Bytes& bytes) {
  ByteReader in(bytes);
  CovarianceMatrix covariance;
  covariance.unknowns = in.values<Unknown>();
  const std::int64_t n = total_dimension(covariance.unknowns);
  if (in.value<std::uint64_t>() != static_cast<std::uint64_t>(n * (n + 1) / 2))
    throw StoreError("merge: a covariance matrix has the wrong size");
  covariance.matrix.resize(at(n * n));
  for (std::int64_t j = 0; j < n; ++j) {
    double* const column = covariance.matrix.data() + j * n;
    in.elements(column + j, at(n - j));
    for (std::int64_t i = j + 1; i < n; ++i) covariance.matrix[at(j + i * n)] = column[i];
  }
  if (!in.at_end()) throw StoreError("merge: a covariance matrix has the wrong size");
  return covariance;
}

FrontCovariance covariance_down(const FrontFactor& factor, CovarianceMatrix given) {
  if (given.unknowns != factor.separator)
    throw ComputeError("merge: a covariance is not that of the separator unknowns of a front");
  const std::int64_t e = total_dimension(factor.eliminated), p = total_dimension(factor.separator), n = e + p;
  FrontCovariance covariance{factor.eliminated, factor.separator, {}, {}, std::move(given.matrix)};
  if (e == 0) return covariance;

  // The memory of L^-1 is free again before X and C_PE are allocated.
  covariance.inner.assign(static_cast<std::size_t>(e * e), 0);
  {
    std::vector<double> inverse(static_cast<std::size_t>(e * e), 0);  // L^-1
    for (std::int64_t k = 0; k < e; ++k) inverse[static_cast<std::size_t>(k + k * e)] = 1;
    for (std::int64_t h : factor.held) inverse[static_cast<std::size_t>(h + h * e)] = 0;
    cblas_dtrsm(CblasColMajor, CblasLeft, CblasLower, CblasNoTrans, CblasNonUnit, blas(e), blas(e), 1,
                factor.factor.data(), blas(n), inverse.data(), blas(e));
    cblas_dsyrk(CblasColMajor, CblasLower, CblasTrans, blas(e), blas(e), 1, inverse.data(), blas(e), 0,
                covariance.inner.data(), blas(e));
  }
  if (p == 0) return covariance;

  std::vector<double> x(static_cast<std::size_t>(p * e));  // K_PE K_EE^-1 = Y L^-1
  for (std::int64_t j = 0; j < e; ++j) std::copy_n(factor.factor.begin() + e + j * n, p, x.begin() + j * p);
  cblas_dtrsm(CblasColMajor, CblasRight, CblasLower, CblasNoTrans, CblasNonUnit, blas(p), blas(e), 1,
              factor.factor.data(), blas(n), x.data(), blas(p));
  covariance.cross.assign(static_cast<std::size_t>(p * e), 0);
  cblas_dsymm(CblasColMajor, CblasLeft, CblasLower, blas(p), blas(e), -1, covariance.outer.data(), blas(p), x.data(),
              blas(p), 0, covariance.cross.data(), blas(p));
  cblas_dgemm(CblasColMajor, CblasTrans, CblasNoTrans, blas(e), blas(e), blas(p), -1, x.data(), blas(p),
              covariance.cross.data(), blas(p), 1, covariance.inner.data(), blas(e));
  return covariance;
}

namespace {

// The elements of a front's covariance, in the order of a list of its unknowns. The three blocks stay where they are,
// and an element above the diagonal is read from below it.
class RestrictedCovariance {
 public:
  // Throws ComputeError when one is missing.
  RestrictedCovariance(const FrontCovariance& front, const UnknownList& wanted)
      : front_(front), e_(total_dimension(front.eliminated)), p_(total_dimension(front.separator)) {
    const std::vector<std::int64_t> inner = row_offsets(front.eliminated), outer = row_offsets(front.separator);
    for (const Unknown& u : wanted) {
      const std::int64_t own = find_unknown(front.eliminated, u.id),
                         other = own < 0 ? find_unknown(front.separator, u.id) : -1;
      if (own < 0 && other < 0) throw ComputeError("covariance lacks " + describe(u.id));
      const std::int64_t first = own >= 0 ? inner[at(own)] : outer[at(other)];
      for (std::int64_t k = 0; k < u.dimension; ++k) rows_.push_back({own >= 0, first + k});
    }
  }

  std::int64_t size() const { return static_cast<std::int64_t>(rows_.size()); }
  double operator()(std::int64_t row, std::int64_t column) const {
    const Row &a = rows_[at(row)], &b = rows_[at(column)];
    if (a.inside && b.inside) return front_.inner[at(std::max(a.index, b.index) + std::min(a.index, b.index) * e_)];
    if (a.inside) return front_.cross[at(b.index + a.index * p_)];
    return b.inside ? front_.cross[at(a.index + b.index * p_)] : front_.outer[at(a.index + b.index * p_)];
  }

 private:
  struct Row {
    bool inside;         // whether it belongs to E
    std::int64_t index;  // in E or P
  };
  const FrontCovariance& front_;
  const std::int64_t e_, p_;
  std::vector<Row> rows_;
};

}  // namespace

CovarianceMatrix FrontCovariance::restricted_to(const UnknownList& wanted) const {
  const RestrictedCovariance element(*this, wanted);
  CovarianceMatrix part{wanted, {}};
  part.matrix.reserve(at(element.size() * element.size()));
  for (std::int64_t j = 0; j < element.size(); ++j)
    for (std::int64_t i = 0; i < element.size(); ++i) part.matrix.push_back(element(i, j));
  return part;
}

Bytes FrontCovariance::bytes_of(const UnknownList& wanted) const {
  const RestrictedCovariance element(*this, wanted);
  return bytes_of_triangle(wanted, [&](std::int64_t j, double* out) {
    for (std::int64_t i = j; i < element.size(); ++i) *out++ = element(i, j);
  });
}

CovarianceMatrix FrontCovariance::whole() const { return restricted_to(unite({&eliminated, &separator})); }

}  // namespace megablock
