// Finds the rows of unknowns in the matrices of fronts, and packs triangles. Internal to merge/front/.
//
// Lists of unknowns name blocks of several scalar rows each (unknowns.h). The matrices have a row for every scalar. The
// functions translate the first into the second.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "io/base/error.h"
#include "merge/plan/unknowns.h"

namespace megablock {

// BLAS takes dimensions of 32 bits. The limit of a front's dimension (front.cpp) lies far below.
inline int blas(std::int64_t n) { return static_cast<int>(n); }

// The first row of every unknown of `wanted` in `list`, whose rows are laid out as by row_offsets(list). Throws
// ComputeError, with `what` as the subject of its message, when one is missing.
inline std::vector<std::int64_t> rows_in(const UnknownList& list, const UnknownList& wanted, const char* what) {
  const std::vector<std::int64_t> offsets = row_offsets(list);
  std::vector<std::int64_t> rows;
  rows.reserve(wanted.size());
  for (const Unknown& u : wanted) {
    const std::int64_t at = find_unknown(list, u.id);
    if (at < 0) throw ComputeError(std::string(what) + " lacks " + describe(u.id));
    rows.push_back(offsets[static_cast<std::size_t>(at)]);
  }
  return rows;
}

// The scalar rows in the larger table, for every scalar row of `wanted`.
inline std::vector<std::int64_t> scalar_rows(const UnknownList& wanted, const std::vector<std::int64_t>& first_rows) {
  std::vector<std::int64_t> rows;
  for (std::size_t i = 0; i < wanted.size(); ++i)
    for (std::int64_t k = 0; k < wanted[i].dimension; ++k) rows.push_back(first_rows[i] + k);
  return rows;
}

// Appends the lower triangle of an n x n matrix column by column.
inline void pack(const std::vector<double>& square, std::int64_t n, std::vector<double>& triangle) {
  triangle.reserve(at(n * (n + 1) / 2));
  for (std::int64_t j = 0; j < n; ++j)
    triangle.insert(triangle.end(), square.begin() + j + j * n, square.begin() + n + j * n);
}

}  // namespace megablock
