#include "merge/front/front.h"

#include <cblas.h>

#include <algorithm>
#include <cmath>

#include "io/base/error.h"
#include "merge/front/front_rows.h"

namespace megablock {

namespace {

// The factorisation goes through the columns of E in panels (right-looking, blocked). With A_11 the diagonal block of
// the panel, A_21 what is below it, and A_22 the columns of E behind it:
//
//     L_11 L_11' = A_11            column by column, with the test of every pivot
//     L_21 = A_21 L_11^-T          dtrsm; the columns of held unknowns are then set to zero
//     z_1 = L_11^-1 b_1,  b_2 -= L_21 z_1                            all right-hand sides
//     A_22 -= L_21 L_21'           dsyrk for the rows of E, dgemm for those of P
//
// The columns of P get -Y Y' in one dsyrk after the last panel, so that the largest matrix is read and written once.
// All but the small diagonal blocks is done by BLAS. LAPACK's dpotrf is no choice for these blocks: it stops at the
// first pivot that is not positive, where this code has to hold the unknown and go on.
constexpr std::int64_t kPanel = 64;  // columns per step of the blocked factorisation

void write_sums(ByteWriter& out, const SubtreeSums& sums) {
  out.value(sums.cost);
  out.value(sums.weighted_squares);
  out.value(sums.decrement_squared);
  out.value(sums.residuals);
  out.value(sums.observations);
  out.value(sums.points);
  out.value(sums.unknowns);
  out.value(sums.held_points);
  out.values(sums.held);
}

SubtreeSums read_sums(ByteReader& in) {
  SubtreeSums sums;
  sums.cost = in.value<double>();
  sums.weighted_squares = in.value<double>();
  sums.decrement_squared = in.value<double>();
  sums.residuals = in.value<std::int64_t>();
  sums.observations = in.value<std::int64_t>();
  sums.points = in.value<std::int64_t>();
  sums.unknowns = in.value<std::int64_t>();
  sums.held_points = in.value<std::int64_t>();
  sums.held = in.values<HeldUnknown>();
  return sums;
}

// The partial Cholesky factorisation of the first e rows and columns of a symmetric n x n matrix. `factor` holds the
// columns of these [n x e], `update` the rest [p x p] (lower triangles, column-major). `reference` [e] are the diagonal
// elements with which the pivots are compared.
class PartialCholesky {
 public:
  PartialCholesky(double* factor, double* update, std::int64_t n, std::int64_t e, double* rhs,
                  std::int64_t right_hand_sides, const double* reference)
      : a_(factor), update_(update), n_(n), e_(e), rhs_(rhs), columns_(right_hand_sides), reference_(reference) {}

  void run() {
    for (std::int64_t first = 0; first < e_; first += kPanel) panel(first, std::min(kPanel, e_ - first));
    const std::int64_t p = n_ - e_;
    if (p > 0 && e_ > 0)
      cblas_dsyrk(CblasColMajor, CblasLower, CblasNoTrans, blas(p), blas(e_), -1, a_ + e_, blas(n_), 1, update_,
                  blas(p));
  }
  // After run(): the rows that were held, ascending, and their pivots over `reference`.
  std::vector<std::int64_t> held;
  std::vector<double> held_ratio;

 private:
  double& at(std::int64_t row, std::int64_t column) { return a_[row + column * n_]; }

  void panel(std::int64_t first, std::int64_t width) {
    const std::int64_t end = first + width, below = n_ - end;
    const std::size_t held_before = held.size();
    factorise_diagonal_block(first, end);
    if (below > 0) {
      cblas_dtrsm(CblasColMajor, CblasRight, CblasLower, CblasTrans, CblasNonUnit, blas(below), blas(width), 1,
                  &at(first, first), blas(n_), &at(end, first), blas(n_));
      for (std::size_t h = held_before; h < held.size(); ++h) std::fill_n(&at(end, held[h]), below, 0.0);
    }
    forward_substitute(first, width, held_before);
    const std::int64_t trailing = e_ - end, separator = n_ - e_;
    if (trailing > 0) {
      cblas_dsyrk(CblasColMajor, CblasLower, CblasNoTrans, blas(trailing), blas(width), -1, &at(end, first), blas(n_),
                  1, &at(end, end), blas(n_));
      if (separator > 0)
        cblas_dgemm(CblasColMajor, CblasNoTrans, CblasTrans, blas(separator), blas(trailing), blas(width), -1,
                    &at(e_, first), blas(n_), &at(end, first), blas(n_), 1, &at(e_, end), blas(n_));
    }
  }

