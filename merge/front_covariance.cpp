// Covariances of a front, by its parts (front.h).
#include <cblas.h>

#include <algorithm>

#include "merge/front.h"
#include "merge/front_rows.h"

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

Bytes CovarianceMatrix::to_bytes() const {
  ByteWriter out;
  out.values(unknowns);
  std::vector<double> triangle;
  pack(matrix, total_dimension(unknowns), triangle);
  out.values(triangle);
  return out.take();
}

CovarianceMatrix CovarianceMatrix::from_bytes(const Bytes& bytes) {
  ByteReader in(bytes);
  CovarianceMatrix covariance;
  covariance.unknowns = in.values<Unknown>();
  const std::vector<double> triangle = in.values<double>();
  const std::int64_t n = total_dimension(covariance.unknowns);
  if (!in.at_end() || static_cast<std::int64_t>(triangle.size()) != n * (n + 1) / 2)
    throw StoreError("merge: a covariance matrix has the wrong size");
  covariance.matrix.resize(at(n * n));
  auto value = triangle.begin();
  for (std::int64_t j = 0; j < n; ++j)
    for (std::int64_t i = j; i < n; ++i, ++value)
      covariance.matrix[at(i + j * n)] = covariance.matrix[at(j + i * n)] = *value;
  return covariance;
}

FrontCovariance covariance_down(const FrontFactor& factor, CovarianceMatrix given) {
  if (given.unknowns != factor.passed) throw ComputeError("merge: a covariance is not of what a front passes on");
  const std::int64_t e = total_dimension(factor.eliminated), p = total_dimension(factor.passed), n = e + p;
  FrontCovariance covariance{factor.eliminated, factor.passed, {}, {}, std::move(given.matrix)};
  if (e == 0) return covariance;

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

CovarianceMatrix FrontCovariance::restricted_to(const UnknownList& wanted) const {
  struct Row {
    bool inside;         // of E
    std::int64_t index;  // in E or P
  };
  const std::vector<std::int64_t> inner_rows = row_offsets(eliminated), outer_rows = row_offsets(passed);
  std::vector<Row> rows;
  for (const Unknown& u : wanted) {
    const std::int64_t own = find_unknown(eliminated, u.id), other = own < 0 ? find_unknown(passed, u.id) : -1;
    if (own < 0 && other < 0) throw ComputeError("covariance lacks " + describe(u.id));
    const std::int64_t first = own >= 0 ? inner_rows[at(own)] : outer_rows[at(other)];
    for (std::int64_t k = 0; k < u.dimension; ++k) rows.push_back({own >= 0, first + k});
  }
  const std::int64_t e = inner_rows.back(), p = outer_rows.back();
  const auto element = [&](const Row& a, const Row& b) {
    if (a.inside && b.inside) return inner[at(std::max(a.index, b.index) + std::min(a.index, b.index) * e)];
    if (a.inside) return cross[at(b.index + a.index * p)];
    return b.inside ? cross[at(a.index + b.index * p)] : outer[at(a.index + b.index * p)];
  };
  CovarianceMatrix part{wanted, {}};
  part.matrix.reserve(rows.size() * rows.size());
  for (const Row& column : rows)
    for (const Row& row : rows) part.matrix.push_back(element(row, column));
  return part;
}

CovarianceMatrix FrontCovariance::whole() const { return restricted_to(unite({&eliminated, &passed})); }

}  // namespace megablock