  // Factorises column by column with the test of the pivots. A held row and column become those of the identity. Its
  // row is cleared back to the first column of E, so that dtrsm and the steps down see the identity, too.
  void factorise_diagonal_block(std::int64_t first, std::int64_t end) {
    for (std::int64_t k = first; k < end; ++k) {
      const double pivot = at(k, k);
      // The condition is negated, so that a pivot that is no number is held as well. Observations that are not finite
      // have been refused before (point_equations.cpp).
      if (!(pivot > kPivotTolerance * reference_[k])) {
        held.push_back(k);
        held_ratio.push_back(reference_[k] > 0 ? pivot / reference_[k] : 0);
        for (std::int64_t j = 0; j < k; ++j) at(k, j) = 0;
        for (std::int64_t i = k + 1; i < end; ++i) at(i, k) = 0;
        at(k, k) = 1;
        continue;
      }
      const double root = std::sqrt(pivot), inverse = 1 / root;
      at(k, k) = root;
      for (std::int64_t i = k + 1; i < end; ++i) at(i, k) *= inverse;
      for (std::int64_t j = k + 1; j < end; ++j) {
        const double factor = at(j, k);
        for (std::int64_t i = j; i < end; ++i) at(i, j) -= at(i, k) * factor;
      }
    }
  }

  // z_1 and b_2 of the head. A held unknown gets z = 0.
  void forward_substitute(std::int64_t first, std::int64_t width, std::size_t held_before) {
    for (std::size_t h = held_before; h < held.size(); ++h)
      for (std::int64_t c = 0; c < columns_; ++c) rhs_[held[h] + c * n_] = 0;
    cblas_dtrsm(CblasColMajor, CblasLeft, CblasLower, CblasNoTrans, CblasNonUnit, blas(width), blas(columns_), 1,
                &at(first, first), blas(n_), rhs_ + first, blas(n_));
    const std::int64_t end = first + width, below = n_ - end;
    if (below > 0)
      cblas_dgemm(CblasColMajor, CblasNoTrans, CblasNoTrans, blas(below), blas(columns_), blas(width), -1,
                  &at(end, first), blas(n_), rhs_ + first, blas(n_), 1, rhs_ + end, blas(n_));
  }

  double *a_, *update_;
  std::int64_t n_, e_;
  double* rhs_;
  std::int64_t columns_;
  const double* reference_;
};

}  // namespace

void SubtreeSums::add(const SubtreeSums& other) {
  cost += other.cost;
  weighted_squares += other.weighted_squares;
  decrement_squared += other.decrement_squared;
  residuals += other.residuals;
  observations += other.observations;
  points += other.points;
  unknowns += other.unknowns;
  held_points += other.held_points;
  held.insert(held.end(), other.held.begin(), other.held.end());
}

std::int64_t UpdateMatrix::byte_count() const {
  return static_cast<std::int64_t>((matrix.size() + rhs.size() + diagonal.size()) * sizeof(double));
}

void UpdateMatrix::write(ByteWriter& out) const {
  out.values(unknowns);
  out.value(right_hand_sides);
  out.values(matrix);
  out.values(rhs);
  out.values(diagonal);
  write_sums(out, sums);
  out.value(alone);
}

Bytes UpdateMatrix::to_bytes() const {
  ByteWriter out;
  write(out);
  return out.take();
}

UpdateMatrix UpdateMatrix::from_bytes(const Bytes& bytes) {
  ByteReader in(bytes);
  UpdateMatrix update = read(in);
  if (!in.at_end()) throw StoreError("merge: an update matrix has the wrong size");
  return update;
}

UpdateMatrix UpdateMatrix::read(ByteReader& in) {
  UpdateMatrix update;
  update.unknowns = in.values<Unknown>();
  update.right_hand_sides = in.value<std::int64_t>();
  update.matrix = in.values<double>();
  update.rhs = in.values<double>();
  update.diagonal = in.values<double>();
  update.sums = read_sums(in);
  update.alone = in.value<LeastSquares>();
  const auto n = static_cast<std::size_t>(total_dimension(update.unknowns));
  if (update.right_hand_sides < 1 || update.matrix.size() != n * (n + 1) / 2 ||
      update.rhs.size() != n * static_cast<std::size_t>(update.right_hand_sides) || update.diagonal.size() != n)
    throw StoreError("merge: an update matrix has the wrong size");
  return update;
}

std::int64_t FrontFactor::byte_count() const {
  return static_cast<std::int64_t>(sizeof(FrontFactor) + (factor.size() + z.size()) * sizeof(double) +
                                   (eliminated.size() + separator.size()) * sizeof(Unknown));
}

void FrontFactor::write(ByteWriter& out) const {
  out.values(eliminated);
  out.values(separator);
  out.value(right_hand_sides);
  out.values(factor);
  out.values(z);
  out.values(held);
}

FrontFactor FrontFactor::read(ByteReader& in) {
  FrontFactor f;
  f.eliminated = in.values<Unknown>();
  f.separator = in.values<Unknown>();
  f.right_hand_sides = in.value<std::int64_t>();
  f.factor = in.values<double>();
  f.z = in.values<double>();
  f.held = in.values<std::int64_t>();
  const auto e = static_cast<std::size_t>(total_dimension(f.eliminated));
  const std::size_t n = e + static_cast<std::size_t>(total_dimension(f.separator));
  if (f.right_hand_sides < 1 || f.factor.size() != n * e ||
      f.z.size() != e * static_cast<std::size_t>(f.right_hand_sides) ||
      std::ranges::any_of(f.held, [&](std::int64_t row) { return static_cast<std::size_t>(row) >= e; }))
    throw StoreError("merge: a factor has the wrong size");
  return f;
}

const double* Step::find(const UnknownId& id, std::int64_t column) const {
  std::int64_t row = 0;
  const std::int64_t at = find_unknown(unknowns, id);
  if (at < 0) return nullptr;
  for (std::int64_t i = 0; i < at; ++i) row += unknowns[static_cast<std::size_t>(i)].dimension;
  return values.data() + row + column * (static_cast<std::int64_t>(values.size()) / columns);
}

Step Step::restricted_to(const UnknownList& wanted) const {
  const std::vector<std::int64_t> rows = scalar_rows(wanted, rows_in(unknowns, wanted, "step"));
  const std::int64_t n = total_dimension(unknowns);
  Step part{wanted, columns, {}};
  part.values.reserve(rows.size() * static_cast<std::size_t>(columns));
  for (std::int64_t c = 0; c < columns; ++c)
    for (std::int64_t row : rows) part.values.push_back(values[static_cast<std::size_t>(row + c * n)]);
  return part;
}

Bytes Step::to_bytes() const {
  ByteWriter out;
  out.values(unknowns);
  out.value(columns);
  out.values(values);
  return out.take();
}

Step Step::from_bytes(const Bytes& bytes) {
  ByteReader in(bytes);
  Step step;
  step.unknowns = in.values<Unknown>();
  step.columns = in.value<std::int64_t>();
  step.values = in.values<double>();
  if (!in.at_end() || step.columns < 1 ||
      static_cast<std::int64_t>(step.values.size()) != total_dimension(step.unknowns) * step.columns)
    throw StoreError("merge: a step has the wrong size");
  return step;
}

// Takes the smallest buffer that is large enough. Without one, the largest buffer is given back to the system.
std::vector<double> FrontMemory::take(std::size_t size) {
  std::vector<double> buffer;
  const auto enough = std::find_if(free_.begin(), free_.end(), [&](const auto& b) { return b.capacity() >= size; });
  if (enough != free_.end()) {
    buffer = std::move(*enough);
    free_.erase(enough);
  } else if (!free_.empty()) {
    free_.pop_back();  // the vector grows; keeping both would take more memory
  }
  buffer.clear();
  buffer.reserve(size);
  return buffer;
}

void FrontMemory::give(std::vector<double> buffer) {
  const auto place =
      std::find_if(free_.begin(), free_.end(), [&](const auto& b) { return b.capacity() >= buffer.capacity(); });
  free_.insert(place, std::move(buffer));
}

Front::Front(UnknownList eliminated, UnknownList separator, std::int64_t right_hand_sides, FrontMemory* memory)
    : eliminated_(std::move(eliminated)),
      separator_(std::move(separator)),
      right_hand_sides_(right_hand_sides),
      memory_(memory) {
  eliminated_rows_ = row_offsets(eliminated_);
  separator_rows_ = row_offsets(separator_);
  eliminated_dimension_ = eliminated_rows_.back();
  for (std::int64_t& row : separator_rows_) row += eliminated_dimension_;
  dimension_ = separator_rows_.back();
  // A full matrix of this size takes 80 GB.
  if (dimension_ > 100000)
    throw ComputeError("merge: a front of " + std::to_string(dimension_) +
                       " unknowns; make tiles smaller or drop weak links between tiles");
  const std::int64_t separator_dimension = dimension_ - eliminated_dimension_;
  factor_.assign(static_cast<std::size_t>(dimension_ * eliminated_dimension_), 0);
  const std::int64_t update_size = separator_dimension * separator_dimension;
  if (memory_) update_ = memory_->take(at(update_size));
  update_.assign(at(update_size), 0);
  rhs_.assign(static_cast<std::size_t>(dimension_ * right_hand_sides_), 0);
  diagonal_.assign(static_cast<std::size_t>(dimension_), 0);
}

std::int64_t Front::row_of(const UnknownId& id) const {
  if (const std::int64_t at = find_unknown(eliminated_, id); at >= 0)
    return eliminated_rows_[static_cast<std::size_t>(at)];
  if (const std::int64_t at = find_unknown(separator_, id); at >= 0)
    return separator_rows_[static_cast<std::size_t>(at)];
  return -1;
}

void Front::add(const UpdateMatrix& child) {
  // A run of the child's rows that follow each other in this front too. Most frames of a child are neighbours here as
  // well, so that whole stretches are added without a table of rows.
  struct Run {
    std::int64_t row, first, count;  // row in this front, first row in the child, number of rows
  };
  std::vector<Run> runs;
  std::int64_t n = 0;
  for (const Unknown& u : child.unknowns) {
    const std::int64_t row = row_of(u.id);
    if (row < 0) throw ComputeError("merge: a front lacks " + describe(u.id) + " of its child");
    if (!runs.empty() && runs.back().row + runs.back().count == row)
      runs.back().count += u.dimension;
    else
      runs.push_back({row, n, u.dimension});
    n += u.dimension;
  }
  // The packed triangle of the child is read once, from its first to its last value.
  const double* source = child.matrix.data();
  for (auto across = runs.begin(); across != runs.end(); ++across) {
    for (std::int64_t k = 0; k < across->count; ++k) {
      const std::int64_t column = across->row + k;
      for (auto down = across; down != runs.end(); ++down) {
        const std::int64_t skipped = down == across ? k : 0, count = down->count - skipped;
        const std::int64_t row = down->row + skipped;
        // A later row of the child lies above an earlier one where the first is in E and the second in P. The block is
        // then added transposed.
        const bool below = row >= column;
        const Place target = below ? place(row, column) : place(column, row);
        const std::int64_t step = below ? 1 : target.stride;
        if (step == 1)
          for (std::int64_t i = 0; i < count; ++i) target.values[i] += source[i];
        else
          for (std::int64_t i = 0; i < count; ++i) target.values[i * step] += source[i];
        source += count;
      }
    }
    for (std::int64_t k = 0; k < across->count; ++k) {
      diagonal_[at(across->row + k)] += child.diagonal[at(across->first + k)];
      for (std::int64_t c = 0; c < std::min(child.right_hand_sides, right_hand_sides_); ++c)
        rhs_[at(across->row + k + c * dimension_)] += child.rhs[at(across->first + k + c * n)];
    }
  }
  sums_.add(child.sums);
}

Front::Result Front::eliminate(double lambda) && {
  const std::int64_t n = dimension_, e = eliminated_dimension_, p = n - e;
  // The pivots are compared with the damped diagonal. The constraints of a free datum are in K and not in `diagonal_`,
  // so that they add no information to the comparison.
  std::vector<double> reference(static_cast<std::size_t>(e));
  for (std::int64_t k = 0; k < e; ++k) {
    const double d = diagonal_[static_cast<std::size_t>(k)];
    factor_[static_cast<std::size_t>(k + k * n)] += lambda * d;
    reference[static_cast<std::size_t>(k)] = (1 + lambda) * d;
  }
  PartialCholesky cholesky(factor_.data(), update_.data(), n, e, rhs_.data(), right_hand_sides_, reference.data());
  cholesky.run();

  Result result;
  result.factor.right_hand_sides = right_hand_sides_;
  result.factor.factor = std::move(factor_);
  for (std::int64_t c = 0; c < right_hand_sides_; ++c)
    result.factor.z.insert(result.factor.z.end(), rhs_.begin() + c * n, rhs_.begin() + c * n + e);
  result.factor.held = cholesky.held;

  UpdateMatrix& update = result.update;
  update.right_hand_sides = right_hand_sides_;
  if (memory_) update.matrix = memory_->take(at(p * (p + 1) / 2));
  pack(update_, p, update.matrix);
  if (memory_) memory_->give(std::move(update_));
  for (std::int64_t c = 0; c < right_hand_sides_; ++c)
    update.rhs.insert(update.rhs.end(), rhs_.begin() + e + c * n, rhs_.begin() + n + c * n);
  update.diagonal.assign(diagonal_.begin() + e, diagonal_.end());

  update.sums = std::move(sums_);
  update.sums.unknowns += e;
  // Only the first right-hand side is the gradient; the others belong to the inner constraints.
  double squares = 0;
  for (std::int64_t k = 0; k < e; ++k) squares += rhs_[static_cast<std::size_t>(k)] * rhs_[static_cast<std::size_t>(k)];
  update.sums.decrement_squared += squares;
  for (std::size_t h = 0; h < cholesky.held.size(); ++h) {
    // The unknown that has this row: the last one that begins at or before it.
    const auto after = std::upper_bound(eliminated_rows_.begin(), eliminated_rows_.end(), cholesky.held[h]);
    const auto u = static_cast<std::size_t>(after - eliminated_rows_.begin()) - 1;
    update.sums.held.push_back({eliminated_[u].id, cholesky.held[h] - eliminated_rows_[u], cholesky.held_ratio[h]});
  }
  update.unknowns = separator_;
  result.factor.eliminated = std::move(eliminated_);
  result.factor.separator = std::move(separator_);
  return result;
}

Step back_substitute(const FrontFactor& factor, const Step& separator) {
  const std::int64_t e = total_dimension(factor.eliminated), p = total_dimension(factor.separator), n = e + p;
  const std::int64_t columns = factor.right_hand_sides;
  const Step outer = factor.separator.empty() ? Step{{}, columns, {}} : separator.restricted_to(factor.separator);
  // x_E = L^-T (z - Y'x_P) for all right-hand sides at once. Held unknowns get zero and change no other, because their
  // rows of z and columns of L and Y are zero but for the one on the diagonal.
  std::vector<double> x = factor.z;
  if (e > 0) {
    if (p > 0)
      cblas_dgemm(CblasColMajor, CblasTrans, CblasNoTrans, blas(e), blas(columns), blas(p), -1,
                  factor.factor.data() + e, blas(n), outer.values.data(), blas(p), 1, x.data(), blas(e));
    cblas_dtrsm(CblasColMajor, CblasLeft, CblasLower, CblasTrans, CblasNonUnit, blas(e), blas(columns), 1,
                factor.factor.data(), blas(n), x.data(), blas(e));
  }
  Step step;
  step.unknowns = unite({&factor.eliminated, &factor.separator});
  step.columns = columns;
  step.values.resize(static_cast<std::size_t>(n * columns));
  const auto copy = [&](const UnknownList& list, const std::vector<double>& values, std::int64_t count) {
    const auto rows = scalar_rows(list, rows_in(step.unknowns, list, "step"));
    for (std::int64_t c = 0; c < columns; ++c)
      for (std::int64_t i = 0; i < count; ++i)
        step.values[static_cast<std::size_t>(rows[static_cast<std::size_t>(i)] + c * n)] =
            values[static_cast<std::size_t>(i + c * count)];
  };
  copy(factor.eliminated, x, e);
  copy(factor.separator, outer.values, p);
  return step;
}

}  // namespace megablock
